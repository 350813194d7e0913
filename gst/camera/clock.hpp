/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <rangecast/base/status.hpp>
#include <string>

/** The clock that stereocamsrc provides: one that another host serves. */
class NetworkClock {
public:
  NetworkClock () = default;
  ~NetworkClock () { gst_clear_object (&clock_); }
  NetworkClock (const NetworkClock &) = delete;
  NetworkClock &operator= (const NetworkClock &) = delete;

  /** Begins to ask the server; nothing waits for it, but for the look-up of a host's name.
   *  @param server  HOST:PORT, [IPv6]:PORT or ptp:DOMAIN; empty: no clock
   *  @return kBadValue: the text says what was expected; kNotFound: there can be no such clock here
   */
  rangecast::Status open (const std::string &server);

  /** Transfer none; null: none. */
  [[nodiscard]] GstClock *clock () const { return clock_; }

private:
  std::string server_;
  GstClock *clock_ = nullptr;
};

/** What a clock-server property names. */
struct ClockServer {
  bool ptp = false;
  std::string host;
  int port = 0; ///< or the PTP domain
};

/** @return kBadValue: the text says what was expected */
rangecast::Status parse_clock_server (const std::string &text, ClockServer &server);
