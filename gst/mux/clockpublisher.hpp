/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/net/gstnet.h>

#include <atomic>
#include <mutex>
#include <rangecast/base/status.hpp>

/** Publishes an element's clock over UDP, for GstNetClientClock of other hosts, between start() and
 *  stop(). Any thread. */
class ClockPublisher {
public:
  static constexpr int kOff = -1, kAnyPort = 0;

  ClockPublisher () = default;
  ~ClockPublisher () { stop (); }
  ClockPublisher (const ClockPublisher &) = delete;
  ClockPublisher &operator= (const ClockPublisher &) = delete;

  /** Binds the port. Requests are answered as soon as the element has a clock. Posts an error that
   *  names the port if another program has it.
   *  @param port  1 .. 65535 or kAnyPort; kOff: nothing happens
   *  @return false after an error */
  bool start (GstElement *element, int port);
  /** Answers with this clock from now on; null: does not answer. Does nothing before start(). Posts
   *  an error if that fails. */
  void set_clock (GstElement *element, GstClock *clock);
  void stop ();
  /** The port in use, else kOff. */
  [[nodiscard]] int port () const { return port_; }

private:
  rangecast::Status open (int port, GstClock *clock);
  void close ();

  std::mutex lock_; /* guards what follows: one of start(), set_clock() and stop() at a time */
  GstNetTimeProvider *provider_ = nullptr;
  GstClock *clock_ = nullptr; /* of provider_; null: it does not answer */
  bool started_ = false;
  std::atomic<int> port_ = kOff; /* written under the lock */
};
