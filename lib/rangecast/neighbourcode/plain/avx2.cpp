/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The functions of profile plain in AVX2 intrinsics. for_this_cpu() could not make them from the
 * scalar code: they code four rows as one wavefront, each row three columns behind the one above
 * it, with saturating arithmetic and moves between lanes that Lanes does not offer. plain_functions
 * (cpu_level ()) selects them, by the same level as for_this_cpu().
 *
 * Each function names its target. With compiler options for the whole file an inline function of a
 * header, compiled here, could be the copy that the linker keeps for all. */
#include "functions.hpp"

#if defined __x86_64__
#include <immintrin.h>

#include "../../base/simd.hpp"

#define AVX2 [[RANGECAST_TARGET_AVX2]]

namespace rangecast {
namespace {

/* ---- quantising ---- */

constexpr int kBlock = 16; /* pixels at a time */

/* floor ((value * last + 127) / 255) of eight numbers; exact, as value * last + 127 < 65535. */
AVX2 inline __m128i
quantise (__m128i value, int colour_bits)
{
  const __m128i last = _mm_set1_epi16 (static_cast<short> ((1 << colour_bits) - 1));
  const __m128i n = _mm_add_epi16 (_mm_mullo_epi16 (value, last), _mm_set1_epi16 (127));
  const __m128i more = _mm_add_epi16 (n, _mm_set1_epi16 (1));
  return _mm_srli_epi16 (_mm_add_epi16 (more, _mm_srli_epi16 (n, 8)), 8);
}

/* How a row is quantised: colours to fewer bits, depths by a table, or neither. */
enum class Codes { kAll, kAllColours, kOffsets };

/* Quantises two pixels of valid depth. */
template <Codes kCodes>
AVX2 inline __m128i
make_two (const PlainQuantising &how, const std::uint16_t *depth, const Rgbx *colour)
{
  __m128i pixels = _mm_cvtepu8_epi16 (_mm_loadl_epi64 (reinterpret_cast<const __m128i *> (colour)));
  if (kCodes == Codes::kAll)
    pixels = quantise (pixels, how.colour.bits ());
  pixels = _mm_insert_epi16 (pixels, how.codes[depth[0]], 3);
  return _mm_insert_epi16 (pixels, how.codes[depth[1]], 7);
}

/* Quantises four pixels; those of other depths become anything.
 * @param offsets  depths less near, four in the lower half */
template <Codes kCodes>
AVX2 inline __m256i
make_four (
    const PlainQuantising &how, const std::uint16_t *depth, __m128i offsets, const Rgbx *colour)
{
  if constexpr (kCodes == Codes::kOffsets) {
    const __m256i colours =
        _mm256_cvtepu8_epi16 (_mm_loadu_si128 (reinterpret_cast<const __m128i *> (colour)));
    return _mm256_blend_epi16 (
        colours, _mm256_slli_epi64 (_mm256_cvtepu16_epi64 (offsets), 48), 0x88);
  }
  return _mm256_inserti128_si256 (_mm256_castsi128_si256 (make_two<kCodes> (how, depth, colour)),
      make_two<kCodes> (how, depth + 2, colour + 2), 1);
}

AVX2 inline __m128i
four_of (__m128i eight, int first)
{
  return first % 8 ? _mm_srli_si128 (eight, 8) : eight;
}

/* Quantises 16 pixels. @return two bits for each pixel, set if it is valid */
template <Codes kCodes>
AVX2 inline unsigned
make_block (
    const PlainQuantising &how, const std::uint16_t *depth, const Rgbx *colour, PlainPixel *to)
{
  const __m256i d = _mm256_loadu_si256 (reinterpret_cast<const __m256i *> (depth));
  const __m256i near = _mm256_set1_epi16 (static_cast<short> (how.near));
  const __m256i far = _mm256_set1_epi16 (static_cast<short> (how.far));
  const __m256i valid = _mm256_cmpeq_epi16 (_mm256_min_epu16 (_mm256_max_epu16 (d, near), far), d);
  const auto mask = static_cast<unsigned> (_mm256_movemask_epi8 (valid));
  const long long even = kInvalidPixelBit + ((how.row & 1) << 13);
  const __m256i invalid = _mm256_set_epi64x (even + 0x1000, even, even + 0x1000, even);
  const __m256i offset = _mm256_sub_epi16 (d, near);
  const __m128i valids[] = {_mm256_castsi256_si128 (valid), _mm256_extracti128_si256 (valid, 1)};
  const __m128i offsets[] = {_mm256_castsi256_si128 (offset), _mm256_extracti128_si256 (offset, 1)};
  for (int i = 0; i < kBlock; i += 4) {
    __m256i pixels = invalid;
    if (mask != 0) {
      const __m256i four =
          make_four<kCodes> (how, depth + i, four_of (offsets[i / 8], i), colour + i);
      pixels =
          _mm256_blendv_epi8 (invalid, four, _mm256_cvtepi16_epi64 (four_of (valids[i / 8], i)));
    }
    _mm256_storeu_si256 (reinterpret_cast<__m256i *> (to + i), pixels);
  }
  return mask;
}

AVX2 inline void
widen (PlainSpan &span, int x, unsigned mask)
{
  if (mask == 0)
    return;
  if (span.valid == 0)
    span.begin = x + static_cast<int> (_tzcnt_u32 (mask)) / 2;
  span.end = x + kBlock - __builtin_clz (mask) / 2;
  span.valid += static_cast<int> (_mm_popcnt_u32 (mask)) / 2;
}

template <Codes kCodes>
AVX2 PlainSpan
make_row (const PlainQuantising &how, const std::uint16_t *depth, const Rgbx *colour, int columns,
    PlainPixel *to)
{
  PlainSpan span;
  int x = 0;
  for (; x + kBlock <= columns; x += kBlock)
    widen (span, x, make_block<kCodes> (how, depth + x, colour + x, to + x));
  if (x < columns) { /* memory after the row must not be read */
    std::uint16_t depths[kBlock] = {};
    Rgbx colours[kBlock];
    const auto rest = static_cast<std::size_t> (columns - x);
    __builtin_memcpy (depths, depth + x, rest * sizeof *depths);
    __builtin_memcpy (colours, colour + x, rest * sizeof *colours);
    widen (span, x, make_block<kCodes> (how, depths, colours, to + x));
  }
  return span;
}

AVX2 PlainSpan
make_pixels (const PlainQuantising &how, const std::uint16_t *depth, const Rgbx *colour,
    int columns, PlainPixel *to)
{
  if (how.colour.bits () < 8)
    return make_row<Codes::kAll> (how, depth, colour, columns, to);
  return how.is_offset ? make_row<Codes::kOffsets> (how, depth, colour, columns, to)
                       : make_row<Codes::kAllColours> (how, depth, colour, columns, to);
}

/* ---- coding ---- */

/* Four rows at once, each kLag columns behind the one above it, so that its upper right neighbour
 * is known: lane i of a vector is row i. A lag of 2 would suffice, but then each step depends on
 * the result of the one before it. */
constexpr int kLag = 3, kColumnsBehind = kLag * (kBandRows - 1);
static_assert (kColumnsBehind <= kPixelsBefore && kColumnsBehind + 16 + 8 <= kPixelsBehind);

/* State of the four rows: the left pixels, and those of the rows above. */
struct Wave {
  __m256i left, upper_left, upper, upper_right, next;
};

AVX2 inline __m256i
load_pixels (const PlainPixel *from)
{
  return _mm256_loadu_si256 (reinterpret_cast<const __m256i *> (from));
}

/* Lanes of all ones where `pixel` lies between the limits in all four numbers. */
AVX2 inline __m256i
is_between (__m256i pixel, __m256i min, __m256i max)
{
  return _mm256_cmpeq_epi64 (_mm256_min_epu16 (_mm256_max_epu16 (pixel, min), max), pixel);
}

/* The symbol's lowest bit lies where invalid pixels have theirs. */
constexpr int kSymbolAt = 14;
static_assert (kInvalidPixelBit == 1 << kSymbolAt);

AVX2 inline __m256i
symbols (long long symbol)
{
  return _mm256_set1_epi64x (symbol << kSymbolAt);
}

/* blendv_pd here and blendv_epi8 for symbols: if both blends were of one kind, GCC 12 would add a
 * comparison of the mask with 0. */
AVX2 inline __m256i
choose_pixel (__m256i otherwise, __m256i pixel, __m256i mask)
{
  return _mm256_castpd_si256 (_mm256_blendv_pd (
      _mm256_castsi256_pd (otherwise), _mm256_castsi256_pd (pixel), _mm256_castsi256_pd (mask)));
}

/* Codes one pixel of each row. `above` is the row above the band, three columns on.
 * @return the symbols, from bit kSymbolAt on; wave.left are the pixels */
AVX2 inline __m256i
step (Wave &wave, __m256i own, __m256i threshold, const PlainPixel *above)
{
  const __m256i min = _mm256_subs_epu16 (own, threshold);
  const __m256i max = _mm256_adds_epu16 (own, threshold);
  const __m256i upper_right = is_between (wave.upper_right, min, max);
  const __m256i upper = is_between (wave.upper, min, max);
  const __m256i upper_left = is_between (wave.upper_left, min, max);
  const __m256i left = is_between (wave.left, min, max);
  static_assert (kInvalid == kFull + 1);
  __m256i symbol = _mm256_or_si256 (
      _mm256_and_si256 (own, _mm256_set1_epi64x (kInvalidPixelBit)), symbols (kFull));
  symbol = _mm256_blendv_epi8 (symbol, symbols (kUpperRight), upper_right);
  symbol = _mm256_blendv_epi8 (symbol, symbols (kUpper), upper);
  symbol = _mm256_blendv_epi8 (symbol, symbols (kUpperLeft), upper_left);
  symbol = _mm256_andnot_si256 (left, symbol);
  __m256i pixel = choose_pixel (own, wave.upper_right, upper_right);
  pixel = choose_pixel (pixel, wave.upper, upper);
  pixel = choose_pixel (pixel, wave.upper_left, upper_left);
  pixel = choose_pixel (pixel, wave.left, left);

  wave.left = pixel;
  wave.upper_left = wave.upper;
  wave.upper = wave.upper_right;
  wave.upper_right = wave.next;
  const __m256i down = _mm256_permute4x64_epi64 (pixel, 0x93); /* lanes 3, 0, 1, 2 */
  wave.next = _mm256_blend_epi32 (down, load_pixels (above), 3);
  return symbol;
}

/* Pixel i of each of four rows of four. */
AVX2 inline void
transpose (__m256i v[4])
{
  const __m256i a = _mm256_unpacklo_epi64 (v[0], v[1]), b = _mm256_unpackhi_epi64 (v[0], v[1]);
  const __m256i c = _mm256_unpacklo_epi64 (v[2], v[3]), d = _mm256_unpackhi_epi64 (v[2], v[3]);
  v[0] = _mm256_permute2x128_si256 (a, c, 0x20);
  v[1] = _mm256_permute2x128_si256 (b, d, 0x20);
  v[2] = _mm256_permute2x128_si256 (a, c, 0x31);
  v[3] = _mm256_permute2x128_si256 (b, d, 0x31);
}

/* The row above in the first lane; rows further down begin outside. */
AVX2 inline __m256i
load_above (const PlainPixel *upper)
{
  return _mm256_blend_epi32 (_mm256_set1_epi64x (kOutsidePixel), load_pixels (upper), 3);
}

/* Codes four pixels of each row, that of the first row at column x.
 * @return four symbols of each, from bit kSymbolAt on */
AVX2 inline __m256i
four_steps (Wave &wave, const PlainBand &band, int x, __m256i threshold)
{
  __m256i own[4], coded[4], all = _mm256_setzero_si256 ();
  for (int row = 0; row < kBandRows; row++)
    own[row] = load_pixels (band.rows[row] + x - kLag * row);
  transpose (own);
#pragma GCC unroll 4
  for (int i = 0; i < 4; i++) {
    const __m256i symbol = step (wave, own[i], threshold, band.upper + x + i + 3);
    all = _mm256_or_si256 (all, _mm256_slli_epi64 (symbol, kSymbolBits * i));
    coded[i] = wave.left;
  }
  /* The last row is above the next band. */
  _mm256_storeu_si256 (reinterpret_cast<__m256i *> (band.upper + x - kColumnsBehind),
      _mm256_permute2x128_si256 (_mm256_unpackhi_epi64 (coded[0], coded[1]),
          _mm256_unpackhi_epi64 (coded[2], coded[3]), 0x31));
  return all;
}

AVX2 void
code_band (const PlainBand &band)
{
  const __m256i threshold = _mm256_set1_epi64x (static_cast<long long> (band.threshold));
  const PlainPixel *const begin = band.upper + band.begin;
  Wave wave = {_mm256_set1_epi64x (kOutsidePixel), load_above (begin - 1), load_above (begin),
      load_above (begin + 1), load_above (begin + 2)};
  const int last = band.end + kColumnsBehind;
  std::size_t bytes = 0;
  for (int x = band.begin; x < last; x += kGroup, bytes += kGroupBits / 8) {
    /* Symbols of each row, 48 bits. The last ones may be missing. */
    __m256i group = _mm256_setzero_si256 ();
    const int steps = last - x < kGroup ? last - x : kGroup;
    for (int i = 0; i < steps; i += 4) {
      const __m256i four = four_steps (wave, band, x + i, threshold);
      group = _mm256_or_si256 (group, _mm256_sll_epi64 (_mm256_srli_epi64 (four, kSymbolAt),
                                          _mm_cvtsi32_si128 (kSymbolBits * i)));
    }
    alignas (32) std::uint64_t words[kBandRows];
    _mm256_store_si256 (reinterpret_cast<__m256i *> (words), group);
    for (int row = 0; row < kBandRows; row++)
      __builtin_memcpy (band.symbols[row] + bytes, &words[row], 8);
  }
}

/* The codes at bit `from` of adjacent pixels, shifted to bit `to`. */
AVX2 inline __m256i
moved (__m256i pixels, int from, __m128i to)
{
  const __m256i code =
      _mm256_and_si256 (_mm256_srli_epi64 (pixels, from), _mm256_set1_epi64x (0xff));
  return _mm256_sll_epi64 (code, to);
}

AVX2 void
pack_pixels (PlainPixel *pixels, std::size_t count, int depth_bits, int colour_bits)
{
  const __m128i r = _mm_cvtsi32_si128 (depth_bits);
  const __m128i g = _mm_cvtsi32_si128 (depth_bits + colour_bits);
  const __m128i b = _mm_cvtsi32_si128 (depth_bits + 2 * colour_bits);
  for (std::size_t i = 0; i < count; i += 4) {
    const __m256i p = load_pixels (pixels + i);
    const __m256i d_r = _mm256_or_si256 (_mm256_srli_epi64 (p, 48), moved (p, 0, r));
    const __m256i g_b = _mm256_or_si256 (moved (p, 16, g), moved (p, 32, b));
    _mm256_storeu_si256 (reinterpret_cast<__m256i *> (pixels + i), _mm256_or_si256 (d_r, g_b));
  }
}

AVX2 std::size_t
gather_full (const PlainRow &row, PlainPixel *to)
{
  std::size_t count = 0, bit = row.first_bit;
  const PlainPixel *pixels = row.pixels;
  for (int left = row.columns; left > 0; left -= kGroup, bit += kGroupBits, pixels += kGroup) {
    const std::uint64_t group = plain_group (row.symbols, bit, left);
    for (std::uint64_t full = group >> 2 & ~(group >> 1) & ~group & kGroupLowBits; full;
         full = _blsr_u64 (full))
      to[count++] = pixels[_tzcnt_u64 (full) / kSymbolBits];
  }
  return count;
}

/* ---- decoding ---- */

AVX2 inline void
count_group (PlainCounts &counts, std::uint64_t group)
{
  const std::uint64_t beyond_3 = group >> 2 & ~(group >> 1) & 0x249249249249;
  counts.full += static_cast<std::size_t> (_mm_popcnt_u64 (beyond_3 & ~group));
  counts.invalid += static_cast<std::size_t> (_mm_popcnt_u64 (beyond_3 & group));
}

AVX2 PlainCounts
count_symbols (const std::uint8_t *symbols, std::size_t bytes)
{
  PlainCounts counts;
  std::size_t i = 0;
  for (; i + 8 <= bytes; i += 6) { /* sixteen symbols */
    std::uint64_t group;
    __builtin_memcpy (&group, symbols + i, 8);
    count_group (counts, group);
  }
  std::uint64_t groups[2] = {};
  __builtin_memcpy (groups, symbols + i, bytes - i);
  count_group (counts, groups[0]);
  count_group (counts, groups[0] >> 48 | groups[1] << 16);
  return counts;
}

/* Writes 16 pixels. @return two bits for each, set if it is invalid */
AVX2 inline unsigned
show_block (const ShownPixel *row, std::uint16_t *depth, Rgbx *colour)
{
  __m256i depths[2];
  for (int i = 0; i < 2; i++) {
    const __m256 a = _mm256_castsi256_ps (load_pixels (row + 8 * i));
    const __m256 b = _mm256_castsi256_ps (load_pixels (row + 8 * i + 4));
    const __m256i colours = _mm256_castps_si256 (_mm256_shuffle_ps (a, b, 0x88));
    _mm256_storeu_si256 (
        reinterpret_cast<__m256i *> (colour + 8 * i), _mm256_permute4x64_epi64 (colours, 0xd8));
    depths[i] = _mm256_castps_si256 (_mm256_shuffle_ps (a, b, 0xdd));
  }
  /* By twos: 0 1 4 5 . 8 9 12 13 . 2 3 6 7 . 10 11 14 15 */
  const __m256i mixed = _mm256_packus_epi32 (depths[0], depths[1]);
  const __m256i order = _mm256_setr_epi32 (0, 4, 1, 5, 2, 6, 3, 7);
  const __m256i all = _mm256_permutevar8x32_epi32 (mixed, order);
  _mm256_storeu_si256 (reinterpret_cast<__m256i *> (depth), all);
  return static_cast<unsigned> (
      _mm256_movemask_epi8 (_mm256_cmpeq_epi16 (all, _mm256_setzero_si256 ())));
}

AVX2 std::size_t
show_row (const ShownPixel *row, int columns, std::uint16_t *depth, Rgbx *colour)
{
  int invalid_bits = 0, x = 0;
  for (; x + kBlock <= columns; x += kBlock)
    invalid_bits += _mm_popcnt_u32 (show_block (row + x, depth + x, colour + x));
  if (x < columns && columns >= kBlock) { /* the last block overlaps the one before */
    const int last = columns - kBlock;
    const unsigned invalid = show_block (row + last, depth + last, colour + last);
    invalid_bits += _mm_popcnt_u32 (invalid >> 2 * (x - last));
  } else if (x < columns) {
    std::uint16_t depths[kBlock];
    Rgbx colours[kBlock];
    const auto rest = static_cast<std::size_t> (columns - x);
    const unsigned invalid = show_block (row + x, depths, colours);
    invalid_bits += _mm_popcnt_u32 (_bzhi_u32 (invalid, 2 * static_cast<unsigned> (rest)));
    __builtin_memcpy (depth + x, depths, rest * sizeof *depths);
    __builtin_memcpy (static_cast<void *> (colour + x), colours, rest * sizeof *colours);
  }
  return static_cast<std::size_t> (columns - invalid_bits / 2);
}

} // namespace

const PlainFunctions kPlainFunctionsAvx2 = {
    make_pixels, code_band, gather_full, pack_pixels, count_symbols, show_row, kBandRows, 3 * kLag};

} // namespace rangecast
#endif
