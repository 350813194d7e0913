/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "reduced_view.hpp"

namespace rangecast {

/** Pixels between a depth edge and the place where a view has its full weight. */
inline constexpr int kFeatherPixels = 6;
/** Tangent of the angle between a surface's normal and the camera's ray from which on a step in
 *  depth may be one between two surfaces. */
inline constexpr double kSteepSlope = 3;

/** Bits of BlendPlanes::colour.x. */
enum BlendFlags : std::uint8_t {
  kValid = 1,
  kJoinsRight = 2, ///< one surface with the pixel to the right
  kJoinsBelow = 4, ///< one surface with the pixel below
};

/** What blending needs of each pixel of one view; width x height of its ROI. */
struct BlendPlanes {
  int width = 0, height = 0;
  /** Colour, smoothed where it equals that of a neighbour, as if the neighbour code had copied it;
   * x holds BlendFlags. */
  std::vector<Rgbx> colour;
  /** Square root of the weight, 255 = 1: how squarely the view sees the surface (cosine), times the
   *  square root of the distance to the nearest depth edge in kFeatherPixels; 0 of invalid pixels.
   */
  std::vector<std::uint8_t> weight;
  std::vector<Rgbx> scratch;        ///< memory of make_blend_planes()
  std::vector<std::uint8_t> copied; ///< the same

  [[nodiscard]] ImageView<const Rgbx> colour_plane () const
  {
    return {colour.data (), width, height, static_cast<std::ptrdiff_t> (sizeof (Rgbx)) * width};
  }
};

/** Makes the planes of one view of a frame set.
 *
 *  Neighbouring pixels whose depths differ by more than depth_step lie on different surfaces. So do
 *  those on a steep step (kSteepSlope) that another view sees through: a surface one behind the
 *  other, which no surface joins.
 *
 *  @param views       all of the frame set
 *  @param which       the one to make planes of
 *  @param depth_step  share of the depth
 *  @param[out] to     replaced; keeps its memory
 *  Reentrant. */
void make_blend_planes (
    std::span<const SurfaceView> views, std::size_t which, double depth_step, BlendPlanes &to);

} // namespace rangecast
