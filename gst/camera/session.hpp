/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/base/gstflowcombiner.h>
#include <gst/gst.h>

#include "camera/aravis/action_command.hpp"
#include "camera/aravis/camera.hpp"
#include "camera/aravis/exposure_sync.hpp"
#include "camera/aravis/heartbeat.hpp"
#include <atomic>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "caps.hpp"
#include "pad.hpp"
#include "pairing.hpp"
#include "settings.hpp"
#include "ticker.hpp"

using CamSourcePads = std::vector<std::shared_ptr<CamSourcePad>>; ///< left, right, perhaps third

/** What stereocamsrc does from READY to PAUSED and back, in a thread of its own, for cameras make
 *  one wait: opens the cameras, agrees with downstream on a format, lets them run, pairs what
 * comes, and begins again when one is lost. The thread keeps itself and the element alive, so that
 * no state change has to wait for a camera that does not answer.
 *
 *  Threads: this one; Aravis' (frames and losses are only noted); the ticker's and the cameras'
 *  trigger threads; the pads' tasks, which tell how pushing goes. lock_ is held while
 *  nothing is called that waits, pushes or posts. */
class CamSourceSession : public std::enable_shared_from_this<CamSourceSession> {
public:
  struct Setup {
    GstElement *element = nullptr; ///< transfer none
    CamSourceSettings settings;
    CameraNames names;
    CamSourcePads pads;
    guint stream = 0;          ///< the pads' group id: what comes for another one they do not take
    GstClock *clock = nullptr; ///< to be waited for; transfer none; may be null
    std::shared_ptr<CamSourceSession> previous; ///< must have ended first; may be null
  };

  /** @return null if the system gives no thread */
  static std::shared_ptr<CamSourceSession> begin (Setup setup);
  ~CamSourceSession ();

  /* Any thread. */

  void set_playing (bool playing);
  /** The thread will end soon. Posts and sends nothing more. */
  void ask_to_stop ();
  /** @return false if it still runs after that time */
  bool wait_for_end (std::chrono::milliseconds most);
  /** Until other programs may have the cameras. While none is open, as when it is still looked for,
   *  that is at once. @return false if it still has some after that time */
  bool wait_for_cameras (std::chrono::milliseconds most);
  /** An EOS event of the application's. */
  void end (guint32 seqnum);
  /** What waits between frames is forgotten. */
  void flushed ();
  bool capture (GstClockTime time) { return ticker_.ask (time); }
  /** What pushing on a pad gives now. */
  void pad_flowed (const CamSourcePad &pad, GstFlowReturn flow);

  /** From a picture's time to when it is handed out, ns; what is known of it. */
  [[nodiscard]] GstClockTime latency () const { return latency_; }
  /** What it is by what was set. @param period  0: single shots */
  static GstClockTime latency_of (GstClockTime exposure, GstClockTime period);
  /** Transfer full. */
  GstStructure *stats ();

private:
  explicit CamSourceSession (Setup setup);

  /** Why a part of the session ended. */
  enum class End { kStopped, kAgain, kFault };

  /* camsourcesession.cpp: life, faults */
  void run ();
  End one_guarded_life ();
  End one_life ();
  bool open_with_gaps ();
  /** @return whether there were such sessions of this process, and this one is still wanted */
  bool wait_for_leavers ();
  bool stands_fault ();
  bool tell_fault ();
  void rest_before_retry ();
  void post_fault (bool warning);
  void say (const char *name, const char *field, const std::string &value);
  void fail (CameraStatus status);
  void lose (Camera &camera);
  bool fail_if_gone (Camera &camera, const CameraStatus &status);
  void finish (guint32 seqnum);
  [[nodiscard]] bool quits ();
  bool wait_for_clock ();
  GstClockTime running_time ();

  /** Whether this element fires its cameras. */
  [[nodiscard]] bool fires () const
  {
    return settings_.trigger == TriggerMode::kSoftware ||
           (settings_.trigger == TriggerMode::kAction && settings_.action_send);
  }

  /* camsourcecameras.cpp: the cameras */
  bool open_cameras ();
  CameraStatus busy_or_twice (const CameraInfo &seen, std::size_t camera, CameraStatus busy) const;
  bool choose_format ();
  bool configure_cameras ();
  bool start_cameras ();
  bool wait_for_ptp ();
  void bank_statistics ();
  void set_has_cameras (bool has);
  void stop_cameras ();
  void start_ticker ();
  void fire (GstClockTime tick);
  void read_clocks ();
  std::vector<GstPad *> gst_pads () const;
  bool needs_other_format ();

  /* camsourceserve.cpp: what comes */
  End serve ();
  void take_frames ();
  void send (CamSourceSet &set);
  bool stamp (const CamSourceSet &set, GstClockTime &pts, GstClockTime &capture);
  void begin_to_play ();
  void warn_if_not_ptp (GstClock *clock);
  void raise_latency ();
  void look_around ();
  void send_gaps (GstClockTime until_ago = 0);
  void feel_pulses (std::int64_t now_ns);
  void watch_clock (std::int64_t now_ns, std::int64_t most_ns);
  void watch_cameras (std::int64_t now_ns);
  bool keeps_buffers ();
  void warn_once (const CameraStatistics &all);
  CameraStatistics camera_statistics ();

  GstElement *element_;
  const CamSourceSettings settings_;
  const CameraNames names_;
  const CamSourcePads pads_;
  const guint stream_;
  GstClock *clock_;
  std::shared_ptr<CamSourceSession> previous_;
  std::atomic<GstClockTime> latency_ = 0;
  std::atomic<guint64> reconnects_ = 0;
  CamSourcePairing pairing_;
  CamSourceTicker ticker_;

  std::mutex lock_; /* guards down to the blank line */
  std::condition_variable changed_;
  bool quit_ = false, ended_ = false, has_cameras_ = false, playing_ = false, eos_ = false,
       flushed_ = false;
  struct Arrival {
    int camera;
    CameraFrame frame;
  };
  std::vector<Arrival> inbox_;
  CameraStatus fault_; ///< what ended the life
  GstFlowReturn fatal_flow_ = GST_FLOW_OK;
  GstFlowCombiner *flows_ = gst_flow_combiner_new ();
  CameraStatistics before_{};                    ///< of cameras that are closed
  std::vector<std::shared_ptr<Camera>> counted_; ///< for stats()

  /* This thread's. */
  std::vector<std::shared_ptr<Camera>> cameras_;
  std::vector<CameraAbilities> abilities_;
  std::array<CameraPulse, kMaxCameras> pulses_;
  LookFollower look_;
  SimultaneousCalls triggers_;
  ActionSender action_;
  CamSourceFormat format_;
  std::vector<Arrival> taken_;
  bool was_playing_ = false, said_fault_ = false, said_underruns_ = false, said_incomplete_ = false,
       clock_ready_ = false;
  std::int64_t playing_since_ns_ = 0, last_look_ns_ = 0, last_clock_read_ns_ = 0,
               last_stats_ns_ = 0, last_sent_ns_ = 0;
  guint64 sent_ = 0;
  GstClockTime exposure_ = 0; ///< of the one that exposes longest, ns; 0: not known
  std::array<std::uint64_t, kMaxCameras> underruns_{}; ///< when it was last looked
  std::optional<bool> stands_;                         ///< the fault of this life, once it was told
  std::array<std::int64_t, kMaxCameras> shortest_trip_us_{}; ///< to a camera's clock and back
  GstClockTime last_pts_ = GST_CLOCK_TIME_NONE, sent_until_ = GST_CLOCK_TIME_NONE, gap_until_ = 0;
};
