/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Viewers that get frame sets interleaved in their RTSP connection. gst-rtsp-server 1.22 queues up
 * to ten seconds of packets for a slow one, then never sends to it again; where all TCP viewers are
 * slow, it stops the stream of everybody. Here at most four frame sets wait for a viewer; when a
 * fifth comes, all but the newest are dropped, for this viewer only.
 *
 * gst-rtsp-server's transport is removed from its stream, and one of ours gets the packets instead
 * and queues them. The thread that serves the connection hands them to gst-rtsp-server's transport,
 * each after the one before has been sent. */
#pragma once

#include <gst/rtsp-server/rtsp-server.h>

#include <atomic>

/** For a new media, before queue_tcp_transports(). */
void prepare_tcp_queues (GstRTSPMedia *media);

/** @return whether the TCP transports of a viewer have their queues */
bool has_tcp_queues (GstRTSPSessionMedia *media);

/** Puts a queue between each TCP transport of a viewer and its stream. Call it in "play-request".
 *  @param left_out    counts dropped frame sets; must outlive the session
 *  @param holds_back  the viewer's packets begin with a key frame set */
void queue_tcp_transports (
    GstRTSPSessionMedia *media, std::atomic<guint64> &left_out, bool holds_back);

/** Ends the queues of a session. Any thread. Call it before gst-rtsp-server removes the connection
 *  from the session's transports, which it may do in another thread than the connection's. */
void drop_tcp_transports (GstRTSPSession *session);
