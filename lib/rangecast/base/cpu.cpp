/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "cpu.hpp"

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <cstring>
#include <iterator>

namespace rangecast {

const char *
cpu_level_name (CpuLevel level)
{
  return level == CpuLevel::kAvx2 ? "avx2" : "scalar";
}

CpuLevel
cpu_supports ()
{
#if defined __x86_64__
  __builtin_cpu_init ();
  if (__builtin_cpu_supports ("avx2") && __builtin_cpu_supports ("bmi") &&
      __builtin_cpu_supports ("bmi2") && __builtin_cpu_supports ("popcnt"))
    return CpuLevel::kAvx2;
#endif
  return CpuLevel::kScalar;
}

static CpuLevel
find_level ()
{
  CpuLevel most = cpu_supports ();
  if (const char *asked = std::getenv ("RANGECAST_CPU"))
    for (CpuLevel level : kCpuLevels)
      if (std::strcmp (asked, cpu_level_name (level)) == 0)
        most = std::min (most, level);
  return most;
}

static std::atomic<CpuLevel> limit{kCpuLevels[std::size (kCpuLevels) - 1]};

CpuLevel
cpu_level ()
{
  static const CpuLevel found = find_level ();
  return std::min (found, limit.load (std::memory_order_relaxed));
}

void
limit_cpu (CpuLevel most)
{
  limit.store (most, std::memory_order_relaxed);
}

} // namespace rangecast
