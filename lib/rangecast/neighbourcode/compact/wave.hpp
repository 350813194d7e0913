/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Several rows of the compact profiles at once, each some columns behind the one above it, where
 * the processor can. The result is that of the row-by-row loops of CompactEncoder and
 * CompactDecoder. */
#pragma once

#include "../plain/functions.hpp"
#include "coded_pixel.hpp"

namespace rangecast {

/** Rows of a wave, and how many columns each is behind the one above it. */
inline constexpr int kWaveRows = 4, kWaveLag = 3;
inline constexpr int kWaveColumnsBehind = kWaveLag * (kWaveRows - 1);

/** A pixel or a residual of a wave: Y, Co, Cg, depth, 16 bits each, Y in the least significant. */
using WaveCode = std::uint64_t;

/** What waves change in the depth of pixels, as codes and as PlainPixel, so that it has a sign as
 * the other numbers. */
inline constexpr WaveCode kWaveDepthSign = WaveCode{0x8000} << 48;

inline WaveCode
wave_code (Components c)
{
  const auto part = [] (std::int32_t v) { return WaveCode{static_cast<std::uint16_t> (v)}; };
  return part (c[1]) | part (c[2]) << 16 | part (c[3]) << 32 | part (c[0]) << 48;
}
inline WaveCode
wave_pixel (Components c)
{
  return wave_code (c) ^ kWaveDepthSign;
}

inline Components
components_of_wave (WaveCode code)
{
  const auto part = [&] (
                        int i) { return std::int32_t{static_cast<std::int16_t> (code >> 16 * i)}; };
  return Components{part (3), part (0), part (1), part (2)};
}

/** How a wave quantises residuals. */
struct WaveSteps {
  WaveCode steps, halves, reciprocals; ///< halves: (step - 1) / 2; reciprocals: of the steps, in
                                       ///< 1/32768, rounded, at most 32767
  WaveCode min, max;                   ///< of pixels
  PlainPixel min_rgb, max_rgb;         ///< of pixels as R, G, B, depth, with kWaveDepthSign
  bool is_wide;                        ///< differences of depths may have more than 16 bits
};

/** The greatest step and depth threshold that waves can do. */
inline constexpr std::int32_t kMaxWaveNumber = 32767;

/** Rows of the encoder. */
struct EncoderWave {
  const PlainPixel *rows[kWaveRows]; ///< quantised, with invalid pixels on both sides; missing
                                     ///< ones are rows of outside pixels
  int last_row;                      ///< the last that is not missing
  PlainPixel *upper; ///< in: the coded row above, with kWaveDepthSign; out, from begin to end: the
                     ///< last row, coded
  WaveCode *upper_codes;            ///< the same as codes; of invalid pixels, anything
  int begin, end;                   ///< elsewhere all pixels of the rows are invalid
  PlainPixel threshold;             ///< in all four numbers
  WaveCode latest[kWaveRows];       ///< in: for each row, the latest valid pixel before it, if its
                                    ///< first has no neighbour; out: after it
  std::uint8_t *symbols[kWaveRows]; ///< out: a Symbol for each column from begin to end, and
                                    ///< kInvalid for up to 16 more on both sides
  bool overflow;                    ///< out: such a difference occurred; the results are wrong
  WaveCode *residuals;              ///< out: of full pixels; of others, anything

  /** Those of a row's first column; the next column's are kWaveRows numbers on. */
  [[nodiscard]] const WaveCode *residuals_of (int row) const
  {
    return residuals + kWaveRows * (kWaveLag * row - begin) + row;
  }
};

/** A context of pixels in profile packed: kind (L) + 4 kind (U) + 16 kind (UR), or this. */
inline constexpr std::uint8_t kNoNeighbour = 64;

/** Rows of symbols are handled so many columns at a time: a word of PixelBits. */
inline constexpr int kWaveWord = 32;

/** A row of symbols and what follows from them. Up to a word more may be read and written, and a
 * column before. */
struct WaveRow {
  const std::uint8_t *symbols, *upper_kinds; ///< kinds as PixelState has them
  std::uint8_t *kinds;
  std::uint16_t *contexts;     ///< of each pixel, times 8, plus its symbol
  std::uint32_t *full, *valid; ///< a bit for each column
  int begin, end;              ///< columns; begin is a multiple of kWaveWord
};

struct WaveFunctions {
  /** Codes rows: neighbours, as the first that is near enough, and residuals. */
  void (*encode) (const WaveSteps &steps, EncoderWave &wave);
  void (*find_contexts) (const WaveRow &row);
};

/** nullptr where rows are coded one at a time. */
const WaveFunctions *wave_functions (CpuLevel level);

#if defined __x86_64__
extern const WaveFunctions kWaveFunctionsAvx2;
#endif

} // namespace rangecast
