/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <vector>

#include "coded_pixel.hpp"

namespace rangecast {

/** A coded row of a slice in the profiles packed and entropy, the same in encoder and decoder. It
 *  has one invalid pixel before it and one after it. */
class CompactRow {
public:
  /** Reserves memory for rows of so many columns. */
  void reserve (std::size_t columns)
  {
    for (auto *numbers : {&codes_, &states_, &shown_, &reference_})
      numbers->reserve (columns + 2);
    valid_.reserve (columns);
    earlier_.reserve (columns);
  }
  /** Makes all pixels invalid.
   *  @param shown  value of invalid pixels in shown() */
  void reset (std::size_t columns, std::uint64_t shown)
  {
    codes_.assign (columns + 2, kNoPixel);
    states_.assign (columns + 2, 0);
    shown_.assign (columns + 2, shown);
    valid_.assign (columns, 0);
    earlier_.assign (columns, 0);
    reference_.resize (columns);
  }
  void invalidate (std::size_t begin, std::size_t end, std::uint64_t shown)
  {
    std::fill (codes () + begin, codes () + end, kNoPixel);
    std::fill (states () + begin, states () + end, 0);
    std::fill (this->shown () + begin, this->shown () + end, shown);
  }

  /** Codes from the first column on; the pixel before it is at -1. */
  [[nodiscard]] PixelCode *codes () { return codes_.data () + 1; }
  [[nodiscard]] PixelState *states () { return states_.data () + 1; }
  /** The pixels as R, G, B: a PixelKey in encoders, the image's pixel in decoders. */
  [[nodiscard]] std::uint64_t *shown () { return shown_.data () + 1; }
  /** One byte a pixel, 0 = invalid. */
  [[nodiscard]] std::vector<std::uint8_t> &valid () { return valid_; }

  /** One byte a pixel, not 0 = equals a pixel of an earlier frame set. */
  [[nodiscard]] std::vector<std::uint8_t> &earlier () { return earlier_; }

  /** The pixels as later frame sets refer to them. */
  [[nodiscard]] std::span<const PixelCode> as_reference ()
  {
    for (std::size_t x = 0; x < reference_.size (); x++)
      reference_[x] = valid_[x] ? codes ()[x] : kEmptyPixel;
    return reference_;
  }

private:
  std::vector<PixelCode> codes_, reference_;
  std::vector<PixelState> states_;
  std::vector<std::uint64_t> shown_;
  std::vector<std::uint8_t> valid_, earlier_;
};

} // namespace rangecast
