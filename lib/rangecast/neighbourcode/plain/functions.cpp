/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "functions.hpp"

#include <algorithm>
#include <bit>
#include <cstring>

#include "../bitstream/components.hpp"

namespace rangecast {

PlainSpan
make_plain_pixels (const PlainQuantising &how, const std::uint16_t *depth, const Rgbx *colour,
    int columns, PlainPixel *to)
{
  PlainSpan span;
  int first = columns;
  for (int x = 0; x < columns; x++) {
    if (depth[x] < how.near || depth[x] > how.far) {
      to[x] = invalid_plain_pixel (x, how.row);
      continue;
    }
    const Rgbx &c = colour[x];
    to[x] = plain_pixel (
        how.colour.code (c.r), how.colour.code (c.g), how.colour.code (c.b), how.codes[depth[x]]);
    first = std::min (first, x);
    span.end = x + 1;
    span.valid++;
  }
  span.begin = span.valid > 0 ? first : 0;
  return span;
}

namespace {

typedef std::uint16_t Packed __attribute__ ((vector_size (8)));

Components
components_of (PlainPixel pixel)
{
  Packed packed;
  std::memcpy (&packed, &pixel, sizeof packed);
  return __builtin_convertvector(packed, Components);
}

/* Three pixels of the row above. */
struct Above {
  PlainPixel left, here, right;
};

/* Codes a valid pixel that is not near its left one. @return its symbol */
inline Symbol
choose_above (PlainPixel &pixel, Components own, const Above &above, Components threshold)
{
  if (are_near (own, components_of (above.left), threshold)) {
    pixel = above.left;
    return kUpperLeft;
  }
  if (are_near (own, components_of (above.here), threshold)) {
    pixel = above.here;
    return kUpper;
  }
  if (are_near (own, components_of (above.right), threshold)) {
    pixel = above.right;
    return kUpperRight;
  }
  return kFull;
}

/* Codes at most a group of a row; `upper` becomes it. @return the symbols */
std::uint64_t
code_group (const PlainPixel *row, PlainPixel *upper, int count, PlainPixel &left_pixel,
    PlainPixel &upper_left, Components threshold)
{
  std::uint64_t symbols = 0;
  Components left = components_of (left_pixel);
  for (int x = 0; x < count; x++) {
    const Above above = {upper_left, upper[x], upper[x + 1]};
    PlainPixel pixel = row[x];
    Symbol symbol = kInvalid;
    if (pixel & kInvalidPixelBit) {
      left = components_of (pixel);
    } else if (const Components own = components_of (pixel); are_near (own, left, threshold)) {
      symbol = kLeft;
      pixel = left_pixel;
    } else {
      symbol = choose_above (pixel, own, above, threshold);
      left = components_of (pixel);
    }
    symbols |= std::uint64_t{symbol} << kSymbolBits * x;
    upper_left = above.here;
    upper[x] = left_pixel = pixel;
  }
  return symbols;
}

} // namespace

void
code_plain_row (const PlainRow &row)
{
  const Components threshold = components_of (row.threshold);
  PlainPixel *const upper = row.upper;
  BitWriter symbols (row.symbols);
  PlainPixel left = kOutsidePixel, upper_left = upper[row.span.begin - 1];
  for (int x = row.span.begin; x < row.span.end; x += kGroup) {
    const int count = std::min (kGroup, row.span.end - x);
    symbols.put (code_group (row.pixels + x, upper + x, count, left, upper_left, threshold),
        count * kSymbolBits);
  }
}

std::size_t
gather_full (const PlainRow &row, PlainPixel *to)
{
  const PlainPixel *const begin = to;
  const PlainPixel *pixels = row.pixels + row.span.begin;
  std::size_t bit = 0;
  for (int left = row.span.end - row.span.begin; left > 0;
       left -= kGroup, bit += kGroupBits, pixels += kGroup) {
    const std::uint64_t group = plain_group (row.symbols, bit, left);
    for (std::uint64_t full = group >> 2 & ~(group >> 1) & ~group & kGroupLowBits; full;
         full &= full - 1)
      *to++ = pixels[std::countr_zero (full) / kSymbolBits];
  }
  return static_cast<std::size_t> (to - begin);
}

void
pack_plain_pixels (PlainPixel *pixels, std::size_t count, int depth_bits, int colour_bits)
{
  const int r = depth_bits, g = r + colour_bits, b = g + colour_bits;
  for (std::size_t i = 0; i < count; i++) {
    const PlainPixel p = pixels[i];
    pixels[i] = p >> 48 | (p & 0xff) << r | (p >> 16 & 0xff) << g | (p >> 32 & 0xff) << b;
  }
}

PlainCounts
count_symbols (const std::uint8_t *symbols, std::size_t bytes)
{
  PlainCounts counts;
  for (std::size_t i = 0; i < bytes; i += 3) { /* eight symbols */
    std::uint32_t group = symbols[i];
    for (std::size_t k = 1; k < std::min<std::size_t> (bytes - i, 3); k++)
      group |= std::uint32_t{symbols[i + k]} << 8 * k;
    const std::uint32_t beyond_3 = group >> 2 & ~(group >> 1) & 0x249249;
    counts.full += static_cast<std::size_t> (std::popcount (beyond_3 & ~group));
    counts.invalid += static_cast<std::size_t> (std::popcount (beyond_3 & group));
  }
  return counts;
}

std::size_t
show_plain_row (const ShownPixel *row, int columns, std::uint16_t *depth, Rgbx *colour)
{
  std::size_t points = 0;
  for (int x = 0; x < columns; x++) {
    const ShownPixel p = row[x];
    depth[x] = static_cast<std::uint16_t> (p >> 32);
    colour[x] = {static_cast<std::uint8_t> (p), static_cast<std::uint8_t> (p >> 8),
        static_cast<std::uint8_t> (p >> 16), 0};
    points += p != 0;
  }
  return points;
}

} // namespace rangecast
