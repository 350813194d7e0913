/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "truth.hpp"

#include <algorithm>
#include <cmath>
#include <rangecast/surface/strips.hpp>
#include <unordered_map>

using namespace rangecast;

namespace bench {

namespace {

constexpr int kSamples = 60000;
/* Metres: a point this far off the surface covers it still; and by the stricter measure. */
constexpr double kAcross = 0.02, kNear = 0.006;
constexpr double kSliceHeight = 0.008; ///< metres
constexpr int kAngles = 72;
constexpr double kCellHeight = 0.004, kLayerGap = 0.03; ///< metres
constexpr int kColumns = 360;

double
quantile (std::vector<double> &values, double share)
{
  if (values.empty ())
    return 0;
  const auto at = values.begin () + std::ptrdiff_t (share * double (values.size () - 1) + 0.5);
  std::nth_element (values.begin (), at, values.end ());
  return *at;
}

double
turn_of (Vec3 p) /* 0 to 1, about the vertical */
{
  const double turn = (std::atan2 (p.z, p.x) + M_PI) / (2 * M_PI);
  return std::min (turn, 1 - 1e-12);
}

} // namespace

Judge::Judge (FrameSet &set, const Surface &surface, std::vector<Sample> visible, double slice_y)
    : spots_ (spots_of (set)), visible_ (std::move (visible))
{
  double pixel_m = 0;
  for (const Spot &spot : spots_) {
    height_.push_back (surface.distance (spot.point).value_or (Surface::kFarthest));
    middle_ = middle_ + 1.0 / double (spots_.size ()) * spot.point;
    const View &view = set.rig.views[std::size_t (spot.view)];
    pixel_m += norm (spot.point - view.world_from_view.translation) / view.intrinsics.fx /
               double (spots_.size ());
  }
  find_covers (2 * pixel_m);
  find_slice (slice_y);
}

void
Judge::find_covers (double reach)
{
  const double cell = std::max (reach, kAcross);
  const auto key = [&] (Vec3 p, int k) {
    const auto part = [&] (double v, int d) {
      return std::uint64_t (std::floor (v / cell) + (1 << 20) + d);
    };
    return part (p.x, k % 3 - 1) << 42 | part (p.y, k / 3 % 3 - 1) << 21 | part (p.z, k / 9 - 1);
  };
  std::unordered_map<std::uint64_t, std::vector<std::uint32_t>> cells;
  for (std::size_t i = 0; i < spots_.size (); i++)
    cells[key (spots_[i].point, 13)].push_back (std::uint32_t (i));
  for (const Sample &sample : visible_) {
    covers_begin_.push_back (std::uint32_t (covers_.size ()));
    for (int k = 0; k < 27; k++) {
      const auto found = cells.find (key (sample.point, k));
      if (found == cells.end ())
        continue;
      for (std::uint32_t i : found->second) {
        const Vec3 d = spots_[i].point - sample.point;
        const double across = dot (d, sample.normal);
        if (std::abs (across) < kAcross && dot (d, d) - across * across < reach * reach) {
          covers_.push_back (i);
          across_.push_back (float (std::abs (across)));
        }
      }
    }
  }
  covers_begin_.push_back (std::uint32_t (covers_.size ()));
}

void
Judge::find_slice (double slice_y)
{
  Vec3 middle;
  double n = 0;
  const auto inside = [&] (Vec3 p) { return std::abs (p.y - slice_y) < kSliceHeight / 2; };
  for (const Spot &spot : spots_)
    if (inside (spot.point))
      middle = middle + spot.point, n++;
  slice_.assign (kAngles, {});
  for (std::size_t i = 0; i < spots_.size (); i++)
    if (inside (spots_[i].point))
      slice_[std::size_t (turn_of (spots_[i].point - 1 / n * middle) * kAngles)].push_back (
          std::uint32_t (i));
}

std::vector<char>
Judge::alive_in (const FrameSet &set) const
{
  std::vector<char> alive;
  for (const Spot &spot : spots_) {
    const auto i = std::size_t (spot.view);
    alive.push_back (
        set.depth[i][std::size_t (spot.v) * std::size_t (set.rig.views[i].width) + spot.u] != 0);
  }
  return alive;
}

bool
Judge::is_covered (std::size_t sample, const std::vector<char> &alive, double across) const
{
  for (std::size_t k = covers_begin_[sample]; k < covers_begin_[sample + 1]; k++)
    if (alive[covers_[k]] && across_[k] < across)
      return true;
  return false;
}

std::vector<Sample>
Judge::covered (const FrameSet &set) const
{
  const std::vector<char> alive = alive_in (set);
  std::vector<Sample> some;
  for (std::size_t i = 0; i < visible_.size (); i++)
    if (is_covered (i, alive, kAcross))
      some.push_back (visible_[i]);
  return some;
}

double
Judge::cells_double (const std::vector<char> &alive) const
{
  struct Member {
    double radius;
    int view;
  };
  std::unordered_map<std::int64_t, std::vector<Member>> cells;
  for (std::size_t i = 0; i < spots_.size (); i++) {
    if (!alive[i])
      continue;
    const Vec3 p = spots_[i].point - middle_;
    const auto slice = std::int64_t (std::floor (p.y / kCellHeight));
    cells[slice * kColumns + std::int64_t (turn_of (p) * kColumns)].push_back (
        {std::hypot (p.x, p.z), spots_[i].view});
  }
  std::size_t several = 0;
  for (auto &[cell, members] : cells) {
    std::ranges::sort (members, {}, &Member::radius);
    bool shared = false;
    for (std::size_t i = 1; i < members.size (); i++)
      shared |= members[i].view != members[i - 1].view &&
                members[i].radius - members[i - 1].radius <= kLayerGap;
    several += shared;
  }
  return double (several) / double (std::max<std::size_t> (1, cells.size ()));
}

void
Judge::judge_slice (const std::vector<char> &alive, Verdict &verdict) const
{
  std::vector<double> thickness, heights;
  double sum = 0;
  for (const auto &angle : slice_) {
    heights.clear ();
    for (std::uint32_t i : angle)
      if (alive[i])
        heights.push_back (1000 * height_[i]);
    if (heights.size () < 5)
      continue;
    thickness.push_back (quantile (heights, 0.9) - quantile (heights, 0.1));
    sum += thickness.back ();
  }
  verdict.thickness_mm = thickness.empty () ? 0 : sum / double (thickness.size ());
  verdict.thickness95_mm = quantile (thickness, 0.95);
}

void
Judge::judge_distance (const std::vector<char> &alive, Verdict &verdict) const
{
  std::vector<double> distances;
  for (std::size_t i = 0; i < spots_.size (); i++)
    if (alive[i])
      distances.push_back (1000 * std::abs (height_[i]));
  verdict.points = distances.size ();
  verdict.removed =
      1 - double (distances.size ()) / double (std::max<std::size_t> (1, spots_.size ()));
  verdict.distance_mm = quantile (distances, 0.5);
  verdict.distance95_mm = quantile (distances, 0.95);
}

Verdict
Judge::judge (FrameSet &set) const
{
  const std::vector<char> alive = alive_in (set);
  Verdict verdict;
  judge_distance (alive, verdict);
  judge_slice (alive, verdict);
  verdict.cells_double = cells_double (alive);
  std::size_t open = 0, open_6mm = 0;
  for (std::size_t i = 0; i < visible_.size (); i++) {
    open += !is_covered (i, alive, kAcross);
    open_6mm += !is_covered (i, alive, kNear);
  }
  const double all = double (std::max<std::size_t> (1, visible_.size ()));
  verdict.uncovered = double (open) / all;
  verdict.uncovered_6mm = double (open_6mm) / all;
  std::vector<StripVertex> vertices;
  for (const RangeImage &image : set.images ()) {
    StripResult result;
    build_strips (image, {}, vertices, result);
    verdict.strips += result.strips;
    verdict.isolated += result.isolated;
  }
  return verdict;
}

std::vector<Sample>
visible_places (
    const Surface &surface, const Rig &rig, const std::vector<std::vector<std::uint16_t>> &depth)
{
  constexpr double kSquare = 0.2, kSame = 0.005; /* cosine; metres */
  std::vector<Pose> view_from_world;
  for (const View &view : rig.views)
    view_from_world.push_back (view.world_from_view.inverse ());
  std::vector<Sample> seen = surface.samples (kSamples);
  std::erase_if (seen, [&] (const Sample &sample) {
    for (std::size_t i = 0; i < rig.views.size (); i++) {
      const View &view = rig.views[i];
      const Vec3 ray = view.world_from_view.translation - sample.point;
      const Vec3 p = view_from_world[i] * sample.point;
      const double u = view.intrinsics.fx * p.x / p.z + view.intrinsics.cx,
                   v = view.intrinsics.fy * p.y / p.z + view.intrinsics.cy;
      if (dot (ray, sample.normal) < kSquare * norm (ray) || !(p.z > 0) || u < 0 || v < 0 ||
          u > view.width - 1 || v > view.height - 1)
        continue;
      const auto at =
          std::size_t (std::lround (v)) * std::size_t (view.width) + std::size_t (std::lround (u));
      if (depth[i][at] && std::abs (depth[i][at] * view.depth_unit_m - p.z) < kSame)
        return false;
    }
    return true;
  });
  return seen;
}

} // namespace bench
