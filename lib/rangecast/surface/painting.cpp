/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "painting.hpp"

#include <algorithm>
#include <cmath>

namespace rangecast {
namespace {

/* By which insides move back, metres. */
constexpr double kInsideGap_m = 0.015;

/* 8 bytes each. */
constexpr std::int64_t kMaxAtlasPixels = std::int64_t{1} << 25;

} // namespace

void
choose_cells (std::span<const double> alignments, std::size_t cells, std::vector<std::size_t> &to)
{
  to.resize (alignments.size ());
  for (std::size_t i = 0; i < alignments.size (); i++) {
    std::size_t rank = 0;
    for (std::size_t k = 0; k < alignments.size (); k++)
      rank += alignments[k] > alignments[i] || (alignments[k] == alignments[i] && k < i);
    to[i] = std::min (rank, cells - 1);
  }
}

void
make_blend_atlas (std::span<const double> alignments, std::size_t max_cells, const Roi &covered,
    int max_side, BlendAtlas &to)
{
  const std::int64_t pixels = std::int64_t{covered.width} * covered.height;
  const int columns = max_side / covered.width, rows = max_side / covered.height;
  const auto fitting = static_cast<std::size_t> (std::max<std::int64_t> (
      std::min (std::int64_t{columns} * rows, kMaxAtlasPixels / pixels), 1));
  to.cells = std::clamp<std::size_t> (alignments.size (), 1, std::min (max_cells, fitting));
  const int count = static_cast<int> (to.cells), used = std::min (count, columns);
  to.width = used * covered.width;
  to.height = (count + used - 1) / std::max (used, 1) * covered.height;
  for (int i = 0; i < count; i++)
    to.from_picture[static_cast<std::size_t> (i)] = {
        i % used * covered.width - covered.x, i / used * covered.height - covered.y};
  choose_cells (alignments, to.cells, to.cell_of);
}

LayerPlace
place_layer (const Mat4 &clip_from_pixel, const Mat4 &clip_from_world, double gap_m)
{
  const DepthShift shift = depth_shift (clip_from_pixel, clip_from_world, gap_m);
  return {clip_from_pixel, {shift.b * shift.g, shift.g}};
}

double
layer_gap (StripMode mode, const Mat4 &clip_from_world, const View &view)
{
  const double along = view_alignment (clip_from_world, view);
  return mode == StripMode::kBlend ? kInsideGap_m * std::clamp (-2 * along, 0.0, 1.0)
                                   : kViewGap_m * (1 - along);
}

LayerAngles
layer_angles (const Mat4 &clip_from_world, const View &view, const Roi &roi)
{
  const Intrinsics &lens = view.intrinsics;
  const Mat3 &r = view.world_from_view.rotation;
  const Vec3 from = viewer_position (clip_from_world) - view.world_from_view.translation;
  const auto f = [] (double value) { return static_cast<float> (value); };
  return {{f (lens.cx - roi.x), f (lens.cy - roi.y), f (1 / lens.fx), f (1 / lens.fy)},
      {f (dot (from, {r[0], r[3], r[6]})), f (dot (from, {r[1], r[4], r[7]})),
          f (dot (from, {r[2], r[5], r[8]}))},
      f (view.depth_unit_m)};
}

int
fill_reach (int picture_height)
{
  return std::max (picture_height / 15, 2);
}

double
pixels_per_unit (const SceneFrame &scene, const Orbit &orbit, int height)
{
  const double fov = orbit.fov_deg > 0 ? orbit.fov_deg : scene.fov_deg;
  return height / (2 * std::tan (fov * M_PI / 360));
}

} // namespace rangecast
