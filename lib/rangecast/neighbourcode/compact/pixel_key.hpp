/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Depth, R, G and B codes of a pixel in one number, so that one subtraction compares all four. */
#pragma once

#include <cstdint>

#include "coded_pixel.hpp"

namespace rangecast {

/** From bit 0 depth, 18 G, 32 R, 50 B, 60 whether it is invalid: each with room for what
 * near_bias() adds. */
using PixelKey = std::uint64_t;

inline constexpr PixelKey kInvalidKey = PixelKey{1} << 60;

/** @param depth  code
 *  @param rgbx   codes, R in the least significant byte */
constexpr PixelKey
key_of (std::uint32_t depth, std::uint32_t rgbx)
{
  const PixelKey rgb = rgbx;
  return depth | (rgb & 0xff) << 32 | (rgb & 0xff00) << 10 | (rgb & 0xff0000) << 34;
}

/** @param c  codes of depth, R, G, B */
inline PixelKey
key_of (Components c)
{
  typedef std::uint64_t Pairs __attribute__ ((vector_size (16)));
  const Pairs pairs = reinterpret_cast<Pairs> (c);
  return pairs[0] | pairs[1] << 18;
}

/** Depth, Y, Co, Cg of a valid pixel, without loss (YCoCg-R). */
inline Components
components_of_key (PixelKey key)
{
  const auto channel = [&] (int at) { return static_cast<std::int32_t> (key >> at & 0xff); };
  const std::int32_t r = channel (32), g = channel (18), b = channel (50);
  const std::int32_t co = r - b, t = b + (co >> 1), cg = g - t;
  return Components{static_cast<std::int32_t> (key & 0xffff), t + (cg >> 1), co, cg};
}

/** The top bit of each number's room. */
inline constexpr PixelKey kNearMask = PixelKey{1} << 17 | PixelKey{1} << 27 | PixelKey{1} << 41 |
                                      PixelKey{1} << 59 | PixelKey{1} << 61;

/** The number that keeps these bits set unless a component is less than another's by more than its
 *  threshold: see near_bits(). */
constexpr PixelKey
near_bias (std::uint32_t depth_threshold, std::uint32_t colour_threshold)
{
  return kNearMask + key_of (depth_threshold, colour_threshold * 0x010101u);
}

/** kNearMask if a valid pixel is near another one, which may be invalid. */
constexpr PixelKey
near_bits (PixelKey own, PixelKey other, PixelKey bias)
{
  return (own + bias - other) & (other + bias - own) & kNearMask;
}

} // namespace rangecast
