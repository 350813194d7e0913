/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/rtsp-server/rtsp-server.h>

#include <memory>
#include <vector>

struct TransportUnref {
  void operator() (GstRTSPStreamTransport *transport) const { g_object_unref (transport); }
};
using TransportRef = std::unique_ptr<GstRTSPStreamTransport, TransportUnref>;

/** The transports of a session's media that go one way, to one viewer. */
std::vector<TransportRef> transports_of (GstRTSPSessionMedia *media, GstRTSPLowerTrans lower);
