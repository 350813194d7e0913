/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "../plain/encoder.hpp"
#include "row.hpp"
#include "wave.hpp"

namespace rangecast {

static_assert (kWaveWord == kBitsOfWord);

/** What is known of a coded row of a wave. Arrays have room on both sides of the columns. */
struct WaveRowMemory {
  std::vector<std::uint8_t> kinds;
  PixelBits valid;
};

/** Memory of an encoder for waves. The first column of all arrays is at kPixelsBefore, of bytes at
 *  kWaveWord. */
struct EncoderWaveMemory {
  struct Row {
    std::vector<PlainPixel> pixels;
    PlainSpan span;
    std::vector<std::uint8_t> symbols;
  };
  WaveSteps steps{};
  PlainPixel threshold = 0;
  std::array<Row, kWaveRows> rows; ///< row y of the partition is number y % kWaveRows
  int loaded = 0;                  ///< rows before this one
  std::vector<PlainPixel> outside; ///< a row
  std::vector<PlainPixel> upper;
  std::vector<WaveCode> upper_codes;
  WaveCode latest = 0;
  EncoderWave wave{}; ///< of the rows that were coded last
  std::vector<std::uint64_t> residuals, codes;
  WaveRowMemory now, above;
  std::vector<std::uint16_t> contexts;
  PixelBits full;
};

} // namespace rangecast
