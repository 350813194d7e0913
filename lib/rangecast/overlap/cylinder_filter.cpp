/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "cylinder_filter.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "../base/guarded.hpp"
#include "../base/parallel.hpp"

namespace rangecast {

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
  if (!(settings.overlap >= 0 && settings.overlap <= kMaxOverlap))
    return bad ("cylinder: overlap, expected 0 to 16 pixels");
  if (!(settings.hysteresis >= 0 && settings.hysteresis <= 2) ||
      !(settings.agreement >= 0 && settings.agreement <= 2))
    return bad ("cylinder: hysteresis and agreement, expected 0 to 2");
  if (settings.bodies < 1 || settings.bodies > kMaxBodies)
    return bad ("cylinder: bodies, expected 1 to 8");
  const double length = norm (settings.fixed_axis.direction);
  if (settings.axis == AxisMode::kFixed && !(length > 1e-9 && length < 1e9))
    return bad ("cylinder: direction of the fixed axis, expected a length of 1e-9 to 1e9");
  if (settings.axis == AxisMode::kFixed && !(norm (settings.fixed_axis.position) < 1e6))
    return bad ("cylinder: position of the fixed axis, expected less than 1000 km");
  return {};
}

Status
CylinderFilter::set_rig (const Rig &rig)
{
  reset ();
  return change_rig (rig);
}

Status
CylinderFilter::change_rig (const Rig &rig)
{
  rig_views_ = 0;
  return guarded ("rig", [&] () -> Status {
    if (Status status = validate (rig); !status.ok ())
      return status;
    for (const View &view : rig.views) {
      if (!view.is_range_view ())
        return {StatusCode::kBadValue,
            "rig: view " + std::to_string (view.id) + " is not rectified, expected a range view"};
      rig_rays_[view.id] = PixelRays (view);
      rig_lookups_[view.id] = PixelLookup (view);
      rig_units_per_metre_[view.id] = static_cast<float> (1 / view.depth_unit_m);
      rig_views_ |= std::uint64_t{1} << view.id;
    }
    return {};
  });
}

void
CylinderFilter::reset ()
{
  for (AxisTracker &tracker : trackers_)
    tracker.reset ();
  units_.rows.forget ();
  decided_ = false;
}

/* Units about an axis found by another rule are other units. So are those about one that was set
 * elsewhere; but one that is set a little further on in each frame follows somebody. */
void
CylinderFilter::forget_other_geometry (const CylinderSettings &settings)
{
  constexpr double kNear = 0.05, kAlike = 0.996; /* metres; cosine of 5 degrees */
  const Vec3 a = settings.fixed_axis.direction, b = fixed_axis_.direction;
  const bool stays = norm (settings.fixed_axis.position - fixed_axis_.position) < kNear &&
                     std::abs (dot (a, b)) > kAlike * norm (a) * norm (b);
  if (settings.axis != axis_mode_ || (settings.axis == AxisMode::kFixed && !stays))
    reset ();
  axis_mode_ = settings.axis;
  fixed_axis_ = settings.fixed_axis;
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
    ids_[i] = id;
  }
  return {};
}

void
CylinderFilter::make_points (std::span<const RangeImage> images, int threads)
{
  in_parallel (
      images.size (), threads, [&] (std::size_t i) { cloud_.fill (i, images[i], rays_[i]); });
}

/* Sorts the points by body, and adds each body's up. */
void
CylinderFilter::find_bodies (const CylinderSettings &settings)
{
  const auto parts = cloud_.parts ();
  body_count_ = bodies_.find (cloud_, settings.axis == AxisMode::kFixed ? 1 : settings.bodies);
  const auto bodies = static_cast<std::size_t> (body_count_);
  runs_.resize (parts.size () * bodies);
  moments_.resize (runs_.size ());
  in_parallel (parts.size (), settings.threads, [&] (std::size_t i) {
    std::array<std::size_t, kMaxBodies> ends{parts[i].end};
    if (bodies > 1)
      bodies_.sort_part (cloud_, i, ends);
    std::size_t begin = parts[i].begin;
    for (std::size_t b = 0; b < bodies; b++) {
      PointRun &run = runs_[i * bodies + b];
      run = {begin, ends[b], static_cast<std::uint32_t> (i), static_cast<std::uint32_t> (b)};
      begin = run.end;
      moments_[i * bodies + b] = {};
      moments_[i * bodies + b].add (cloud_, {run.begin, run.end});
    }
  });
}

