/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <gst/gst.h>
#include <rangecast/base/status.hpp>
#include <string>

/** Time of this host's monotonic clock, ns. */
inline std::int64_t
monotonic_ns ()
{
  return g_get_monotonic_time () * 1000;
}

/** The clock of another host, which stereocamsrc provides to its pipeline. */
class NetworkClock {
public:
  NetworkClock () = default;
  ~NetworkClock () { gst_clear_object (&clock_); }
  NetworkClock (const NetworkClock &) = delete;
  NetworkClock &operator= (const NetworkClock &) = delete;

  /** Starts to synchronise; waits only for the look-up of a host name.
   *  @param server  HOST:PORT, [IPv6]:PORT or ptp:DOMAIN; empty: no clock
   *  @return kBadValue: the text says what was expected; kNotFound: no such clock on this host */
  rangecast::Status open (const std::string &server);

  /** Transfer none; may be null. */
  [[nodiscard]] GstClock *clock () const { return clock_; }

private:
  std::string server_;
  GstClock *clock_ = nullptr;
};
