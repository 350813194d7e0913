/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "../geometry/range_image.hpp"
#include "../geometry/world_points.hpp"
#include "cells.hpp"

namespace rangecast {

/** A frame set whose cells have been decided. */
struct ResolvedFrame {
  std::span<const RangeImage> images;
  std::span<const PixelRays> rays;      ///< of each image's camera
  std::span<const PixelLookup> lookups; ///< of each image's camera
  const WorldPoints &cloud;
  std::span<const PointRun> runs; ///< ordered by view
  std::span<const std::int32_t> column;
  const Cells &cells;
};

/** The points that can go without opening a hole. Keeps its memory from frame to frame: 2 bytes a
 *  pixel, 4 a point.
 *
 *  A point whose cell another view won is a candidate. With it go the triangles between it and its
 *  eight neighbours, so it goes only if the winner's own triangles cover all of these:
 *  - Where the winner sees the point and each neighbour that joins it, the winner's surface is no
 *    more than kTolerance pixel footprints away.
 *  - All pixels of the winner that surround them make one closed surface of points that stay.
 *  - The point's surface faces the winner: the other side of a thin thing is not covered.
 *  Pixels join as in striprender: their depths differ by no more than kDepthStep.
 *
 *  Images are processed in order. A point that goes no longer covers others, so each one that goes
 * is covered by points that stay, and where the regions of two views meet, the later one keeps an
 *  overlap of a pixel or two. */
class RedundantPoints {
public:
  /** @param overlap  radius around a point within which its surface must be covered, in pixels of
   * its own view; 1: as far as its triangles reach; more keeps a wider overlap */
  void find (const ResolvedFrame &frame, double overlap, int threads);

  /** Makes the pixels found invalid. */
  void clear (const ResolvedFrame &frame);

  /** Points found. */
  [[nodiscard]] std::size_t size () const { return count_; }

private:
  template <typename L> struct CoverLoop; /* cover_loop.hpp */

  /* A byte for each pixel of an image, with a margin. */
  class BytePlane {
  public:
    void reset (int width, int height, std::uint8_t value);
    [[nodiscard]] std::uint8_t *row (int y) { return bytes_.data () + offset (y); }
    [[nodiscard]] const std::uint8_t *row (int y) const { return bytes_.data () + offset (y); }
    static constexpr int kMargin = 8; ///< bytes left and right of a row; above there is one row

  private:
    [[nodiscard]] std::size_t offset (int y) const
    {
      return static_cast<std::size_t> (y + 1) * stride_ + kMargin;
    }
    std::vector<std::uint8_t> bytes_;
    std::size_t stride_ = 0;
  };

  struct ImageState {
    /* kSurface where the pixel, the one to its right and the two below are one surface of points
     * that stay; else 0. */
    BytePlane surface;
    /* Number of the image that won the pixel's cell; kNoWinner: it is no candidate; kGoes. */
    BytePlane winner;
    std::uint64_t winners = 0; /* bit i: image i is in `winner` */
  };
  static constexpr std::uint8_t kSurface = 0xff, kNoWinner = 0xff, kGoes = 0xfe;

  /* A row of an image and of what lies left and right of it, as another image sees it. */
  struct Row {
    int y = -1;                           /* -1: not made */
    std::vector<float> depth;             /* 0: invalid, or not in the image */
    std::vector<float> u, v;              /* pixels of the other image's plane */
    std::vector<std::int32_t> on_surface; /* -1: on the other image's surface; else 0 */
  };
  struct Range { /* of columns */
    int begin = 0, end = 0;
  };

  void begin (const ResolvedFrame &frame);
  void find_nodes (const ResolvedFrame &frame);
  void list_winners (const ResolvedFrame &frame);
  void make_surface (const RangeImage &image, BytePlane &surface) const;
  bool find_candidates (const RangeImage &image, const BytePlane &winners, std::size_t winner);

  std::array<ImageState, kMaxViews> images_;
  std::size_t count_ = 0;
  std::array<Row, 3> rows_;
  std::vector<Range> candidates_; /* of each row */
  /* First node of each slice of one plane, kNoNode for others, whose points have their node in
   * node_of_: kNoNode for the fifth and further surfaces of a cell, whose points all stay. */
  std::vector<std::uint32_t> first_node_, node_of_;
  static constexpr std::uint32_t kNoNode = UINT32_MAX;
};

} // namespace rangecast
