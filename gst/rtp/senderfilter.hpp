/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gio/gio.h>

/** A socket filter with which the kernel drops the packets of all but one sender before they reach
 *  the socket's buffer. A flood would fill the buffer faster than it is read, and packets of the
 *  sender would be lost.
 *
 *  One in `kSample` foreign packets still passes, so that the element can report rivals and detect
 *  the next sender. Needs no privileges. Linux only (classic BPF, see
 *  Documentation/networking/filter.rst of the kernel); elsewhere nothing is filtered. */
class SenderFilter {
public:
  static constexpr unsigned kSample = 8;

  /** Replaces the filter of an earlier sender.
   *  @param socket  a UDP socket, for example udpsrc's used-socket
   *  @param sender  IPv4 or IPv6 address with port, from a packet's GstNetAddressMeta
   *  @return whether the filter is attached */
  static bool attach (GSocket *socket, GSocketAddress *sender);
  /** All packets pass again. */
  static void detach (GSocket *socket);
};
