/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Profile entropy: choices and residuals of a row as symbols whose frequencies adapt to their
 * context. */
#pragma once

#include <vector>

#include "coded_pixel.hpp"
#include "motion.hpp"
#include "rans.hpp"

namespace rangecast {

/** A pixel as contexts see it: 0 if it is invalid, else its PixelChoice plus 1. */
using PixelClass = std::uint8_t;
inline constexpr PixelClass kCorrectedClass = kCorrect + 1, kEarlierClass = kTakeEarlier + 1;
inline constexpr std::size_t kPixelClasses = 8;

using ChoiceModel = SymbolModel<7>;
/** Of a number: 0, 1, -1, ... 4, -4 are symbols 0 to 8; those after stand for 2, 4, ... 32, and 64
 * or more numbers, which raw bits tell apart. */
using NumberModel = SymbolModel<15>;

/** Groups of classes that the upper and upper-right pixel count as; the last is of earlier pixels.
 */
inline constexpr std::size_t kUpperGroups = 5, kEarlierGroup = 4;
inline constexpr std::size_t kChoiceContexts = kPixelClasses * kUpperGroups * kUpperGroups;
/** Contexts of each of a residual's numbers, see kResidualContexts. */
inline constexpr std::size_t kResidualClasses = 10;
inline constexpr std::size_t kMotionNumbers = std::size (kMotionMembers);

/** The frequencies of a slice. */
struct EntropyModel {
  ChoiceModel choices[kChoiceContexts];
  NumberModel residuals[kComponents][kResidualClasses];
  NumberModel runs[2];       ///< ends of runs of invalid and of valid pixels
  NumberModel motion_change; ///< 0: motion is as expected, 1: it is not
  NumberModel motions[kMotionNumbers];
};

/** The class of a pixel whose state has its choice. */
constexpr PixelClass
class_of (PixelState state)
{
  return state >> 16 & 7;
}

/** Frequencies at the start of each slice: learnt from scans and recordings, so that small slices
 * do not pay for adaptation. Part of the format.
 *  @param key    the slice refers to no earlier frame set
 *  @param steps  of residuals */
const EntropyModel &initial_model (bool key, Components steps);

/** What the choice of a pixel depends on beside the class of the left pixel, to which it is added.
 */
constexpr std::uint8_t
upper_context (PixelClass upper, PixelClass upper_right)
{
  /* Groups: invalid, left, another neighbour, in full, earlier. */
  const auto group = [] (PixelClass c) { return c - (c >= 3) - (c >= 4) - (c >= 6); };
  return static_cast<std::uint8_t> (
      kPixelClasses * (group (upper) + kUpperGroups * group (upper_right)));
}

/** The activity of invalid pixels in each number, beyond sums of three valid ones. */
inline constexpr Activity kNoActivity = 0x40404040;

/** What a residual depends on: one byte for each number. */
constexpr Activity
residual_context (Activity left, Activity upper, Activity upper_right)
{
  return left + upper + (upper_right & ~kNoActivity);
}
/** The context of a number by that byte. */
inline constexpr auto kResidualContexts = [] {
  std::array<std::uint8_t, 256> contexts{};
  for (unsigned sum = 0; sum < 256; sum++)
    contexts[sum] = static_cast<std::uint8_t> (sum >= 128  ? 9
                                               : sum >= 64 ? 8
                                               : sum < 3   ? sum
                                               : sum < 5   ? 3
                                               : sum < 8   ? 4
                                               : sum < 13  ? 5
                                               : sum < 21  ? 6
                                                           : 7);
  return contexts;
}();

/** Magnitudes with symbols of their own. */
inline constexpr std::int32_t kMaxOwnSymbol = 4;
inline constexpr unsigned kFirstEscape = 2 * kMaxOwnSymbol + 1, kLastEscape = 14;
/** Raw bits of the magnitude of the first escape, and from which on their number is coded. */
inline constexpr int kLongBits = 6, kBitsOfLongBits = 4, kMaxLongBits = 17;

/** A number that has no symbol of its own: 3 + 2^bits + rest. */
struct EscapedNumber {
  std::uint32_t rest;
  int bits;

