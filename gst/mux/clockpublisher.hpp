/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/net/gstnet.h>

#include <mutex>

/** Publishes an element's clock over UDP, for GstNetClientClock of other hosts, between start() and
 *  stop(). Any thread. */
class ClockPublisher {
public:
  ~ClockPublisher () { stop (); }

  /** Posts an error that names the port if another program has it.
   *  @param port  UDP; 0: nothing is published
   *  @return false after an error */
  bool start (GstElement *element, int port);
  /** Publishes this clock from now on; null: none. Does nothing before start(). Posts an error if
   *  that fails. */
  void set_clock (GstElement *element, GstClock *clock);
  void stop ();

private:
  std::mutex lock_; /* guards what follows */
  int port_ = 0;
  const char *address_ = nullptr; /* any of IPv6 and IPv4, or of IPv4 alone */
  GstNetTimeProvider *provider_ = nullptr;
  GstClock *clock_ = nullptr; /* of provider_ */
};
