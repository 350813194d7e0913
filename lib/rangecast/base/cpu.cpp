/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "cpu.hpp"

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <cstring>
#include <iterator>
#if defined __linux__
#include <sched.h>
#include <unistd.h>
#endif
#if !defined __wasm__
#include <thread>
#endif

namespace rangecast {
namespace {

std::atomic<CpuLevel> limit{kCpuLevels[std::size (kCpuLevels) - 1]};

} // namespace

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

CpuLevel
cpu_level ()
{
  static const CpuLevel found = [] {
    CpuLevel level = cpu_supports ();
    if (const char *asked = std::getenv ("RANGECAST_CPU"))
      for (CpuLevel lower : kCpuLevels)
        if (std::strcmp (asked, cpu_level_name (lower)) == 0)
          level = std::min (level, lower);
    return level;
  }();
  return std::min (found, limit.load (std::memory_order_relaxed));
}

void
limit_cpu (CpuLevel max)
{
  limit.store (max, std::memory_order_relaxed);
}

int
core_count ()
{
  static const int count = [] {
#if defined __linux__
    cpu_set_t cores;
    /* Of the first thread, so that a thread that is bound to a core does not count for all. */
    if (sched_getaffinity (getpid (), sizeof cores, &cores) == 0)
      return std::max (CPU_COUNT (&cores), 1);
#endif
#if defined __wasm__
    return 1;
#else
    return std::max (static_cast<int> (std::thread::hardware_concurrency ()), 1);
#endif
  }();
  return count;
}

} // namespace rangecast
