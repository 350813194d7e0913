/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "decoder.hpp"

#include "../bitstream/symbols.hpp"

namespace rangecast {

bool
PlainDecoder::decode (std::span<const std::uint8_t> body, const SliceHeader &header,
    const DepthQuantiser &depth, const ColourQuantiser &colour, const RangeImage &image,
    std::uint64_t &points)
{
  const auto columns = static_cast<std::size_t> (header.columns);
  const std::size_t pixels = static_cast<std::size_t> (header.rows) * columns;
  const LittleEndianBits symbols (body.first (symbol_bytes (pixels))),
      full (body.subspan (symbol_bytes (pixels)));
  if (!symbols.end_after (pixels * kSymbolBits))
    return false;
  const int colour_bits = colour.bits ();
  const unsigned depth_mask = (1u << header.depth_bits) - 1, colour_mask = (1u << colour_bits) - 1;
  const auto full_bits = static_cast<std::size_t> (header.depth_bits + 3 * colour_bits);
  std::size_t symbol_at = 0, full_at = 0, valid = 0;
  bool damaged = false;
  upper_.assign (columns + 1, {});
  for (int y = header.first_row; y < header.first_row + header.rows; y++) {
    std::uint16_t *const depths = image.depth.row (y) + header.first_column;
    Rgbx *const colours = image.colour.row (y) + header.first_column;
    Pixel left, upper_left;
    for (std::size_t x = 0; x < columns; x++, symbol_at += kSymbolBits) {
      const std::uint64_t symbol = symbols.from (symbol_at) & 7;
      Pixel pixel;
      if (symbol == kFull) {
        if (full_at + full_bits > full.size ())
          return false;
        const std::uint64_t bits = full.from (full_at);
        const auto code = static_cast<unsigned> (bits & depth_mask);
        if (code >= static_cast<unsigned> (depth.codes ()))
          return false;
        const auto channel = [&] (int i) {
          return colour.value (static_cast<std::uint8_t> (
              bits >> (header.depth_bits + i * colour_bits) & colour_mask));
        };
        pixel = {depth.depth (static_cast<std::uint16_t> (code)),
            {channel (0), channel (1), channel (2), 0}};
        full_at += full_bits;
      } else { /* reserved symbols, and those that refer to a pixel without depth, are damage */
        const Pixel neighbours[] = {left, upper_left, upper_[x], upper_[x + 1], {}, {}, {}, {}};
        pixel = neighbours[symbol];
        damaged |= pixel.depth == 0 && symbol != kInvalid;
      }
      valid += pixel.depth != 0;
      depths[x] = pixel.depth;
      colours[x] = pixel.colour;
      upper_left = upper_[x];
      upper_[x] = left = pixel;
    }
  }
  points += valid;
  return !damaged && full.end_after (full_at);
}

} // namespace rangecast