/* Gives each body the place that it had in the frame before: the nearest pair of a body and a place
 * first, if they are nearer than half a metre; bodies that are left get places where nobody was. */
void
CylinderFilter::choose_slots (const std::array<Axis, kMaxBodies> &measured)
{
  constexpr double kFar = 0.5;
  slots_.fill (-1);
  unsigned taken = 0;
  const auto take = [&] (int body, int slot) {
    slots_[body] = slot;
    taken |= 1u << slot;
  };
  for (int pair = 0; pair < body_count_; pair++) {
    double least = kFar;
    int best_body = -1, best_slot = -1;
    for (int body = 0; body < body_count_; body++)
      for (int slot = 0; slot < kMaxBodies; slot++) {
        if (slots_[body] >= 0 || (taken >> slot & 1) || !trackers_[slot].started ())
          continue;
        const double distance = norm (trackers_[slot].axis ().position - measured[body].position);
        if (distance < least)
          least = distance, best_body = body, best_slot = slot;
      }
    if (best_body >= 0)
      take (best_body, best_slot);
  }
  for (int slot = 0; slot < kMaxBodies; slot++)
    if (!(taken >> slot & 1))
      trackers_[slot].reset ();
  for (int body = 0, slot = 0; body < body_count_; body++) {
    while (slots_[body] < 0 && (taken >> slot & 1))
      slot++;
    if (slots_[body] < 0)
      take (body, slot);
  }
}

void
CylinderFilter::choose_axes (const CylinderSettings &settings, std::size_t images)
{
  if (settings.axis == AxisMode::kFixed) {
    const Vec3 direction = settings.fixed_axis.direction;
    const double up = direction.y < 0 ? -1 : 1;
    axis_ = axes_[0] = {settings.fixed_axis.position, up / norm (direction) * direction};
    slots_[0] = 0;
    for (AxisTracker &tracker : trackers_)
      tracker.reset ();
    return;
  }
  std::array<Axis, kMaxBodies> measured;
  const auto bodies = static_cast<std::size_t> (body_count_);
  for (std::size_t body = 0; body < bodies; body++) {
    Moments all;
    for (std::size_t i = 0; i < images; i++)
      all += moments_[i * bodies + body];
    measured[body] = axis_of_points (settings.axis, all, {rays_.data (), images});
  }
  choose_slots (measured);
  for (std::size_t body = 0; body < bodies; body++) {
    const int slot = slots_[body];
    axes_[slot] = trackers_[slot].follow (measured[body]);
  }
  axis_ = axes_[slots_[0]];
}

/* Where cameras are about a body's cylinder. */
void
CylinderFilter::look_from (int body, const CylinderFrame &frame, std::size_t images)
{
  const Mat3 world_from_body = transposed (frame.rotation);
  for (std::size_t i = 0; i < images; i++) {
    const float *a = rays_[i].optical_axis;
    const Vec3 optical = frame.rotation * Vec3{a[0], a[1], a[2]};
    rules_.optical[body][i] = {static_cast<float> (optical.x), static_cast<float> (optical.z)};
    const PixelLookup &world = rig_lookups_[ids_[i]];
    for (int k = 0; k < 3; k++) {
      const float *row = world.rows[k];
      const Vec3 r{row[0], row[1], row[2]};
      const Mat3 &m = world_from_body;
      const double turned[] = {dot (r, {m[0], m[3], m[6]}), dot (r, {m[1], m[4], m[7]}),
          dot (r, {m[2], m[5], m[8]}), dot (r, frame.origin) + row[3]};
      for (int c = 0; c < 4; c++)
        lookups_[body][i].rows[k][c] = static_cast<float> (turned[c]);
    }
  }
}