  explicit EscapedNumber (std::int32_t number)
  {
    const auto size = static_cast<std::uint32_t> (std::abs (number)) - (kMaxOwnSymbol - 1);
    bits = std::bit_width (size) - 1;
    rest = size - (1u << bits);
  }
  [[nodiscard]] unsigned symbol () const
  {
    return kFirstEscape - 1 + static_cast<unsigned> (std::min (bits, kLongBits));
  }
};

inline constexpr std::int8_t kSmallNumbers[kLastEscape + 1] = {0, 1, -1, 2, -2, 3, -3, 4, -4};

constexpr unsigned
symbol_of_small (std::int32_t number)
{
  return static_cast<unsigned> (2 * std::abs (number) - (number > 0));
}

/** A row as the coder needs it. The pixels before the first and after the last are invalid. */
struct EntropyRow {
  PixelClass *classes;
  const PixelClass *upper_classes;
  Activity *activities; ///< kNoActivity of invalid pixels; of valid ones, 0 before the residuals
  const Activity *upper_activities;
  int *corrected;            ///< memory: columns of the pixels that have residuals
  Components *residuals;     ///< theirs, in that order
  std::span<const int> runs; ///< ends of runs of invalid and valid pixels by turns
};

/** Memory for rows. */
struct EntropyRowMemory {
  struct Pixels {
    std::vector<PixelClass> classes;
    std::vector<Activity> activities;

    void reserve (std::size_t columns)
    {
      classes.reserve (columns + 2);
      activities.reserve (columns + 2);
    }
    void reset (std::size_t columns)
    {
      classes.assign (columns + 2, 0);
      activities.assign (columns + 2, kNoActivity);
    }
  };
  Pixels now, upper;
  std::vector<int> corrected;
  std::vector<Components> residuals;

  /** Room for rows of so many columns, all pixels invalid. */
  void reset (std::size_t columns, std::size_t most_columns)
  {
    for (Pixels *pixels : {&now, &upper}) {
      pixels->reserve (most_columns);
      pixels->reset (columns);
    }
    corrected.resize (std::max (corrected.size (), most_columns + 1));
    residuals.resize (corrected.size ());
  }
  [[nodiscard]] EntropyRow row (std::span<const int> runs)
  {
    return {now.classes.data () + 1, upper.classes.data () + 1, now.activities.data () + 1,
        upper.activities.data () + 1, corrected.data (), residuals.data (), runs};
  }
};

/** Calls work (begin, end) for each run of valid pixels. */
template <class Work>
[[gnu::always_inline]] inline void
for_valid_runs (std::span<const int> runs, const Work &work)
{
  for (std::size_t i = 1; i < runs.size (); i += 2)
    work (runs[i - 1], runs[i]);
}

/** Whether a pixel that begins a run has no neighbour, so that its choice is not coded in slices
 *  that refer to no earlier frame set. */
inline bool
is_alone (const PixelClass *upper)
{
  return (upper[-1] | upper[0] | upper[1]) == 0;
}

/** Writes the symbols of a slice. A copy continues from where it was taken, once. */
class EntropyWriter {
public:
  static constexpr bool kUsesActivity = true, kEarlierInRuns = false, kByRow = true;

  EntropyWriter (std::uint32_t *entries, EntropyModel &model, const EntropyModel &initial)
      : coder_ (entries), model_ (&model)
  {
    model = initial;
  }

  /** Numbers of memory that a row of so many columns needs at most. */
  static constexpr std::size_t max_entries (std::size_t columns)
  {
    constexpr std::size_t kOfNumber = 4;
    return (columns + 1) * (kOfNumber * (1 + kComponents + 2) + 1) + 64;
  }
  RansEncoder &coder () { return coder_; }

