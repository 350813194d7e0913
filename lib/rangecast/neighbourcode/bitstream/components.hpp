/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>

namespace rangecast {

/** The four numbers of one pixel side by side, depth first, then R, G, B (profile plain) or Y, Co,
 *  Cg (packed and entropy). One pixel is one vector of four on every processor; vectors over
 *  several pixels are Lanes (base/simd.hpp). */
typedef std::int32_t Components __attribute__ ((vector_size (16)));
typedef float FloatComponents __attribute__ ((vector_size (16)));
inline constexpr int kComponents = 4;

inline bool
is_zero (Components c)
{
  typedef std::int64_t Halves __attribute__ ((vector_size (16)));
  const Halves halves = reinterpret_cast<Halves> (c);
  return (halves[0] | halves[1]) == 0;
}

/** Whether no component differs by more than its threshold. */
inline bool
are_near (Components a, Components b, Components threshold)
{
  const Components difference = a - b;
  return is_zero ((difference > threshold) | (difference < -threshold));
}

} // namespace rangecast
