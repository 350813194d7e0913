/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The cylinder's inner loops exist twice: for every processor, and for those with AVX2. Both are
 * compiled from one text and do the same operations in the same order, without fused multiplication
 * and addition, so they give the same bits. */
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>

#include "cpu.hpp"

/* On a function: what it calls becomes a part of it, so that all is made for that processor. */
#if defined __x86_64__
#define RANGECAST_CYLINDER_AVX2 gnu::target ("avx2"), gnu::flatten
#else
#define RANGECAST_CYLINDER_AVX2 gnu::flatten
#endif
#define RANGECAST_CYLINDER_ANY gnu::flatten

namespace rangecast {

/* Some numbers at a time, as many as a register holds. They lie anywhere in memory, so their types
 * say aligned (4). Functions take and give them by reference: how they are passed by value depends
 * on the processor. */
template <int kNumbers> struct LanesOf {
  static constexpr int kLanes = kNumbers;
  typedef float F __attribute__ ((vector_size (4 * kNumbers), aligned (4), may_alias));
  typedef std::int32_t I __attribute__ ((vector_size (4 * kNumbers), aligned (4), may_alias));
  typedef std::uint32_t U __attribute__ ((vector_size (4 * kNumbers), aligned (4), may_alias));

  static F &at (float *p) { return *reinterpret_cast<F *> (p); }
  static const F &at (const float *p) { return *reinterpret_cast<const F *> (p); }
  static I &at (std::int32_t *p) { return *reinterpret_cast<I *> (p); }
  static const I &at (const std::int32_t *p) { return *reinterpret_cast<const I *> (p); }
  static U &at (std::uint32_t *p) { return *reinterpret_cast<U *> (p); }
  static const U &at (const std::uint32_t *p) { return *reinterpret_cast<const U *> (p); }

  /* |v| */
  static void make_positive (F &v) { v = (F)((I)v & 0x7fffffff); }

  /* Square roots of numbers that are not negative. std::sqrt, which may set errno, is no vector
   * code. */
  static void make_root (F &v)
  {
#if defined __x86_64__
    typedef float Four __attribute__ ((vector_size (16)));
    Four parts[kLanes / 4];
    std::memcpy (parts, &v, sizeof parts);
    for (Four &part : parts)
      part = __builtin_ia32_sqrtps (part);
    std::memcpy (&v, parts, sizeof parts);
#else
    for (int l = 0; l < kLanes; l++)
      v[l] = std::sqrt (v[l]);
#endif
  }

  /* mask ? v : 0; mask is -1 or 0 in each lane, as comparisons give it */
  static void keep_where (F &v, const I &mask)
  {
    v = (F)((I)v & mask);
  }

  static std::uint64_t fold (const U &bits)
  {
    std::uint64_t parts[kLanes / 2];
    std::memcpy (parts, &bits, sizeof parts);
    for (int k = 1; k < kLanes / 2; k++)
      parts[0] |= parts[k];
    return parts[0];
  }
  /* All bits of all lanes. */
  static std::uint32_t any_of (const U &bits)
  {
    const std::uint64_t both = fold (bits);
    return static_cast<std::uint32_t> (both | both >> 32);
  }
  static bool any (const I &mask)
  {
    return fold ((U)mask) != 0;
  }
};

using Narrow = LanesOf<4>; ///< SSE2, NEON
using Wide = LanesOf<8>;   ///< AVX2
inline constexpr int kMostLanes = 8;

} // namespace rangecast
