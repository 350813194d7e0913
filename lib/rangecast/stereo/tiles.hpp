/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <algorithm>
#include <cstddef>
#include <opencv2/core.hpp>
#include <span>
#include <vector>

#include "../base/parallel.hpp"
#include "../base/simd.hpp"

namespace rangecast {

/** Regions of an image: rectangles one below the other without common rows, divided into tiles of a
 * few rows for parallel processing. */
class Tiles {
public:
  /** @param n_threads  0 = one per core */
  void set (std::span<const cv::Rect> parts, int n_threads)
  {
    constexpr int kRows = 32; /* scratch memory fits a core's cache */
    n_threads_ = n_threads;
    parts_.assign (parts.begin (), parts.end ());
    tiles_.clear ();
    for (const cv::Rect &part : parts)
      for (int y = part.y; y < part.br ().y; y += kRows)
        tiles_.emplace_back (part.x, y, part.width, std::min (kRows, part.br ().y - y));
  }

  [[nodiscard]] const std::vector<cv::Rect> &parts () const { return parts_; }
  /** The arguments of each(). */
  [[nodiscard]] const std::vector<cv::Rect> &tiles () const { return tiles_; }
  /** Bounding box of all parts; empty if there are none. */
  [[nodiscard]] cv::Rect hull () const
  {
    cv::Rect all;
    for (const cv::Rect &part : parts_)
      all = all.empty () ? part : all | part;
    return all;
  }
  /** Number of tiles processed concurrently; worker numbers are less than that. */
  [[nodiscard]] std::size_t workers () const { return workers_for (tiles_.size (), n_threads_); }
  [[nodiscard]] int n_threads () const { return n_threads_; }

  /** Calls work (tile, worker) for each tile in parallel, in a version for this processor. */
  template <typename Work> void each (const Work &work) const
  {
    in_parallel (tiles_.size (), n_threads_, [&] (std::size_t i, std::size_t worker) {
      for_this_cpu ([&] { work (tiles_[i], worker); });
    });
  }

private:
  std::vector<cv::Rect> parts_, tiles_;
  int n_threads_ = 0;
};

} // namespace rangecast
