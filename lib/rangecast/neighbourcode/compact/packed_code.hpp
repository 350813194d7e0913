/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Profile packed: run lengths and fixed prefix codes. */
#pragma once

#include <bit>

#include "../bitstream/symbols.hpp"
#include "entropy_code.hpp"

namespace rangecast {

inline constexpr int kPackedContexts = 64;
inline constexpr int kMaxChoiceBits = 5;
inline constexpr int kMaxPatternBits = 7;
/** Bits of the greatest number that an exponential Golomb code holds; a greater one is damage. */
inline constexpr int kMaxGolombBits = 18;
/** Golomb orders of run ends and of depth motion. */
inline constexpr int kRunOrder = 1, kMotionOrder = 1;

/** Lengths of the codes in bits, 0 = no code. Part of the format. */
extern const std::array<std::array<std::uint8_t, kChoices>, kPackedContexts> kChoiceLengths;
/** Codes of the pattern of non-zero components of a residual: the second is for slices whose steps
 * are all 1, where few components are 0. */
inline constexpr std::size_t kPatternCodes = 2;
extern const std::array<std::array<std::uint8_t, 16>, kPatternCodes> kPatternLengths;

/** The residual codes of a packed slice. */
struct ResidualCodes {
  GolombOrders orders;
  bool exact; ///< all steps are 1
};

struct PrefixCode {
  std::uint16_t bits = 0;
  std::uint8_t length = 0;
};

/** The exponential Golomb code of a number below 2^kMaxGolombBits. */
struct GolombCode {
  std::uint64_t bits;
  int length;

  constexpr GolombCode (std::uint32_t value, int order)
  {
    const std::uint64_t upper = (value >> order) + 1;
    const int width = std::bit_width (upper) - 1;
    const std::uint64_t top = std::uint64_t{1} << width;
    const std::uint64_t low = value & ((std::uint64_t{1} << order) - 1);
    bits = top | (upper ^ top) << (width + 1) | low << (2 * width + 1);
    length = 2 * width + 1 + order;
  }
};

/** Result of reading bits that are no code. */
inline constexpr int kNoSymbol = 16;

/** Residuals up to this magnitude are written by table; codes up to so many bits are read by one.
 */
inline constexpr int kMaxQuickSize = 31, kQuickBits = 9;

/** The codes and the tables to read them, built once from the lengths. */
struct PackedTables {
  /** Sign and size of a residual; no bits for 0. */
  struct QuickCode {
    std::uint32_t bits : 24, length : 8;
  };
  /** A residual that is known from the next kQuickBits bits; length 0: it is not. */
  struct QuickEntry {
    std::int16_t residual = 0;
    std::uint16_t length = 0;
  };
  struct Entry {
    std::uint8_t symbol = kNoSymbol, length = 1;
  };
  std::array<std::array<PrefixCode, kChoices>, kPackedContexts> choice;
  std::array<std::array<PrefixCode, 16>, kPatternCodes> pattern;
  std::array<std::array<Entry, 1 << kMaxChoiceBits>, kPackedContexts> choice_of;
  std::array<std::array<Entry, 1 << kMaxPatternBits>, kPatternCodes> pattern_of;
  /* For each order. */
  std::array<std::array<QuickCode, 2 * kMaxQuickSize + 1>, 16> quick;
  std::array<std::array<QuickEntry, 1 << kQuickBits>, 16> quick_of;
};
const PackedTables &packed_tables ();

constexpr std::uint32_t
zigzag (std::int32_t v)
{
  return static_cast<std::uint32_t> (v) << 1 ^ static_cast<std::uint32_t> (v >> 31);
}

constexpr std::int32_t
unzigzag (std::uint32_t v)
{
  return static_cast<std::int32_t> (v >> 1) ^ -static_cast<std::int32_t> (v & 1);
}

/** Writes the choices and residuals of a slice. A copy continues from where it was taken. */
class PackedWriter {
public:
  static constexpr bool kUsesActivity = false;
  static constexpr bool kEarlierInRuns = true, kByRow = false;

  PackedWriter (std::uint8_t *to, const ResidualCodes &codes)
      : begin_ (to), to_ (to), orders_ (codes.orders), exact_ (codes.exact),
        tables_ (&packed_tables ())
  {
  }

