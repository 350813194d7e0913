/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Milliseconds a frame set, of the filter and its peers. */
#pragma once

#include <algorithm>
#include <chrono>
#include <string>
#include <vector>

#include "frames.hpp"

namespace bench {

/** The median time of some calls of work, each on the set as it was; milliseconds. */
template <typename Work>
double
median_ms (FrameSet &set, int rounds, const Work &work)
{
  std::vector<double> ms;
  for (int i = 0; i < rounds; i++) {
    set.restore ();
    const auto start = std::chrono::steady_clock::now ();
    work ();
    const std::chrono::duration<double, std::milli> took =
        std::chrono::steady_clock::now () - start;
    ms.push_back (took.count ());
  }
  std::nth_element (ms.begin (), ms.begin () + std::ptrdiff_t (ms.size () / 2), ms.end ());
  return ms[ms.size () / 2];
}

/** Prints one scene's table. */
void measure_speed (const std::string &name, FrameSet set, int rounds);

} // namespace bench
