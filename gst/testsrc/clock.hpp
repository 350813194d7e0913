/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <condition_variable>
#include <mutex>

/** When a picture is taken. */
struct AvatarMoment {
  GstClockTime pts, duration, capture_time;
  guint64 index; ///< pictures before it: in the stream, or (not live, after a seek) from time 0
  guint64 tick;  ///< number of the frame period that capture_time begins, at the present rate
  bool discont;
};

/** Tells the streaming thread when the next picture is due: at once, frame after frame, or, live,
 *  at the multiples of the frame period of the pipeline's clock. */
class AvatarClock {
public:
  /* Streaming thread, or while it stands still. */

  /** Forgets the stream. */
  void start ();
  /** next() goes on with the frame that is shown at this time. */
  void seek (GstClockTime position);
  /** Time goes on where the old rate left it. @return whether the rate is another one */
  bool set_rate (int fps_n, int fps_d);
  /** The frame after the last one, at once. */
  AvatarMoment next ();
  /** Waits for the next multiple of the frame period. Those that have passed are skipped, but the
   *  one after the last is taken until half a period behind it.
   *  @return false if woken before it came: look why, and call again */
  bool wait (GstElement *element, AvatarMoment &moment);

  /* Any thread. */

  /** A live picture is taken only while the element plays. */
  void set_playing (bool playing);
  /** The thread rests: ticks from now to the next picture are none that it missed. */
  void note_rest ();
  /** Ends wait() now, and at once until resume(). */
  void interrupt ();
  void resume ();
  /** Nanoseconds; 0 while the rate is not known. */
  GstClockTime period ();
  /** Multiples that passed without a picture while the element played. */
  guint64 skipped ();

private:
  static constexpr guint64 kNone = G_MAXUINT64;

  [[nodiscard]] GstClockTime time_of (guint64 frame) const;
  [[nodiscard]] guint64 next_tick (GstClockTime now, GstClockTime base);
  bool wait_until (GstClock *clock, GstClockTime time);
  void take_tick (guint64 tick, AvatarMoment &moment);

  std::mutex lock_; /* guards all down to the blank line, and fps_* against period() */
  std::condition_variable wake_;
  bool playing_ = false, interrupted_ = false, paused_since_tick_ = false;
  GstClockID waiting_ = nullptr;
  guint64 skipped_ = 0;

  int fps_n_ = 0, fps_d_ = 1;
  guint64 index_ = 0;
  bool discont_ = true;
  /* not live: PTS = since_ + time_of (frame_) */
  guint64 frame_ = 0;
  GstClockTime since_ = 0, position_ = GST_CLOCK_TIME_NONE;
  guint64 last_tick_ = kNone;
};
