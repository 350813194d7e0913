/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "cylinder_filter.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "../base/guarded.hpp"
#include "../base/parallel.hpp"

namespace rangecast {
namespace {

constexpr CellGrid::HeightRange kNoHeights = {
    std::numeric_limits<float>::max (), -std::numeric_limits<float>::max ()};

/* Of a cylinder: y along its axis, z as near to world z as that leaves (world x where the axis is
 * along z), right-handed. */
struct CylinderFrame {
  float origin[3], rows[3][3]; /* world, metres; cylinder_from_world */

  explicit CylinderFrame (const Axis &axis = {})
  {
    const Vec3 y = axis.direction, near_z = std::abs (y.z) < 0.9 ? Vec3{0, 0, 1} : Vec3{1, 0, 0};
    Vec3 z = near_z - dot (near_z, y) * y;
    z = 1 / norm (z) * z;
    const Vec3 from[] = {axis.position, cross (y, z), y, z};
    float *to[] = {origin, rows[0], rows[1], rows[2]};
    for (int i = 0; i < 4; i++) {
      to[i][0] = static_cast<float> (from[i].x);
      to[i][1] = static_cast<float> (from[i].y);
      to[i][2] = static_cast<float> (from[i].z);
    }
  }
  void turn (const float v[3], float out[3]) const
  {
    for (int k = 0; k < 3; k++)
      out[k] = rows[k][0] * v[0] + rows[k][1] * v[1] + rows[k][2] * v[2];
  }
};

} // namespace

Status
CylinderFilter::set_rig (const Rig &rig)
{
  reset ();
  rig_views_ = 0;
  return guarded ("rig", [&] () -> Status {
    if (Status status = validate (rig); !status.ok ())
      return status;
    for (const View &view : rig.views) {
      if (!view.is_range_view ())
        return {StatusCode::kBadValue, "rig: view " + std::to_string (view.id) +
                                           " is not rectified: stereodepth makes range views"};
      rig_rays_[view.id] = PixelRays (view);
      rig_lookups_[view.id] = PixelLookup (view);
      rig_views_ |= std::uint64_t{1} << view.id;
    }
    return {};
  });
}

void
CylinderFilter::reset ()
{
  tracker_.reset ();
  grid_.reset ();
  decided_ = false;
}

Status
CylinderFilter::find_cameras (std::span<const RangeImage> images)
{
  if (images.size () > kMaxViews)
    return {StatusCode::kBadSize, "frame set: more than 64 views"};
  for (std::size_t i = 0; i < images.size (); i++) {
    const int id = images[i].view_id;
    if (id < 0 || id >= kMaxViews || !(rig_views_ >> id & 1))
      return {StatusCode::kNotFound,
          "rig: no view " + std::to_string (id) + ", which the frame set has"};
    rays_[i] = rig_rays_[id];
    lookups_[i] = rig_lookups_[id];
    ids_[i] = id;
  }
  return {};
}

void
CylinderFilter::choose_axis (const CylinderSettings &settings, Axis &axis)
{
  if (settings.axis == AxisMode::kWorld)
    return;
  const auto parts = cloud_.parts ();
  in_parallel (parts.size (), settings.threads, [&] (std::size_t i) {
    moments_[i] = {};
    for (std::size_t k = parts[i].begin; k < parts[i].end; k++)
      moments_[i].add (cloud_.x[k], cloud_.y[k], cloud_.z[k]);
  });
  Moments all;
  for (std::size_t i = 0; i < parts.size (); i++)
    all += moments_[i];
  axis = tracker_.follow (axis_of_points (settings.axis, all, {rays_.data (), parts.size ()}));
}

/* Moves the points to the coordinates of the cylinder, and into its cells. */
void
CylinderFilter::fill_grid (const CylinderSettings &settings, const Axis &axis)
{
  const auto parts = cloud_.parts ();
  const CylinderFrame to (axis);
  for (std::size_t i = 0; i < parts.size (); i++) {
    float optical[3];
    to.turn (rays_[i].optical_axis, optical);
    optical_[i] = {optical[0], optical[2]};
  }
  radius_.resize (std::max (radius_.size (), cloud_.x.size ()));
  cell_.resize (radius_.size ());
  const float columns_per_radian = static_cast<float> (settings.columns / (2 * M_PI));
  in_parallel (parts.size (), settings.threads, [&] (std::size_t i) {
    CellGrid::HeightRange &range = ranges_[i] = kNoHeights;
    for (std::size_t k = parts[i].begin; k < parts[i].end; k++) {
      float *p[] = {&cloud_.x[k], &cloud_.y[k], &cloud_.z[k]}, out[3];
      const float moved[] = {*p[0] - to.origin[0], *p[1] - to.origin[1], *p[2] - to.origin[2]};
      to.turn (moved, out);
      for (int a = 0; a < 3; a++)
        *p[a] = out[a];
      radius_[k] = std::sqrt (out[0] * out[0] + out[2] * out[2]);
      const float phi = std::atan2 (out[2], out[0]);
      const int column = static_cast<int> (
          (phi < 0 ? phi + static_cast<float> (2 * M_PI) : phi) * columns_per_radian);
      cell_[k] = static_cast<std::uint32_t> (std::min (column, settings.columns - 1));
      range = {std::min (range.y_min, out[1]), std::max (range.y_max, out[1])};
    }
  });
  CellGrid::HeightRange all = kNoHeights;
  for (std::size_t i = 0; i < parts.size (); i++)
    all = {std::min (all.y_min, ranges_[i].y_min), std::max (all.y_max, ranges_[i].y_max)};
  grid_.lay_out (all, settings.slice_height_m, settings.columns);
  for (const WorldPoints::Part &part : parts)
    for (std::size_t k = part.begin; k < part.end; k++) {
      cell_[k] = grid_.cell_of (cloud_.y[k], cell_[k]);
      grid_.count (cell_[k]);
    }
  grid_.make_room (cloud_.x.size ());
  for (std::size_t i = 0; i < parts.size (); i++)
    for (std::size_t k = parts[i].begin; k < parts[i].end; k++)
      grid_.add (cell_[k], {radius_[k], cloud_.x[k], cloud_.z[k], static_cast<std::uint32_t> (k),
                               static_cast<std::uint32_t> (i)});
}

Status
CylinderFilter::work (
    std::span<const RangeImage> images, const CylinderSettings &settings, CylinderResult &result)
{
  decided_ = false;
  if (Status status = cloud_.reset (images); !status.ok ())
    return status;
  if (settings.axis != axis_mode_) /* winners of cells about another axis are of no use */
    reset ();
  axis_mode_ = settings.axis;
  in_parallel (images.size (), settings.threads,
      [&] (std::size_t i) { cloud_.fill (i, images[i], rays_[i]); });
  result.points_in = result.points_out = cloud_.size ();
  if (result.points_in > 0)
    choose_axis (settings, result.axis);
  if (std::ranges::count_if (
          cloud_.parts (), [] (const WorldPoints::Part &part) { return part.size () > 0; }) < 2)
    return {};
  fill_grid (settings, result.axis);
  result.cells = grid_.decide (optical_, {ids_.data (), images.size ()}, settings.threads);
  const DecidedFrame frame{
      images, {rays_.data (), images.size ()}, {lookups_.data (), images.size ()}, cloud_, grid_};
  result.points_out -= redundant_.find (frame, settings.overlap, settings.threads);
  redundant_.clear (images);
  decided_ = true;
  return {};
}

Status
CylinderFilter::process (
    std::span<const RangeImage> images, const CylinderSettings &settings, CylinderResult &result)
{
  result = {};
  bool began = false;
  const Status status = guarded ("cylinder", [&] () -> Status {
    if (Status bad = find_cameras (images); !bad.ok ())
      return bad;
    began = true;
    return work (images, settings, result);
  });
  if (began && !status.ok ()) {
    reset (); /* an incomplete state cannot be used */
    result = {};
  }
  return status;
}

} // namespace rangecast
