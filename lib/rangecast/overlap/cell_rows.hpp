/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "../geometry/range_image.hpp"

namespace rangecast {

/** The radius of a node without points, metres: further than any layer gap from all others. */
inline constexpr float kNoRadius = 1e30f;
/** Maximum number of cylinders. */
inline constexpr int kMaxClusters = 8;

/** How the winners of cells follow from their neighbourhood. Lengths in metres. */
struct RowRules {
  float layer_gap = 0;
  float smoothing_columns = 0; ///< columns at a radius of 1 m; at radius r this divided by r
  float max_columns = 0;       ///< maximum number of columns, 0 .. CellRows::kPad
  int smoothing_slices = 0;
  float hysteresis = 0; ///< bonus of the previous frame's winner, 0 .. 2 (a cosine)
  float agreement = 0;  ///< bonus of a view that won all neighbours, 0 .. 2 (a cosine)
  int images = 0;
  /** x, z of each image's optical axis in each cluster's cylinder. */
  std::array<std::array<std::array<float, 2>, kMaxViews>, kMaxClusters> optical;
};

/** Statistics of decide(). */
struct RowCounts {
  std::uint64_t held = 0;    ///< layers that had a winner in the frame before
  std::uint64_t changed = 0; ///< those of them that have another one now
};

/** The layers of all cells as a grid of nodes, one node for each layer of each cell, in rows so
 * that eight columns can be worked on together. The first layer of a cell lies in plane 0 of its
 * slice, the next in plane 1 and so on; a slice has one row for each plane that its cells need,
 * none without points.
 *
 *  Order of calls for a frame: begin(), add_slice(), make_room(), put(), sum_along() of all
 *  slices, sum_across() of all, decide(), keep_winners(). Calls for different slices may be made at
 * the same time. All planes have pads of columns repeated from the other end of the row. */
class CellRows {
public:
  static constexpr int kPad = 8;
  static constexpr int kPlanes = 4;

  struct Slice {
    std::uint32_t first_row = 0;
    int planes = 0;
    int cluster = 0;
    int number = 0; ///< floor (height / slice height), counted from the axis' own origin
  };

  /** Of one layer. */
  struct Node {
    float radius = kNoRadius;
    float tangent[2] = {}; ///< x, z; unit vector after sum_across()
    std::uint64_t views = 0;
  };

  void begin (int columns, double slice_height_m, int images, std::size_t slices);
  /** Appends a slice; slices of a cluster are consecutive. @param planes  number of its rows */
  void add_slice (int cluster, int number, int planes);
  /** Makes room for the slices' rows, and empties them. */
  void make_room ();

  /** Index of the node of a layer. */
  [[nodiscard]] std::uint32_t node (int slice, int plane, int column) const
  {
    return (slices_[slice].first_row + static_cast<std::uint32_t> (plane)) * width_ + kPad +
           static_cast<std::uint32_t> (column);
  }
  void put (std::uint32_t node, const Node &layer)
  {
    radius_[node] = layer.radius;
    tangent_[0][node] = layer.tangent[0];
    tangent_[1][node] = layer.tangent[1];
    views_[0][node] = static_cast<std::uint32_t> (layer.views);
    if (words_ > 1)
      views_[1][node] = static_cast<std::uint32_t> (layer.views >> 32);
  }
  /** The image that won the node; -1 if it is empty. */
  [[nodiscard]] int winner (std::uint32_t node) const { return first_[node]; }
  [[nodiscard]] const std::vector<Slice> &slices () const { return slices_; }
  [[nodiscard]] int columns () const { return columns_; }

  /** Adds up tangents over the neighbourhood of each layer (smoothing each way along the slice,
   *  then across slices, not across layer gaps), so that winners do not change from cell to cell by
   *  chance; and finds the views that cover a layer without a point in it: those with points on
   *  both sides of it (in angle or in height) in that neighbourhood. */
  void sum_along (const RowRules &rules, int slice);
  void sum_across (const RowRules &rules, int slice);

  /** Chooses winners, with a bonus for the previous frame's and, in kSweeps sweeps, for those of
   * neighbours. */
  RowCounts decide (const RowRules &rules, int threads);
  static constexpr int kSweeps = 2;

  /** Keeps the winners for the next frame's hysteresis.
   *  @param ids  view-id of each image */
  void keep_winners (const RowRules &rules, const std::array<int, kMaxViews> &ids);
  /** Before the next decide(): maps the winners kept to the numbers of this frame's images. Winners
   *  of cells of another size are not used. */
  void renumber_winners (const std::array<int, kMaxViews> &ids, int images);
  void reset ();

  /** The slices of the frame that keep_winners() saw, and the view-id of the winner of a cell's
   *  outermost layer in it; -1 where the cell had no points, whoever held it before. */
  [[nodiscard]] int old_slices () const { return static_cast<int> (old_slices_.size ()); }
  [[nodiscard]] int old_winner (int slice, int column) const;

private:
  template <typename L> struct RowLoops; /* cell_row_loops.hpp */
  enum class Pass { kAlone, kWithNeighbours };

  void decide_slice (const RowRules &rules, std::size_t number, Pass pass);
  [[nodiscard]] const Slice *old_slice (const Slice &slice) const;

  template <typename Number> using Plane = std::vector<Number>;
  template <typename Number> void wrap (Plane<Number> &plane, std::uint32_t row) const;

  int columns_ = 0, words_ = 1;
  double slice_height_m_ = 0;
  std::uint32_t width_ = 0, rows_ = 0;
  std::vector<Slice> slices_;
  Plane<float> radius_;
  std::array<Plane<float>, 2> tangent_, sum_;
  std::array<Plane<std::uint32_t>, 2> views_, covering_;
  Plane<std::int32_t> first_, held_;
  Plane<std::int32_t> next_; /* after decide(): as first_ before keep_winners() */
  std::array<std::vector<float>, 2> circle_tangent_; /* x, z in each column */

  /* Of the frame before. */
  std::vector<Slice> old_slices_;
  std::array<std::uint32_t, kMaxClusters + 1> old_begin_{}; /* of each cluster in old_slices_ */
  std::uint32_t old_width_ = 0;
  int old_columns_ = 0, old_images_ = 0;
  double old_slice_height_m_ = 0;
  std::array<int, kMaxViews> old_ids_{};
  Plane<float> old_radius_;
  Plane<std::int32_t> old_first_;
};

} // namespace rangecast
