/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The inner loops of profile plain. */
#pragma once

#include <cstddef>
#include <cstdint>

#include "../../geometry/image_view.hpp"
#include "../../geometry/quantiser.hpp"
#include "../bitstream/symbols.hpp"

namespace rangecast {

/** A quantised pixel: codes of R, G, B and depth, 16 bits each, R in the least significant. */
using PlainPixel = std::uint64_t;

constexpr PlainPixel
plain_pixel (unsigned r, unsigned g, unsigned b, unsigned depth)
{
  return r | PlainPixel{g} << 16 | PlainPixel{b} << 32 | PlainPixel{depth} << 48;
}

/** A pixel outside the slice: its R is farther than any threshold from that of a pixel. */
inline constexpr PlainPixel kOutsidePixel = 0xc000;
/** An invalid pixel. Its R is also far from that of the invalid pixels beside and above it, so that
 *  comparison alone finds that it has no neighbour. */
constexpr PlainPixel
invalid_plain_pixel (int x, int y)
{
  return PlainPixel{0x4000} + 0x1000 * static_cast<unsigned> ((x & 1) | (y & 1) << 1);
}
inline constexpr PlainPixel kInvalidPixelBit = 0x4000; /* set in both, and in no valid pixel */

/** Padding of rows: so many pixels before and after can be read, and are outside or invalid. */
inline constexpr int kPixelsBefore = 1, kPixelsBehind = 16;

/** Parameters to quantise a row. */
struct PlainQuantising {
  std::uint16_t near, far;    ///< of valid depths
  const std::uint16_t *codes; ///< of all 65536 depths; of those that are not valid, anything
  const ColourQuantiser &colour;
  int row; ///< of the partition: its last bit matters
};

/** The columns of a row with valid pixels. */
struct PlainSpan {
  int begin = 0, end = 0; ///< all pixels elsewhere are invalid
  int valid = 0;          ///< valid pixels
};

/** A row to be coded. */
struct PlainRow {
  const PlainPixel *pixels; ///< quantised
  PlainPixel *upper;        ///< in: the coded row above; out: from begin to end this one as coded,
                            ///< elsewhere unchanged, outside or invalid
  PlainSpan span;
  PlainPixel threshold;  ///< in all four numbers
  std::uint8_t *symbols; ///< 3 bits each, from column `begin` on; with room for a group more
};

/** Up to sixteen symbols from a bit on; the bits above them are 0. */
inline std::uint64_t
plain_group (const std::uint8_t *symbols, std::size_t bit, int count)
{
  const std::uint64_t group = load_little_endian (symbols + bit / 8) >> (bit % 8) & kGroupMask;
  return count < kGroup ? group & ((std::uint64_t{1} << count * kSymbolBits) - 1) : group;
}

/** A decoded pixel as it goes into an image: R, G, B, 0, 8 bits each, R in the least significant,
 *  above them 16 bits of depth. 0 is an invalid one. */
using ShownPixel = std::uint64_t;

struct PlainCounts {
  std::size_t full = 0, invalid = 0;
};

/** Quantises a row. */
PlainSpan make_plain_pixels (const PlainQuantising &how, const std::uint16_t *depth,
    const Rgbx *colour, int columns, PlainPixel *to);
/** Codes a row, see "How an encoder chooses" in docs/formats/bitstream.md. */
void code_plain_row (const PlainRow &row);
/** Copies the full pixels of a coded row to `to`. @return how many */
std::size_t gather_full (const PlainRow &row, PlainPixel *to);
/** Packs pixels in place: D bits of depth, then C each of R, G, B. */
void pack_plain_pixels (PlainPixel *pixels, std::size_t count, int depth_bits, int colour_bits);
/** Counts symbols. Bits that fill the last byte are 0. */
PlainCounts count_symbols (const std::uint8_t *symbols, std::size_t bytes);
/** Writes a decoded row. @return valid pixels */
std::size_t show_plain_row (const ShownPixel *row, int columns, std::uint16_t *depth, Rgbx *colour);

} // namespace rangecast
