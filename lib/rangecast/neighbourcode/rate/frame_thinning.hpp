/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>

namespace rangecast {

/** What a stream may cost, and what it costs. */
struct ThinningInput {
  std::uint64_t time_ns = 0;     ///< of the frame set's capture
  std::uint64_t interval_ns = 0; ///< of frame sets, as the stream says
  double bits_per_s = 0;         ///< that there are; 0: no limit
  double least_bits = 0;         ///< of a frame set at the worst quality; 0: not known
  double least_fps = 1;          ///< frame sets a second that are kept at least
};

/** Leaves out whole frame sets where the worst quality still takes more than there is: one of n is
 *  kept, evenly. Which ones goes by their time alone, so that encoders on hosts whose clocks agree
 *  keep the same ones. n rises within a quarter of a second, and falls where for two seconds there
 *  was a fifth more than it takes. Where frame sets come twice as fast or half as fast as the
 *  stream says, or more so, that whole multiple counts; one that comes with gaps still goes by what
 *  the stream says, and keeps what others keep. Nothing is allocated. */
class FrameThinning {
public:
  void reset () { *this = FrameThinning (); }
  /** @return false: the frame set is left out. Once for each that comes. */
  bool keep (const ThinningInput &input);
  /** n. */
  [[nodiscard]] int one_of () const { return one_of_; }

private:
  void measure (const ThinningInput &input, double elapsed_s);
  void adjust (const ThinningInput &input, double elapsed_s);

  int one_of_ = 1;
  double short_s_ = 0, enough_s_ = 0; /* since when the rate has been wrong */
  bool has_time_ = false;
  std::uint64_t told_ns_ = 0, interval_ns_ = 0; /* as the stream says; what counts */
  int measured_ = 0;
  double measured_s_ = 0;                /* of so many intervals as they came */
  std::uint64_t time_ns_ = 0, kept_ = 0; /* kept_: time in units of one_of_ intervals */
};

} // namespace rangecast
