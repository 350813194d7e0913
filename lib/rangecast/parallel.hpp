/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstddef>
#include <opencv2/core/utility.hpp>

namespace rangecast {

/** Runs work (i) for each i below n, some at a time, and waits for all of them. Calls of different
 *  i must not touch the same memory.
 *  @param threads  at a time; 0 = number of cores */
template <typename Work>
void
in_parallel (std::size_t n, int threads, const Work &work)
{
  if (threads == 1 || n < 2) {
    for (std::size_t i = 0; i < n; i++)
      work (i);
    return;
  }
  cv::parallel_for_ (
      cv::Range (0, static_cast<int> (n)),
      [&] (const cv::Range &range) {
        for (int i = range.start; i < range.end; i++)
          work (static_cast<std::size_t> (i));
      },
      threads > 0 ? threads : -1.0);
}

} // namespace rangecast
