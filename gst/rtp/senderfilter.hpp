/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gio/gio.h>

/** Lets the kernel drop what others than one sender send to a UDP socket, before it takes room in
 *  the socket's buffer: a flood would fill that faster than anybody reads it, and the good packets
 *  would be lost with the others.
 *
 *  One in `kSample` packets of the others is let through, so that the reader sees that there are
 *  some, and the next sender once this one is gone. Needs no rights. Linux (classic BPF, see
 *  Documentation/networking/filter.rst of the kernel); elsewhere nothing is filtered. */
class SenderFilter {
public:
  static constexpr unsigned kSample = 8;

  /** Another sender replaces the one before.
   *  @param socket  a UDP socket, for example udpsrc's used-socket
   *  @param sender  IPv4 or IPv6 address with port, from a packet's GstNetAddressMeta
   *  @return whether the kernel filters now */
  static bool attach (GSocket *socket, GSocketAddress *sender);
  /** All packets come again. */
  static void detach (GSocket *socket);
};
