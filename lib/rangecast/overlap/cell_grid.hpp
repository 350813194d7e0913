/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "../geometry/range_image.hpp"

namespace rangecast {

/** The cylinder has no more cells; slices become higher where points would need more. */
inline constexpr int kMaxCells = 1 << 21;

/** The points of a frame set in the cells of a cylinder, and the view
 *  that wins each surface of a cell. Keeps its memory from frame to frame: 100 bytes a point, 20 a
 *  cell.
 *
 *  A node is one surface in one cell: points whose radii have no gap of more than kLayerGapM
 * between them. A view's tangent in a node is the normalised difference to its next point along the
 * slice: rows of a range image need not lie along slices, and a cell often holds one point of a
 * view or none, so "next" is the view's mean point in the next node at most kReach columns further
 * that has any, across 2 pi too. Tangents are summed over kSmoothingM each way, so that winners do
 * not change from cell to cell by chance. A view also competes in a node that it has no point in,
 * but points on both sides of, in angle or in height.
 *
 *  Of the views that compete the one wins with the largest |N . a| (N: normal of the summed tangent
 *  in the slice, a: the view's optical axis), plus kHysteresis for the node's winner in the frame
 *  before, plus kAgreement if it won all neighbours; of equals the first.
 *
 *  Order of calls for a frame: lay_out(), count(), make_room(), add(), decide(). */
class CellGrid {
public:
  static constexpr std::uint32_t kNoNode = UINT32_MAX;

  /** A point in the coordinates of the cylinder, metres. */
  struct Point {
    float radius, x, z;
    std::uint32_t index; ///< of the point in the cloud
    std::uint32_t view;  ///< number of the image in the frame set, not its view-id
  };
  /** Heights of points on the cylinder, metres; none if y_min > y_max. */
  struct HeightRange {
    float y_min, y_max;
  };
  struct Counts {
    std::uint64_t cells = 0, shared = 0; ///< with points; with points of more than one view
    std::uint64_t held = 0, changed = 0; ///< nodes that had a winner before; that have another now
  };
  /** x, z of each image's optical axis in the cylinder's coordinates. */
  using OpticalAxes = std::array<std::array<float, 2>, kMaxViews>;

  /** Cuts the cylinder into slices. @param range  heights of the points */
  void lay_out (const HeightRange &range, double slice_height_m, int columns);
  [[nodiscard]] std::uint32_t cell_of (float y, std::uint32_t column) const;

  /** Counts each point, to make room, then takes them in the order of the cloud.
   *  @param size  of the cloud, unused elements included */
  void count (std::uint32_t cell) { ends_[cell]++; }
  void make_room (std::size_t size);
  void add (std::uint32_t cell, const Point &point) { points_[ends_[cell]++] = point; }

  /** Chooses the winner of each node. @param ids  view-id of each image */
  Counts decide (const OpticalAxes &optical, std::span<const int> ids, int threads);
  /** Forgets the winners. */
  void reset ();

  /** The number of the image that won a point's surface; -1 for the fifth and further surfaces of a
   *  cell, whose points all stay. */
  [[nodiscard]] int winner_of (std::size_t point) const
  {
    const std::uint32_t node = node_of_[point];
    return node == kNoNode ? -1 : nodes_[node].winner;
  }
  [[nodiscard]] int slices () const { return stack_.count; }
  /** The view-id of the winner of a cell's outermost surface; -1 without points. */
  [[nodiscard]] int cell_winner (int slice, int column) const;

private:
  struct Stack {                     /* the slices */
    int count = 0, first_number = 0; /* number: floor (height / slice height) */
    float first_y = 0;
  };
  struct Node {
    float radius;        /* mean of the points */
    float tangent[2];    /* x, z: sum of the views' tangents, weighted by their points */
    float along[2];      /* the same over the neighbourhood in the slice, then in all slices */
    std::uint64_t views; /* bit i: image i has points here; one entry each, in their order */
    std::uint64_t competing;
    std::uint32_t first_entry;
    std::int8_t winner, next, held; /* images; -1: none */
  };
  struct Entry { /* the points of one view in a node */
    float x, z, weight, tangent[2];
  };
  struct Cell { /* its nodes, from the axis outwards */
    std::uint32_t first = 0, count = 0;
  };
  struct Held { /* a node of the frame before */
    float radius;
    int view_id;
  };

  [[nodiscard]] Cell &cell (std::size_t slice, int column)
  {
    return cells_[slice * static_cast<std::size_t> (columns_) + static_cast<std::size_t> (column)];
  }
  [[nodiscard]] std::span<Node> nodes_of (std::size_t slice, int column)
  {
    const Cell &c = cell (slice, (column + columns_) % columns_);
    return {nodes_.data () + c.first, c.count};
  }
  [[nodiscard]] bool is_beside (std::size_t slice, std::ptrdiff_t step) const
  {
    const std::ptrdiff_t other = static_cast<std::ptrdiff_t> (slice) + step;
    return other >= 0 && other < stack_.count;
  }
  void make_nodes (std::size_t slice);
  void add_node (std::uint32_t from, std::uint32_t to, std::uint32_t &entry_end, Cell &cell);
  void find_tangents (std::size_t slice);
  Entry *next_entry (std::size_t slice, int column, const Node &node, int view);
  void sum_along (std::size_t slice);
  void sum_across (std::size_t slice);
  void find_held (std::size_t slice, std::span<const int> ids);
  void choose (std::size_t slice, const OpticalAxes &optical, bool with_neighbours);
  void remember (std::span<const int> ids);
  template <typename Work> void for_nodes (std::size_t slice, const Work &work);

  int columns_ = 0;
  double slice_height_m_ = 0;
  Stack stack_;
  std::vector<Counts> counts_;      /* of each slice */
  std::vector<std::uint32_t> ends_; /* of each cell in points_ */
  std::vector<Point> points_;
  std::vector<Cell> cells_;
  /* A slice's nodes and entries begin where its points do; elements between are unused. */
  std::vector<Node> nodes_;
  std::vector<Entry> entries_;
  std::vector<std::uint32_t> node_of_; /* of each point of the cloud */
  /* Of the frame before. */
  int old_columns_ = 0;
  double old_slice_height_m_ = 0;
  Stack old_stack_;
  std::vector<Cell> old_cells_;
  std::vector<Held> old_nodes_;
};

} // namespace rangecast
