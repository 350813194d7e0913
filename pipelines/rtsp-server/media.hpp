/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* A launch string as a shared media of gst-rtsp-server. */
#pragma once

#include <gst/rtsp-server/rtsp-server.h>

#include <atomic>
#include <functional>
#include <string>

#include "options.hpp"

/** The role that may access the factory where there is authentication. */
inline constexpr char kViewerRole[] = "viewer";

/** Since the start; any thread. */
struct StreamCounts {
  std::atomic<guint64> frame_sets = 0;   /* from the launch string */
  std::atomic<guint64> bytes = 0;        /* of their RTP packets */
  std::atomic<guint64> key_requests = 0; /* GstForceKeyUnit events at the payloader */
  std::atomic<guint64> left_out =
      0; /* frame sets dropped for slow TCP viewers, each counted once a viewer */
};

/** A bin of the launch string, with a payloader pay0, which is added where coded frame sets have
 *  none.
 *  @return nullptr with error set on failure */
GstElement *make_stream_bin (const std::string &launch, GError **error);

/** Called by any thread when a stream ends: maybe with is_over = false at EOS of the payloader,
 *  then with is_over = true at EOS or an error on the bus. `why` is empty at EOS, otherwise the
 *  error. */
using StreamEnd = std::function<void (GstRTSPMedia *media, bool is_over, const std::string &why)>;

/** The factory of the launch string.
 *  @param counts  must live as long as the factory */
GstRTSPMediaFactory *make_factory (
    const RtspOptions &options, StreamCounts &counts, StreamEnd on_end);

/** Viewers that come from now on share a new media. Any thread. */
void begin_new_run (GstRTSPMediaFactory *factory);

/** Ends waits for a first frame set, for which gst_rtsp_media_prepare() waits up to 20 s. For good;
 *  any thread. */
void end_waiting (GstRTSPMediaFactory *factory);

/** Call it once, before the server has clients. At each PLAY gst-rtsp-server 1.22 makes the sinks
 *  of live media, too, wait for the clock, for all viewers; this turns it off until
 *  disable_live_sync(). */
void disable_live_sync_at_play ();

/** Sinks of a live media send at once instead of delaying frame sets by the pipeline's latency:
 *  the viewer's jitter buffer goes by RTP timestamps. Media that is not live (files) keeps
 *  waiting for the clock. gst-rtsp-server 1.22 turns the waiting on at each PLAY: call this
 *  after it. Any thread. */
void disable_live_sync (GstRTSPMedia *media);

/** Requests a key frame set, with the rig in it, from the encoder. */
void request_key_frame_set (GstRTSPMedia *media);
