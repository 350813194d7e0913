/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "painting.hpp"

#include <algorithm>
#include <cmath>

namespace rangecast {
namespace {

/* By which insides move back, metres. */
constexpr double kInsideGap_m = 0.015;

/* The largest weight: half floats (up to 65504) hold the sum of four surfaces of each view. The
 * smallest weight is a share of it. */
constexpr float kMaxWeight = 1000, kMaxSum = 64000, kMinShare = 2e-6f;

} // namespace

BlendWeights
blend_weights (std::size_t rig_views, bool precise)
{
  const auto n = static_cast<float> (std::max<std::size_t> (rig_views, 1));
  const float max = precise ? kMaxWeight : std::min (kMaxWeight, kMaxSum / (4 * n)),
              min = kMinShare * max;
  return {max, min, min / (2.5f * n)};
}

LayerPlace
place_layer (const Mat4 &clip_from_pixel, const Mat4 &clip_from_world, double gap_m)
{
  const DepthShift shift = depth_shift (clip_from_pixel, clip_from_world, gap_m);
  return {clip_from_pixel, {shift.b * shift.g, shift.g}};
}

double
sum_pass_gap (const Mat4 &clip_from_world, const View &view)
{
  return kInsideGap_m * std::clamp (-2 * view_alignment (clip_from_world, view), 0.0, 1.0);
}

double
depth_pass_gap (const Mat4 &clip_from_world, const View &view, double blend_range_m)
{
  return blend_range_m + sum_pass_gap (clip_from_world, view);
}

double
strip_gap (const Mat4 &clip_from_world, const View &view, double view_gap_m)
{
  return view_gap_m * (1 - view_alignment (clip_from_world, view));
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