  /** Columns by which a run of valid or invalid pixels ends later than the one above. */
  void run (bool valid, std::int32_t later) { number (model_->runs[valid], later); }
  /** Motion of a block, relative to `expected`. */
  void motion (const BlockMotion &expected, const BlockMotion &m)
  {
    number (model_->motion_change, m != expected);
    if (m == expected)
      return;
    for (std::size_t i = 0; i < kMotionNumbers; i++)
      number (model_->motions[i], m.*kMotionMembers[i] - expected.*kMotionMembers[i]);
  }

  /** @name How CompactEncoder hands over pixels one by one: row() writes them @{ */
  void begin_row (const EntropyRow &row) { residual_ = row.residuals; }
  void choice (const Neighbours &, int) {}
  void full (const Neighbours &, bool has_neighbour, Components r)
  {
    if (!has_neighbour || !is_zero (r))
      *residual_++ = r;
  }
  /** @} */

  /** @tparam Delta  the slice refers to an earlier frame set */
  template <bool Delta> [[gnu::always_inline]] void row (const EntropyRow &row)
  {
    RansEncoder coder = coder_; /* stays in registers */
    EntropyModel *const model = model_;
    std::size_t count = 0;
    unsigned place = 0;
    for_valid_runs (row.runs, [&] (int begin, int end) {
      PixelClass left = 0;
      for (int x = begin; x < end; x++) {
        if (Delta || x > begin || !is_alone (row.upper_classes + x))
          coder.code (place++ % kRansStates,
              model->choices[left + upper_context (row.upper_classes[x], row.upper_classes[x + 1])],
              row.classes[x] - std::size_t{1});
        left = row.classes[x];
        row.corrected[count] = x;
        count += left == kCorrectedClass;
      }
    });
    for (std::size_t i = 0; i < count; i++)
      residual (coder, *model, row, row.corrected[i], row.residuals[i]);
    coder_ = coder;
  }

  [[nodiscard]] std::size_t bound () const { return coder_.bound (); }
  std::size_t finish (std::uint8_t *to) const { return coder_.finish (to); }

