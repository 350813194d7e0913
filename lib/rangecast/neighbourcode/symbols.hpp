/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What encoder and decoder share: the symbols of a pixel, and bits in memory. */
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

namespace rangecast {

/** One symbol a pixel; 3 bits in profile plain. 6 and 7 are reserved. */
enum Symbol : std::uint8_t {
  kLeft = 0, ///< equals the pixel to the left
  kUpperLeft = 1,
  kUpper = 2,
  kUpperRight = 3,
  kFull = 4,    ///< written in full
  kInvalid = 5, ///< has no depth
};
inline constexpr int kSymbolBits = 3;

/** Bytes that so many symbols of profile plain take. */
constexpr std::size_t
symbol_bytes (std::size_t pixels)
{
  return (pixels * kSymbolBits + 7) / 8;
}

/** Writes numbers of up to 40 bits, least significant bit first, into memory that is large enough
 *  plus 8 bytes. */
class BitWriter {
public:
  explicit BitWriter (std::uint8_t *to) : to_ (to) {}
  void put (std::uint64_t value, int bits)
  {
    held_ |= value << count_;
    count_ += bits;
    while (count_ >= 8) {
      *to_++ = static_cast<std::uint8_t> (held_);
      held_ >>= 8;
      count_ -= 8;
    }
  }
  /** Fills the last byte with zeros. @return one past it */
  std::uint8_t *finish ()
  {
    if (count_ > 0)
      *to_++ = static_cast<std::uint8_t> (held_);
    held_ = 0;
    count_ = 0;
    return to_;
  }

private:
  std::uint8_t *to_;
  std::uint64_t held_ = 0;
  int count_ = 0;
};

/** Reads numbers of up to 40 bits; past the end it gives zeros and says so. */
class BitReader {
public:
  BitReader (const std::uint8_t *from, std::size_t bytes) : from_ (from), end_ (from + bytes) {}
  std::uint64_t get (int bits)
  {
    while (count_ < bits) {
      if (from_ == end_) {
        exhausted_ = true;
        return 0;
      }
      held_ |= static_cast<std::uint64_t> (*from_++) << count_;
      count_ += 8;
    }
    const std::uint64_t value = held_ & ((std::uint64_t{1} << bits) - 1);
    held_ >>= bits;
    count_ -= bits;
    return value;
  }
  [[nodiscard]] bool exhausted () const { return exhausted_; }
  /** Nothing is left but the zero bits that fill the last byte. */
  [[nodiscard]] bool at_clean_end () const { return from_ == end_ && count_ < 8 && held_ == 0; }

private:
  const std::uint8_t *from_, *end_;
  std::uint64_t held_ = 0;
  int count_ = 0;
  bool exhausted_ = false;
};

} // namespace rangecast
