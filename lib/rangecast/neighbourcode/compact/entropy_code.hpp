/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Profile entropy: each decision of a pixel is coded with the probability of its context. */
#pragma once

#include "motion.hpp"
#include "range_coder.hpp"

namespace rangecast {

/** Index of the first context of each kind of decision among a slice's probabilities. */
namespace context {
inline constexpr int kRunExact = 0;            /* of invalid and of valid pixels */
inline constexpr int kRunSize = kRunExact + 2; /* 16 each */
inline constexpr int kLeft = kRunSize + 2 * 16;
inline constexpr int kOther = kLeft + 64;
inline constexpr int kPredicted = kOther + 48;
inline constexpr int kNonZero = kPredicted + 25;          /* 12 for each component */
inline constexpr int kSize = kNonZero + kComponents * 12; /* 2 x 16 for each component */
inline constexpr int kEarlier = kSize + kComponents * 2 * 16;
inline constexpr int kMotion = kEarlier + 36;     /* whether it equals the expected motion */
inline constexpr int kMotionNumber = kMotion + 1; /* 1 + 16 for each of dx, dy, dz and slopes */
inline constexpr int kCount = kMotionNumber + 5 * 17;
} // namespace context

using EntropyModel = std::array<Probability, context::kCount>;

/** Probabilities at the start of each slice: learnt from scans and recordings, so that small slices
 *  do not pay for adaptation. Part of the format. */
extern const EntropyModel kInitialModel;
/** The same for slices that refer to an earlier frame set. */
extern const EntropyModel kInitialDeltaModel;

/** What a yes costs, bits, by the upper 8 bits of its probability. */
extern const std::array<float, 256> kBitsOfProbability;

/** Magnitudes with decisions of their own; greater ones are an exponential Golomb code. */
inline constexpr int kUnarySizes = 4;
/** Longest prefix of that code; a longer one means damaged data. */
inline constexpr int kMaxPrefix = 17;

/** The decisions of a slice in their order, the same for both directions. Coder is RangeEncoder or
 *  RangeDecoder: code (probability, yes) writes `yes`, or reads it and ignores the argument; so
 * does bits(). Small, so that a loop can keep a copy in registers; the probabilities are the
 * caller's. */
template <class Coder> class EntropyCode {
public:
  /** Whether contexts need the activity of pixels. */
  static constexpr bool kUsesActivity = true;

  EntropyCode (Coder coder, EntropyModel &model) : model_ (model.data ()), coder_ (coder) {}

  /** Columns by which a run of valid or invalid pixels ends later than the one above.
   *  @return false if the number is too large */
  bool run (bool valid, std::int32_t &later)
  {
    return number (context::kRunExact + valid, context::kRunSize + 16 * valid, later);
  }

  /** Motion of a block, relative to `expected`. @return false if a number is too large */
  bool motion (const BlockMotion &expected, BlockMotion &m)
  {
    if (code (context::kMotion, m == expected)) {
      m = expected;
      return true;
    }
    int at = context::kMotionNumber;
    for (const auto member : kMotionMembers) {
      std::int32_t rest = m.*member - expected.*member;
      if (!number (at, at + 1, rest))
        return false;
      m.*member = expected.*member + rest;
      at += 17;
    }
    return true;
  }

  /** Whether a valid pixel equals one of the earlier frame set. */
  bool earlier (const Neighbours &n, bool yes)
  {
    return code (context::kEarlier + earlier_context (n), yes);
  }

  /** The PixelChoice of a valid pixel that has a neighbour.
   *  @tparam Delta  the slice refers to an earlier frame set: contexts must not depend on pixel
   *  values, because a decoder may not have them */
  template <bool Delta> int choice (const Neighbours &n, int chosen)
  {
    if (n.left.valid ()) {
      if (code (context::kLeft + static_cast<int> (n.kinds ()), chosen == kTakeLeft))
        return kTakeLeft;
    }
    const int other = other_choice (n, chosen, Delta ? known_candidates (n) : candidates (n));
    if (other != kPredict)
      return other;
    return code (predicted_context (n), chosen == kPredict) ? kPredict : kCorrect;
  }

  /** The residual of a pixel coded in full. @return false if it is too large */
  [[gnu::always_inline]] bool residual (const Neighbours &n, bool has_neighbour, Components &r)
  {
    const Activity sums = n.activities ();
    const bool alone = !n.left.valid () || !n.upper ().valid ();
    bool previous = false;
    for (int i = 0; i < kComponents; i++) {
      const int where = surroundings (has_neighbour, alone, sums >> 8 * i & 0xff);
      std::int32_t value = r[i];
      if (!number (zero_context (i, previous, where), size_context (i, where), value))
        return false;
      r[i] = value;
      previous = value != 0;
    }
    return true;
  }

  /** @name What decisions would cost, bits @{ */
  [[nodiscard]] float earlier_bits (const Neighbours &n, bool yes) const
  {
    return bits_of (context::kEarlier + earlier_context (n), yes);
  }
  /** Of the left neighbour, which is valid: to take it, and at least to take another. */
  [[nodiscard]] std::pair<float, float> left_bits (const Neighbours &n) const
  {
    const int at = context::kLeft + static_cast<int> (n.kinds ());
    return {bits_of (at, true), bits_of (at, false)};
  }
  template <bool Delta> [[nodiscard]] ChoiceBits choice_bits (const Neighbours &n) const
  {
    ChoiceBits bits;
    bits.fill (kImpossible);
    float before = 0; /* of the decisions against the choices before */
    const auto decide = [&] (int at, int choice) {
      bits[static_cast<std::size_t> (choice)] = before + bits_of (at, true);
      before += bits_of (at, false);
    };
    if (n.left.valid ())
      decide (context::kLeft + static_cast<int> (n.kinds ()), kTakeLeft);
    const Candidates c = Delta ? known_candidates (n) : candidates (n);
    for (int i = 0; i < 3; i++)
      if (c.is[i])
        decide (other_context (n, i, c), kTakeUpperLeft + i);
    if (n.any ())
      decide (predicted_context (n), kPredict);
    bits[kCorrect] = before;
    return bits;
  }
  [[nodiscard]] float residual_bits (const Neighbours &n, bool has_neighbour, Components r) const
  {
    const Activity sums = n.activities ();
    const bool alone = !n.left.valid () || !n.upper ().valid ();
    bool previous = false;
    float bits = 0;
    for (int i = 0; i < kComponents; i++) {
      const int where = surroundings (has_neighbour, alone, sums >> 8 * i & 0xff);
      bits += number_bits (zero_context (i, previous, where), size_context (i, where), r[i]);
      previous = r[i] != 0;
    }
    return bits;
  }
  /** @} */

private:
  bool code (int at, bool yes) { return coder_.code (model_[at], yes); }

  /* Which of the three above are valid and differ from the neighbours before them, which would have
   * been chosen first. */
  struct Candidates {
    bool is[3];
  };
  static Candidates candidates (const Neighbours &n)
  {
    const PixelCode l = n.left.code, ul = n.codes[-1], u = n.codes[0], ur = n.codes[1];
    return {{static_cast<bool> (n.upper_left ().valid () & (ul != l)),
        static_cast<bool> (n.upper ().valid () & (u != l) & (u != ul)),
        static_cast<bool> (n.upper_right ().valid () & (ur != l) & (ur != ul) & (ur != u))}};
  }
  /* The same, from the neighbours' choices alone. */
  static Candidates known_candidates (const Neighbours &n)
  {
    const PixelState l = n.left.state, u = n.states[0], ur = n.states[1];
    return {{n.upper_left ().valid () && !is_copy (l, kTakeUpper),
        n.upper ().valid () && !is_copy (u, kTakeLeft) && !is_copy (l, kTakeUpperRight),
        n.upper_right ().valid () && !is_copy (ur, kTakeLeft)}};
  }

  /* One of the three above, or kPredict for none of them. */
  int other_choice (const Neighbours &n, int chosen, const Candidates &candidates)
  {
    const bool *const candidate = candidates.is;
    for (int i = 0; i < 3; i++)
      if (candidate[i] && code (other_context (n, i, candidates), chosen == kTakeUpperLeft + i))
        return kTakeUpperLeft + i;
    return kPredict;
  }

  /* ---- contexts ---- */

  static int earlier_context (const Neighbours &n)
  {
    const auto of = [] (PixelState s) { return (s != 0) + is_copy (s, kTakeEarlier); };
    return of (n.left.state) + 3 * of (n.states[0]) + 9 * is_copy (n.states[1], kTakeEarlier) +
           18 * is_copy (n.states[-1], kTakeEarlier);
  }
  static int other_context (const Neighbours &n, int i, const Candidates &candidates)
  {
    const bool *const is = candidates.is;
    const int full = 2 * (n.left.kind () == 3) + (n.upper ().kind () == 3);
    const int later = i == 0 ? is[1] + 2 * is[2] : i == 1 ? is[2] : 0;
    return context::kOther + 16 * i + 4 * full + later;
  }
  static int predicted_context (const Neighbours &n)
  {
    return context::kPredicted + n.left.origin () + 5 * n.upper ().origin ();
  }
  static int surroundings (bool has_neighbour, bool alone, Activity sum)
  {
    return !has_neighbour ? 5 : alone ? 4 : kActivityClass[sum];
  }
  static int zero_context (int component, bool previous, int where)
  {
    return context::kNonZero + 12 * component + 6 * previous + where;
  }
  static int size_context (int component, int where)
  {
    return context::kSize + 32 * component + 16 * (where >= 3);
  }

  /* ---- costs ---- */

  [[nodiscard]] float bits_of (int at, bool yes) const
  {
    const Probability p = model_[at];
    return kBitsOfProbability[(yes ? p : static_cast<Probability> (~p)) >> 8];
  }
  [[nodiscard]] float number_bits (int zero, int at, std::int32_t r) const
  {
    float bits = bits_of (zero, r != 0);
    if (r == 0)
      return bits;
    bits += bits_of (at++, r < 0);
    const std::uint32_t size = static_cast<std::uint32_t> (std::abs (r)) - 1;
    for (std::uint32_t i = 0; i < kUnarySizes; i++) {
      bits += bits_of (at + static_cast<int> (i), size > i);
      if (size <= i)
        return bits;
    }
    const int width = std::bit_width (size - kUnarySizes + 1) - 1;
    for (int i = 0; i <= width; i++)
      bits += bits_of (at + kUnarySizes + std::min (i, 10), i < width);
    return bits + float (width);
  }

  /* Context class for the sum of three activities. */
  static constexpr std::uint8_t kActivityClass[] = {
      0, 1, 2, 2, 3, 3, 3, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4};

  bool number (int zero, int at, std::int32_t &r)
  {
    if (!code (zero, r != 0)) {
      r = 0;
      return true;
    }
    const bool negative = code (at, r < 0);
    std::uint32_t size = static_cast<std::uint32_t> (std::abs (r)) - 1;
    if (!magnitude (at + 1, size))
      return false;
    r = static_cast<std::int32_t> (size) + 1;
    r = negative ? -r : r;
    return true;
  }

  bool magnitude (int at, std::uint32_t &size)
  {
    for (std::uint32_t i = 0; i < kUnarySizes; i++)
      if (!code (at + static_cast<int> (i), size > i)) {
        size = i;
        return true;
      }
    const std::uint32_t rest = size - kUnarySizes + 1;
    const int width = std::bit_width (rest) - 1;
    int prefix = 0;
    while (code (at + kUnarySizes + std::min (prefix, 10), prefix < width))
      if (++prefix > kMaxPrefix)
        return false;
    const std::uint32_t low = coder_.bits (rest & ((1u << prefix) - 1), prefix);
    size = (1u << prefix) + low - 1 + kUnarySizes;
    return true;
  }

  Probability *model_;

protected:
  Coder coder_;
};

} // namespace rangecast
