/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* A viewer that gets frame sets inside its RTSP connection. gst-rtsp-server of GStreamer 1.22 keeps
 * up to ten seconds of packets for one that is slow, then never sends to it again; and where all
 * such viewers are slow it stops the whole stream. Here at most four frame sets wait for a viewer;
 * where a fifth comes all but the newest are left out, for this viewer only.
 *
 * How: the library's transport is taken out of its stream, and another one, of ours, gets the
 * packets instead. It queues them, and the thread that serves the connection hands them to the
 * library's transport, one message after the other has been sent. */
#pragma once

#include <gst/rtsp-server/rtsp-server.h>

#include <atomic>

/** To be called when a media is made, before queue_tcp_transports() for it. */
void prepare_tcp_queues (GstRTSPMedia *media);

/** @return whether the TCP transports of a viewer have their queues */
bool has_tcp_queues (GstRTSPSessionMedia *media);

/** Puts such a queue between the TCP transports of a viewer and their streams. Call it when the
 *  viewer's PLAY was answered, from the thread that serves its connection.
 *  @param left_out    counts the frame sets that are left out; must outlive the session
 *  @param holds_back  nothing is sent before a key frame set begins */
void queue_tcp_transports (
    GstRTSPSessionMedia *media, std::atomic<guint64> &left_out, bool holds_back);

/** Ends the queues of a session; the viewer gets no more. Any thread; to be called before the
 *  library takes the connection away from its transports in another thread than its own. */
void drop_tcp_transports (GstRTSPSession *session);
