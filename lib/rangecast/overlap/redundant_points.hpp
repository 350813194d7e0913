/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "../geometry/range_image.hpp"
#include "../geometry/world_points.hpp"
#include "cell_grid.hpp"

namespace rangecast {

/** A frame set whose winners have been decided. */
struct DecidedFrame {
  std::span<const RangeImage> images;
  std::span<const PixelRays> rays;      ///< of each image's camera
  std::span<const PixelLookup> lookups; ///< of each image's camera
  const WorldPoints &cloud;
  const CellGrid &grid;
};

/** The points that can go without opening a hole. Keeps its memory from frame to frame: 2 bytes a
 *  pixel of all images, 12 a pixel of the largest.
 *
 *  A point whose node another view won is a candidate. With it go the triangles between it and its
 *  eight neighbours, so it goes only if the winner's own triangles cover all of these:
 *  - Where the winner sees the point and each neighbour that joins it, the winner's surface is no
 *    more than kTolerance pixel footprints away.
 *  - All pixels of the winner that surround them make one closed surface of points that stay.
 *  - The point's surface faces the winner: the other side of a thin thing is not covered.
 *  Pixels join as in striprender: their depths differ by no more than kDepthStep.
 *
 *  Images are processed in order. A point that goes no longer covers others, so each one that goes
 *  is covered by points that stay, and where the regions of two views meet, the later one keeps an
 *  overlap of a pixel or two. */
class RedundantPoints {
public:
  /** @param overlap  radius around a point within which its surface must be covered, in pixels of
   *                  its own view; 1: as far as its triangles reach; more keeps a wider overlap
   *  @return how many points there are */
  std::size_t find (const DecidedFrame &frame, double overlap, int threads);

  /** Makes the pixels found invalid. */
  void clear (std::span<const RangeImage> images);

private:
  /* A byte for each pixel of an image. */
  struct BytePlane {
    std::vector<std::uint8_t> bytes;
    std::size_t width = 0;
    void reset (const RangeImage &image, std::uint8_t value);
    [[nodiscard]] std::uint8_t *row (int y) { return bytes.data () + std::size_t (y) * width; }
  };
  struct ImageState {
    /* 1 where the pixel, the one to its right and the two below are one surface of points that
     * stay; else 0. */
    BytePlane surface;
    /* Number of the image that won the pixel's node; kNoWinner: it is no candidate; kGoes. */
    BytePlane winner;
    std::uint64_t winners = 0; /* bit i: image i is in `winner` */
  };
  /* Where the image of a pixel's winner sees the pixel. */
  struct Place {
    float u, v;          /* pixels of the winner's plane */
    std::uint8_t winner; /* kNoWinner: not known yet */
    bool on_surface;     /* of the winner */
  };
  struct Comparison;
  static constexpr std::uint8_t kNoWinner = 0xff, kGoes = 0xfe;

  std::array<ImageState, kMaxViews> images_;
  std::vector<Place> places_; /* of the pixels of one image */
};

} // namespace rangecast
