/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* gst-rtsp-server 1.22 stops a shared media with its last viewer, fails requests that meet it
 * stopping, and stalls it while its only viewer is slow. So a viewer that discards all packets
 * keeps it alive. */
#pragma once

#include <gst/rtsp-server/rtsp-server.h>

#include <condition_variable>
#include <mutex>

/** Prepares and plays one media at a time. Any thread; no lock is held while the media changes its
 *  state. */
class MediaKeepAlive {
public:
  ~MediaKeepAlive () { release (); }
  /** Prepares the media, and makes its sinks. Does nothing while another one is held.
   *  @return whether this media is held */
  bool hold (GstRTSPMedia *media);
  /** Plays the media if it is held. Call it when the first viewer's transports are in place, so
   *  that this viewer gets the first frame set. */
  void start (GstRTSPMedia *media);
  bool has_started (GstRTSPMedia *media);
  /** Stops the media that is held.
   *  @param only  of this media, which is not held again; nullptr: of any */
  void release (GstRTSPMedia *only = nullptr);
  /** Stops the media that is held unless record_request() was called since then. */
  void release_unless_asked_since (gint64 monotonic_us);
  bool holds_any ();
  /** Before a DESCRIBE is handled. Waits until no release() is in progress, during which the
   *  factory would return a media that is ending. */
  void record_request ();

private:
  enum class Phase { kNone, kPreparing, kHeld, kStarted };
  void release_held (std::unique_lock<std::mutex> &guard);

  std::mutex lock_; /* guards what follows */
  std::condition_variable changed_;
  Phase phase_ = Phase::kNone;
  bool released_ = false; /* while it was prepared */
  int releasing_ = 0;     /* release() calls in progress */
  gint64 requested_at_us_ = 0;
  GstRTSPMedia *media_ = nullptr;
  GPtrArray *transports_ = nullptr;
};
