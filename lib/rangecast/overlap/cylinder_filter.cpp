/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "cylinder_filter.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "../base/guarded.hpp"
#include "../base/parallel.hpp"

namespace rangecast {
namespace {

Status
check (const CylinderSettings &settings)
{
  const CellSettings &cells = settings.cells;
  auto bad = [] (const char *what) { return Status{StatusCode::kBadValue, what}; };
  if (!(cells.height_m >= 0.0002 && cells.height_m <= 10))
    return bad ("cylinder: unit height, expected 0.0002 to 10 metres");
  if (cells.columns < 8 || cells.columns > 3600)
    return bad ("cylinder: columns, expected 8 to 3600");
  if (!(cells.layer_gap_m >= 0 && cells.layer_gap_m <= 100) ||
      !(cells.smoothing_m >= 0 && cells.smoothing_m <= 1))
    return bad ("cylinder: layer gap, expected 0 to 100 metres; smoothing, 0 to 1 metre");
  if (!(settings.overlap >= 0 && settings.overlap <= kMaxOverlap))
    return bad ("cylinder: overlap, expected 0 to 16 pixels");
  if (!(settings.hysteresis >= 0 && settings.hysteresis <= 2) ||
      !(settings.agreement >= 0 && settings.agreement <= 2))
    return bad ("cylinder: hysteresis and agreement, expected 0 to 2");
  if (settings.max_clusters < 1 || settings.max_clusters > kMaxClusters)
    return bad ("cylinder: bodies, expected 1 to 8");
  const double length = norm (settings.fixed_axis.direction);
  if (settings.axis == AxisMode::kFixed && !(length > 1e-9 && length < 1e9))
    return bad ("cylinder: direction of the fixed axis, expected a length of 1e-9 to 1e9");
  if (settings.axis == AxisMode::kFixed && !(norm (settings.fixed_axis.position) < 1e6))
    return bad ("cylinder: position of the fixed axis, expected less than 1000 km");
  return {};
}

} // namespace

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
  cells_.rows.reset ();
  decided_ = false;
}

/* Winners of cells about an axis found by another rule, or set elsewhere, are of no use. But an
 * application may move a fixed axis a little in each frame, to follow a person. */
void
CylinderFilter::reset_on_new_geometry (const CylinderSettings &settings)
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
    ids_[i] = id;
  }
  return {};
}

/* Sorts the points by cluster, and computes the moments of each cluster. */
void
CylinderFilter::find_clusters (const CylinderSettings &settings)
{
  const auto parts = cloud_.parts ();
  cluster_count_ =
      clusters_.find (cloud_, settings.axis == AxisMode::kFixed ? 1 : settings.max_clusters);
  const auto clusters = static_cast<std::size_t> (cluster_count_);
  runs_.resize (parts.size () * clusters);
  moments_.resize (runs_.size ());
  in_parallel (parts.size (), settings.threads, [&] (std::size_t i) {
    std::array<std::size_t, kMaxClusters> ends{parts[i].end};
    if (clusters > 1)
      clusters_.sort_part (cloud_, i, ends);
    std::size_t begin = parts[i].begin;
    for (std::size_t b = 0; b < clusters; b++) {
      PointRun &run = runs_[i * clusters + b];
      run = {begin, ends[b], static_cast<std::uint32_t> (i), static_cast<std::uint32_t> (b)};
      begin = run.end;
      moments_[i * clusters + b] = {};
      moments_[i * clusters + b].add (cloud_, {run.begin, run.end});
    }
  });
}

/* Gives each cluster the slot that it had in the frame before: the nearest pair of a cluster and a
 * slot first, if they are less than half a metre apart; the other clusters get unused slots. */
