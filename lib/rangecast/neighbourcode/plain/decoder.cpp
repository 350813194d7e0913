/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "decoder.hpp"

#include <algorithm>

namespace rangecast {
namespace {

/* Pixels up to two before and five after a row may be read, and up to a group after it written. */
constexpr std::size_t kBefore = 2, kAfter = kGroup;

constexpr ShownPixel kNothing[kGroup] = {};
constexpr std::uint64_t kYes = ~std::uint64_t{0};
constexpr std::uint64_t kIsLeft[8] = {kYes}, kIsFull[8] = {0, 0, 0, 0, kYes};
constexpr std::size_t kFullPixels[8] = {0, 0, 0, 0, 1};

/* Decodes the pixels of a group of symbols without branches, which would be unpredictable. */
inline void
decode_group (std::uint64_t symbols, const ShownPixel *upper, ShownPixel *row, ShownPixel &last,
    const ShownPixel *&full)
{
  const ShownPixel *const from[8] = {
      kNothing, upper - 1, upper, upper + 1, kNothing, kNothing, kNothing, kNothing};
  ShownPixel left = last;
  const ShownPixel *next = full;
#pragma GCC unroll 16
  for (int i = 0; i < kGroup; i++, symbols >>= kSymbolBits) {
    const std::uint64_t symbol = symbols & 7;
    left = (left & kIsLeft[symbol]) | (from[symbol][i] | (*next & kIsFull[symbol]));
    row[i] = left;
    next += kFullPixels[symbol];
  }
  last = left;
  full = next;
}

/* Decodes one row. @param at  bit of its first symbol */
void
decode_row (const LittleEndianBits &symbols, std::size_t at, const ShownPixel *upper,
    ShownPixel *row, int columns, const ShownPixel *&full)
{
  ShownPixel left = 0;
  for (; columns > 0; columns -= kGroup, at += kGroupBits, upper += kGroup, row += kGroup) {
    std::uint64_t group = symbols.from (at) & kGroupMask;
    if (columns < kGroup) { /* pixels after the row are invalid */
      const std::uint64_t own = (std::uint64_t{1} << columns * kSymbolBits) - 1;
      group = (group & own) | (kInvalidGroup & ~own);
    }
    if (group == 0) {
      std::fill_n (row, kGroup, left);
    } else if (group == kInvalidGroup) {
      std::fill_n (row, kGroup, left = 0);
    } else {
      decode_group (group, upper, row, left, full);
    }
  }
}

/* Reads full pixels. @return false if one has a depth code that does not exist */
bool
read_full (const LittleEndianBits &bits, std::size_t count, int depth_bits,
    const DepthQuantiser &depth, const ColourQuantiser &colour, ShownPixel *to)
{
  const auto last = static_cast<std::uint64_t> (depth.codes () - 1);
  const auto size = static_cast<std::size_t> (depth_bits + 3 * colour.bits ());
  const unsigned mask = (1u << colour.bits ()) - 1;
  bool good = true;
  for (std::size_t i = 0; i < count; i++) {
    const std::uint64_t value = bits.from (i * size);
    const std::uint64_t code = value & ((1u << depth_bits) - 1);
    good &= code <= last;
    std::uint64_t rgb = value >> depth_bits;
    if (colour.bits () == 8) {
      rgb &= 0xffffff;
    } else {
      const auto channel = [&] (int k) {
        return std::uint64_t{
            colour.value (static_cast<std::uint8_t> (rgb >> k * colour.bits () & mask))};
      };
      rgb = channel (0) | channel (1) << 8 | channel (2) << 16;
    }
    to[i] = rgb | std::uint64_t{depth.depth (static_cast<std::uint16_t> (std::min (code, last)))}
                      << 32;
  }
  return good;
}

} // namespace

bool
PlainDecoder::decode (std::span<const std::uint8_t> body, const SliceHeader &header,
    const DepthQuantiser &depth, const ColourQuantiser &colour, const RangeImage &image,
    std::uint64_t &points)
{
  const auto columns = static_cast<std::size_t> (header.columns);
  const std::size_t pixels = static_cast<std::size_t> (header.rows) * columns;
  const std::size_t size = symbol_bytes (pixels);
  const LittleEndianBits symbols (body.first (size)), full_bits (body.subspan (size));
  if (!symbols.end_after (pixels * kSymbolBits))
    return false;
  const PlainCounts counts = count_symbols (body.data (), size);
  const auto bits = static_cast<std::size_t> (header.depth_bits + 3 * header.colour_bits);
  if (!full_bits.end_after (counts.full * bits))
    return false;
  full_.resize (std::max (full_.size (), counts.full + 1));
  if (!read_full (full_bits, counts.full, header.depth_bits, depth, colour, full_.data ()))
    return false;
  const std::size_t padded = kBefore + columns + kAfter;
  rows_.resize (std::max (rows_.size (), 2 * padded));
  std::fill_n (rows_.begin (), 2 * padded, ShownPixel{0});
  ShownPixel *row = rows_.data () + kBefore, *upper = row + padded;
  const ShownPixel *full = full_.data ();
  std::size_t at = 0, valid = 0;
  for (int y = header.first_row; y < header.first_row + header.rows; y++) {
    decode_row (symbols, at, upper, row, header.columns, full);
    valid += show_plain_row (row, header.columns, image.depth.row (y) + header.first_column,
        image.colour.row (y) + header.first_column);
    at += columns * kSymbolBits;
    std::swap (row, upper);
  }
  points += valid;
  /* A pixel is 0 if its symbol is kInvalid, is reserved, or refers to a pixel that is 0. */
  return valid + counts.invalid == pixels;
}

} // namespace rangecast
