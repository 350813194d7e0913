/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "cell_grid.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "../base/parallel.hpp"

namespace rangecast {
namespace {

/* Radii further apart are of different surfaces, such as an arm before the chest; metres. */
constexpr float kLayerGapM = 0.03f;
/* Surfaces of a cell that compete, from the axis outwards: bounds the work of hostile input. */
constexpr std::uint32_t kMaxLayers = 4;
/* Columns over which a view's points are still successive. */
constexpr int kReach = 6;
/* Cells (1 degree, 4 mm) are finer than the cameras' pixels, and tangents of two points are noise:
 * the bunny has 3.1 mm instead of 10 mm large holes with these. */
constexpr double kSmoothingM = 0.01;
constexpr int kMaxSmoothingColumns = 8, kMaxSmoothingSlices = 8;
/* Bonuses, as cosines: in still scenes 0.2 to 0.8 % of the nodes change their winner in a frame,
 * without hysteresis 4.4 %. */
constexpr float kHysteresis = 0.2f, kAgreement = 0.1f;
constexpr int kSweeps = 2;

template <typename Nodes>
auto
nearest (Nodes nodes, float radius)
{
  decltype (nodes.data ()) found = nullptr;
  float distance = kLayerGapM;
  for (auto &node : nodes)
    if (const float d = std::abs (node.radius - radius); d <= distance)
      distance = d, found = &node;
  return found;
}

} // namespace

void
CellGrid::lay_out (const HeightRange &range, double slice_height_m, int columns)
{
  columns_ = columns;
  const double height = std::max (0.0, double{range.y_max} - range.y_min);
  const double step = slice_height_m_ =
      std::max (slice_height_m, height / (kMaxCells / columns - 2.0));
  stack_ = {};
  if (range.y_min <= range.y_max) {
    /* Slices begin at multiples of their height from the axis' origin, not at the lowest point. */
    const double first = std::floor (range.y_min / step);
    stack_.count = static_cast<int> (std::floor (range.y_max / step) - first) + 1;
    stack_.first_number = static_cast<int> (std::clamp (first, -1e9, 1e9));
    stack_.first_y = static_cast<float> (first * step);
  }
  counts_.assign (static_cast<std::size_t> (stack_.count), {});
  const std::size_t cells = counts_.size () * static_cast<std::size_t> (columns);
  ends_.resize (std::max (ends_.size (), cells));
  std::fill_n (ends_.begin (), cells, 0u);
}

std::uint32_t
CellGrid::cell_of (float y, std::uint32_t column) const
{
  const int slice = static_cast<int> ((y - stack_.first_y) / static_cast<float> (slice_height_m_));
  return static_cast<std::uint32_t> (std::clamp (slice, 0, stack_.count - 1)) *
             static_cast<std::uint32_t> (columns_) +
         column;
}

void
CellGrid::make_room (std::size_t size)
{
  const std::size_t cells = counts_.size () * static_cast<std::size_t> (columns_);
  std::uint32_t total = 0;
  for (std::size_t i = 0; i < cells; i++)
    total += std::exchange (ends_[i], total);
  for (auto *of_cells : {&cells_, &old_cells_}) /* they are swapped after each frame */
    of_cells->resize (std::max (of_cells->size (), cells));
  points_.resize (std::max<std::size_t> (points_.size (), total));
  nodes_.resize (points_.size ());
  entries_.resize (points_.size ());
  old_nodes_.resize (points_.size ());
  node_of_.resize (std::max (node_of_.size (), size));
}

template <typename Work>
void
CellGrid::for_nodes (std::size_t slice, const Work &work)
{
  for (int column = 0; column < columns_; column++)
    for (Node &node : nodes_of (slice, column))
      work (column, node);
}

/* ---- nodes and tangents ---- */

/* Makes a node of points, which are sorted by view. */
void
CellGrid::add_node (std::uint32_t from, std::uint32_t to, std::uint32_t &entry_end, Cell &cell)
{
  const std::uint32_t number = cell.first + cell.count++;
  Node &node = nodes_[number];
  node = {0, {}, {}, 0, 0, entry_end, -1, -1, -1};
  for (std::uint32_t i = from; i < to;) {
    Entry &entry = entries_[entry_end++] = {};
    const std::uint32_t view = points_[i].view;
    for (; i < to && points_[i].view == view; i++) {
      entry.x += points_[i].x;
      entry.z += points_[i].z;
      entry.weight++;
      node.radius += points_[i].radius;
      node_of_[points_[i].index] = number;
    }
    entry.x /= entry.weight;
    entry.z /= entry.weight;
    node.views |= std::uint64_t{1} << view;
  }
  node.radius /= static_cast<float> (to - from);
}

void
CellGrid::make_nodes (std::size_t slice)
{
  const std::size_t first_cell = slice * static_cast<std::size_t> (columns_);
  std::uint32_t begin = first_cell > 0 ? ends_[first_cell - 1] : 0;
  std::uint32_t node_end = begin, entry_end = begin;
  Counts &counts = counts_[slice];
  const auto less_radius = [] (const Point &a, const Point &b) {
    return a.radius != b.radius ? a.radius < b.radius : a.index < b.index;
  };
  const auto less_index = [] (const Point &a, const Point &b) { return a.index < b.index; };
  for (int column = 0; column < columns_; column++) {
    const std::uint32_t end = ends_[first_cell + static_cast<std::size_t> (column)];
    Cell &to = cell (slice, column);
    to = {node_end, 0};
    if (begin == end)
      continue;
    Point *points = points_.data ();
    const auto [low, high] = std::minmax_element (points + begin, points + end, less_radius);
    const bool one_layer = high->radius - low->radius <= kLayerGapM;
    if (!one_layer)
      std::sort (points + begin, points + end, less_radius);
    std::uint64_t views = 0;
    for (std::uint32_t from = begin, i = begin + 1; i <= end; i++) {
      if (i < end && (one_layer || points[i].radius - points[i - 1].radius <= kLayerGapM))
        continue;
      if (to.count < kMaxLayers) {
        if (!one_layer)
          std::sort (points + from, points + i, less_index);
        add_node (from, i, entry_end, to);
        views |= nodes_[node_end++].views;
      } else {
        for (std::uint32_t k = from; k < i; k++)
          node_of_[points[k].index] = kNoNode;
      }
      from = i;
    }
    counts.cells++;
    counts.shared += (views & (views - 1)) != 0;
    begin = end;
  }
}

CellGrid::Entry *
CellGrid::next_entry (std::size_t slice, int column, const Node &node, int view)
{
  const std::uint64_t bit = std::uint64_t{1} << view;
  for (int step = 1; step <= std::min (kReach, columns_ / 4); step++)
    for (Node &other : nodes_of (slice, column + step))
      if ((other.views & bit) && std::abs (other.radius - node.radius) <= kLayerGapM)
        return &entries_[other.first_entry +
                         static_cast<std::uint32_t> (std::popcount (other.views & (bit - 1)))];
  return nullptr;
}

/* The last entry of a run has the tangent of the one before it. */
void
CellGrid::find_tangents (std::size_t slice)
{
  for_nodes (slice, [&] (int column, Node &node) {
    Entry *entry = &entries_[node.first_entry];
    for (std::uint64_t rest = node.views; rest; rest &= rest - 1, entry++) {
      Entry *next = next_entry (slice, column, node, std::countr_zero (rest));
      if (!next)
        continue;
      const float dx = next->x - entry->x, dz = next->z - entry->z,
                  length = std::sqrt (dx * dx + dz * dz);
      if (!(length > 1e-9f))
        continue;
      entry->tangent[0] = dx / length;
      entry->tangent[1] = dz / length;
      if (next->tangent[0] == 0 && next->tangent[1] == 0)
        std::copy_n (entry->tangent, 2, next->tangent);
    }
  });
  for_nodes (slice, [&] (int, Node &node) {
    const Entry *entry = &entries_[node.first_entry];
    for (int i = 0; i < std::popcount (node.views); i++, entry++)
      for (int k = 0; k < 2; k++)
        node.tangent[k] += entry->weight * entry->tangent[k];
  });
}

/* ---- the neighbourhood ---- */

void
CellGrid::sum_along (std::size_t slice)
{
  const auto columns_per_metre = static_cast<float> (kSmoothingM * columns_ / (2 * M_PI));
  const auto max = static_cast<float> (std::min (kMaxSmoothingColumns, columns_ / 4));
  for_nodes (slice, [&] (int column, Node &node) {
    std::copy_n (node.tangent, 2, node.along);
    const int reach =
        static_cast<int> (std::min (max, columns_per_metre / std::max (node.radius, 1e-6f)));
    std::uint64_t side[2] = {};
    for (int step = -reach; step <= reach; step++)
      for (const Node &other : step ? nodes_of (slice, column + step) : std::span<Node> ()) {
        if (std::abs (other.radius - node.radius) > kLayerGapM)
          continue;
        node.along[0] += other.tangent[0];
        node.along[1] += other.tangent[1];
        side[step > 0] |= other.views;
      }
    node.competing = node.views | (side[0] & side[1]);
  });
}

void
CellGrid::sum_across (std::size_t slice)
{
  const int reach = static_cast<int> (
      std::min (kSmoothingM / slice_height_m_, double{kMaxSmoothingSlices}) + 0.5);
  for_nodes (slice, [&] (int column, Node &node) {
    float x = node.along[0], z = node.along[1];
    std::uint64_t side[2] = {};
    for (int step = -reach; step <= reach; step++)
      if (step && is_beside (slice, step))
        if (const Node *other =
                nearest (nodes_of (slice + static_cast<std::size_t> (step), column), node.radius)) {
          x += other->along[0];
          z += other->along[1];
          side[step > 0] |= other->views;
        }
    node.competing |= side[0] & side[1];
    const float length = std::sqrt (x * x + z * z);
    /* Where no tangent is known it is the circle's. */
    const double phi = 2 * M_PI * (column + 0.5) / columns_;
    node.tangent[0] = length > 1e-6f ? x / length : static_cast<float> (-std::sin (phi));
    node.tangent[1] = length > 1e-6f ? z / length : static_cast<float> (std::cos (phi));
  });
}

/* ---- winners ---- */

void
CellGrid::find_held (std::size_t slice, std::span<const int> ids)
{
  const int number = stack_.first_number + static_cast<int> (slice) - old_stack_.first_number;
  if (number < 0 || number >= old_stack_.count || old_columns_ != columns_ ||
      old_slice_height_m_ != slice_height_m_)
    return;
  const Cell *cells =
      &old_cells_[static_cast<std::size_t> (number) * static_cast<std::size_t> (columns_)];
  /* Or of the cell left or right of it: which cells have points changes as the axis moves. */
  for_nodes (slice, [&] (int column, Node &node) {
    const Held *held = nullptr;
    for (const int at : {column, column + columns_ - 1, column + 1})
      if (const Cell &cell = cells[at % columns_]; !held)
        held = nearest (
            std::span<const Held> (old_nodes_.data () + cell.first, cell.count), node.radius);
    if (!held)
      return;
    const auto found = std::ranges::find (ids, held->view_id);
    node.held = static_cast<std::int8_t> (found == ids.end () ? -1 : found - ids.begin ());
  });
}

void
CellGrid::choose (std::size_t slice, const OpticalAxes &optical, bool with_neighbours)
{
  for_nodes (slice, [&] (int column, Node &node) {
    std::array<std::int8_t, 4 * kMaxLayers> around;
    std::size_t count = 0;
    const auto add = [&] (std::span<const Node> neighbours) {
      for (const Node &other : neighbours)
        if (std::abs (other.radius - node.radius) <= kLayerGapM)
          around[count++] = other.winner;
    };
    if (std::has_single_bit (node.competing)) {
      node.next = static_cast<std::int8_t> (std::countr_zero (node.competing));
      return;
    }
    if (with_neighbours) {
      add (nodes_of (slice, column - 1));
      add (nodes_of (slice, column + 1));
      if (is_beside (slice, -1))
        add (nodes_of (slice - 1, column));
      if (is_beside (slice, 1))
        add (nodes_of (slice + 1, column));
    }
    float best = -1;
    node.next = static_cast<std::int8_t> (std::countr_zero (node.competing));
    for (std::uint64_t rest = node.competing; rest; rest &= rest - 1) {
      const auto view = static_cast<std::int8_t> (std::countr_zero (rest));
      const auto &axis = optical[static_cast<std::size_t> (view)];
      const auto agreeing = std::count (around.begin (), around.begin () + count, view);
      const float score = std::abs (node.tangent[1] * axis[0] - node.tangent[0] * axis[1]) +
                          (view == node.held ? kHysteresis : 0) +
                          kAgreement / 4 * static_cast<float> (agreeing);
      if (score > best)
        best = score, node.next = view;
    }
  });
  for_nodes (slice, [] (int, Node &node) { node.winner = node.next; });
}

/* Keeps the winners for the next frame's hysteresis. */
void
CellGrid::remember (std::span<const int> ids)
{
  for (std::size_t slice = 0; slice < counts_.size (); slice++)
    for_nodes (slice, [&] (int, Node &node) {
      old_nodes_[static_cast<std::size_t> (&node - nodes_.data ())] = {
          node.radius, ids[static_cast<std::size_t> (node.winner)]};
    });
  std::swap (cells_, old_cells_);
  old_stack_ = stack_;
  old_columns_ = columns_;
  old_slice_height_m_ = slice_height_m_;
}

/* A sweep decides every other slice, then the rest: so the neighbours that a slice reads do not
 * change meanwhile, with any number of threads, and two neighbours cannot swap forever. */
CellGrid::Counts
CellGrid::decide (const OpticalAxes &optical, std::span<const int> ids, int threads)
{
  const std::size_t count = counts_.size ();
  in_parallel (count, threads, [&] (std::size_t s) {
    make_nodes (s);
    find_tangents (s);
    sum_along (s);
  });
  in_parallel (count, threads, [&] (std::size_t s) {
    sum_across (s);
    find_held (s, ids);
    choose (s, optical, false);
  });
  for (int sweep = 0; sweep < 2 * kSweeps; sweep++)
    in_parallel ((count + 1 - sweep % 2) / 2, threads,
        [&] (std::size_t s) { choose (2 * s + sweep % 2, optical, true); });
  Counts sum;
  for (std::size_t s = 0; s < count; s++) {
    Counts &counts = counts_[s];
    for_nodes (s, [&] (int, const Node &node) {
      counts.held += node.held >= 0;
      counts.changed += node.held >= 0 && node.held != node.winner;
    });
    sum.cells += counts.cells;
    sum.shared += counts.shared;
    sum.held += counts.held;
    sum.changed += counts.changed;
  }
  remember (ids);
  return sum;
}

void
CellGrid::reset ()
{
  old_stack_ = {};
}

int
CellGrid::cell_winner (int slice, int column) const
{
  const Cell &cell = old_cells_[static_cast<std::size_t> (slice * columns_ + column)];
  return cell.count ? old_nodes_[cell.first + cell.count - 1].view_id : -1;
}

} // namespace rangecast
