/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Asymmetric numeral systems (rANS) with several states, so that a processor decodes several
 * symbols at a time. docs/formats/bitstream.md defines what is read; the writer starts at its end.
 */
#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <numbers>

#include "symbol_model.hpp"

namespace rangecast {

inline constexpr int kRansStates = 2;
/** States are at least this and below 2^16 times this. */
inline constexpr std::uint64_t kMinRansState = 1u << 20;
/** Bytes of the states at the beginning. */
inline constexpr std::size_t kRansHeaderSize = 4 * kRansStates;
/** Raw bits that are coded at once. */
inline constexpr int kMaxRawBits = 15;

/** Collects symbols and writes them at the end of the slice. A copy continues from the point where
 * it was taken, as long as it alone is used from then on. */
class RansEncoder {
public:
  /** @param entries  memory, see room() */
  explicit RansEncoder (std::uint32_t *entries) : begin_ (entries), to_ (entries) {}

  /** Moves to other memory, which holds what there is. */
  void move_to (std::uint32_t *entries)
  {
    to_ = entries + (to_ - begin_);
    begin_ = entries;
  }
  /** Numbers that are in use. */
  [[nodiscard]] std::size_t entries () const { return static_cast<std::size_t> (to_ - begin_); }

  [[gnu::always_inline]] void put (unsigned state, SymbolInterval interval)
  {
    *to_++ = interval.start | interval.frequency << kFrequencyBits | state << 2 * kFrequencyBits;
    cost_ += kCosts[interval.frequency >> kCostShift];
  }
  template <int kSymbols>
  [[gnu::always_inline]] void code (
      unsigned state, SymbolModel<kSymbols> &model, std::size_t symbol)
  {
    put (state, model.interval (symbol));
    model.learn (symbol);
  }
  /** 0 to kMaxRawBits bits. */
  void raw (unsigned state, std::uint32_t value, int bits)
  {
    if (bits == 0)
      return;
    const int rest = kFrequencyBits - bits;
    *to_++ = value << rest | 1u << rest << kFrequencyBits | state << 2 * kFrequencyBits;
    cost_ += static_cast<std::uint32_t> (bits * kCostOfBit + kCostOfRaw);
  }

  /** Upper bound of the bytes that finish() would leave: of each state, 36 bits more than its
   *  symbols cost, rounded up. */
  [[nodiscard]] std::size_t bound () const
  {
    return kRansHeaderSize + 3 + static_cast<std::size_t> (cost_ / (8 * kCostOfBit));
  }
  /** Writes at most bound() bytes. @return how many */
  std::size_t finish (std::uint8_t *to) const
  {
    std::uint8_t *const end = to + (bound () & ~std::size_t{1});
    std::uint8_t *at = end;
    const auto word = [&] (std::uint64_t value) {
      *--at = static_cast<std::uint8_t> (value >> 8);
      *--at = static_cast<std::uint8_t> (value);
    };
    std::uint64_t states[kRansStates];
    for (std::uint64_t &state : states)
      state = kMinRansState;
    for (const std::uint32_t *from = to_; from != begin_;) {
      const std::uint32_t entry = *--from;
      const std::uint32_t start = entry & (kFrequencySum - 1);
      const std::uint32_t frequency = entry >> kFrequencyBits & (kFrequencySum - 1);
      std::uint64_t x = states[entry >> 2 * kFrequencyBits];
      if (x >= std::uint64_t{frequency} * (kMinRansState >> kFrequencyBits << 16)) {
        word (x);
        x >>= 16;
      }
      states[entry >> 2 * kFrequencyBits] =
          (x / frequency << kFrequencyBits) + x % frequency + start;
    }
    for (int i = kRansStates; i-- > 0;) /* a reader takes the first state first */
      if (states[i] >> 32 != 0) {
        word (states[i]);
        states[i] >>= 16;
      }
    for (int i = kRansStates; i-- > 0;) {
      word (states[i] >> 16);
      word (states[i]);
    }
    const auto size = static_cast<std::size_t> (end - at);
    std::memmove (to, at, size);
    return size;
  }

  /** What an interval costs, bits. */
  [[nodiscard]] static float bits_of (SymbolInterval interval)
  {
    return static_cast<float> (kCosts[interval.frequency >> kCostShift]) * (1.0f / kCostOfBit);
  }

private:
  static constexpr int kCostOfBit = 1024, kCostShift = 6;
  static constexpr int kCostOfRaw = 47; /* max_excess (0) */
  /* Upper bounds, by frequency. Coding a symbol of probability p turns a state x, which is at least
   * p kMinRansState after a word has been written, into at most x / p + (1 - p) 2^15, see finish().
   * So it costs at most max_excess() more than -log2 (p) bits. */
  static constexpr double max_excess (double p)
  {
    return (1 - p) * kFrequencySum / kMinRansState / std::numbers::ln2;
  }
  static const std::array<std::uint16_t, (kFrequencySum >> kCostShift)> kCosts;

  std::uint32_t *begin_, *to_;
  std::uint64_t cost_ = 0;
};

/** Reads symbols. Beyond the end it reads zeros, and overrun() is true. */
class RansDecoder {
public:
  /** @param bytes  at least kRansHeaderSize */
  RansDecoder (const std::uint8_t *from, std::size_t bytes) : from_ (from), end_ (from + bytes)
  {
    for (std::uint64_t &state : states_) {
      state = word ();
      state |= std::uint64_t{word ()} << 16;
    }
    for (std::uint64_t &state : states_)
      refill (state);
  }

  /** @return the symbol */
  template <int kSymbols>
  [[gnu::always_inline]] std::size_t code (unsigned state, SymbolModel<kSymbols> &model)
  {
    std::uint64_t &x = states_[state];
    const auto number = static_cast<std::uint32_t> (x & (kFrequencySum - 1));
    const std::size_t symbol = model.find (number);
    const SymbolInterval interval = model.interval (symbol);
    model.learn (symbol);
    x = interval.frequency * (x >> kFrequencyBits) + number - interval.start;
    refill (x);
    return symbol;
  }
  std::uint32_t raw (unsigned state, int bits)
  {
    std::uint64_t &x = states_[state];
    const int rest = kFrequencyBits - bits;
    const auto number = static_cast<std::uint32_t> (x & (kFrequencySum - 1));
    x = (x >> kFrequencyBits << rest) + (number & ((1u << rest) - 1));
    refill (x);
    return number >> rest;
  }

  [[nodiscard]] bool overrun () const { return overrun_; }
  /** Everything has been read, and the states are those that an encoder begins with. */
  [[nodiscard]] bool at_clean_end () const
  {
    bool clean = from_ == end_ && !overrun_;
    for (const std::uint64_t state : states_)
      clean &= state == kMinRansState;
    return clean;
  }

private:
  std::uint32_t word ()
  {
    if (end_ - from_ < 2) {
      overrun_ = true;
      return 0;
    }
    const std::uint32_t value = from_[0] | from_[1] << 8;
    from_ += 2;
    return value;
  }
  [[gnu::always_inline]] void refill (std::uint64_t &x)
  {
    if (x < kMinRansState) [[unlikely]]
      x = x << 16 | word ();
  }

  std::uint64_t states_[kRansStates];
  const std::uint8_t *from_, *end_;
  bool overrun_ = false;
};

} // namespace rangecast
