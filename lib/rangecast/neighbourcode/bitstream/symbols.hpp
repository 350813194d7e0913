/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The symbols of profile plain, and bits in memory. */
#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

namespace rangecast {

static_assert (std::endian::native == std::endian::little,
    "bits, pixels and points are used as they lie in memory");

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

/** Bytes that the symbols of so many pixels take in profile plain. */
constexpr std::size_t
symbol_bytes (std::size_t pixels)
{
  return (pixels * kSymbolBits + 7) / 8;
}

/** Eight bytes as one number, the first the least significant. */
inline std::uint64_t
load_little_endian (const std::uint8_t *from)
{
  std::uint64_t value;
  std::memcpy (&value, from, sizeof value);
  return value;
}

inline void
store_little_endian (std::uint64_t value, std::uint8_t *to)
{
  std::memcpy (to, &value, sizeof value);
}

/** Writes numbers of up to 56 bits, least significant bit first. The memory needs 8 bytes more than
 *  the result. It is complete after each call; the last byte is filled with zeros. */
class BitWriter {
public:
  /** Continues after the first `bits` of `to`, which another writer wrote. */
  explicit BitWriter (std::uint8_t *to, std::size_t bits = 0)
      : to_ (to + bits / 8), held_ (bits % 8 ? *to_ : 0), count_ (static_cast<int> (bits % 8))
  {
  }
  /** @param value  less than 2^bits */
  void put (std::uint64_t value, int bits)
  {
    held_ |= value << count_;
    store_little_endian (held_, to_);
    count_ += bits;
    to_ += count_ >> 3;
    held_ >>= count_ & ~7; /* 56 at most, as 7 + 56 are held at most */
    count_ &= 7;
  }

private:
  std::uint8_t *to_;
  std::uint64_t held_; /* bits of the last byte, while it is not full */
  int count_;          /* how many; 0 to 7 */
};

/** Random access to bits in memory; beyond the end they are 0. */
class LittleEndianBits {
public:
  explicit LittleEndianBits (std::span<const std::uint8_t> bytes) : bytes_ (bytes) {}
  [[nodiscard]] std::size_t size () const { return 8 * bytes_.size (); }
  /** At least 57 bits from bit `at` on, which is at most the end. */
  [[nodiscard]] std::uint64_t from (std::size_t at) const
  {
    const std::size_t byte = at / 8, rest = bytes_.size () - byte;
    if (rest >= 8) [[likely]]
      return load_little_endian (bytes_.data () + byte) >> at % 8;
    std::uint8_t last[8] = {};
    std::copy_n (bytes_.data () + byte, rest, last);
    return load_little_endian (last) >> at % 8;
  }
  /** The data is `bits` long and zeros fill its last byte. */
  [[nodiscard]] bool end_after (std::size_t bits) const
  {
    return bytes_.size () == (bits + 7) / 8 && (bits % 8 == 0 || bytes_.back () >> bits % 8 == 0);
  }

private:
  std::span<const std::uint8_t> bytes_;
};

} // namespace rangecast
