/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/base/gstflowcombiner.h>

#include <atomic>
#include <mutex>

#include "clock.hpp"
#include "pad.hpp"
#include "painter.hpp"
#include "settings.hpp"

/** The thread that feeds all pads of avatartestsrc: negotiates one size and frame rate with their
 *  peers, waits until the next frame is due, draws and pushes. It runs from READY to PAUSED and
 *  back while a pad is linked.
 *
 *  Locks, in this order: lock_, that of FrameClock. None is held while pushing, querying, posting
 *  or waiting. */
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
  /** For EOS of the application. @return false: not in this state */
  bool end ();

  [[nodiscard]] bool is_live () const { return is_live_; }
  GstClockTime period () { return clock_.period (); }
  guint64 skipped () { return clock_.skipped (); }
  [[nodiscard]] guint64 frames () const { return frames_; }

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

  GstElement *element_;
  FrameClock clock_;
  std::atomic<bool> is_live_ = false; ///< of this run
  std::atomic<guint64> frames_ = 0;

  std::mutex lock_; /* guards what follows, down to the blank line */
  AvatarPads pads_;
  GstFlowCombiner *combiner_ = gst_flow_combiner_new ();
  GstTask *task_ = nullptr; ///< made when the first pad is linked
  bool running_ = false;    ///< between run() and request_stop()
  bool eos_wanted_ = false, ended_ = false;

  /* The thread's, or while it does not run. */
  GRecMutex task_lock_;
  int num_buffers_ = -1;
  AvatarPainter painter_;
  guint group_id_ = 0;
};
