/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Adaptive frequencies of symbols. docs/formats/bitstream.md says how they change. */
#pragma once

#include <cstddef>
#include <cstdint>

namespace rangecast {

/** The sum of the frequencies of a model's symbols is 2^15. */
inline constexpr int kFrequencyBits = 15;
inline constexpr std::uint32_t kFrequencySum = 1u << kFrequencyBits;
/** A symbol's frequency moves a 32nd of the way to what it would be if the symbol always came, and
 * never falls below this. */
inline constexpr int kAdaptationShift = 5;
inline constexpr std::uint32_t kMinFrequency = 4;

/** The interval of a symbol, or of raw bits. */
struct SymbolInterval {
  std::uint32_t start, frequency;
};

/** Frequencies of symbols 0 to kSymbols - 1, which are 7 or 15, as the starts of their intervals
 *  and the end of the last, 2^15: one or two vectors of the simplest processors. */
template <int kSymbols> struct alignas (2 * (kSymbols + 1)) SymbolModel {
  static_assert (kSymbols == 7 || kSymbols == 15);
  typedef std::int16_t Vector __attribute__ ((vector_size (2 * (kSymbols + 1)), may_alias));

  std::uint16_t starts[kSymbols + 1];

  [[nodiscard, gnu::always_inline]] SymbolInterval interval (std::size_t symbol) const
  {
    const std::uint32_t start = starts[symbol];
    return {start, starts[symbol + 1] - start};
  }

  /** The symbol whose interval holds a number below 2^15. */
  [[nodiscard, gnu::always_inline]] std::size_t find (std::uint32_t number) const
  {
    std::uint16_t symbol = 0; /* counted without jumps, which would be unpredictable */
    for (int i = 1; i < kSymbols; i++)
      symbol += starts[i] <= number;
    return symbol;
  }

  [[gnu::always_inline]] void learn (std::size_t symbol)
  {
    Vector &now = *reinterpret_cast<Vector *> (starts);
    const Vector &target = *reinterpret_cast<const Vector *> (kTargets.starts[symbol]);
    now += (target - now) >> kAdaptationShift;
  }

private:
  /* What the starts move towards when a symbol comes: all other symbols have the least frequency.
   */
  struct Targets {
    alignas (Vector) std::uint16_t starts[kSymbols][kSymbols + 1];
  };
  static constexpr Targets kTargets = [] {
    Targets targets{};
    for (unsigned symbol = 0; symbol < kSymbols; symbol++)
      for (unsigned i = 0; i <= kSymbols; i++)
        targets.starts[symbol][i] = static_cast<std::uint16_t> (
            i <= symbol ? i * kMinFrequency : kFrequencySum - (kSymbols - i) * kMinFrequency);
    return targets;
  }();
};

} // namespace rangecast
