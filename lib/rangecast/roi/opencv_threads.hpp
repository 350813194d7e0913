/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <opencv2/core/utility.hpp>

#include "../base/parallel.hpp"

namespace rangecast {

/** in_parallel() for work that calls OpenCV's functions, which split a picture among threads of
 *  OpenCV's own: where several jobs run at a time, they do not. OpenCV runs one loop at a time in a
 *  process, so a loop of one item around the jobs keeps all of them from starting others. */
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
