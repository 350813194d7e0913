/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>

namespace rangecast {

/** Depth, R, G, B of a pixel side by side; compilers make vector code of it where there is some. */
typedef std::int32_t Lanes __attribute__ ((vector_size (16)));

/** The depth of an invalid pixel: further than any threshold from every valid one. */
inline constexpr std::int32_t kNoDepthCode = -(1 << 24);

inline bool
are_near (Lanes a, Lanes b, Lanes threshold)
{
  typedef std::int64_t Halves __attribute__ ((vector_size (16)));
  const Lanes difference = a - b;
  const Lanes beyond = (difference > threshold) | (difference < -threshold);
  const Halves halves = reinterpret_cast<Halves> (beyond);
  return (halves[0] | halves[1]) == 0;
}

} // namespace rangecast
