/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What rtsp-server serves: a launch string as a media of gst-rtsp-server that all viewers share. */
#pragma once

#include <gst/rtsp-server/rtsp-server.h>

#include <atomic>
#include <functional>
#include <string>

#include "options.hpp"

/** The role of the factory that its viewers must have, where there is authentication. */
inline constexpr char kViewerRole[] = "viewer";

/** Counted since the start; any thread. */
struct StreamCounts {
  std::atomic<guint64> frame_sets = 0;   /* that the launch string gave */
  std::atomic<guint64> bytes = 0;        /* of their RTP packets */
  std::atomic<guint64> key_requests = 0; /* GstForceKeyUnit that came to the payloader */
  std::atomic<guint64> left_out = 0;     /* frame sets not sent to viewers that were too slow */
};

/** The element that a launch string makes: a bin with a payloader pay0. One is added behind coded
 *  frame sets if it is missing.
 *  @return nullptr, with error set, if it cannot be made */
GstElement *make_stream_bin (const std::string &launch, GError **error);

/** Called by any thread when a stream ends: maybe first when its viewers are told, then when it is
 *  over. The text is empty at EOS, otherwise what went wrong. */
using StreamEnd = std::function<void (GstRTSPMedia *media, bool is_over, const std::string &why)>;

/** The factory of the one media; by it clients of the server get theirs.
 *  @param counts  must live as long as the factory */
GstRTSPMediaFactory *make_factory (
    const RtspOptions &options, StreamCounts &counts, StreamEnd on_end);

/** Who comes from now on gets a media of its own, not the one that others have. Any thread. */
void begin_new_run (GstRTSPMediaFactory *factory);

/** The server ends: nobody waits any longer for a first frame set, which may be 20 seconds. Any
 *  thread. */
void end_waiting (GstRTSPMediaFactory *factory);

/** To be called once, before the server has clients. Else the library has live frame sets, too,
 * wait for their times at each PLAY, for all viewers, until send_as_they_come(). */
void let_live_media_play ();

/** Live frame sets go out as soon as they are there: they carry their times, and the viewer's
 * jitter buffer goes by them. Others (files) are held back to their times. The library holds all of
 * them back anew at each PLAY: call this after it. Any thread. */
void send_as_they_come (GstRTSPMedia *media);

/** Lets every payloader of the media ask its encoder for a key frame set, with the rig. */
void request_key_frame_set (GstRTSPMedia *media);
