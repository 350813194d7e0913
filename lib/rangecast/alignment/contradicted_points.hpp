/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "../geometry/pixel_transfer.hpp"
#include "../geometry/range_image.hpp"

namespace rangecast {

/** One view of a frame set with its camera. */
struct BalancedView {
  RangeImage image;
  PixelRays rays;
  PixelLookup lookup;
  /** Factors of its colours; without, they are not compared with those of other views. */
  std::optional<std::array<float, 3>> gains;
};

/** Whether two cameras may see one surface well: they are at most 120 degrees apart. */
inline bool
may_share_surfaces (const PixelRays &a, const PixelRays &b)
{
  constexpr float kMinAxes = -0.5f;
  const float *p = a.optical_axis, *q = b.optical_axis;
  return p[0] * q[0] + p[1] * q[1] + p[2] * q[2] >= kMinAxes;
}

/** Finds points that cannot be where one view has them: another view should see them, but sees a
 *  surface farther away in another colour (photo-consistency, K. N. Kutulakos, S. M. Seitz, "A
 *  theory of shape by space carving", IJCV 38, 2000). Depth alone does not tell which of two views
 *  is wrong; colour does. Typical are pieces of hair that stereo puts in front of a face. */
class ContradictedPoints {
public:
  /** Share of depth by which another view has to see farther. */
  static constexpr float kMargin = 0.03f;

  /** Looks at every other pixel of every other row, and around those that are contradicted.
   *  Allocates only for an image larger than all before. Views without gains are left alone.
   *  @param which  number of the image that is checked; other images may be checked in parallel by
   *                other objects */
  void find (std::span<const BalancedView> views, std::size_t which);
  /** Makes the points that find() found invalid. To be called when all images have been checked.
   *  @return how many points */
  std::size_t clear (const RangeImage &image);

private:
  void check_row (std::span<const BalancedView> views, std::size_t which, int y);

  struct Other {
    std::size_t which;
    PixelTransfer transfer;
  };
  std::vector<Other> others_;
  std::vector<std::uint8_t> found_; /* 1: contradicted; by pixel */
  bool any_ = false;
};

} // namespace rangecast
