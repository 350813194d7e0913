/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Keeps a media running, as a viewer would that throws away what comes. */
#pragma once

#include <gst/rtsp-server/rtsp-server.h>

#include <condition_variable>
#include <mutex>

/** So it goes on while viewers come and go, and packets flow where the only viewer is slow. Any
 *  thread; no lock is held while the media changes its state. */
class MediaHolder {
public:
  ~MediaHolder () { release (); }
  /** Gets it ready. Another one that is held is left alone until release().
   *  @return whether it is held */
  bool hold (GstRTSPMedia *media);
  /** If it is held. Its first viewer must have been connected before, to get its first frame set.
   */
  void start (GstRTSPMedia *media);
  /** @return whether it was started */
  bool has_started (GstRTSPMedia *media);
  /** @param only  nothing happens if another one is held, and it is never held again; nullptr:
   *  whatever is held */
  void release (GstRTSPMedia *only = nullptr);
  /** The same, if nobody has asked since then. */
  void release_unless_asked_since (gint64 monotonic_us);
  bool holds_any ();
  /** Somebody asks for the media: it is not let go soon. Returns when no release() is at work: who
   *  got the media meanwhile would get one that ends, and an error. */
  void note_asking ();

private:
  enum class Phase { kNone, kTaking, kHeld, kStarted };
  void let_go (std::unique_lock<std::mutex> &guard);

  std::mutex lock_; /* guards what follows */
  std::condition_variable changed_;
  Phase phase_ = Phase::kNone;
  bool unwanted_ = false; /* was released while it was taken */
  int releasing_ = 0;     /* calls at work */
  gint64 asked_at_us_ = 0;
  GstRTSPMedia *media_ = nullptr;
  GPtrArray *transports_ = nullptr;
};
