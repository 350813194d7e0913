/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

namespace rangecast {

/** What code may take for granted, in rungs: each holds all before it. */
enum class CpuLevel : int {
  kScalar, ///< what the compiler was told to build for
  kAvx2,   ///< x86-64 with AVX2, BMI1, BMI2 and POPCNT
};
inline constexpr CpuLevel kCpuLevels[] = {CpuLevel::kScalar, CpuLevel::kAvx2};

const char *cpu_level_name (CpuLevel level);

/** The highest rung that this machine has. */
CpuLevel cpu_supports ();

/** The rung to use: the machine's, or a lower one that RANGECAST_CPU (`scalar`, `avx2`) or
 *  limit_cpu() asks for. Any thread. */
CpuLevel cpu_level ();

/** For tests: no rung above this one from now on. */
void limit_cpu (CpuLevel most);

/** How many threads can run at a time: the processors that the process may use (its affinity, as
 *  taskset and containers with a set of processors have it), counted once; at least 1. A share of
 *  processor time that a container grants does not count. */
int core_count ();

} // namespace rangecast
