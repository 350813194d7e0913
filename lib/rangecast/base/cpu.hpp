/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

namespace rangecast {

/** Instruction sets that code may use; each includes those before it. */
enum class CpuLevel : int {
  kScalar, ///< the compiler's target
  kAvx2,   ///< x86-64 with AVX2, BMI1, BMI2 and POPCNT
};
inline constexpr CpuLevel kCpuLevels[] = {CpuLevel::kScalar, CpuLevel::kAvx2};

const char *cpu_level_name (CpuLevel level);

/** The highest level that this machine supports. */
CpuLevel cpu_supports ();

/** The level to use: the machine's, or a lower one set by the environment variable RANGECAST_CPU
 *  (`scalar`, `avx2`) or by limit_cpu(). Any thread. */
CpuLevel cpu_level ();

/** For tests: limits cpu_level() from now on. */
void limit_cpu (CpuLevel max);

/** Number of processors that the process may use (its affinity mask, as taskset and container
 * cpusets set it), counted once; at least 1. CPU quotas of containers are not considered. */
int core_count ();

} // namespace rangecast
