/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* One source for several processors. for_this_cpu() runs a loop in a version compiled for the
 * current processor; Lanes are vectors for loops that the compiler does not vectorise. All versions
 * do the same operations in the same order, without fused multiplication and addition (meson.build
 * says -ffp-contract=off), so their results are equal bit by bit. */
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>
#include <type_traits>

#include "cpu.hpp"

/* What takes and returns vectors is inlined into functions for one processor. */
#pragma GCC diagnostic ignored "-Wpsabi"

/* The instructions that CpuLevel::kAvx2 stands for. */
#define RANGECAST_TARGET_AVX2 gnu::target ("avx2,bmi,bmi2,popcnt")

namespace rangecast {

/** Vectors of 32-bit numbers, and of as many bytes, without alignment (hence aligned (4)).
 * Functions take and return them by reference, because the calling convention for values depends on
 * the processor. */
template <int kNumbers> struct Lanes {
  static constexpr int kLanes = kNumbers;
  typedef float F __attribute__ ((vector_size (4 * kNumbers), aligned (4), may_alias));
  typedef std::int32_t I __attribute__ ((vector_size (4 * kNumbers), aligned (4), may_alias));
  typedef std::uint32_t U __attribute__ ((vector_size (4 * kNumbers), aligned (4), may_alias));
  typedef std::uint8_t B __attribute__ ((vector_size (4 * kNumbers), aligned (1), may_alias));

  static F &at (float *p) { return *reinterpret_cast<F *> (p); }
  static const F &at (const float *p) { return *reinterpret_cast<const F *> (p); }
  static I &at (std::int32_t *p) { return *reinterpret_cast<I *> (p); }
  static const I &at (const std::int32_t *p) { return *reinterpret_cast<const I *> (p); }
  static U &at (std::uint32_t *p) { return *reinterpret_cast<U *> (p); }
  static const U &at (const std::uint32_t *p) { return *reinterpret_cast<const U *> (p); }
  static B &at (std::uint8_t *p) { return *reinterpret_cast<B *> (p); }
  static const B &at (const std::uint8_t *p) { return *reinterpret_cast<const B *> (p); }

  /** v = |v| */
  static void make_positive (F &v) { v = (F)((I)v & 0x7fffffff); }

  /** v = sqrt (v), v >= 0. std::sqrt, which may set errno, does not become vector code. */
  static void make_root (F &v)
  {
#if defined __x86_64__
    /* in registers: reading a vector just written as two halves defeats store forwarding */
    typedef float Four __attribute__ ((vector_size (16)));
    typedef float Eight __attribute__ ((vector_size (32)));
    if constexpr (kLanes == 8) {
      const Eight all = (Eight)v;
      const Four low = __builtin_ia32_sqrtps (__builtin_shufflevector (all, all, 0, 1, 2, 3)),
                 high = __builtin_ia32_sqrtps (__builtin_shufflevector (all, all, 4, 5, 6, 7));
      v = (F)__builtin_shufflevector (low, high, 0, 1, 2, 3, 4, 5, 6, 7);
    } else
      v = (F)__builtin_ia32_sqrtps ((Four)v);
#else
    for (int l = 0; l < kLanes; l++)
      v[l] = std::sqrt (v[l]);
#endif
  }

  /** v = mask ? v : 0; mask is -1 or 0 in each lane, as comparisons give it */
  static void keep_where (F &v, const I &mask)
  {
    v = (F)((I)v & mask);
  }

  /** All bits that are set in some lane. */
  static std::uint32_t any_of (const U &bits)
  {
    const std::uint64_t both = fold (bits);
    return static_cast<std::uint32_t> (both | both >> 32);
  }
  static bool any (const I &mask)
  {
    return fold ((U)mask) != 0;
  }

private:
  static std::uint64_t fold (const U &bits)
  {
    std::uint64_t parts[kLanes / 2];
    std::memcpy (parts, &bits, sizeof parts);
    for (int k = 1; k < kLanes / 2; k++)
      parts[0] |= parts[k];
    return parts[0];
  }
};

/** Lanes of the widest version, AVX2's. Others have four: SSE2, NEON. */
inline constexpr int kMaxLanes = 8;

/* gnu::flatten: everything that work () calls is inlined, if its definition is visible, and so
 * compiled for the target; not through a function shared by both versions, as GCC 12 does not
 * flatten what an inlined function calls. gnu::noinline: else this could be inlined into its caller
 * before. */
template <typename Work>
[[gnu::flatten, gnu::noinline]] auto
run_for_any_cpu (const Work &work)
{
  if constexpr (std::is_invocable_v<const Work &, Lanes<4>>)
    return work (Lanes<4>{});
  else
    return work ();
}

#if defined __x86_64__
template <typename Work>
[[RANGECAST_TARGET_AVX2, gnu::flatten, gnu::noinline]] auto
run_for_avx2 (const Work &work)
{
  if constexpr (std::is_invocable_v<const Work &, Lanes<kMaxLanes>>)
    return work (Lanes<kMaxLanes>{});
  else
    return work ();
}
#endif

/** Returns work (), or work (Lanes<n>{}) where work takes lanes, in the version for cpu_level ().
 */
template <typename Work>
auto
for_this_cpu (const Work &work)
{
#if defined __x86_64__
  if (cpu_level () >= CpuLevel::kAvx2)
    return run_for_avx2 (work);
#endif
  return run_for_any_cpu (work);
}

} // namespace rangecast
