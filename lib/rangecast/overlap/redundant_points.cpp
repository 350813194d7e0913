/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "redundant_points.hpp"

#include <algorithm>
#include <bit>

#include "../base/parallel.hpp"
#include "cover_loop.hpp"

namespace rangecast {

void
RedundantPoints::BytePlane::reset (int width, int height, std::uint8_t value)
{
  stride_ = static_cast<std::size_t> (width + 2 * kMargin);
  const std::size_t size = stride_ * static_cast<std::size_t> (height + 2);
  if (bytes_.size () < size)
    bytes_.resize (size);
  std::fill_n (bytes_.begin (), size, value);
}

/* Where cells of a slice have several layers, a point's column does not determine its node. */
void
RedundantPoints::find_nodes (const ResolvedFrame &frame)
{
  const Cells &cells = frame.cells;
  const CellRows &rows = cells.rows;
  node_of_.resize (std::max (node_of_.size (), frame.cloud.x.size ()));
  first_node_.resize (cells.slices.size ());
  for (std::size_t s = 0; s < cells.slices.size (); s++) {
    const auto number = static_cast<int> (s);
    const int planes = rows.slices ()[s].planes;
    const bool plain = cells.slices[s].planes == 1 && planes == 1;
    first_node_[s] = plain ? rows.node (number, 0, 0) : kNoNode;
    if (plain)
      continue;
    for (const CellLayer &layer : cells.layers_of (cells.slices[s])) {
      const std::uint32_t node =
          layer.plane < planes ? rows.node (number, layer.plane, layer.column) : kNoNode;
      for (std::uint32_t i = 0; i < layer.point_count; i++)
        node_of_[cells.points[layer.first_point + i].index] = node;
    }
  }
}

/* Marks in each image which other image won the cell of each point. */
void
RedundantPoints::list_winners (const ResolvedFrame &frame)
{
  find_nodes (frame);
  const CellRows &rows = frame.cells.rows;
  const std::uint32_t *slice_of = frame.cells.slice_of.data ();
  for (const PointRun &run : frame.runs) {
    ImageState &image = images_[run.view];
    for (std::size_t i = run.begin; i < run.end; i++) {
      const std::uint32_t first = first_node_[slice_of[i]];
      const std::uint32_t node =
          first != kNoNode ? first + static_cast<std::uint32_t> (frame.column[i]) : node_of_[i];
      const int winner = node == kNoNode ? -1 : rows.winner (node);
      if (winner < 0 || winner == static_cast<int> (run.view))
        continue;
      const std::uint32_t pixel = frame.cloud.pixel[i];
      image.winner.row (static_cast<int> (pixel >> 16))[pixel & 0xffff] =
          static_cast<std::uint8_t> (winner);
      image.winners |= std::uint64_t{1} << winner;
    }
  }
}

void
RedundantPoints::make_surface (const RangeImage &image, BytePlane &surface) const
{
  constexpr std::uint32_t kStep = static_cast<std::uint32_t> (kDepthStep * 65536);
  for (int y = 0; y + 1 < image.depth.height; y++) {
    const std::uint16_t *upper = image.depth.row (y), *lower = image.depth.row (y + 1);
    std::uint8_t *to = surface.row (y);
    for (int x = 0; x + 1 < image.depth.width; x++) {
      const std::uint32_t nearest = std::min (
                              std::min (upper[x], upper[x + 1]), std::min (lower[x], lower[x + 1])),
                          farthest = std::max (
                              std::max (upper[x], upper[x + 1]), std::max (lower[x], lower[x + 1]));
      to[x] =
          nearest != kInvalidDepth && farthest - nearest <= nearest * kStep >> 16 ? kSurface : 0;
    }
  }
}

/* Finds which columns of each row another image won. @return whether any */
bool
RedundantPoints::find_candidates (
    const RangeImage &image, const BytePlane &winners, std::size_t winner)
{
  const auto number = static_cast<std::uint8_t> (winner);
  bool any = false;
  for (int y = 0; y < image.depth.height; y++) {
    const std::uint8_t *row = winners.row (y), *end = row + image.depth.width;
    const std::uint8_t *first = std::find (row, end, number);
    Range &range = candidates_[static_cast<std::size_t> (y)];
    range = {};
    if (first == end)
      continue;
    while (end[-1] != number)
      end--;
    range = {static_cast<int> (first - row), static_cast<int> (end - row)};
    any = true;
  }
  return any;
}

/* Resets the state for this frame's images. */
void
RedundantPoints::begin (const ResolvedFrame &frame)
{
  std::size_t width = 0, height = 0;
  count_ = 0;
  for (std::size_t i = 0; i < frame.images.size (); i++) {
    const auto &depth = frame.images[i].depth;
    images_[i].winners = 0;
    images_[i].winner.reset (depth.width, depth.height, kNoWinner);
    images_[i].surface.reset (depth.width, depth.height, 0);
    width = std::max (width, static_cast<std::size_t> (depth.width));
    height = std::max (height, static_cast<std::size_t> (depth.height));
  }
  if (candidates_.size () < height)
    candidates_.resize (height);
  for (Row &row : rows_) {
    const std::size_t size = width + 4 * kMaxLanes;
    if (row.on_surface.size () >= size)
      continue;
    for (auto *numbers : {&row.depth, &row.u, &row.v})
      numbers->resize (size);
    row.on_surface.resize (size); /* the last to grow: all have grown */
  }
}

void
RedundantPoints::find (const ResolvedFrame &frame, double overlap, int threads)
{
  begin (frame);
  in_parallel (frame.images.size (), threads,
      [&] (std::size_t i) { make_surface (frame.images[i], images_[i].surface); });
  list_winners (frame);
  for (std::size_t i = 0; i < frame.images.size (); i++)
    for (std::uint64_t rest = images_[i].winners; rest; rest &= rest - 1) {
      const auto winner = static_cast<std::size_t> (std::countr_zero (rest));
      if (find_candidates (frame.images[i], images_[i].winner, winner))
        for_this_cpu (
            [&]<typename L> (L) { CoverLoop<L> (*this, frame, i, winner, overlap).run (); });
    }
}

void
RedundantPoints::clear (const ResolvedFrame &frame)
{
  for (std::size_t i = 0; i < frame.images.size (); i++) {
    const auto &depth = frame.images[i].depth;
    for (int y = 0; y < depth.height && images_[i].winners; y++) {
      const std::uint8_t *winner = images_[i].winner.row (y);
      std::uint16_t *row = depth.row (y);
      for (int x = 0; x < depth.width; x++)
        row[x] = winner[x] == kGoes ? kInvalidDepth : row[x];
    }
  }
}

} // namespace rangecast