  /** @name What symbols would cost, bits @{ */
  [[nodiscard]] float earlier_bits (const Neighbours &n, bool yes) const
  {
    return yes ? RansEncoder::bits_of (choices (n).interval (kTakeEarlier)) : 0;
  }
  /** Of the left neighbour, which is valid: to take it, and at least to take another. */
  [[nodiscard]] std::pair<float, float> left_bits (const Neighbours &n) const
  {
    const SymbolInterval left = choices (n).interval (kTakeLeft);
    return {RansEncoder::bits_of (left),
        RansEncoder::bits_of ({0, kFrequencySum - 1 - left.frequency})};
  }
  template <bool Delta> [[nodiscard]] ChoiceBits choice_bits (const Neighbours &n) const
  {
    const bool can_take[kChoices] = {n.left.valid (), n.upper_left ().valid (), n.upper ().valid (),
        n.upper_right ().valid (), n.any (), true};
    const ChoiceModel &model = choices (n);
    ChoiceBits bits;
    for (std::size_t i = 0; i < kChoices; i++)
      bits[i] = can_take[i] ? RansEncoder::bits_of (model.interval (i)) : kImpossible;
    if (!Delta && !n.any ())
      bits[kCorrect] = 0;
    return bits;
  }
  [[nodiscard]] float residual_bits (const Neighbours &n, bool, Components r) const
  {
    const auto activity = [] (PixelState s) {
      return s != 0 ? static_cast<Activity> (s >> 32) : kNoActivity;
    };
    const Activity context =
        residual_context (activity (n.left.state), activity (n.states[0]), activity (n.states[1]));
    float bits = 0;
    for (int i = 0; i < kComponents; i++) {
      const NumberModel &model = model_->residuals[i][kResidualContexts[context >> 8 * i & 0xff]];
      if (std::abs (r[i]) <= kMaxOwnSymbol) {
        bits += RansEncoder::bits_of (model.interval (symbol_of_small (r[i])));
        continue;
      }
      const EscapedNumber escaped (r[i]);
      bits += RansEncoder::bits_of (model.interval (escaped.symbol ())) +
              float (1 + escaped.bits + (escaped.bits >= kLongBits ? kBitsOfLongBits : 0));
    }
    return bits;
  }
  /** @} */

private:
  [[nodiscard]] const ChoiceModel &choices (const Neighbours &n) const
  {
    return model_->choices[class_of (n.left.state) +
                           upper_context (class_of (n.states[0]), class_of (n.states[1]))];
  }
  [[gnu::always_inline]] static void residual (
      RansEncoder &coder, EntropyModel &model, const EntropyRow &row, int x, Components r)
  {
    const Activity context = residual_context (
        row.activities[x - 1], row.upper_activities[x], row.upper_activities[x + 1]);
    row.activities[x] = activity_of (r);
    const Components size = r < 0 ? -r : r;
    Components symbols = 2 * size + (r > 0);
    const bool escapes = !is_zero (size > kMaxOwnSymbol);
    if (escapes) [[unlikely]]
      for (int i = 0; i < kComponents; i++)
        if (size[i] > kMaxOwnSymbol)
          symbols[i] = static_cast<std::int32_t> (EscapedNumber (r[i]).symbol ());
    for (unsigned i = 0; i < kComponents; i++)
      coder.code (i % kRansStates, model.residuals[i][kResidualContexts[context >> 8 * i & 0xff]],
          static_cast<std::size_t> (symbols[i]));
    if (escapes) [[unlikely]]
      for (unsigned i = 0; i < kComponents; i++)
        if (size[i] > kMaxOwnSymbol)
          escape (coder, i % kRansStates, r[i]);
  }
  static void escape (RansEncoder &coder, unsigned state, std::int32_t number)
  {
    const EscapedNumber escaped (number);
    const std::uint32_t negative = number < 0;
    if (escaped.bits < kLongBits) {
      coder.raw (state, negative | escaped.rest << 1, 1 + escaped.bits);
      return;
    }
    const int more = escaped.bits - kLongBits;
    coder.raw (state, negative | static_cast<std::uint32_t> (more) << 1, 1 + kBitsOfLongBits);
    coder.raw (state, escaped.rest & ((1u << kLongBits) - 1), kLongBits);
    coder.raw (state, escaped.rest >> kLongBits, more);
  }
  void number (NumberModel &model, std::int32_t number)
  {
    if (std::abs (number) <= kMaxOwnSymbol) {
      coder_.code (0, model, symbol_of_small (number));
      return;
    }
    coder_.code (0, model, EscapedNumber (number).symbol ());
    escape (coder_, 0, number);
  }

  RansEncoder coder_;
  EntropyModel *model_;
  Components *residual_ = nullptr; /* the row's next */
};

/** Reads the symbols of a slice. A copy continues from where it was taken, once. */
class EntropyReader {
public:
  /** @param bytes  at least kRansHeaderSize */
  EntropyReader (
      std::span<const std::uint8_t> bytes, EntropyModel &model, const EntropyModel &initial)
      : coder_ (bytes.data (), bytes.size ()), model_ (&model)
  {
    model = initial;
  }

  /** @return false if the number is too large */
  bool run (bool valid, std::int32_t &later) { return number (model_->runs[valid], later); }
  bool motion (const BlockMotion &expected, BlockMotion &m)
  {
    std::int32_t change = 0;
    if (!number (model_->motion_change, change) || change < 0 || change > 1)
      return false;
    m = expected;
    for (std::size_t i = 0; change && i < kMotionNumbers; i++) {
      std::int32_t more = 0;
      if (!number (model_->motions[i], more))
        return false;
      m.*kMotionMembers[i] += more;
    }
    return true;
  }

