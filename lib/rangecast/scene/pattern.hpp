/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "../geometry/camera.hpp"

namespace rangecast {

/** A well-mixed number from a counter: the finaliser of MurmurHash3 (64 bit). */
inline std::uint64_t
mix64 (std::uint64_t x)
{
  x ^= x >> 33;
  x *= 0xff51afd7ed558ccdULL;
  x ^= x >> 33;
  x *= 0xc4ceb9fe1a85ec53ULL;
  return x ^ (x >> 33);
}

/** Smooth noise in space: values at the points of a grid of `wavelength_m`, blended between, and
 *  `octaves` - 1 more with half the wavelength and 0.6 of the height each. It has detail for
 *  stereo matching, but none finer than its last wavelength, so it does not alias.
 *  @return -1 to 1. Reentrant. */
double smooth_noise (Vec3 point, double wavelength_m, int octaves, std::uint32_t seed);

/** 0 below `from`, 1 above `to`, smooth between; `from` may be the greater one. */
inline double
smooth_step (double from, double to, double x)
{
  const double t = (x - from) / (to - from), c = t < 0 ? 0 : t > 1 ? 1 : t;
  return c * c * (3 - 2 * c);
}

/** A grey level, rounded and clipped to 0 .. 255. */
inline std::uint8_t
to_byte (double level)
{
  return static_cast<std::uint8_t> (std::lround (std::clamp (level, 0.0, 255.0)));
}

} // namespace rangecast
