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
    const auto of = [] (PixelState s) { return (s != 0) + is_copy (s, kTakeEarlier); };
    const int at = of (n.left.state) + 3 * of (n.states[0]) +
                   9 * is_copy (n.states[1], kTakeEarlier) +
                   18 * is_copy (n.states[-1], kTakeEarlier);
    return code (context::kEarlier + at, yes);
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
    const int at = context::kPredicted + n.left.origin () + 5 * n.upper ().origin ();
    return code (at, chosen == kPredict) ? kPredict : kCorrect;
  }

  /** The residual of a pixel coded in full. @return false if it is too large */
  [[gnu::always_inline]] bool residual (const Neighbours &n, bool has_neighbour, Components &r)
  {
    const Activity sums = n.activities ();
    const bool alone = !n.left.valid () || !n.upper ().valid ();
    bool previous = false;
    for (int i = 0; i < kComponents; i++) {
      const int surroundings = !has_neighbour ? 5
                               : alone        ? 4
                                              : kActivityClass[sums >> 8 * i & 0xff];
      const int zero = context::kNonZero + 12 * i + 6 * previous + surroundings;
      const int size = context::kSize + 32 * i + 16 * (surroundings >= 3);
      std::int32_t value = r[i];
      if (!number (zero, size, value))
        return false;
      r[i] = value;
      previous = value != 0;
    }
    return true;
  }

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
    const int full = 2 * (n.left.kind () == 3) + (n.upper ().kind () == 3);
    for (int i = 0; i < 3; i++) {
      if (!candidate[i])
        continue;
      const int later = i == 0 ? candidate[1] + 2 * candidate[2] : i == 1 ? candidate[2] : 0;
      if (code (context::kOther + 16 * i + 4 * full + later, chosen == kTakeUpperLeft + i))
        return kTakeUpperLeft + i;
    }
    return kPredict;
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
