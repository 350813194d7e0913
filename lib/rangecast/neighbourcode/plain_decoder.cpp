/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "plain_decoder.hpp"

#include <algorithm>

#include "symbols.hpp"

namespace rangecast {
namespace {

/* A decoded pixel: depth in bits 0 to 15, R, G, B above it. 0 is an invalid one. */
constexpr std::uint64_t
pack (std::uint16_t depth, std::uint8_t r, std::uint8_t g, std::uint8_t b)
{
  return depth | std::uint64_t{r} << 16 | std::uint64_t{g} << 24 | std::uint64_t{b} << 32;
}

/* Full pixels of one slice. */
struct FullPixels {
  BitReader bits;
  const DepthQuantiser &depth;
  const ColourQuantiser &colour;
  int depth_bits;

  /* 0 if there is no such depth or no such pixel. */
  std::uint64_t next ()
  {
    const std::uint64_t value = bits.get (depth_bits + 3 * colour.bits ());
    const auto code = static_cast<std::uint32_t> (value & ((1u << depth_bits) - 1));
    if (code >= static_cast<std::uint32_t> (depth.codes ()) || bits.exhausted ())
      return 0;
    const unsigned mask = (1u << colour.bits ()) - 1;
    const auto channel = [&] (int i) {
      return colour.value (
          static_cast<std::uint8_t> (value >> (depth_bits + i * colour.bits ()) & mask));
    };
    return pack (
        depth.depth (static_cast<std::uint16_t> (code)), channel (0), channel (1), channel (2));
  }
};

/* Decodes one row into `row` (columns pixels, one invalid pixel before and after). */
bool
decode_row (BitReader &symbols, FullPixels &full, const std::uint64_t *upper, std::uint64_t *row,
    int columns)
{
  for (int x = 0; x < columns; x++) {
    std::uint64_t pixel = 0;
    const auto symbol = symbols.get (kSymbolBits);
    switch (symbol) {
      case kLeft:
        pixel = row[x - 1];
        break;
      case kUpperLeft:
      case kUpper:
      case kUpperRight:
        pixel = upper[x + int (symbol) - kUpper];
        break;
      case kFull:
        pixel = full.next ();
        break;
      case kInvalid:
        row[x] = 0;
        continue;
      default:
        return false;
    }
    if (pixel == 0) /* refers to an invalid pixel, or is not there */
      return false;
    row[x] = pixel;
  }
  return true;
}

std::uint64_t
write_row (const std::uint64_t *row, int columns, std::uint16_t *depth, Rgbx *colour)
{
  std::uint64_t points = 0;
  for (int x = 0; x < columns; x++) {
    const std::uint64_t p = row[x];
    depth[x] = static_cast<std::uint16_t> (p);
    colour[x] = {static_cast<std::uint8_t> (p >> 16), static_cast<std::uint8_t> (p >> 24),
        static_cast<std::uint8_t> (p >> 32), 0};
    points += p != 0;
  }
  return points;
}

} // namespace

bool
PlainDecoder::decode (std::span<const std::uint8_t> body, const SliceHeader &header,
    const DepthQuantiser &depth, const ColourQuantiser &colour, const RangeImage &image,
    std::uint64_t &points)
{
  const std::size_t symbols_size = symbol_bytes (
      static_cast<std::size_t> (header.rows) * static_cast<std::size_t> (header.columns));
  BitReader symbols (body.data (), symbols_size);
  FullPixels full = {BitReader (body.data () + symbols_size, body.size () - symbols_size), depth,
      colour, header.depth_bits};
  const auto padded = static_cast<std::size_t> (header.columns) + 2;
  rows_.assign (std::max (rows_.size (), 2 * padded), 0);
  std::uint64_t *row = rows_.data () + 1, *upper = row + padded;
  for (int y = 0; y < header.rows; y++) {
    if (!decode_row (symbols, full, upper, row, header.columns))
      return false;
    const int image_row = header.first_row + y;
    points += write_row (row, header.columns, image.depth.row (image_row) + header.first_column,
        image.colour.row (image_row) + header.first_column);
    std::swap (row, upper);
  }
  return symbols.at_clean_end () && full.bits.at_clean_end ();
}

} // namespace rangecast
