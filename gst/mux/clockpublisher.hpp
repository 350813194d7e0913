/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/net/gstnet.h>

#include <mutex>
#include <rangecast/base/status.hpp>

/** Gives an element's clock to other hosts, as GstNetClientClock asks for it (UDP), from READY ->
 *  PAUSED to PAUSED -> READY. Any thread; calls one after the other where the caller's state lock
 *  does not see to it. */
class ClockPublisher {
public:
  static constexpr int kOff = -1, kAnyPort = 0;

  ClockPublisher () = default;
  ~ClockPublisher () { stop (); }
  ClockPublisher (const ClockPublisher &) = delete;
  ClockPublisher &operator= (const ClockPublisher &) = delete;

  /** For the next start. @param port  kOff, kAnyPort, or 1 .. 65535 */
  void set_port (int port);
  /** The one in use, else the one that was set. */
  int port ();

  /** Takes the port, and answers as soon as there is a clock.
   *  @param clock  may be null
   *  @return kBadValue naming the port, if another program has it */
  rangecast::Status start (GstClock *clock);
  /** From now on the answers are this clock's; null: none. Nothing happens before start(). */
  rangecast::Status use (GstClock *clock);
  void stop ();

private:
  rangecast::Status open (GstClock *clock);
  void close ();

  std::mutex calls_; /* one of start(), use() and stop() at a time */
  GstNetTimeProvider *provider_ = nullptr;
  GstClock *clock_ = nullptr; /* that it tells; null: it does not answer */
  bool started_ = false;

  std::mutex lock_; /* guards the two below; taken last */
  int wanted_ = kOff, actual_ = kOff;
};