  /** Reads classes, residuals and activities of a row. @return false if a number is too large */
  template <bool Delta> [[gnu::always_inline]] bool row (const EntropyRow &row)
  {
    RansDecoder coder = coder_; /* stays in registers */
    EntropyModel *const model = model_;
    std::size_t count = 0;
    unsigned place = 0;
    for_valid_runs (row.runs, [&] (int begin, int end) {
      std::fill (row.activities + begin, row.activities + end, Activity{0});
      std::size_t left = 0;
      for (int x = begin; x < end; x++) {
        if (!Delta && x == begin && is_alone (row.upper_classes + x))
          left = kCorrectedClass;
        else
          left = 1 + coder.code (place++ % kRansStates,
                         model->choices[left + upper_context (row.upper_classes[x],
                                                   row.upper_classes[x + 1])]);
        row.classes[x] = static_cast<PixelClass> (left);
        row.corrected[count] = x;
        count += left == kCorrectedClass;
      }
    });
    bool good = true;
    for (std::size_t i = 0; i < count; i++)
      good &= residual (coder, *model, row, row.corrected[i], row.residuals[i]);
    coder_ = coder;
    return good;
  }

  [[nodiscard]] bool overrun () const { return coder_.overrun (); }
  [[nodiscard]] bool at_clean_end () const { return coder_.at_clean_end (); }

private:
  [[gnu::always_inline]] static bool residual (
      RansDecoder &coder, EntropyModel &model, const EntropyRow &row, int x, Components &r)
  {
    const Activity context = residual_context (
        row.activities[x - 1], row.upper_activities[x], row.upper_activities[x + 1]);
    std::size_t symbols[kComponents], largest = 0;
    for (unsigned i = 0; i < kComponents; i++) {
      symbols[i] = coder.code (
          i % kRansStates, model.residuals[i][kResidualContexts[context >> 8 * i & 0xff]]);
      largest = std::max (largest, symbols[i]);
    }
    Components made = {kSmallNumbers[symbols[0]], kSmallNumbers[symbols[1]],
        kSmallNumbers[symbols[2]], kSmallNumbers[symbols[3]]};
    bool good = true;
    if (largest >= kFirstEscape) [[unlikely]]
      for (unsigned i = 0; i < kComponents; i++)
        if (symbols[i] >= kFirstEscape) {
          std::int32_t number = 0;
          good &= escape (coder, i % kRansStates, symbols[i], number);
          made[i] = number;
        }
    r = made;
    row.activities[x] = activity_of (made);
    return good;
  }
  static bool escape (RansDecoder &coder, unsigned state, std::size_t symbol, std::int32_t &number)
  {
    int bits = static_cast<int> (symbol - kFirstEscape) + 1;
    const bool is_long = symbol == kLastEscape;
    const std::uint32_t first = coder.raw (state, 1 + (is_long ? kBitsOfLongBits : bits));
    std::uint32_t rest = first >> 1;
    if (is_long) {
      const int more = static_cast<int> (rest);
      bits = kLongBits + more;
      if (bits > kMaxLongBits)
        return false;
      rest = coder.raw (state, kLongBits);
      if (more > 0)
        rest |= coder.raw (state, more) << kLongBits;
    }
    const auto size = static_cast<std::int32_t> (kMaxOwnSymbol - 1 + (1u << bits) + rest);
    number = first & 1 ? -size : size;
    return true;
  }
  bool number (NumberModel &model, std::int32_t &number)
  {
    const std::size_t symbol = coder_.code (0, model);
    if (symbol >= kFirstEscape)
      return escape (coder_, 0, symbol, number);
    number = kSmallNumbers[symbol];
    return true;
  }

  RansDecoder coder_;
  EntropyModel *model_;
};

} // namespace rangecast