void
CylinderFilter::choose_slots (const std::array<Axis, kMaxClusters> &measured)
{
  constexpr double kFar = 0.5;
  slots_.fill (-1);
  unsigned taken = 0;
  const auto assign = [&] (int cluster, int slot) {
    slots_[cluster] = slot;
    taken |= 1u << slot;
  };
  for (int pair = 0; pair < cluster_count_; pair++) {
    double nearest = kFar;
    int best_cluster = -1, best_slot = -1;
    for (int cluster = 0; cluster < cluster_count_; cluster++)
      for (int slot = 0; slot < kMaxClusters; slot++) {
        if (slots_[cluster] >= 0 || (taken >> slot & 1) || !trackers_[slot].started ())
          continue;
        const double distance =
            norm (trackers_[slot].axis ().position - measured[cluster].position);
        if (distance < nearest)
          nearest = distance, best_cluster = cluster, best_slot = slot;
      }
    if (best_cluster >= 0)
      assign (best_cluster, best_slot);
  }
  for (int slot = 0; slot < kMaxClusters; slot++)
    if (!(taken >> slot & 1))
      trackers_[slot].reset ();
  for (int cluster = 0, slot = 0; cluster < cluster_count_; cluster++) {
    while (slots_[cluster] < 0 && (taken >> slot & 1))
      slot++;
    if (slots_[cluster] < 0)
      assign (cluster, slot);
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
  std::array<Axis, kMaxClusters> measured;
  const auto clusters = static_cast<std::size_t> (cluster_count_);
  for (std::size_t cluster = 0; cluster < clusters; cluster++) {
    Moments all;
    for (std::size_t i = 0; i < images; i++)
      all += moments_[i * clusters + cluster];
    measured[cluster] = axis_of_points (settings.axis, all, {rays_.data (), images});
  }
  choose_slots (measured);
  for (std::size_t cluster = 0; cluster < clusters; cluster++) {
    const int slot = slots_[cluster];
    axes_[slot] = trackers_[slot].follow (measured[cluster]);
  }
  axis_ = axes_[slots_[0]];
}

/* Moves the points to coordinates of their cluster's cylinder, and finds each cylinder's heights.
 */
void
CylinderFilter::unroll (const CylinderSettings &settings, std::size_t images)
{
  std::array<CylinderFrame, kMaxClusters> frames;
  for (int cluster = 0; cluster < cluster_count_; cluster++) {
    const int slot = slots_[cluster];
    frames[slot] = CylinderFrame (axes_[slot]);
    for (std::size_t i = 0; i < images; i++) {
      const float *a = rays_[i].optical_axis;
      const Vec3 optical = frames[slot].rotation * Vec3{a[0], a[1], a[2]};
      rules_.optical[slot][i] = {static_cast<float> (optical.x), static_cast<float> (optical.z)};
    }
  }
  if (column_.size () < cloud_.x.size ()) { /* the last to grow: all have grown */
    radius_.resize (cloud_.x.size ());
    column_.resize (cloud_.x.size ());
  }
  run_ranges_.resize (runs_.size ());
  in_parallel (runs_.size (), settings.threads, [&] (std::size_t i) {
    runs_[i].cluster = static_cast<std::uint32_t> (slots_[runs_[i].cluster]);
    run_ranges_[i] = project_to_cylinder (cloud_, {runs_[i].begin, runs_[i].end},
        frames[runs_[i].cluster], settings.cells.columns, radius_.data (), column_.data ());
  });
  constexpr float kHuge = std::numeric_limits<float>::max ();
  ranges_.fill ({kHuge, -kHuge});
  for (std::size_t i = 0; i < runs_.size (); i++) {
    HeightRange &range = ranges_[runs_[i].cluster];
    range.y_min = std::min (range.y_min, run_ranges_[i].y_min);
    range.y_max = std::max (range.y_max, run_ranges_[i].y_max);
  }
}

void
CylinderFilter::set_rules (const CylinderSettings &settings, std::size_t images)
{
  constexpr double kMaxSmoothingSlices = 8; /* more would cost time for little */
  const CellSettings &cells = settings.cells;
  const double slices = std::min (cells.smoothing_m / cells_.slice_height_m, kMaxSmoothingSlices);
  rules_.layer_gap = static_cast<float> (cells.layer_gap_m);
  rules_.smoothing_columns = static_cast<float> (cells.smoothing_m * cells.columns / (2 * M_PI));
  rules_.max_columns = std::min (float{CellRows::kPad}, static_cast<float> (cells.columns / 4));
  rules_.smoothing_slices = cells.smoothing_m > 0 ? static_cast<int> (slices + 0.5) : 0;
  rules_.hysteresis = static_cast<float> (settings.hysteresis);
  rules_.agreement = static_cast<float> (settings.agreement);
  rules_.images = static_cast<int> (images);
}

void
CylinderFilter::decide_cells (const CylinderSettings &settings, CylinderResult &result)
{
  const std::size_t slices = cells_.slices.size ();
  in_parallel (slices, settings.threads, [&] (std::size_t s) {
    cells_.fill_rows (static_cast<int> (s));
    cells_.rows.sum_along (rules_, static_cast<int> (s));
  });
  in_parallel (slices, settings.threads,
      [&] (std::size_t s) { cells_.rows.sum_across (rules_, static_cast<int> (s)); });
  cells_.rows.renumber_winners (ids_, rules_.images);
  const RowCounts counts = cells_.rows.decide (rules_, settings.threads);
  result.cells_held = counts.held;
  result.cells_changed = counts.changed;
  for (const Cells::Slice &slice : cells_.slices) {
    result.cells += slice.occupied;
    result.cells_shared += slice.shared;
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
      {lookups.data (), images.size ()}, cloud_, runs_, column_, cells_};
  redundant_.find (frame, settings.overlap, settings.threads);
  redundant_.clear (frame);
}

Status
CylinderFilter::work (
    std::span<const RangeImage> images, const CylinderSettings &settings, CylinderResult &result)
{
  decided_ = false;
  if (Status status = cloud_.reset (images); !status.ok ())
    return status;
  reset_on_new_geometry (settings);
  in_parallel (images.size (), settings.threads,
      [&] (std::size_t i) { cloud_.fill (i, images[i], rays_[i]); });
  result.points_in = result.points_out = cloud_.size ();
  if (result.points_in > 0) {
    find_clusters (settings);
    choose_axes (settings, images.size ());
    result.clusters = cluster_count_;
  }
  result.axis = axis_;
  if (std::ranges::count_if (
          cloud_.parts (), [] (const WorldPoints::Part &part) { return part.size () > 0; }) < 2)
    return {};
  unroll (settings, images.size ());
  cells_.sort (cloud_, radius_, column_, runs_, ranges_, settings.cells, settings.threads);
  set_rules (settings, images.size ());
  decide_cells (settings, result);
  clear_redundant (images, settings);
  cells_.rows.keep_winners (rules_, ids_);
  decided_ = true;
  result.points_out -= redundant_.size ();
  return {};
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