  /** Columns by which a run ends later than the one above: of valid or invalid pixels, or of pixels
   *  that equal those of the earlier frame set or do not. */
  void run (bool, std::int32_t later) { golomb (zigzag (later), kRunOrder); }
  /** Motion of a block, relative to `expected`. */
  void motion (const BlockMotion &expected, const BlockMotion &m)
  {
    put (m == expected, 1);
    if (m == expected)
      return;
    for (const auto member : kMotionMembers)
      golomb (zigzag (m.*member - expected.*member), kMotionOrder);
  }
  [[gnu::always_inline]] void choice (const Neighbours &n, int chosen)
  {
    const PrefixCode code = tables_->choice[n.kinds ()][static_cast<std::size_t> (chosen)];
    put (code.bits, code.length);
  }
  /** A pixel that equals no neighbour; its residual may be 0 if there is a neighbour. */
  [[gnu::always_inline]] void full (const Neighbours &n, bool has_neighbour, Components r)
  {
    const Components sizes = r < 0 ? -r : r;
    const auto pattern = static_cast<std::size_t> (
        (r[0] != 0) | (r[1] != 0) << 1 | (r[2] != 0) << 2 | (r[3] != 0) << 3);
    std::uint64_t bits = 0;
    int length = 0;
    const auto add = [&] (std::uint64_t more, int count) {
      bits |= more << length;
      length += count;
    };
    if (has_neighbour) [[likely]] {
      const PrefixCode choice = tables_->choice[n.kinds ()][pattern == 0 ? kPredict : kCorrect];
      add (choice.bits, choice.length);
    }
    const PrefixCode code = tables_->pattern[exact_][pattern];
    if (pattern != 0 || !has_neighbour)
      add (code.bits, code.length);
    if (!is_zero (sizes > kMaxQuickSize)) [[unlikely]] {
      put (bits, length);
      long_residual (r, static_cast<unsigned> (pattern));
      return;
    }
    const auto quick = [&] (int i) {
      const auto code = tables_->quick[orders_[static_cast<std::size_t> (i)]]
                                      [static_cast<std::size_t> (r[i] + kMaxQuickSize)];
      add (code.bits, code.length);
    };
    quick (0);
    quick (1);
    put (bits, length);
    bits = 0;
    length = 0;
    quick (2);
    quick (3);
    put (bits, length);
  }
  /** @name What choices and residuals would cost, bits @{ */
  /** Of the left neighbour, which is valid: to take it, and at least to take another. */
  [[nodiscard]] std::pair<float, float> left_bits (const Neighbours &n) const
  {
    return {float (tables_->choice[n.kinds ()][kTakeLeft].length), 1};
  }
  template <bool Delta> [[nodiscard]] ChoiceBits choice_bits (const Neighbours &n) const
  {
    ChoiceBits bits;
    bits.fill (kImpossible);
    bits[kCorrect] = 0;
    if (n.any ())
      for (std::size_t i = 0; i < kChoices; i++)
        if (const int length = tables_->choice[n.kinds ()][i].length; length > 0)
          bits[i] = float (length);
    return bits;
  }
  [[nodiscard]] float residual_bits (const Neighbours &, bool, Components r) const
  {
    const auto pattern = static_cast<std::size_t> (
        (r[0] != 0) | (r[1] != 0) << 1 | (r[2] != 0) << 2 | (r[3] != 0) << 3);
    int bits = tables_->pattern[exact_][pattern].length;
    for (int i = 0; i < kComponents; i++)
      if (r[i] != 0) {
        const int order = orders_[static_cast<std::size_t> (i)];
        const auto size = static_cast<std::uint32_t> (std::abs (r[i])) - 1;
        bits += 2 + order + 2 * (std::bit_width ((size >> order) + 1) - 1);
      }
    return float (bits);
  }
  /** @} */
  /** The bytes that finish() returns. */
  [[nodiscard]] std::size_t bound () const
  {
    return static_cast<std::size_t> (to_ - begin_) + (count_ > 0);
  }
  std::size_t finish ()
  {
    put (0, 0); /* again, because a copy may have overwritten the last byte */
    return bound ();
  }

private:
  /* Up to 56 bits. Writes eight bytes; the next call overwrites those that are not full. */
  [[gnu::always_inline]] void put (std::uint64_t value, int bits)
  {
    held_ |= value << count_;
    count_ += bits;
    store_little_endian (held_, to_);
    to_ += count_ >> 3;
    held_ >>= count_ & ~7;
    count_ &= 7;
  }
  void long_residual (Components r, unsigned pattern)
  {
    for (; pattern != 0; pattern &= pattern - 1) {
      const int i = std::countr_zero (pattern);
      put (r[i] < 0, 1);
      golomb (
          static_cast<std::uint32_t> (std::abs (r[i])) - 1, orders_[static_cast<std::size_t> (i)]);
    }
  }
  void golomb (std::uint32_t value, int order)
  {
    const GolombCode code (value, order);
    put (code.bits, code.length);
  }

  std::uint8_t *begin_, *to_;
  std::uint64_t held_ = 0;
  int count_ = 0; /* below 8 between calls */
  GolombOrders orders_;
  bool exact_;
  const PackedTables *tables_;
};

/** Reads what a PackedWriter wrote. Beyond the end it reads zeros, so long loops must check
 *  overrun(). */
class PackedReader {
public:
  /** Zero bytes that must follow the data in memory. */
  static constexpr std::size_t kPadding = 16;

