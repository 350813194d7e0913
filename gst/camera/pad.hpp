/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <array>
#include <atomic>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <vector>

/** One pad of stereocamsrc: a short queue and the task that empties it, so that a branch that is
 *  held up holds up neither the other branches nor the cameras. A full queue lets its oldest
 *  picture go and counts it. Any thread, but for what is said. */
class CameraPad {
public:
  /** From the task: what a push gave, if it is something else than the last one's. */
  using Flowed = std::function<void (CameraPad &, GstFlowReturn)>;

  /** @param pad  not active; this has a reference */
  CameraPad (GstElement *element, GstPad *pad, Flowed flowed);
  /** The pad is not active any more. */
  ~CameraPad ();
  CameraPad (const CameraPad &) = delete;
  CameraPad &operator= (const CameraPad &) = delete;

  [[nodiscard]] GstPad *pad () const { return pad_; }
  [[nodiscard]] const char *name () const { return GST_PAD_NAME (pad_); }

  /** Before the pad becomes active: a new stream. */
  void prepare (guint group_id);
  /** For the pad's activatemode function. */
  bool activate (bool active);

  /* Each with the group id of the stream that it is for: of an older one nothing is taken. */

  /** All but the first of equal caps do nothing. Transfer none. */
  void set_caps (guint stream, GstCaps *caps);
  /** Takes the buffer; its PTS is set. */
  void send (guint stream, GstBuffer *buffer);
  /** Nothing comes for that time. */
  void send_gap (guint stream, GstClockTime begin, GstClockTime duration);
  /** What waits goes out first; nothing is taken after it, until a flush. */
  void send_eos (guint stream, guint32 seqnum);

  void flush_start (GstEvent *event);
  void flush_stop (GstEvent *event);

  /** Pictures that the queue had no room for. */
  [[nodiscard]] guint64 overrun () const { return overrun_; }
  void reset_counters () { overrun_ = 0; }

private:
  static constexpr guint kMaxPictures = 3; ///< beyond the one that is being pushed
  static constexpr guint kMaxItems = 16;   ///< with events

  static GstPadProbeReturn see_flush (GstPad *pad, GstPadProbeInfo *info, gpointer self);
  static void loop (gpointer self);
  void flushed_by_others ();
  void wait_while_flushing ();
  void one_item ();
  GstMiniObject *next_item ();
  void put (GstMiniObject *item);
  void remove (guint index);
  bool let_oldest_go (bool gap_too);
  void clear ();
  void push_stream_start ();
  void push_segment ();
  GstFlowReturn push (GstMiniObject *item);

  GstElement *element_;
  GstPad *pad_;
  Flowed flowed_;
  gulong flush_probe_ = 0;
  std::atomic<guint64> overrun_ = 0;

  std::mutex lock_; /* guards down to the blank line */
  std::condition_variable changed_;
  std::array<GstMiniObject *, kMaxItems> ring_{};
  guint first_ = 0, count_ = 0, pictures_ = 0;
  bool flushing_ = true, ended_ = false, discont_ = true;
  bool flushed_ = false;    ///< by an event that the application pushed on the pad
  GstCaps *caps_ = nullptr; ///< the last that were put
  guint group_id_ = 0;

  /* The task's, and theirs who made it stand still. */
  bool needs_start_ = true, needs_segment_ = true;
  GstFlowReturn last_flow_ = GST_FLOW_OK;
};

using CameraPads = std::vector<std::shared_ptr<CameraPad>>; ///< left, right, perhaps third
