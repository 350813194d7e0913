/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include "cpu.hpp"

namespace rangecast {

#if defined __x86_64__
/** The same as work (), compiled for AVX2: all that it calls and whose text is at hand becomes a
 *  part of it. */
template <typename Work>
[[gnu::target ("avx2,bmi,bmi2,popcnt"), gnu::flatten]] void
run_for_avx2 (const Work &work)
{
  work ();
}
#endif

/** Calls work (), in a version made for the processor that runs it: loops over pixels that the
 *  compiler makes vectors of get wider ones. Multiplication and addition stay apart in all versions
 *  (meson.build says -ffp-contract=off, for builds that have fused ones), so results are the same
 *  bit by bit. */
template <typename Work>
void
for_this_cpu (const Work &work)
{
#if defined __x86_64__
  if (cpu_level () >= CpuLevel::kAvx2)
    return run_for_avx2 (work);
#endif
  work ();
}

} // namespace rangecast
