/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The threads of an RTSP server that serve connections, and which of them serves which. */
#pragma once

#include <gst/rtsp-server/rtsp-server.h>

#include <functional>

/** Called when a connection gets its thread, before that serves it; with what runs in that thread.
 */
using ThreadOfClient = std::function<void (GstRTSPClient *, GMainContext *)>;

/** @param n  threads at most, which serve all connections */
GstRTSPThreadPool *make_thread_pool (int n, ThreadOfClient on_client);
