/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/base/gstflowcombiner.h>
#include <gst/gst.h>

#include <atomic>
#include <chrono>
#include <memory>
#include <optional>
#include <vector>

#include "cameras.hpp"
#include "common/backgroundjobs.hpp"
#include "common/statsreporter.hpp"
#include "events.hpp"
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
 *  Threads: this one; Aravis' and the trigger threads, which only report to CameraEvents; the pads'
 *  tasks, which report flows. No lock is held while anything waits for a camera, pushes or posts.
 */
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
  /** @return false if the thread has not ended after that time, and may still hold a camera */
  bool wait_until_ended (std::chrono::milliseconds limit);
  /** Ends all pads. */
  void send_eos (guint32 seqnum);
  /** Pushing on a pad gives a new flow. */
  void handle_flow (const CameraPad &pad, GstFlowReturn flow);

  /** From capture to output, ns, as far as it is known. */
  [[nodiscard]] GstClockTime latency () const { return latency_; }
  /** Transfer full. */
  GstStructure *stats ();
  /** For rangecast-stats; its latency is the delay of images. */
  StatsRow stats_row ();

private:
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
  void clear_frames ();
  void wait_before_retry ();
  bool report_fault ();
  void post_fault (const CameraStatus &fault, bool warning);
  void post_element_message (const char *name, const char *field, const std::string &value);
  void send_gaps (GstClockTime until_ago = 0);

  /* streaming.cpp: while cameras stream */
  End stream ();
  void handle_frames ();
  void begin_playing ();
  void run_periodic_checks ();
  CameraStatus check_silence (std::int64_t now_ns);
  void warn_about_losses ();
  void update_latency ();

  /* Constant. */
  GstElement *element_; ///< a reference, which the thread drops last
  const StereoCamSettings settings_;
  const CameraNames names_;
  const CameraPads pads_;
  const std::vector<GstPad *> gst_pads_;
  GstClock *clock_;

  /* Each has its own rules for threads. */
  CameraEvents events_;
  FramePairing pairing_;
  CameraTrigger trigger_;
  CameraGroup cameras_;
  SetOutput output_;
  std::atomic<GstClockTime> latency_;
  std::atomic<guint64> reconnects_ = 0;

  /* Between threads: guarded by the lock of events_. */
  bool ended_ = false, playing_ = false, eos_ = false;
  GstFlowReturn flow_ = GST_FLOW_OK; ///< of all pads together, if it ends the stream
  GstFlowCombiner *combiner_ = gst_flow_combiner_new ();

  /* The thread's. */
  std::shared_ptr<CameraSession> previous_;
  std::vector<CameraEvents::Frame> frames_; ///< swapped with those of events_
  BackgroundJobs opening_;
  std::optional<bool> retry_; ///< once the fault was reported: whether it is worth trying again
  bool clock_ready_ = false;  ///< clock-server answered
  bool lost_ = false;         ///< stereocamsrc-lost was posted, stereocamsrc-back was not
  bool warned_buffers_ = false, warned_incomplete_ = false;
  bool was_playing_ = false;
  std::int64_t playing_since_ns_ = 0, checked_ns_ = 0, latency_updated_ns_ = 0;
};
