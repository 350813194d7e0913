/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Adaptive frequencies of symbols. docs/formats/bitstream.md says how they change. */
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>

#if defined __SSE2__
#include <emmintrin.h>
#endif

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

/** @name Starts of 7 or 15 symbols' intervals, and the end of the last @{ */
typedef std::int16_t EightStarts __attribute__ ((vector_size (16), may_alias));
typedef std::int16_t SixteenStarts __attribute__ ((vector_size (32), may_alias));
template <int kSymbols> struct StartsOf;
template <> struct StartsOf<7> {
  typedef EightStarts Vector;
};
template <> struct StartsOf<15> {
  typedef SixteenStarts Vector;
};
/** @} */

/** @name Twice the number of the first start that is greater; the last counts as greater @{ */
#if defined __SSE2__
[[gnu::always_inline]] inline unsigned
first_greater (const EightStarts *starts, std::int16_t number)
{
  const auto greater = reinterpret_cast<__m128i> (starts[0] > number);
  const auto bits = static_cast<unsigned> (_mm_movemask_epi8 (greater)); /* two each */
  return static_cast<unsigned> (std::countr_zero (bits | 3u << 14));
}
[[gnu::always_inline]] inline unsigned
first_greater (const SixteenStarts *starts, std::int16_t number)
{
  const auto eight = reinterpret_cast<const EightStarts *> (starts);
  const __m128i greater = _mm_packs_epi16 (
      reinterpret_cast<__m128i> (eight[0] > number), reinterpret_cast<__m128i> (eight[1] > number));
  const auto bits = static_cast<unsigned> (_mm_movemask_epi8 (greater));
  return 2 * static_cast<unsigned> (std::countr_zero (bits | 1u << 15));
}
#else
[[gnu::always_inline]] inline unsigned
first_greater (const EightStarts *starts, std::int16_t number)
{
  typedef std::int8_t Bytes __attribute__ ((vector_size (8)));
  const Bytes bytes = __builtin_convertvector(*starts > number, Bytes);
  std::uint64_t bits;
  std::memcpy (&bits, &bytes, sizeof bits);
  return static_cast<unsigned> (std::countr_zero (bits | std::uint64_t{1} << 63)) / 8 * 2;
}
[[gnu::always_inline]] inline unsigned
first_greater (const SixteenStarts *starts, std::int16_t number)
{
  typedef std::int8_t Bytes __attribute__ ((vector_size (16)));
  typedef std::uint16_t Pairs __attribute__ ((vector_size (16)));
  typedef std::uint8_t Halves __attribute__ ((vector_size (8)));
  const Bytes bytes = __builtin_convertvector(*starts > number, Bytes);
  /* Four bits of each. */
  const Halves halves = __builtin_convertvector(reinterpret_cast<Pairs> (bytes) >> 4, Halves);
  std::uint64_t bits;
  std::memcpy (&bits, &halves, sizeof bits);
  return static_cast<unsigned> (std::countr_zero (bits | std::uint64_t{1} << 63)) / 4 * 2;
}
#endif
/** @} */

/** Frequencies of symbols 0 to kSymbols - 1, which are 7 or 15, as the starts of their intervals
 *  and the end of the last, 2^15: one or two vectors of the simplest processors. */
template <int kSymbols> struct alignas (2 * (kSymbols + 1)) SymbolModel {
  static_assert (kSymbols == 7 || kSymbols == 15);
  typedef typename StartsOf<kSymbols>::Vector Vector;

  std::uint16_t starts[kSymbols + 1];

  [[nodiscard, gnu::always_inline]] SymbolInterval interval (std::size_t symbol) const
  {
    const std::uint32_t start = starts[symbol];
    return {start, starts[symbol + 1] - start};
  }

  /** The symbol whose interval holds a number below 2^15: twice it plus 2. Loops keep it so,
   * because it is the place of the interval's end in bytes. */
  [[nodiscard, gnu::always_inline]] std::size_t find (std::uint32_t number) const
  {
    if constexpr (std::endian::native == std::endian::big) {
      std::size_t next = 1;
      while (next < kSymbols && starts[next] <= number)
        next++;
      return 2 * next;
    }
    /* 2^15 is negative there. */
    return first_greater (
        reinterpret_cast<const Vector *> (starts), static_cast<std::int16_t> (number));
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
