/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* A binary range coder with adaptive probabilities. docs/formats/bitstream.md says what it writes.
 */
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>

namespace rangecast {

/** Probability that a decision is yes, in 1/65536; the coder uses the upper 12 bits. It moves a
 * 32nd of the way to each outcome, and so never reaches 0 or 65536. */
using Probability = std::uint16_t;
inline constexpr int kAdaptationShift = 5;
inline constexpr std::uint32_t kMinRange = 1u << 24;
/** Zero bytes that a reader may read beyond the end of the data; more is damage. Without a limit a
 *  few bytes could keep the decoder busy for long. */
inline constexpr std::size_t kMaxOverrun = 16;

/** What one decision splits off the range for yes; at least 1 and less than the range. */
constexpr std::uint32_t
yes_part (std::uint32_t range, Probability p)
{
  return (range >> 12) * (p >> 4);
}

constexpr void
learn (Probability &p, bool yes)
{
  /* 31 makes the shift round up what p loses: it loses a whole floor (p / 32). */
  p = static_cast<Probability> (p + (((yes ? 65536 : 31) - p) >> kAdaptationShift));
}

/** Writes decisions; the interface is that of RangeDecoder, so that EntropyCode serves both. A copy
 *  continues from the point where it was taken: bytes already written do not change, because a
 *  carry only reaches the two that are held back and the 0xff bytes behind them. */
class RangeEncoder {
public:
  explicit RangeEncoder (std::uint8_t *to) : begin_ (to), to_ (to) {}

  bool code (Probability &p, bool yes)
  {
    const std::uint32_t part = yes_part (range_, p);
    low_ += yes ? 0 : part;
    range_ = yes ? part : range_ - part;
    learn (p, yes);
    normalise ();
    return yes;
  }
  /** Writes `count` bits that are as likely 0 as 1, most significant first. */
  std::uint32_t bits (std::uint32_t value, int count)
  {
    while (count-- > 0) {
      range_ >>= 1;
      low_ += value >> count & 1 ? 0 : range_;
      normalise ();
    }
    return value;
  }
  /** Upper bound of the bytes that finish() would leave: those that have left the range, and 4. */
  [[nodiscard]] std::size_t bound () const
  {
    return static_cast<std::size_t> (to_ - begin_) + 2 * pending_ + (holds_ ? 2 : 0) +
           static_cast<std::size_t> (count_) / 8 + 4;
  }
  /** Writes the fewest bytes that identify a number in the range, such that a reader goes no more
   *  than kMaxOverrun bytes beyond them. @return how many bytes there are */
  std::size_t finish ()
  {
    const std::uint64_t rest = low_ & 0xffffffffu;
    std::uint64_t value = rest;
    for (int bits = 32; bits >= 0; bits -= 8) { /* the roundest number in the range */
      const std::uint64_t mask = (std::uint64_t{1} << bits) - 1;
      value = (rest + mask) & ~mask;
      if (value < rest + range_)
        break;
    }
    low_ += value - rest;
    const std::size_t read = bound ();
    const std::size_t min = read > kMaxOverrun ? read - kMaxOverrun : 0;
    for (int i = 0; i < 4; i++) { /* all that is held back goes out, and zeros behind it */
      low_ <<= 16;
      count_ += 16;
      shift ();
    }
    auto size = read;
    while (size > min && begin_[size - 1] == 0)
      size--;
    return size;
  }

private:
  void normalise ()
  {
    const int bits = std::countl_zero (range_) & 24; /* to be at least kMinRange: 0, 8 or 16 */
    range_ <<= bits;
    low_ <<= bits;
    count_ += bits;
    if (count_ >= 16)
      shift ();
  }
  /* Moves the uppermost 16 bits of low out; they are held back as long as a carry may change them.
   */
  void shift ()
  {
    const auto out = static_cast<std::uint32_t> (low_ >> (16 + count_));
    count_ -= 16;
    low_ &= (std::uint64_t{1} << (32 + count_)) - 1;
    if (out == 0xffff) {
      pending_++;
      return;
    }
    const std::uint32_t carry = out >> 16;
    if (holds_)
      write (held_ + carry);
    for (; pending_ > 0; pending_--)
      write (0xffff + carry);
    holds_ = true;
    held_ = out & 0xffff;
  }
  void write (std::uint32_t bits)
  {
    *to_++ = static_cast<std::uint8_t> (bits >> 8);
    *to_++ = static_cast<std::uint8_t> (bits);
  }

  std::uint8_t *begin_, *to_;
  std::uint64_t low_ =
      0; /* 32 bits, above them count_ more that have left the range, and a carry */
  std::uint32_t range_ = 0xffffffff;
  int count_ = 0;           /* 0 or 8 between decisions */
  std::size_t pending_ = 0; /* pairs of bytes 0xff behind the held one */
  bool holds_ = false;
  std::uint32_t held_ = 0; /* two bytes */
};

/** Reads decisions; beyond the end it reads zeros. The second argument of code() and the first of
 *  bits() are what an encoder writes. */
class RangeDecoder {
public:
  RangeDecoder (const std::uint8_t *from, std::size_t bytes) : from_ (from), end_ (from + bytes)
  {
    for (int i = 0; i < 4; i++)
      code_ = code_ << 8 | next_byte ();
  }
  [[gnu::always_inline]] bool code (Probability &p, bool = false)
  {
    const std::uint32_t part = yes_part (range_, p);
    if (code_ < part) {
      range_ = part;
      learn (p, true);
      normalise ();
      return true;
    }
    code_ -= part;
    range_ -= part;
    learn (p, false);
    normalise ();
    return false;
  }
  std::uint32_t bits (std::uint32_t, int count)
  {
    std::uint32_t value = 0;
    while (count-- > 0) {
      range_ >>= 1;
      const bool one = code_ < range_;
      code_ -= one ? 0 : range_;
      value = value << 1 | one;
      normalise ();
    }
    return value;
  }
  /** Every byte has been read. */
  [[nodiscard]] bool at_end () const { return from_ == end_; }
  /** More has been read than an encoder leaves out. */
  [[nodiscard]] bool overrun () const { return overrun_ > kMaxOverrun; }

private:
  std::uint32_t next_byte ()
  {
    if (from_ != end_)
      return *from_++;
    overrun_++;
    return 0;
  }
  void normalise ()
  {
    while (range_ < kMinRange) {
      range_ <<= 8;
      code_ = code_ << 8 | next_byte ();
    }
  }

  const std::uint8_t *from_, *end_;
  std::uint32_t range_ = 0xffffffff, code_ = 0;
  std::size_t overrun_ = 0;
};

} // namespace rangecast
