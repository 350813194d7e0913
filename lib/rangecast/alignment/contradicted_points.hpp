/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "../geometry/range_image.hpp"
#include "pixel_transfer.hpp"

namespace rangecast {

/** One view of a frame set and its camera. */
struct SeenView {
  RangeImage image;
  PixelRays rays;
  PixelLookup lookup;
  /** What its colours are multiplied with before they are compared; none: they are not. */
  std::optional<std::array<float, 3>> gains;
};

/** Finds the points that cannot be where one view has them: another view would see them, and sees a
 *  surface behind them in another colour (photo-consistency, K. N. Kutulakos, S. M. Seitz, "A
 * theory of shape by space carving", IJCV 38, 2000). Depth alone does not tell which of two views
 * is wrong; with colour a point that is there would show. Typical are pieces of hair that stereo
 * puts in front of a face. */
class ContradictedPoints {
public:
  /** Share of depth by which another view has to see farther. */
  static constexpr float kMargin = 0.03f;
  /** Grey levels by which one of R, G, B has to differ, from all of 3 x 3 pixels. */
  static constexpr float kOtherColour = 40;

  /** Looks at every other pixel of every other row, and around those that are found. Nothing is
   *  allocated once as many have been.
   *  @param which  number of the image that is checked; images of other numbers may be checked in
   *                parallel by other objects */
  void find (std::span<const SeenView> views, std::size_t which);
  /** Makes the points that find() found invalid. To be called when all images have been checked. */
  void clear (const RangeImage &image) const;

private:
  [[nodiscard]] static bool is_contradicted (
      const SeenView &own, const SeenView &seen, const PixelTransfer &transfer, int x, int y);
  void check_row (std::span<const SeenView> views, std::size_t which, int y);

  struct Other {
    std::size_t which;
    PixelTransfer transfer;
  };
  std::vector<Other> others_;
  std::vector<std::uint32_t> found_; /* pixels, counted row by row */
};

} // namespace rangecast
