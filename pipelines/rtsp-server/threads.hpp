/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The threads of an RTSP server that serve connections, and which of them serves which. */
#pragma once

#include <gst/rtsp-server/rtsp-server.h>

#include <functional>

/** Called when a connection gets its thread, before that serves it. By the main loop, with the
 *  server's lock. */
using ThreadOfClient = std::function<void (GstRTSPClient *, GstRTSPThread *)>;

/** @param n  threads at most, which serve all connections */
GstRTSPThreadPool *make_thread_pool (int n, ThreadOfClient on_client);

/** Returns when all threads of all such pools have ended, which they do without connections and
 *  media. gst_rtsp_thread_pool_cleanup() does not know them. */
void end_threads ();
