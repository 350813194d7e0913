/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>

namespace rangecast {

/** Frame rate as a fraction, and its ticks: the multiples of the frame period since the 0 of a
 * clock, at which all hosts that share the clock capture. Hosts need to agree on the rate only. */
struct TickRate {
  int frames = 0;  ///< > 0 where there is a rate
  int seconds = 1; ///< > 0

  [[nodiscard]] bool valid () const { return frames > 0 && seconds > 0; }

  /** When a tick is due: floor (tick * seconds / frames), ns since the clock's 0. */
  [[nodiscard]] std::int64_t time_of (std::int64_t tick) const
  {
    return static_cast<std::int64_t> (
        static_cast<__int128> (tick) * seconds * 1'000'000'000 / frames);
  }

  /** The first tick that is due at or after a time. @param time_ns  >= 0 */
  [[nodiscard]] std::int64_t at_or_after (std::int64_t time_ns) const
  {
    const __int128 second = static_cast<__int128> (seconds) * 1'000'000'000;
    auto tick = static_cast<std::int64_t> (static_cast<__int128> (time_ns) * frames / second);
    while (time_of (tick) < time_ns)
      tick++;
    return tick;
  }

  [[nodiscard]] std::int64_t period_ns () const { return time_of (1); }
};

} // namespace rangecast