void
CylinderFilter::unroll (const CylinderSettings &settings, std::size_t images)
{
  std::array<CylinderFrame, kMaxBodies> frames;
  for (int body = 0; body < body_count_; body++) {
    const int slot = slots_[body];
    frames[slot] = CylinderFrame (axes_[slot]);
    look_from (slot, frames[slot], images);
  }
  if (column_.size () < cloud_.x.size ()) { /* the last to grow: all have grown */
    radius_.resize (cloud_.x.size ());
    column_.resize (cloud_.x.size ());
  }
  run_ranges_.resize (runs_.size ());
  in_parallel (runs_.size (), settings.threads, [&] (std::size_t i) {
    runs_[i].body = static_cast<std::uint32_t> (slots_[runs_[i].body]);
    run_ranges_[i] = to_wall (cloud_, {runs_[i].begin, runs_[i].end}, frames[runs_[i].body],
        settings.units.columns, radius_.data (), column_.data ());
  });
  constexpr float kHuge = std::numeric_limits<float>::max ();
  ranges_.fill ({kHuge, -kHuge});
  for (std::size_t i = 0; i < runs_.size (); i++) {
    WallRange &range = ranges_[runs_[i].body];
    range.y_min = std::min (range.y_min, run_ranges_[i].y_min);
    range.y_max = std::max (range.y_max, run_ranges_[i].y_max);
  }
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
  bool began = false;
  const Status status = guarded ("cylinder", [&] () -> Status {
    if (Status bad = check (settings); !bad.ok ())
      return bad;
    if (Status bad = take_cameras (images); !bad.ok ())
      return bad;
    began = true;
    return work (images, settings, result);
  });
  if (began && !status.ok ()) {
    reset (); /* what is half done is of no use */
    result = {};
  }
  return status;
}

Status
CylinderFilter::work (
    std::span<const RangeImage> images, const CylinderSettings &settings, CylinderResult &result)
{
  decided_ = false;
  if (Status status = cloud_.reset (images); !status.ok ())
    return status;
  forget_other_geometry (settings);
  make_points (images, settings.threads);
  result.points_in = result.points_out = cloud_.size ();
  if (result.points_in > 0) {
    find_bodies (settings);
    choose_axes (settings, images.size ());
    result.bodies = body_count_;
  }
  result.axis = axis_;
  if (views_with_points (cloud_) < 2)
    return {};
  unroll (settings, images.size ());
  units_.sort (cloud_, radius_, column_, runs_, ranges_, settings.units, settings.threads);
  set_rules (settings, images.size ());
  decide_units (settings, result);
  clear_redundant (images, settings);
  units_.rows.remember (rules_, ids_);
  decided_ = true;
  result.points_out -= redundant_.size ();
  return {};
}

void
CylinderFilter::set_rules (const CylinderSettings &settings, std::size_t images)
{
  /* Units are narrow near the axis; beyond this many columns they would cost more than they tell.
   */
  constexpr double kMaxSmoothingSlices = 8;
  const UnitSettings &units = settings.units;
  const double slices = std::min (units.smoothing_m / units_.slice_height_m, kMaxSmoothingSlices);
  rules_.layer_gap = static_cast<float> (units.layer_gap_m);
  rules_.smoothing_columns = static_cast<float> (units.smoothing_m * units.columns / (2 * M_PI));
  rules_.most_columns = std::min (float{UnitRows::kPad}, static_cast<float> (units.columns / 4));
  rules_.smoothing_slices = units.smoothing_m > 0 ? static_cast<int> (slices + 0.5) : 0;
  rules_.hysteresis = static_cast<float> (settings.hysteresis);
  rules_.agreement = static_cast<float> (settings.agreement);
  rules_.images = static_cast<int> (images);
}

void
CylinderFilter::decide_units (const CylinderSettings &settings, CylinderResult &result)
{
  const std::size_t slices = units_.slices.size ();
  in_parallel (slices, settings.threads, [&] (std::size_t s) {
    units_.fill_rows (static_cast<int> (s));
    units_.rows.sum_along (rules_, static_cast<int> (s));
  });
  in_parallel (slices, settings.threads,
      [&] (std::size_t s) { units_.rows.sum_across (rules_, static_cast<int> (s)); });
  units_.rows.recall (ids_, rules_.images);
  const RowCounts counts = units_.rows.decide (rules_, settings.threads);
  result.units_held = counts.held;
  result.units_changed = counts.changed;
  for (const Units::Slice &slice : units_.slices) {
    result.units += slice.occupied;
    result.units_shared += slice.shared;
  }
}

void
CylinderFilter::clear_redundant (
    std::span<const RangeImage> images, const CylinderSettings &settings)
{
  std::array<PixelLookup, kMaxViews> lookups;
  for (std::size_t i = 0; i < images.size (); i++)
    lookups[i] = rig_lookups_[static_cast<std::size_t> (ids_[i])];
  const ResolvedFrame frame{images, {rays_.data (), images.size ()},
      {lookups.data (), images.size ()}, cloud_, runs_, column_, units_};
  redundant_.find (frame, settings.overlap, settings.threads);
  redundant_.clear (frame);
}

} // namespace rangecast
