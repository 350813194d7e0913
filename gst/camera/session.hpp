/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/base/gstflowcombiner.h>
#include <gst/gst.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "cameras.hpp"
#include "output.hpp"
#include "pad.hpp"
#include "pairing.hpp"
#include "settings.hpp"
#include "trigger.hpp"

/** What stereocamsrc does from READY to PAUSED and back, in a thread of its own, because cameras
 *  make one wait: opens the cameras, negotiates, lets them stream, pairs and sends their images,
 *  and starts over when one is lost.
 *
 *  The thread keeps this object and the element alive, so that no state change waits for a camera
 *  that does not answer. The thread is not a GstTask, since that must be joined.
 *
 *  Threads: this one; Aravis' and the trigger threads, which only report frames and faults; the
 *  pads' tasks, which report flows. No lock is held while anything waits for a camera, pushes or
 *  posts. */
class CameraSession {
public:
  struct Setup {
    GstElement *element = nullptr; ///< transfer none
    StereoCamSettings settings;
    CameraNames names;
    CameraPads pads;
    guint group_id = 0;        ///< of the pads; they take nothing from a session with another one
    GstClock *clock = nullptr; ///< clock-server's, to wait for; transfer none; may be null
    std::shared_ptr<CameraSession> previous; ///< must have ended first; may be null
  };

  /** @return null if the system gives no thread */
  static std::shared_ptr<CameraSession> begin (Setup setup);
  ~CameraSession ();

  /* Any thread. */

  void set_playing (bool playing);
  /** Ends the thread soon; nothing is posted or sent any more. */
  void request_stop ();
  /** @return false if a camera is still open after that time */
  bool wait_until_closed (std::chrono::milliseconds limit)
  {
    return cameras_.wait_until_closed (limit);
  }
  /** Ends all pads. */
  void send_eos (guint32 seqnum);
  /** The application flushes: drops images between cameras and pads, and goes on after EOS. */
  void flush ();
  bool capture (GstClockTime time) { return trigger_.request (time); }
  /** Pushing on a pad gives a new flow. */
  void handle_flow (const CameraPad &pad, GstFlowReturn flow);

  /** From capture to output, ns, as far as it is known. */
  [[nodiscard]] GstClockTime latency () const { return latency_; }
  /** Transfer full. */
  GstStructure *stats ();

private:
  struct CameraEvent {
    int camera;
    CameraFrame frame;
  };
  /** Why streaming ended. */
  enum class End { kStopped, kRenegotiate, kFault };

  explicit CameraSession (Setup setup);

  /* session.cpp: from opening the cameras to their loss, and again */
  void run ();
  End run_cameras ();
  CameraStatus open_cameras ();
  CameraStatus wait_for_clock ();
  CameraStatus start_cameras ();
  void stop_cameras ();
  void clear_inbox ();
  bool wait_for_other_sessions ();
  bool wait (std::chrono::milliseconds time);
  void wait_before_retry ();
  void fail (CameraStatus fault);
  bool report_fault ();
  void post_fault (const CameraStatus &fault, bool warning);
  void post_element_message (const char *name, const char *field, const std::string &value);
  [[nodiscard]] bool stopping ();
  void send_gaps (GstClockTime until_ago = 0);

  /* streaming.cpp: while cameras stream */
  End stream ();
  void handle_frames ();
  void begin_playing ();
  void warn_if_not_ptp (GstClock *clock);
  void run_periodic_checks ();
  void check_silence (std::int64_t now_ns);
  void warn_about_losses ();
  void update_latency ();

  /* Constant. */
  GstElement *element_; ///< a reference, which the thread drops last
  const StereoCamSettings settings_;
  const CameraNames names_;
  const CameraPads pads_;
  GstClock *clock_;

  /* Each has its own rules for threads. */
  FramePairing pairing_;
  CameraTrigger trigger_;
  CameraGroup cameras_;
  SetOutput output_;
  std::atomic<GstClockTime> latency_;
  std::atomic<guint64> reconnects_ = 0;

  /* Between threads. */
  std::mutex lock_; /* guards what follows */
  std::condition_variable changed_;
  bool stop_ = false, ended_ = false, playing_ = false, eos_ = false, flushed_ = false;
  CameraStatus fault_; ///< the first since the cameras were opened: the cause of others
  GstFlowReturn flow_ = GST_FLOW_OK; ///< of all pads together, if it ends the stream
  GstFlowCombiner *combiner_ = gst_flow_combiner_new ();
  std::vector<CameraEvent> inbox_;

  /* The thread's. */
  std::shared_ptr<CameraSession> previous_;
  std::vector<CameraEvent> events_; ///< swapped with the inbox
  std::optional<bool> retry_; ///< once the fault was reported: whether it is worth trying again
  bool clock_ready_ = false;  ///< clock-server answered
  bool lost_ = false;         ///< stereocamsrc-lost was posted, stereocamsrc-back was not
  bool warned_buffers_ = false, warned_incomplete_ = false;
  bool was_playing_ = false;
  std::int64_t playing_since_ns_ = 0, checked_ns_ = 0, stats_posted_ns_ = 0;
};
