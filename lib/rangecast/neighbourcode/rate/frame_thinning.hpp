/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>

namespace rangecast {

/** Rate and cost of a stream at one frame set. */
struct ThinningInput {
  std::uint64_t time_ns = 0;     ///< of the frame set's capture
  std::uint64_t interval_ns = 0; ///< between frame sets, from the caps
  double bits_per_s = 0;         ///< available rate; 0: no limit
  double min_bits = 0;           ///< size of a frame set at the worst quality; 0: unknown
  double min_fps = 1;            ///< minimum number of frame sets per second to keep
};

/** Drops whole frame sets when the worst quality still exceeds the rate: one of n is kept, evenly.
 *  Which ones depends on their time alone, so that encoders on hosts with synchronised clocks keep
 *  the same ones. n rises within a quarter of a second, and falls after two seconds in which the
 * rate was a fifth above what is needed. If frame sets arrive at a multiple or a fraction of the
 * nominal rate, the interval is scaled by that whole number; gaps do not change it. Nothing is
 * allocated. */
class FrameThinning {
public:
  void reset () { *this = FrameThinning (); }
  /** To be called once for each frame set. @return false if it is to be dropped */
  bool keep (const ThinningInput &input);

private:
  void measure (const ThinningInput &input, double elapsed_s);
  void adjust (const ThinningInput &input, double elapsed_s);

  int one_of_ = 1;
  double short_s_ = 0,
         enough_s_ = 0; /* for how long the rate has been too low, or sufficient for more */
  bool has_time_ = false;
  std::uint64_t nominal_ns_ = 0, interval_ns_ = 0; /* from the caps; as measured */
  int measured_ = 0;
  double measured_s_ = 0;                /* sum of so many measured intervals */
  std::uint64_t time_ns_ = 0, kept_ = 0; /* kept_: time in units of one_of_ intervals */
};

} // namespace rangecast
