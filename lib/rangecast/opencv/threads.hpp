/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <opencv2/core/utility.hpp>

#include "../base/parallel.hpp"

namespace rangecast {

/** in_parallel() for work that calls OpenCV, whose functions start threads of their own: prevents
 * that if there are several jobs. OpenCV runs one parallel loop at a time in a process, so a loop
 * of one item around the jobs makes all loops inside them serial. */
template <typename Work>
void
in_parallel_with_opencv (std::size_t n, int threads, const Work &work)
{
  if (workers_for (n, threads) < 2)
    in_parallel (n, threads, work);
  else
    cv::parallel_for_ (
        cv::Range (0, 1), [&] (const cv::Range &) { in_parallel (n, threads, work); });
}

} // namespace rangecast
