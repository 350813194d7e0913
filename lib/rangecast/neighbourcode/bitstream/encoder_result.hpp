/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>

namespace rangecast {

/** Statistics of coded partitions, views and frame sets; they add up. */
struct EncoderResult {
  std::uint64_t points = 0;       ///< valid pixels
  std::uint64_t full_pixels = 0;  ///< of these, written in full
  std::uint64_t slices = 0;       ///< all
  std::uint64_t delta_slices = 0; ///< of these, with reference to an earlier frame set
  std::uint64_t raw_bits = 0; ///< points x (depth bits + 3 x colour bits) + 1 for each ROI pixel

  EncoderResult &operator+= (const EncoderResult &other)
  {
    points += other.points;
    full_pixels += other.full_pixels;
    slices += other.slices;
    delta_slices += other.delta_slices;
    raw_bits += other.raw_bits;
    return *this;
  }
};

} // namespace rangecast
