/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace rangecast {

/** Thresholds of an encoder, in codes. */
struct Thresholds {
  int depth = 0;  ///< 0 to 65535
  int colour = 0; ///< 0 to 255

  friend bool operator== (const Thresholds &, const Thresholds &) = default;
};

struct RateSettings {
  double bits_per_s = 0;        ///< the target; > 0
  Thresholds best;              ///< lower limits
  Thresholds worst;             ///< upper limits, unless `best` is above
  double bits_per_point = 8;    ///< estimate for the first frame set, at `best`
  double interval_s = 1.0 / 30; ///< estimated interval of frame sets, seconds; 0: the default

  friend bool operator== (const RateSettings &, const RateSettings &) = default;
};

/** Size of one coded frame set. */
struct CodedFrame {
  std::uint64_t bytes = 0;
  std::uint64_t points = 0; ///< valid pixels; 0: the scene is empty
  std::uint64_t pixels = 0; ///< of all ROIs
  bool refresh = false;     ///< a key frame set in a stream of smaller ones
};

/** Chooses thresholds so that coded frame sets meet a bit rate.
 *
 *  Quality is one number, *coarseness* x >= 0: the logarithms of both thresholds (+ 1/2) rise
 *  linearly with it from the best to the worst. A model predicts the size of a frame set,
 *      bits = points * exp (a - b * x)
 *  where a adapts to every frame set and b to each change of x. An account holds the bytes sent
 *  beyond the target; it is paid back over about a second, the extra bytes of key frame sets over
 *  two. From one frame set to the next thresholds change little, and because of hysteresis rarely:
 *  usually by one code in one of the two.
 *
 *  Time is that of the frame sets. Nothing is allocated. Not thread-safe. */
class RateControl {
public:
  /** Forgets everything. */
  void reset () { *this = RateControl (); }

  /** May be called before every frame set. A target that differs by more than an eighth
   *  begins a new account; thresholds continue from their values, within the new limits. */
  void configure (const RateSettings &settings);

  /** The thresholds for the next frame set, once for each.
   *  @param time_ns  capture time; steps back, or ahead by more than some seconds, are
   *  discontinuities
   *  @param pixels  of all its ROIs: more pixels are expected to need more bytes */
  Thresholds next (std::uint64_t time_ns, std::uint64_t pixels);

  /** Reports the size of the frame set of the latest next(). */
  void coded (const CodedFrame &frame);

  [[nodiscard]] double coarseness () const { return x_; }

  /** Predicted size of the latest frame set at the worst thresholds, bits; 0 before the first. */
  [[nodiscard]] double min_bits () const;

private:
  [[nodiscard]] double threshold_at (int best, int worst, double x) const;
  [[nodiscard]] double coarseness_of (const Thresholds &thresholds) const;
  [[nodiscard]] double bytes_per_s () const { return settings_.bits_per_s / 8; }
  double pay_for_refreshes ();
  double plan_bytes ();
  void learn (double bits_per_point);

  RateSettings settings_;
  bool configured_ = false;
  double depth_span_ = 0, colour_span_ = 0; /* logarithms of worst / best */
  double x_ = 0, max_x_ = 0;
  Thresholds thresholds_;
  double learnt_x_ = 0, learnt_bits_ = 0; /* of the latest frame set with points */
  int frames_ = 0;                        /* learnt from, up to a few */
  int outliers_ = 0;                      /* in a row */
  double a_ = 0, b_ = 0;
  double fill_ = 0;   /* points of a pixel */
  double points_ = 0; /* of the latest frame set */
  bool has_time_ = false;
  std::uint64_t time_ns_ = 0;
  double interval_s_ = 0, elapsed_s_ = 0;
  double account_ = 0; /* bytes sent beyond the target */
  /* Bytes of refreshes beyond the size of other frame sets that are still to be paid back: they
   * move from entering_ to spread_, and are paid from there. */
  double entering_ = 0, spread_ = 0;
};

/** Bits per second over the last two seconds of frame sets. */
class RateMeter {
public:
  void reset () { *this = RateMeter (); }
  void add (std::uint64_t time_ns, std::uint64_t bytes);
  /** The rate; until two seconds are full, of all frame sets so far.
   *  @param interval_ns  nominal interval, used if there is only one frame set; 0 = not known, then
   *  the rate is 0 */
  [[nodiscard]] double bits_per_s (std::uint64_t interval_ns = 0) const;

private:
  static constexpr std::uint64_t kWindowNs = 2'000'000'000;
  struct Entry {
    std::uint64_t time_ns, bytes;
  };
  [[nodiscard]] const Entry &at (std::size_t i) const
  {
    return entries_[(first_ + i) % entries_.size ()];
  }
  std::array<Entry, 256> entries_{}; /* a ring; of faster streams the window is shorter */
  std::size_t first_ = 0, count_ = 0;
  std::uint64_t sum_ = 0;
  bool is_full_ = false;
};

} // namespace rangecast
