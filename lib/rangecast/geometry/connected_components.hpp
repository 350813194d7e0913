/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace rangecast {

/** Connected components of an image, built row by row: runs of pixels, joined by union-find
 *  (R. Sedgewick, K. Wayne, "Algorithms", 4th ed., section 1.5). Its memory only grows. */
class ConnectedComponents {
public:
  /** Connected pixels of a row, columns x0 to x1 - 1. */
  struct Run {
    int x0, x1;
    int root, size; ///< internal: see size_of()
  };

  /** Starts an image. */
  void clear ();
  /** Adds the next row, without pixels. */
  void add_empty_row () { rows_.push_back (runs_.size ()); }
  /** Adds the next row: pixels that are not 0 in a mask of 0 and 255, connected to their eight
   * neighbours. */
  void add_mask_row (const std::uint8_t *mask, int width);
  /** Adds the next row: pixels of at least `min`, connected to those of their four neighbours that
   *  differ by at most `range`.
   *  @param above  the row before; not read if that one is empty
   *  @param x0, x1  columns to use, without x1 */
  void add_level_row (
      const std::int16_t *level, const std::int16_t *above, int x0, int x1, int min, int range);

  [[nodiscard]] std::span<const Run> runs () const { return runs_; }
  [[nodiscard]] std::span<const Run> row (int y) const
  {
    const auto i = static_cast<std::size_t> (y);
    return runs ().subspan (rows_[i], rows_[i + 1] - rows_[i]);
  }
  /** Whether a run represents its component: one run of each does. */
  [[nodiscard]] bool is_root (const Run &run) const
  {
    return static_cast<std::size_t> (run.root) == static_cast<std::size_t> (&run - runs_.data ());
  }
  /** Number of pixels of the component that a run belongs to. */
  [[nodiscard]] int size_of (const Run &run) const
  {
    std::size_t root = static_cast<std::size_t> (run.root);
    while (static_cast<std::size_t> (runs_[root].root) != root)
      root = static_cast<std::size_t> (runs_[root].root);
    return runs_[root].size;
  }

private:
  void add (int x0, int x1);
  int find_root (int run);
  void join (int one, int other);
  template <typename Touch> void join_rows (int reach, const Touch &touch);

  std::vector<Run> runs_;
  std::vector<std::size_t> rows_; /* first run of each row, and one for the end */
};

} // namespace rangecast
