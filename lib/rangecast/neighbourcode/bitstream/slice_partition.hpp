/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What an encoder cuts range images into, so that slices fit and threads have work: pieces, some
 * columns of a band of rows each. */
#pragma once

#include <cstdint>

#include "refresh.hpp"
#include "unit.hpp"

namespace rangecast {

/** What pieces, views and frame sets came to. */
struct EncoderResult {
  std::uint64_t points = 0;      ///< valid pixels
  std::uint64_t full_pixels = 0; ///< of these, written in full
  std::uint64_t slices = 0;
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

/** Into how many pieces a ROI is cut in profile plain: the least of which each row fits into a
 *  slice, whatever is in it.
 *  @param header  its ROI, bits, and whether it is kept as a reference */
int plain_pieces (const SliceHeader &header, int max_slice_size);

/** The same of a band in the profiles packed and entropy: a guess, a row may still not fit.
 *  @param is_exact  all residuals are coded without loss
 *  @param delta_bytes_per_pixel  of the last bands with a reference; 0: there was none */
int compact_pieces (const SliceHeader &header, const RowBand &band, int max_slice_size,
    bool is_exact, double delta_bytes_per_pixel);

} // namespace rangecast