  PackedReader (const std::uint8_t *from, std::size_t bytes, const ResidualCodes &codes)
      : from_ (from), end_ (from + bytes), orders_ (codes.orders), exact_ (codes.exact),
        tables_ (&packed_tables ())
  {
  }

  bool run (bool, std::int32_t &later)
  {
    std::uint32_t value = 0;
    const bool good = golomb (kRunOrder, value);
    later = unzigzag (value);
    return good && !overrun ();
  }
  bool motion (const BlockMotion &expected, BlockMotion &m)
  {
    refill ();
    m = expected;
    if (take (1))
      return true;
    for (const auto member : kMotionMembers) {
      std::uint32_t rest = 0;
      if (!golomb (kMotionOrder, rest))
        return false;
      m.*member += unzigzag (rest);
    }
    return true;
  }
  /** A PixelChoice, or kNoSymbol for damage. */
  [[gnu::always_inline]] int choice (const Neighbours &n)
  {
    return get (tables_->choice_of[n.kinds ()], kMaxChoiceBits);
  }
  [[gnu::always_inline]] bool residual (Components &r)
  {
    const int pattern = get (tables_->pattern_of[exact_], kMaxPatternBits);
    bool good = pattern != kNoSymbol;
    const auto number = [&] (int i) {
      const int order = orders_[static_cast<std::size_t> (i)];
      const std::uint32_t there = -(static_cast<std::uint32_t> (pattern) >> i & 1);
      const auto quick =
          tables_->quick_of[static_cast<std::size_t> (order)][held_ & ((1u << kQuickBits) - 1)];
      if (there & !quick.length) [[unlikely]]
        return long_residual (order, good);
      /* The same as quick.length, but sooner: the next number waits for it. */
      const int length = 2 + order + 2 * std::countr_zero (held_ >> 1 | std::uint64_t{1} << 63);
      consume (static_cast<int> (there) & length);
      return static_cast<std::int32_t> (there) & quick.residual;
    };
    refill ();
    const std::int32_t z = number (0), y = number (1), co = number (2);
    refill ();
    const std::int32_t cg = number (3);
    r = Components{z, y, co, cg};
    return good;
  }
  /** More was read than there is. */
  [[nodiscard]] bool overrun () const { return left () < 0; }
  /** All was read, exactly, up to the zero bits that fill the last byte. */
  [[nodiscard]] bool at_clean_end () const
  {
    const std::ptrdiff_t bits = left ();
    return bits == 0 || (bits > 0 && bits < 8 && end_[-1] >> (8 - bits) == 0);
  }

private:
  template <std::size_t N>
  [[gnu::always_inline]] int get (const std::array<PackedTables::Entry, N> &table, int max_bits)
  {
    if (count_ < max_bits)
      refill ();
    const PackedTables::Entry e = table[held_ & ((1u << max_bits) - 1)];
    consume (e.length);
    return e.symbol;
  }
  std::int32_t long_residual (int order, bool &good)
  {
    refill ();
    const bool negative = held_ & 1;
    consume (1);
    std::uint32_t size = 0;
    good &= golomb (order, size);
    refill ();
    const auto r = static_cast<std::int32_t> (size) + 1;
    return negative ? -r : r;
  }
  bool golomb (int order, std::uint32_t &value)
  {
    refill ();
    const int width = std::countr_zero (held_);
    if (width > kMaxGolombBits)
      return false;
    consume (width + 1);
    const std::uint32_t upper = (1u << width) + take (width) - 1;
    if (upper >> (kMaxGolombBits - order))
      return false;
    refill ();
    value = upper << order | take (order);
    return true;
  }
  std::uint32_t take (int bits)
  {
    const auto value = static_cast<std::uint32_t> (held_ & ((std::uint64_t{1} << bits) - 1));
    consume (bits);
    return value;
  }
  /* At least 56 bits are held afterwards. */
  [[gnu::always_inline]] void refill ()
  {
    held_ |= load_little_endian (from_) << count_;
    from_ = std::min (from_ + ((63 - count_) >> 3), end_ + 8);
    count_ |= 56;
  }
  void consume (int bits)
  {
    held_ >>= bits;
    count_ -= bits;
  }
  /* Bits that have not been read; negative if more was read than there is. */
  [[nodiscard]] std::ptrdiff_t left () const { return 8 * (end_ - from_) + count_; }

  const std::uint8_t *from_, *end_;
  std::uint64_t held_ = 0; /* bits from count_ upwards are those of the next bytes, or zeros */
  int count_ = 0;
  GolombOrders orders_;
  bool exact_;
  const PackedTables *tables_;
};

} // namespace rangecast
