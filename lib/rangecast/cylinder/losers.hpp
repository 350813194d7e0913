/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "../geometry/range_image.hpp"
#include "units.hpp"
#include "world_points.hpp"

namespace rangecast {

/** A frame set whose units have been decided. */
struct DecidedFrame {
  std::span<const RangeImage> images;
  const WorldPoints &cloud;
  std::span<const PointRun> runs; ///< ordered by view
  std::span<const std::int32_t> column;
  const Units &units;
  /** Where images see points of each body's cylinder. */
  const std::array<std::array<PixelLookup, kMaxViews>, kMaxBodies> &lookups;
  /** How far a point may lie behind, or before, what the image has there; in its depth units. */
  std::array<float, kMaxViews> behind{}, before{};
};

/** The points in units that another view won, and which of them stay all the same. Keeps its memory
 *  from frame to frame: 20 bytes a point. */
class Losers {
public:
  /** Lists them, in the order of the cloud. */
  void list (const DecidedFrame &frame);

  /** Takes off the list what no view that competes has a point left for.
   *
   *  A point well behind what a view sees is hidden from it: another place. A point well before it
   *  would have hidden that: one of both is wrong, and it is the loser's, up to errors that no
   *  stereo makes on the same surface. Where the regions of two views meet, they overlap by a
   * pixel; but what is left of a row's run of points must be more than two pixels for that. One
   * after the other, so that of two losers at one place only the first stays. */
  void keep_uncovered (const DecidedFrame &frame);

  /** Makes the pixels invalid. */
  void clear (const DecidedFrame &frame) const;

  [[nodiscard]] std::size_t size () const { return count_; }

private:
  struct Loser {
    std::uint32_t point; /* in the cloud */
    std::uint32_t place; /* in lost_ */
    std::uint32_t cell;  /* in the rows */
    std::uint8_t image, body, winner;
  };
  template <typename L> struct CoverLoop; /* over some losers at a time */
  struct Twins;

  void find_cells (const DecidedFrame &frame);
  void take_lookups (const DecidedFrame &frame);

  std::vector<Loser> losers_; /* as many as there can be; of these, the first count_ */
  std::size_t count_ = 0;
  std::vector<std::uint8_t> lost_; /* a bit a pixel: it is a loser's; images one after the other */
  struct Lookups {                 /* PixelLookup::rows of all images */
    float rows[3][4][kMaxViews];
  };
  std::array<Lookups, kMaxBodies> lookups_{};
  float boxes_[4][kMaxViews] = {}; /* left, top, width and height of all images' planes */
  /* Of each slice of one plane its first cell, kNoCell of others. There cell_of_ tells the cell of
   * each point; kNoCell for the fifth and further surfaces of a unit, whose points all stay. */
  std::vector<std::uint32_t> first_cell_, cell_of_;
  static constexpr std::uint32_t kNoCell = UINT32_MAX;
};

} // namespace rangecast
