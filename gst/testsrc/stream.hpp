/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/base/gstflowcombiner.h>

#include <mutex>

#include "clock.hpp"
#include "pad.hpp"
#include "painter.hpp"
#include "settings.hpp"

/** The thread that feeds all pads of avatartestsrc: it agrees with their peers on one size and
 *  frame rate, waits for the next picture's time, draws and pushes. It runs from READY to PAUSED
 *  and back, as long as a pad is linked; flushes and seeks make it stand still for a moment.
 *
 *  Locks, in this order: task_lock_, lock_, those inside of AvatarClock and AvatarPad. The thread
 *  holds task_lock_ all through a frame, as it would a pad's stream lock. No other is held while
 *  pushing, querying, posting or waiting; lock_ and AvatarPad's are held while a pool, which may be
 *  downstream's, is told to flush. */
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
  /** Live pictures are taken only while the element plays. */
  void set_playing (bool playing) { clock_.set_playing (playing); }
  /** Ends all waits. The pads are still active. */
  void ask_to_stop ();
  /** Waits for the thread's end. The pads are inactive, so no push holds it. */
  void stop ();

  /* Any thread. */

  void add_pad (GstPad *pad, AvatarPadKind kind);
  /** Call while the pad is still active: what the thread gets from a pad that it does not know any
   *  more, as FLUSHING, it forgets. */
  void remove_pad (GstPad *pad);
  void pad_linked ();
  /** Answers to events; false: not in this state. */
  bool end ();
  bool flush_start (GstEvent *event);
  bool flush_stop (GstEvent *event);
  bool seek (GstEvent *event);

  bool is_live ();
  GstClockTime period () { return clock_.period (); }
  guint64 skipped () { return clock_.skipped (); }
  guint64 frames ();

private:
  AvatarPads pads ();
  bool all_unlinked ();
  bool knows (const AvatarPad &pad) const; /* with lock_ */
  bool any_linked () const;                /* with lock_ */
  bool rests () const;                     /* with lock_ */

  GstCaps *caps_for (const AvatarPad &pad, const AvatarFormat &format) const;
  GstFlowReturn negotiate (const AvatarPads &pads);
  GstFlowReturn negotiate_pad (AvatarPad &pad, const AvatarFormat &format);
  GstFlowReturn refused (const AvatarPad &pad);
  GstFlowReturn no_common_format ();

  static void loop (gpointer stream);
  static bool any_stale (const AvatarPads &pads);
  GstFlowReturn negotiate_if_stale (const AvatarPads &pads);
  GstFlowReturn one_frame (const AvatarPads &pads);
  GstFlowReturn push_pictures (const AvatarPads &pads, const AvatarMoment &moment);
  GstFlowReturn combine (const AvatarPad &pad, GstFlowReturn flow);
  GstFlowReturn push_picture (AvatarPad &pad, const AvatarMoment &moment);
  void end_stream (const AvatarPads &pads, GstFlowReturn flow);
  void post_segment_done ();
  GstEvent *end_event () const;

  void run_task ();   /* with lock_ */
  void pause_task (); /* with lock_ */
  void hold_task ();
  void release_task (guint32 seqnum); /* with task_lock_ */
  void push_flush_start (guint32 seqnum);
  void push_flush_stop (guint32 seqnum, bool reset_time);
  void restart_time ();                /* with task_lock_ */
  bool seek_segment (GstEvent *event); /* with task_lock_ */
  enum class SeekAnswer { kNo, kDone, kFlush, kContinue };
  SeekAnswer admit_seek (GstEvent *event);

  GstElement *element_;
  AvatarClock clock_;

  std::mutex lock_; /* guards all down to the blank line */
  AvatarPads pads_;
  GstFlowCombiner *combiner_ = gst_flow_combiner_new ();
  guint64 frames_ = 0;
  GstTask *task_ = nullptr; /* made when first there is a pad to feed */
  bool running_ = false;    /* between run() and ask_to_stop() */
  int holds_ = 0;           /* so many flushes and seeks under way: the task stands still */
  bool app_flush_ = false;  /* one of them is the application's own */
  bool eos_wanted_ = false, ended_ = false;
  guint32 last_seek_ = GST_SEQNUM_INVALID;
  bool is_live_ = false; /* of this run; also read by the thread, without the lock */

  /* The thread's, and theirs who hold task_lock_. */
  GRecMutex task_lock_;
  int num_buffers_ = -1;
  AvatarPainter painter_;
  GstSegment segment_;
  guint32 segment_seqnum_ = 0;
  guint group_id_ = 0;
  guint64 sent_ = 0;
};
