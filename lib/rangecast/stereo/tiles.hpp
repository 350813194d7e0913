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

/** The parts of a picture that are worked on: rectangles one below the other, no two of which share
 *  a row, cut into pieces of a few rows for threads to take. */
class Pieces {
public:
  /** @param n_threads  that work at a time; 0 = as many as there are cores */
  void set (std::span<const cv::Rect> parts, int n_threads)
  {
    constexpr int kRows = 32; /* their scratch memory stays in a core's cache */
    n_threads_ = n_threads;
    parts_.assign (parts.begin (), parts.end ());
    pieces_.clear ();
    for (const cv::Rect &part : parts)
      for (int y = part.y; y < part.br ().y; y += kRows)
        pieces_.emplace_back (part.x, y, part.width, std::min (kRows, part.br ().y - y));
  }

  [[nodiscard]] const std::vector<cv::Rect> &parts () const { return parts_; }
  /** What each() calls work for. */
  [[nodiscard]] const std::vector<cv::Rect> &pieces () const { return pieces_; }
  /** The smallest rectangle that holds all parts; empty if there are none. */
  [[nodiscard]] cv::Rect hull () const
  {
    cv::Rect all;
    for (const cv::Rect &part : parts_)
      all = all.empty () ? part : all | part;
    return all;
  }
  /** How many pieces are worked on at a time; workers are numbered below that. */
  [[nodiscard]] std::size_t workers () const { return workers_for (pieces_.size (), n_threads_); }
  [[nodiscard]] int n_threads () const { return n_threads_; }

  /** Calls work (piece, worker) for each, some at a time, in a version for this processor. */
  template <typename Work> void each (const Work &work) const
  {
    in_parallel (pieces_.size (), n_threads_, [&] (std::size_t i, std::size_t worker) {
      for_this_cpu ([&] { work (pieces_[i], worker); });
    });
  }

private:
  std::vector<cv::Rect> parts_, pieces_;
  int n_threads_ = 0;
};

} // namespace rangecast
