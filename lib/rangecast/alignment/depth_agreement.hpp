/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "fused_view.hpp"

namespace rangecast {

/** Moves the depth of pixels towards what other views measured of the same surface.
 *
 *  A pixel is moved along its own ray, to the weighted mean of its own depth and of where the ray
 *  meets the tangent planes that the other views have at the place. A view's weight falls with the
 *  fourth power of depth (the square of the error of stereo, z^2 / (focal length * baseline)), with
 *  the slant of its surface and towards its depth edges (SurfacePlane::weight). The
 *  weight also falls with the distance, to 0 beyond some pixel footprints (Tukey's biweight), so
 *  depth has no step where views begin to disagree. Pixels that are copies of a neighbour (equal
 * depth and colour, as the neighbour code makes them) stay copies. */
class DepthAgreement {
public:
  /** Changes the depth of one image. Planes are of all images' depth before any was changed, so
   *  images may be worked on in any order, or in parallel with a DepthAgreement each. Nothing is
   *  allocated once an image as large has been seen. Neither makes nor clears a pixel.
   *  @param which  number of the image */
  void process (std::span<const FusedView> views, std::size_t which);

private:
  /* Another view that may see the same surfaces. */
  struct Other {
    const SurfacePlanes *planes = nullptr;
    PixelTransfer transfer;
    float closeness = 1; /* own depth over the other's is multiplied with it before the 4th power */
  };

  void find_others (std::span<const FusedView> views, std::size_t which);
  bool sum_row (const FusedView &own, int y);
  void move_row (const FusedView &own, int y);

  std::vector<Other> others_;
  int begin_ = 0, end_ = 0;                    /* of the row's pixels that have planes */
  std::vector<float> depth_, sum_, weight_;    /* of a row */
  std::vector<float> u_, v_, z_, plane_[4];    /* of a row, in the other view */
  std::vector<std::uint16_t> above_, present_; /* depth of two rows, before */
};

} // namespace rangecast
