/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The functions of waves in AVX2 intrinsics; plain/avx2.cpp says why. Lane i of a vector, 64 bits,
 * is row i. */
#include "wave.hpp"

#if defined __x86_64__
#include <immintrin.h>

#include "../../base/simd.hpp"

#define AVX2 [[RANGECAST_TARGET_AVX2]]

namespace rangecast {
namespace {

AVX2 inline __m256i
load (const std::uint64_t *from)
{
  return _mm256_loadu_si256 (reinterpret_cast<const __m256i *> (from));
}

AVX2 inline void
store (std::uint64_t *to, __m256i v)
{
  _mm256_storeu_si256 (reinterpret_cast<__m256i *> (to), v);
}

AVX2 inline __m256i
all_lanes (std::uint64_t v)
{
  return _mm256_set1_epi64x (static_cast<long long> (v));
}

/* Moves the four numbers of each pixel: number i becomes number `from` of `i`, or 0 for -1. */
template <int a, int b, int c, int d>
AVX2 inline __m256i
moved (__m256i v)
{
  constexpr auto at = [] (int number, int byte) {
    return static_cast<char> (number < 0 ? -1 : 2 * number + byte);
  };
  const __m128i one = _mm_setr_epi8 (at (a, 0), at (a, 1), at (b, 0), at (b, 1), at (c, 0),
      at (c, 1), at (d, 0), at (d, 1), at (a < 0 ? -1 : a + 4, 0), at (a < 0 ? -1 : a + 4, 1),
      at (b < 0 ? -1 : b + 4, 0), at (b < 0 ? -1 : b + 4, 1), at (c < 0 ? -1 : c + 4, 0),
      at (c < 0 ? -1 : c + 4, 1), at (d < 0 ? -1 : d + 4, 0), at (d < 0 ? -1 : d + 4, 1));
  return _mm256_shuffle_epi8 (v, _mm256_broadcastsi128_si256 (one));
}

/* `b` where the mask is set, which is of whole lanes. blendv_pd, because GCC 12 adds a comparison
 * of such masks with 0 before blendv_epi8. */
AVX2 inline __m256i
choose (__m256i a, __m256i b, __m256i mask)
{
  return _mm256_castpd_si256 (_mm256_blendv_pd (
      _mm256_castsi256_pd (a), _mm256_castsi256_pd (b), _mm256_castsi256_pd (mask)));
}

/* Rows of four pixels to pixels of four rows, or back. */
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

/* Each lane gets that of the row above; the first, a number from memory. */
AVX2 inline __m256i
from_above (__m256i v, const std::uint64_t *above)
{
  const __m256i down = _mm256_permute4x64_epi64 (v, 0x93); /* lanes 3, 0, 1, 2 */
  return _mm256_blend_epi32 (down,
      _mm256_castsi128_si256 (_mm_loadl_epi64 (reinterpret_cast<const __m128i *> (above))), 3);
}

AVX2 inline __m256i
is_between (__m256i pixel, __m256i min, __m256i max)
{
  return _mm256_cmpeq_epi64 (_mm256_min_epi16 (_mm256_max_epi16 (pixel, min), max), pixel);
}

/* The pixels of a vector's rows that are valid. */
AVX2 inline __m256i
is_valid (__m256i pixels)
{
  return _mm256_cmpeq_epi64 (
      _mm256_and_si256 (pixels, all_lanes (kInvalidPixelBit)), _mm256_setzero_si256 ());
}

/* Pixels as depth and YCoCg-R, see components_of_key(). */
AVX2 inline __m256i
codes_of (__m256i rgb)
{
  const __m256i r = moved<0, 0, 0, -1> (rgb), g = moved<1, 1, 1, -1> (rgb);
  const __m256i b = moved<2, 2, 2, -1> (rgb);
  const __m256i co = _mm256_sub_epi16 (r, b), t = _mm256_add_epi16 (b, _mm256_srai_epi16 (co, 1));
  const __m256i cg = _mm256_sub_epi16 (g, t), y = _mm256_add_epi16 (t, _mm256_srai_epi16 (cg, 1));
  const __m256i y_co = _mm256_blend_epi16 (y, co, 0x22);
  const __m256i cg_depth = _mm256_blend_epi16 (cg, rgb, 0x88);
  return _mm256_blend_epi16 (y_co, cg_depth, 0xcc);
}

/* The opposite, see to_rgb(). */
AVX2 inline __m256i
rgb_of (__m256i c, __m256i min_rgb, __m256i max_rgb)
{
  const __m256i half = _mm256_srai_epi16 (c, 1);
  const __m256i t = _mm256_sub_epi16 (moved<0, 0, 0, 3> (c), moved<2, 2, 2, -1> (half));
  const __m256i plus = moved<1, 2, -1, -1> (c), minus = moved<1, -1, 1, -1> (half);
  const __m256i rgb = _mm256_add_epi16 (t, _mm256_sub_epi16 (plus, minus));
  return _mm256_min_epi16 (_mm256_max_epi16 (rgb, min_rgb), max_rgb);
}

/* A neighbour of each row's pixel, three ways. */
struct Pixels {
  __m256i rgb, codes, valid;
};

/* Neighbours of one pixel of each row; `next` is one further than the upper right. */
struct Wave {
  Pixels left, upper_left, upper, upper_right, next;
  __m256i latest;   /* the latest valid pixel, as code */
  __m256i overflow; /* not 0: a difference was too large for 16 bits */
};

/* See predict(). */
AVX2 inline __m256i
predicted (const Wave &w, __m256i last_depth)
{
  const __m256i l = w.left.codes, u = w.upper.codes, ul = w.upper_left.codes;
  const __m256i right = choose (u, w.upper_right.codes, w.upper_right.valid);
  const __m256i others = _mm256_add_epi16 (_mm256_add_epi16 (u, right), _mm256_set1_epi16 (2));
  const __m256i mean = _mm256_srai_epi16 (_mm256_add_epi16 (_mm256_add_epi16 (l, l), others), 2);
  /* Depth, without its sign. */
  const __m256i sign = all_lanes (kWaveDepthSign);
  const __m256i a = _mm256_xor_si256 (l, sign), b = _mm256_xor_si256 (u, sign);
  const __m256i c = _mm256_xor_si256 (ul, sign);
  const __m256i plane = _mm256_min_epu16 (
      _mm256_subs_epu16 (_mm256_adds_epu16 (a, _mm256_subs_epu16 (b, c)), _mm256_subs_epu16 (c, b)),
      last_depth);
  const __m256i depth =
      _mm256_xor_si256 (choose (_mm256_avg_epu16 (a, b), plane, w.upper_left.valid), sign);
  const __m256i both = _mm256_blend_epi16 (mean, depth, 0x88);
  __m256i one = choose (w.latest, w.upper_right.codes, w.upper_right.valid);
  one = choose (one, ul, w.upper_left.valid);
  one = choose (one, u, w.upper.valid);
  one = choose (one, l, w.left.valid);
  return choose (one, both, _mm256_and_si256 (w.left.valid, w.upper.valid));
}

AVX2 inline void
move_on (Wave &w, const Pixels &coded, const PlainPixel *above, const WaveCode *above_codes)
{
  w.left = coded;
  w.upper_left = w.upper;
  w.upper = w.upper_right;
  w.upper_right = w.next;
  w.next.rgb = from_above (coded.rgb, above);
  w.next.codes = from_above (coded.codes, above_codes);
  w.next.valid = is_valid (w.next.rgb);
}

/* ---- encoding ---- */

struct EncoderConstants {
  __m256i threshold, steps, halves, reciprocals, min, max, min_rgb, max_rgb, last_depth;
};

/* The symbol's lowest bit lies where invalid pixels have theirs. */
constexpr int kSymbolAt = 14;
static_assert (kInvalidPixelBit == 1 << kSymbolAt && kInvalid == kFull + 1);

AVX2 inline __m256i
symbols (std::uint64_t symbol)
{
  return all_lanes (symbol << kSymbolAt);
}

/* Codes one pixel of each row. @return the symbols; w.left are the pixels, of invalid ones as they
 * are given */
template <bool kIsWide>
AVX2 inline __m256i
encode_step (Wave &w, const EncoderConstants &k, __m256i own, __m256i &residual, Pixels &coded)
{
  const __m256i min = _mm256_subs_epi16 (own, k.threshold);
  const __m256i max = _mm256_adds_epi16 (own, k.threshold);
  const __m256i upper_right = is_between (w.upper_right.rgb, min, max);
  const __m256i upper = is_between (w.upper.rgb, min, max);
  const __m256i upper_left = is_between (w.upper_left.rgb, min, max);
  const __m256i left = is_between (w.left.rgb, min, max);
  const __m256i valid = is_valid (own);
  __m256i symbol =
      _mm256_or_si256 (_mm256_and_si256 (own, all_lanes (kInvalidPixelBit)), symbols (kFull));
  symbol = choose (symbol, symbols (kUpperRight), upper_right);
  symbol = choose (symbol, symbols (kUpper), upper);
  symbol = choose (symbol, symbols (kUpperLeft), upper_left);
  symbol = _mm256_andnot_si256 (left, symbol);
  const __m256i is_copy = _mm256_or_si256 (_mm256_or_si256 (upper_right, upper), upper_left);
  Pixels other;
  other.rgb = choose (own, w.upper_right.rgb, upper_right);
  other.rgb = choose (other.rgb, w.upper.rgb, upper);
  other.rgb = choose (other.rgb, w.upper_left.rgb, upper_left);
  other.codes = choose (w.upper_right.codes, w.upper.codes, upper);
  other.codes = choose (other.codes, w.upper_left.codes, upper_left);

  /* The pixel in full: its residual is rounded to the nearest step. The first quotient may be off
   * by 1; then the rest is more than half a step. */
  const __m256i code = codes_of (own);
  w.latest = choose (w.latest, w.left.codes, w.left.valid);
  const __m256i expected = predicted (w, k.last_depth);
  const __m256i difference = _mm256_sub_epi16 (code, expected);
  if constexpr (kIsWide) {
    const __m256i is_full = _mm256_andnot_si256 (_mm256_or_si256 (is_copy, left), valid);
    const __m256i wrong = _mm256_xor_si256 (_mm256_subs_epi16 (code, expected), difference);
    w.overflow = _mm256_or_si256 (w.overflow, _mm256_and_si256 (wrong, is_full));
  }
  const __m256i quotient = _mm256_mulhrs_epi16 (difference, k.reciprocals);
  const __m256i rest = _mm256_sub_epi16 (difference, _mm256_mullo_epi16 (quotient, k.steps));
  const __m256i nearer = _mm256_sub_epi16 (rest, _mm256_sign_epi16 (k.steps, rest));
  const __m256i is_off = _mm256_cmpgt_epi16 (_mm256_abs_epi16 (rest), k.halves);
  const __m256i made = _mm256_min_epi16 (
      _mm256_max_epi16 (_mm256_subs_epi16 (code, _mm256_blendv_epi8 (rest, nearer, is_off)), k.min),
      k.max);
  residual = _mm256_add_epi16 (
      quotient, _mm256_sign_epi16 (_mm256_and_si256 (is_off, _mm256_set1_epi16 (1)), rest));

  const __m256i keep = _mm256_or_si256 (is_copy, _mm256_xor_si256 (valid, all_lanes (~0ull)));
  coded.rgb = choose (rgb_of (made, k.min_rgb, k.max_rgb), other.rgb, keep);
  coded.rgb = choose (coded.rgb, w.left.rgb, left);
  coded.codes = choose (made, other.codes, is_copy);
  coded.codes = choose (coded.codes, w.left.codes, left);
  coded.valid = valid;
  return symbol;
}

AVX2 inline Pixels
outside_but_first (const PlainPixel *above, const WaveCode *above_codes)
{
  Pixels p;
  p.rgb = from_above (all_lanes (kOutsidePixel), above);
  p.codes = from_above (_mm256_setzero_si256 (), above_codes);
  p.valid = is_valid (p.rgb);
  return p;
}

/* Stores four pixels of a row. */
AVX2 inline void
keep_row (std::uint64_t *to, const __m256i v[4], int row)
{
  const __m256i a =
      row % 2 ? _mm256_unpackhi_epi64 (v[0], v[1]) : _mm256_unpacklo_epi64 (v[0], v[1]);
  const __m256i b =
      row % 2 ? _mm256_unpackhi_epi64 (v[2], v[3]) : _mm256_unpacklo_epi64 (v[2], v[3]);
  store (to,
      row / 2 ? _mm256_permute2x128_si256 (a, b, 0x31) : _mm256_permute2x128_si256 (a, b, 0x20));
}

template <int kLastRow, bool kIsWide>
AVX2 void
encode_rows (const WaveSteps &s, EncoderWave &wave)
{
  const EncoderConstants k = {all_lanes (wave.threshold), all_lanes (s.steps), all_lanes (s.halves),
      all_lanes (s.reciprocals), all_lanes (s.min), all_lanes (s.max), all_lanes (s.min_rgb),
      all_lanes (s.max_rgb), all_lanes (s.max ^ kWaveDepthSign)};
  PlainPixel *const upper = wave.upper + wave.begin;
  WaveCode *const upper_codes = wave.upper_codes + wave.begin;
  Wave w;
  w.left = {all_lanes (kOutsidePixel), _mm256_setzero_si256 (), _mm256_setzero_si256 ()};
  w.upper_left = outside_but_first (upper - 1, upper_codes - 1);
  w.upper = outside_but_first (upper, upper_codes);
  w.upper_right = outside_but_first (upper + 1, upper_codes + 1);
  w.next = outside_but_first (upper + 2, upper_codes + 2);
  w.latest = load (wave.latest);
  w.overflow = _mm256_setzero_si256 ();
  constexpr int behind = kWaveLag * kLastRow;
  const int steps = wave.end - wave.begin + behind;
  const PlainPixel *rows[kWaveRows];
  std::uint8_t *to[kWaveRows];
  for (int i = 0; i < kWaveRows; i++) {
    rows[i] = wave.rows[i] + wave.begin - kWaveLag * i;
    to[i] = wave.symbols[i] + wave.begin - kWaveLag * i;
  }
  std::uint64_t *residuals = wave.residuals;
  for (int x = 0; x < steps; x += 8) {
    __m256i eight = _mm256_setzero_si256 ();
    for (int half = 0; half < 8; half += 4) {
      __m256i own[4], rgb[4], codes[4], four = _mm256_setzero_si256 ();
      for (int i = 0; i < kWaveRows; i++)
        own[i] = _mm256_xor_si256 (load (rows[i] + x + half), all_lanes (kWaveDepthSign));
      transpose (own);
#pragma GCC unroll 4
      for (int i = 0; i < 4; i++) {
        const int at = x + half + i;
        __m256i residual;
        Pixels coded;
        const __m256i symbol = encode_step<kIsWide> (w, k, own[i], residual, coded);
        four = _mm256_or_si256 (four, 8 * i < kSymbolAt
                                          ? _mm256_srli_epi64 (symbol, kSymbolAt - 8 * i)
                                          : _mm256_slli_epi64 (symbol, 8 * i - kSymbolAt));
        store (residuals + 4 * at, residual);
        move_on (w, coded, upper + at + 3, upper_codes + at + 3);
        rgb[i] = coded.rgb;
        codes[i] = coded.codes;
      }
      keep_row (upper + x + half - behind, rgb, kLastRow);
      keep_row (upper_codes + x + half - behind, codes, kLastRow);
      eight = _mm256_or_si256 (eight, half ? _mm256_slli_epi64 (four, 32) : four);
    }
    alignas (32) std::uint64_t words[kWaveRows];
    _mm256_store_si256 (reinterpret_cast<__m256i *> (words), eight);
    for (int i = 0; i < kWaveRows; i++)
      __builtin_memcpy (to[i] + x, &words[i], 8);
  }
  w.latest = choose (w.latest, w.left.codes, w.left.valid);
  store (wave.latest, w.latest);
  wave.overflow = !_mm256_testz_si256 (w.overflow, w.overflow);
}

template <bool kIsWide>
AVX2 void
encode_wave (const WaveSteps &steps, EncoderWave &wave)
{
  static_assert (kWaveRows == 4);
  switch (wave.last_row) {
    case 0:
      return encode_rows<0, kIsWide> (steps, wave);
    case 1:
      return encode_rows<1, kIsWide> (steps, wave);
    case 2:
      return encode_rows<2, kIsWide> (steps, wave);
    default:
      return encode_rows<3, kIsWide> (steps, wave);
  }
}

AVX2 void
encode (const WaveSteps &steps, EncoderWave &wave)
{
  if (steps.is_wide)
    encode_wave<true> (steps, wave);
  else
    encode_wave<false> (steps, wave);
}

/* ---- contexts ---- */

AVX2 inline __m256i
load_bytes (const std::uint8_t *from)
{
  return _mm256_loadu_si256 (reinterpret_cast<const __m256i *> (from));
}

AVX2 inline void
store_bytes (std::uint8_t *to, __m256i v)
{
  _mm256_storeu_si256 (reinterpret_cast<__m256i *> (to), v);
}

/* PixelState's kind of each symbol. */
AVX2 inline __m256i
kinds_of (__m256i symbols)
{
  const __m128i kinds = _mm_setr_epi8 (1, 2, 2, 2, 3, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0);
  return _mm256_shuffle_epi8 (_mm256_broadcastsi128_si256 (kinds), symbols);
}

AVX2 inline void
store_contexts (std::uint16_t *to, __m128i contexts, __m128i symbols)
{
  const __m256i both = _mm256_or_si256 (
      _mm256_slli_epi16 (_mm256_cvtepu8_epi16 (contexts), 3), _mm256_cvtepu8_epi16 (symbols));
  _mm256_storeu_si256 (reinterpret_cast<__m256i *> (to), both);
}

AVX2 void
find_contexts (const WaveRow &row)
{
  for (int x = row.begin; x < row.end; x += kWaveWord) {
    const __m256i symbols = load_bytes (row.symbols + x);
    const __m256i left = kinds_of (load_bytes (row.symbols + x - 1));
    const __m256i upper_left = load_bytes (row.upper_kinds + x - 1);
    const __m256i upper = load_bytes (row.upper_kinds + x);
    const __m256i upper_right = load_bytes (row.upper_kinds + x + 1);
    const __m256i context = _mm256_or_si256 (
        _mm256_or_si256 (left, _mm256_slli_epi16 (upper, 2)), _mm256_slli_epi16 (upper_right, 4));
    const __m256i none =
        _mm256_cmpeq_epi8 (_mm256_or_si256 (context, upper_left), _mm256_setzero_si256 ());
    const __m256i all =
        _mm256_or_si256 (context, _mm256_and_si256 (none, _mm256_set1_epi8 (kNoNeighbour)));
    store_contexts (
        row.contexts + x, _mm256_castsi256_si128 (all), _mm256_castsi256_si128 (symbols));
    store_contexts (row.contexts + x + 16, _mm256_extracti128_si256 (all, 1),
        _mm256_extracti128_si256 (symbols, 1));
    store_bytes (row.kinds + x, kinds_of (symbols));
    const __m256i full = _mm256_cmpeq_epi8 (symbols, _mm256_set1_epi8 (kFull));
    const __m256i invalid = _mm256_cmpeq_epi8 (symbols, _mm256_set1_epi8 (kInvalid));
    row.full[x / kWaveWord] = static_cast<std::uint32_t> (_mm256_movemask_epi8 (full));
    row.valid[x / kWaveWord] = ~static_cast<std::uint32_t> (_mm256_movemask_epi8 (invalid));
  }
}

} // namespace

const WaveFunctions kWaveFunctionsAvx2 = {encode, find_contexts};

} // namespace rangecast
#endif
