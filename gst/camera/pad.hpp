/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/base/gstqueuearray.h>
#include <gst/gst.h>

#include <atomic>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <vector>

/** One pad of stereocamsrc: a short queue and the task that empties it, so that a blocked branch
 *  blocks neither the other branches nor the cameras. A full queue drops its oldest image and
 *  counts it. Any thread, except where it says otherwise. */
class CameraPad {
public:
  /** Called from the task when pushing gives another flow than before. */
  using FlowChanged = std::function<void (CameraPad &, GstFlowReturn)>;

  /** @param pad  inactive; this takes a reference */
  CameraPad (GstElement *element, GstPad *pad, FlowChanged flow_changed);
  /** The pad is inactive. */
  ~CameraPad ();
  CameraPad (const CameraPad &) = delete;
  CameraPad &operator= (const CameraPad &) = delete;

  [[nodiscard]] GstPad *pad () const { return pad_; }

  /** Begins a new stream; before the pad becomes active. */
  void prepare (guint group_id);
  /** For the pad's activatemode function. */
  bool activate (bool active);

  /* Each with the group id of its stream; what is for an older stream is dropped. */

  /** Ignores equal caps. Transfer none. */
  void set_caps (guint group_id, GstCaps *caps);
  /** Takes the buffer, which has its PTS. */
  void send (guint group_id, GstBuffer *buffer);
  /** No image comes for that time. */
  void send_gap (guint group_id, GstClockTime begin, GstClockTime duration);
  /** After what is queued. What is sent after it is dropped. */
  void send_eos (guint group_id, guint32 seqnum);

  /** Images that were dropped from a full queue. */
  [[nodiscard]] guint64 overrun () const { return overrun_; }
  void reset_counters () { overrun_ = 0; }

private:
  static constexpr guint kMaxImages = 3; ///< besides the one that is being pushed
  static constexpr guint kMaxItems = 8;  ///< with events, before a GAP event is queued

  static void loop (gpointer self);
  void push_next ();
  void put (GstMiniObject *item);
  void drop_oldest_image ();
  void clear ();
  void push_segment ();
  GstFlowReturn push (GstMiniObject *item);

  GstElement *element_;
  GstPad *pad_;
  FlowChanged flow_changed_;
  std::atomic<guint64> overrun_ = 0;

  std::mutex lock_; /* guards down to the blank line */
  std::condition_variable changed_;
  GstQueueArray *queue_ = gst_queue_array_new (kMaxItems); ///< of GstMiniObject
  guint images_ = 0;                                       ///< in the queue
  bool flushing_ = true, ended_ = false, discont_ = true;
  GstCaps *caps_ = nullptr; ///< the last ones queued
  guint group_id_ = 0;

  /* The task's, or while it is paused. */
  bool needs_start_ = true, needs_segment_ = true;
  GstFlowReturn last_flow_ = GST_FLOW_OK;
};

using CameraPads = std::vector<std::shared_ptr<CameraPad>>; ///< left, right, perhaps third
