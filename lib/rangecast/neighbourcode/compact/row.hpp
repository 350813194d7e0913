/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <vector>

#include "coded_pixel.hpp"

namespace rangecast {

/** @name Rows of one bit a pixel, set if it is valid @{ */
inline constexpr int kBitsOfWord = 32;
using PixelBits = std::vector<std::uint32_t>;

constexpr std::size_t
bit_words (std::size_t columns)
{
  return columns / kBitsOfWord + 1;
}

/** The first column from `begin` on whose bit is not `bit`, or `columns`. */
inline int
bits_end (const PixelBits &bits, int begin, bool bit, int columns)
{
  const std::uint32_t flip = bit ? ~std::uint32_t{0} : 0;
  auto word = static_cast<std::size_t> (begin / kBitsOfWord);
  std::uint32_t others = (bits[word] ^ flip) & ~std::uint32_t{0} << begin % kBitsOfWord;
  while (others == 0 && word + 1 < bits.size ())
    others = bits[++word] ^ flip;
  return std::min (columns, static_cast<int> (word) * kBitsOfWord + std::countr_zero (others));
}

/** Sets the bits from `begin` to `end`, which is greater. */
inline void
set_bits (PixelBits &bits, int begin, int end)
{
  const auto first = static_cast<std::size_t> (begin / kBitsOfWord);
  const auto last = static_cast<std::size_t> ((end - 1) / kBitsOfWord);
  const std::uint32_t from = ~std::uint32_t{0} << begin % kBitsOfWord;
  const std::uint32_t to = ~std::uint32_t{0} >> (kBitsOfWord - 1 - (end - 1) % kBitsOfWord);
  bits[first] |= first == last ? from & to : from;
  for (std::size_t word = first + 1; word < last; word++)
    bits[word] = ~std::uint32_t{0};
  if (first < last)
    bits[last] |= to;
}
/** @} */

/** A coded row of a slice in the profiles packed and entropy, the same in encoder and decoder. It
 *  has one invalid pixel before it and a few after it, because vectors read beyond its end. */
class CompactRow {
public:
  /** Pixels after the row that may be read. */
  static constexpr std::size_t kMargin = 8;

  /** Reserves memory for rows of so many columns. */
  void reserve (std::size_t columns)
  {
    for (auto *numbers : {&codes_, &states_, &shown_, &reference_})
      numbers->reserve (columns + 1 + kMargin);
    valid_.reserve (columns);
    earlier_.reserve (columns);
  }
  /** Makes all pixels invalid.
   *  @param shown  value of invalid pixels in shown() */
  void reset (std::size_t columns, std::uint64_t shown)
  {
    codes_.assign (columns + 1 + kMargin, kNoPixel);
    states_.assign (columns + 1 + kMargin, 0);
    shown_.assign (columns + 1 + kMargin, shown);
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

  /** The pixels as later frame sets refer to them.
   *  @param is_valid  of a column */
  template <class IsValid>
  [[nodiscard]] std::span<const PixelCode> as_reference (
      std::size_t columns, const IsValid &is_valid)
  {
    for (std::size_t x = 0; x < columns; x++)
      reference_[x] = is_valid (x) ? codes ()[x] : kEmptyPixel;
    return std::span (reference_).first (columns);
  }

  /** The same in key slices, where the codes alone tell which pixels are valid. */
  [[nodiscard]] std::span<const PixelCode> as_key_reference (std::size_t columns)
  {
    for (std::size_t x = 0; x < columns; x++)
      reference_[x] = codes ()[x] != kNoPixel ? codes ()[x] : kEmptyPixel;
    return std::span (reference_).first (columns);
  }

private:
  std::vector<PixelCode> codes_, reference_;
  std::vector<PixelState> states_;
  std::vector<std::uint64_t> shown_;
  std::vector<std::uint8_t> valid_, earlier_;
};

} // namespace rangecast
