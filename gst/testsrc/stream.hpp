/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/base/gstflowcombiner.h>

#include <mutex>

#include "clock.hpp"
#include "pad.hpp"
#include "painter.hpp"
#include "settings.hpp"

/** The thread that feeds all pads of avatartestsrc: negotiates one size and frame rate with their
 *  peers, waits until the next frame is due, draws and pushes. It runs from READY to PAUSED and
 *  back while a pad is linked; flushes and seeks pause it.
 *
 *  Locks, in this order: task_lock_, lock_, those of FrameClock and AvatarPad. The thread holds
 *  task_lock_ for a whole frame, as it would hold a pad's stream lock. No other lock is held while
 *  pushing, querying, posting or waiting; lock_ and AvatarPad's are held while a pool, which may be
 *  downstream's, is set flushing. */
class AvatarStream {
public:
  /** @param element  owns this, and outlives it */
  explicit AvatarStream (GstElement *element);
  ~AvatarStream ();
  AvatarStream (const AvatarStream &) = delete;
  AvatarStream &operator= (const AvatarStream &) = delete;

  /* State changes, in this order. */

  /** @return false after an error message */
  bool start (const AvatarSettings &settings);
  /** Lets the thread run. The pads are active. */
  void run ();
  /** Live frames are captured only while the element plays. */
  void set_playing (bool playing) { clock_.set_playing (playing); }
  /** Ends all waits. The pads are still active. */
  void request_stop ();
  /** Waits for the thread's end. The pads are inactive, so no push holds it. */
  void stop ();

  /* Any thread. */

  void add_pad (GstPad *pad, AvatarPadKind kind);
  /** Call while the pad is active: the thread ignores the flow of a pad that was removed. */
  void remove_pad (GstPad *pad);
  void pad_linked ();
  /** For events of the application. @return false: not in this state */
  bool end ();
  bool flush_start (GstEvent *event);
  bool flush_stop (GstEvent *event);
  bool seek (GstEvent *event);

  bool is_live ();
  GstClockTime period () { return clock_.period (); }
  guint64 skipped () { return clock_.skipped (); }
  guint64 frames ();

private:
  static void loop (gpointer stream);
  GstFlowReturn output_frame (const AvatarPads &pads);
  GstFlowReturn negotiate (const AvatarPads &pads);
  GstFlowReturn negotiate_pad (AvatarPad &pad, const AvatarFormat &format);
  GstFlowReturn push_frame (const AvatarPads &pads, const FrameTime &time);
  GstFlowReturn push_picture (AvatarPad &pad, const FrameTime &time);
  void end_stream (const AvatarPads &pads, GstFlowReturn flow);

  /* With lock_. */
  [[nodiscard]] bool has_pad (const AvatarPad &pad) const;
  [[nodiscard]] bool any_linked () const;
  [[nodiscard]] bool must_pause () const;
  void start_task ();
  void pause_task ();

  AvatarPads pads ();
  void hold_task ();
  void release_task (guint32 seqnum); /* with task_lock_ */
  void push_flush (bool start, guint32 seqnum, bool reset_time);

  GstElement *element_;
  FrameClock clock_;

  std::mutex lock_; /* guards what follows, down to the blank line */
  AvatarPads pads_;
  GstFlowCombiner *combiner_ = gst_flow_combiner_new ();
  guint64 frames_ = 0;
  GstTask *task_ = nullptr; ///< made when the first pad is linked
  bool running_ = false;    ///< between run() and request_stop()
  int holds_ = 0;           ///< flushes and seeks in progress, which keep the task paused
  bool app_flush_ = false;  ///< one of them is the application's own
  bool eos_wanted_ = false, ended_ = false;
  guint32 last_seek_ = GST_SEQNUM_INVALID;
  bool is_live_ = false; ///< of this run; the thread reads it without the lock

  /* The thread's, or with task_lock_. */
  GRecMutex task_lock_;
  int num_buffers_ = -1;
  AvatarPainter painter_;
  GstSegment segment_;
  guint32 segment_seqnum_ = 0;
  guint group_id_ = 0;
  guint64 sent_ = 0;
  bool renegotiated_ = false; /* because a peer refused a frame; none has been sent since */
};
