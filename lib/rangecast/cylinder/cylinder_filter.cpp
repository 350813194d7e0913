/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "cylinder_filter.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "../parallel.hpp"

namespace rangecast {

/* Views that look at a surface more squarely than this, |N . a|, from opposite sides see two
 * surfaces. Well above what noise makes of a camera that looks along the surface. */
constexpr float kOtherSide = 0.35f;

static Status
check (const CylinderSettings &settings)
{
  const UnitSettings &u = settings.units;
  auto bad = [] (const char *what) { return Status{StatusCode::kBadValue, what}; };
  if (!(u.unit_height_m >= 0.0002 && u.unit_height_m <= 10))
    return bad ("cylinder: unit height, expected 0.0002 to 10 metres");
  if (u.columns < 8 || u.columns > 3600)
    return bad ("cylinder: columns, expected 8 to 3600");
  if (!(u.layer_gap_m >= 0 && u.layer_gap_m <= 100) || !(u.smoothing_m >= 0 && u.smoothing_m <= 1))
    return bad ("cylinder: layer gap, expected 0 to 100 metres; smoothing, 0 to 1 metre");
  if (!(settings.hidden_gap_m >= 0 && settings.hidden_gap_m <= 100))
    return bad ("cylinder: hidden gap, expected 0 to 100 metres");
  const double length = norm (settings.fixed_axis.direction);
  if (settings.axis == AxisMode::kFixed &&
      !(length > 1e-9 && length < 1e9 && norm (settings.fixed_axis.position) < 1e6))
    return bad ("cylinder: fixed axis, expected a direction that is not 0, 0, 0");
  return {};
}

Status
CylinderFilter::set_rig (const Rig &rig)
{
  if (Status status = validate (rig); !status.ok ())
    return status;
  rig_views_ = 0;
  for (const View &view : rig.views) {
    if (!view.is_range_view ())
      return {StatusCode::kBadValue,
          "rig: view " + std::to_string (view.id) + " is not rectified, expected a range view"};
    rig_rays_[view.id] = PixelRays (view);
    rig_lookups_[view.id] = PixelLookup (view);
    rig_units_per_metre_[view.id] = static_cast<float> (1 / view.depth_unit_m);
    rig_views_ |= std::uint64_t{1} << view.id;
  }
  reset ();
  return {};
}

Status
CylinderFilter::take_cameras (std::span<const RangeImage> images)
{
  if (images.size () > kMaxViews)
    return {StatusCode::kBadSize, "frame set: more than 64 views"};
  for (std::size_t i = 0; i < images.size (); i++) {
    const int id = images[i].view_id;
    if (id < 0 || id >= kMaxViews || !(rig_views_ >> id & 1))
      return {StatusCode::kNotFound,
          "rig: no view " + std::to_string (id) + ", which the frame set has"};
    rays_[i] = rig_rays_[id];
  }
  return {};
}

void
CylinderFilter::make_points (std::span<const RangeImage> images, int threads)
{
  in_parallel (images.size (), threads, [&] (std::size_t i) {
    cloud_.fill (i, images[i], rays_[i]);
    moments_[i] = {};
    moments_[i].add (cloud_, cloud_.parts ()[i]);
  });
}

void
CylinderFilter::choose_axis (const CylinderSettings &settings, std::size_t images)
{
  if (settings.axis == AxisMode::kFixed) {
    const Vec3 direction = settings.fixed_axis.direction;
    axis_ = {
        settings.fixed_axis.position, (direction.y < 0 ? -1 : 1) / norm (direction) * direction};
    tracker_.reset ();
    return;
  }
  Moments all;
  for (std::size_t i = 0; i < images; i++)
    all += moments_[i];
  axis_ = tracker_.follow (axis_of_points (settings.axis, all, {rays_.data (), images}));
}

void
CylinderFilter::unroll (int columns, int threads)
{
  const CylinderFrame frame (axis_);
  if (radius_.size () < cloud_.x.size ()) {
    radius_.resize (cloud_.x.size ());
    column_.resize (cloud_.x.size ());
  }
  in_parallel (cloud_.parts ().size (), threads, [&] (std::size_t i) {
    ranges_[i] =
        to_wall (cloud_, cloud_.parts ()[i], frame, columns, radius_.data (), column_.data ());
    const float *a = rays_[i].optical_axis;
    const Vec3 optical = frame.rotation * Vec3{a[0], a[1], a[2]};
    optical_[i] = {static_cast<float> (optical.x), static_cast<float> (optical.z)};
  });
}

static std::uint64_t
views_with_points (const WorldPoints &cloud)
{
  std::uint64_t n = 0;
  for (const WorldPoints::Part &part : cloud.parts ())
    n += part.size () > 0;
  return n;
}

Status
CylinderFilter::process (
    std::span<const RangeImage> images, const CylinderSettings &settings, CylinderResult &result)
{
  result = {};
  if (Status status = check (settings); !status.ok ())
    return status;
  if (Status status = take_cameras (images); !status.ok ())
    return status;
  /* No exception leaves the core: neither ours for memory nor OpenCV's. */
  try {
    return work (images, settings, result);
  } catch (const std::exception &error) {
    return {StatusCode::kNoSpace, std::string ("cylinder: ") + error.what ()};
  }
}

Status
CylinderFilter::work (
    std::span<const RangeImage> images, const CylinderSettings &settings, CylinderResult &result)
{
  if (Status status = cloud_.reset (images); !status.ok ())
    return status;
  make_points (images, settings.threads);
  result.points_in = result.points_out = cloud_.size ();
  if (result.points_in > 0)
    choose_axis (settings, images.size ());
  result.axis = axis_;
  if (views_with_points (cloud_) < 2)
    return {};
  unroll (settings.units.columns, settings.threads);
  WallRange range = ranges_[0];
  for (std::size_t i = 1; i < images.size (); i++) {
    range.y_min = std::min (range.y_min, ranges_[i].y_min);
    range.y_max = std::max (range.y_max, ranges_[i].y_max);
  }
  units_.sort (cloud_, radius_, column_, range, settings.units);
  units_.find_tangents (settings.threads);
  units_.smooth (settings.threads);
  result.units = units_.occupied;
  result.units_shared = units_.shared;
  mark_losers ();
  if (settings.hidden_gap_m > 0)
    keep_uncovered (images, settings);
  clear_losers (images);
  result.points_out -= losers_.size ();
  return {};
}

/* The views that stay in a layer: one, or two that look at it from opposite sides. */
std::uint64_t
CylinderFilter::winners (const UnitLayer &layer) const
{
  float tx = layer.tangent[0], tz = layer.tangent[1];
  if (const float length = std::sqrt (tx * tx + tz * tz); length > 1e-6f) {
    tx /= length, tz /= length;
  } else {
    const UnitEntry &entry = units_.entries[layer.first_entry];
    const float r = std::max (entry.radius, 1e-6f);
    tx = -entry.z / r, tz = entry.x / r;
  }
  /* Least (greatest) facing: who sees the outside (inside) most squarely. */
  float least = std::numeric_limits<float>::max (), greatest = -least;
  int outside = 0, inside = 0;
  for (std::uint64_t rest = layer.covering; rest; rest &= rest - 1) {
    const int view = std::countr_zero (rest);
    const float facing = tz * optical_[view][0] - tx * optical_[view][1];
    if (facing < least)
      least = facing, outside = view;
    if (facing > greatest)
      greatest = facing, inside = view;
  }
  const std::uint64_t out = std::uint64_t{1} << outside, in = std::uint64_t{1} << inside;
  if (least < -kOtherSide && greatest > kOtherSide)
    return out | in;
  return -least >= greatest ? out : in;
}

void
CylinderFilter::mark_losers ()
{
  losers_.clear ();
  losers_.reserve (cloud_.x.size ()); /* as large as it can ever get, once */
  for (const UnitLayer &layer : units_.layers) {
    if (!(layer.covering & (layer.covering - 1)))
      continue;
    const std::uint64_t stay = winners (layer);
    const UnitEntry *entry = &units_.entries[layer.first_entry];
    for (std::uint64_t rest = layer.views; rest; rest &= rest - 1, entry++) {
      if (stay >> entry->view & 1)
        continue;
      const std::uint64_t rivals = layer.covering & ~(std::uint64_t{1} << entry->view);
      for (std::uint32_t i = 0; i < entry->point_count; i++)
        losers_.push_back ({rivals, cloud_.pixel[units_.points[entry->first_point + i].index],
            static_cast<std::uint8_t> (entry->view)});
    }
  }
}

/* What a view has in the pixel and its neighbours where it sees a point at depth z. */
bool
CylinderFilter::covers (std::size_t i, const RangeImage &image, float u, float v, float z) const
{
  const float x = u - static_cast<float> (image.roi.x), y = v - static_cast<float> (image.roi.y);
  const int left = static_cast<int> (std::floor (x)), top = static_cast<int> (std::floor (y));
  const int column = static_cast<int> (std::floor (x + 0.5f)),
            row = static_cast<int> (std::floor (y + 0.5f));
  bool covered = false;
  for (int py = top; py <= top + 1; py++)
    for (int px = left; px <= left + 1; px++) {
      if (px < 0 || py < 0 || px >= image.depth.width || py >= image.depth.height)
        continue;
      const std::uint16_t there = image.depth.at (px, py);
      if (there == kInvalidDepth || z - there > behind_[i] || there - z > before_[i])
        continue;
      if (lost_[cloud_.parts ()[i].begin + static_cast<std::size_t> (py) * image.depth.width + px])
        return false; /* the winner's region ends here: overlap by a pixel */
      covered |= px == column && py == row;
    }
  return covered;
}

/* Whether one of the loser's rivals has a point left where it sees the loser's. A point well behind
 * what a view sees is hidden from it: another place. A point well before it would have hidden that:
 * one of both is wrong, and it is the loser's, up to errors that no stereo makes on the same
 * surface. */
bool
CylinderFilter::is_covered (std::span<const RangeImage> images, const Loser &loser) const
{
  const RangeImage &image = images[loser.image];
  const int column = static_cast<int> (loser.pixel & 0xffff),
            row = static_cast<int> (loser.pixel >> 16);
  float point[3];
  rays_[loser.image].point (static_cast<float> (image.roi.x + column),
      static_cast<float> (image.roi.y + row), image.depth.at (column, row), point);
  for (std::uint64_t rest = loser.rivals; rest; rest &= rest - 1) {
    const auto i = static_cast<std::size_t> (std::countr_zero (rest));
    float u, v, z;
    rig_lookups_[images[i].view_id].find (point, u, v, z);
    constexpr float kFar = 1e6f; /* pixels; keeps what follows within integers */
    if (z > 0 && std::abs (u) < kFar && std::abs (v) < kFar && covers (i, images[i], u, v, z))
      return true;
  }
  return false;
}

/* One after the other, so that of two losers at one place only the first stays. */
void
CylinderFilter::keep_uncovered (
    std::span<const RangeImage> images, const CylinderSettings &settings)
{
  for (std::size_t i = 0; i < images.size (); i++) {
    const double units_per_metre = rig_units_per_metre_[images[i].view_id];
    behind_[i] = static_cast<float> (settings.hidden_gap_m * units_per_metre);
    before_[i] = static_cast<float> (settings.units.layer_gap_m / 2 * units_per_metre);
  }
  lost_.assign (cloud_.x.size (), 0);
  for (const Loser &loser : losers_)
    lost_[place (images, loser)] = 1;
  std::erase_if (losers_, [&] (const Loser &loser) {
    if (is_covered (images, loser))
      return false;
    lost_[place (images, loser)] = 0;
    return true;
  });
}

std::size_t
CylinderFilter::place (std::span<const RangeImage> images, const Loser &loser) const
{
  const auto width = static_cast<std::size_t> (images[loser.image].depth.width);
  return cloud_.parts ()[loser.image].begin + (loser.pixel >> 16) * width + (loser.pixel & 0xffff);
}

void
CylinderFilter::clear_losers (std::span<const RangeImage> images) const
{
  for (const Loser &loser : losers_)
    images[loser.image].depth.at (static_cast<int> (loser.pixel & 0xffff),
        static_cast<int> (loser.pixel >> 16)) = kInvalidDepth;
}

} // namespace rangecast
