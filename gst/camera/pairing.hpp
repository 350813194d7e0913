/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include "camera/aravis/types.hpp"
#include "common/matcher.hpp"
#include <array>
#include <mutex>
#include <optional>
#include <rangecast/sync/camera_clock.hpp>
#include <rangecast/sync/trigger_matcher.hpp>

/** Images of all cameras that were exposed at the same time. */
struct ImageSet {
  std::array<GstBufferPtr, kMaxCameras> images;
  GstClockTime trigger_time = GST_CLOCK_TIME_NONE; ///< on the pipeline clock; NONE: see taken_ns
  std::int64_t taken_ns = 0; ///< capture time of the left image, g_get_monotonic_time () * 1000
};

/** Counters since the session began. */
struct PairingStatistics {
  guint64 sets = 0;
  std::array<guint64, kMaxCameras> dropped{};    ///< complete images without partner
  std::array<guint64, kMaxCameras> incomplete{}; ///< images with missing packets, or lost
  guint64 time_mismatch = 0; ///< sets that were dropped because of different exposure times
  guint64 unknown = 0;       ///< images that answer no known trigger
  guint64 missing_packets = 0;
  bool has_spread = false;                           ///< the following are valid
  std::int64_t spread_p50_ns = 0, spread_p99_ns = 0; ///< of the exposures within a set
  std::int64_t delay_p50_ns = 0, delay_p99_ns = 0; ///< from trigger or exposure to the last packet
};

/** Assembles image sets from the frames of two or three cameras: by the trigger that they answer
 *  or, where this element sends none, by exposure time. Any thread; one lock guards all. */
class FramePairing {
public:
  /** @param element  for log messages; outlives this; may be null */
  explicit FramePairing (GstElement *element = nullptr) : element_ (element) {}
  FramePairing (const FramePairing &) = delete;
  FramePairing &operator= (const FramePairing &) = delete;

  /** A partner more than so many frames late is not waited for. */
  static constexpr int kMaxWaiting = 8;

  enum class TriggeredBy {
    kElement,  ///< this element, which reports each trigger with add_trigger()
    kExternal, ///< one signal or command that reaches all cameras
    kCamera,   ///< each camera by itself
  };

  /** @param exposure_ns  as far as it is known
   *  @param max_waiting  images of one camera that may wait for partners, 1 to kMaxWaiting */
  void configure (int cameras, TriggeredBy by, GstClockTime period_ns, GstClockTime exposure_ns,
      int max_waiting);
  /** Drops frames and what was learnt about delays and clocks; keeps the counters. */
  void reset ();
  /** Drops the frames that wait for partners. */
  void drop_waiting ();

  /** Sets what to add to a camera's timestamps for g_get_monotonic_time, ns. */
  void set_clock_offset (int camera, std::int64_t offset_ns);
  /** True once after timestamps contradicted the offsets: read the clocks again. */
  bool clocks_are_off ();

  /** Whether a trigger may be sent now. While a camera's delay is unknown, a trigger must have been
   *  answered before the next one.
   *  @param now_ns  g_get_monotonic_time */
  bool may_trigger (std::int64_t now_ns);
  /** A trigger is about to be sent; answers count from now on.
   *  @param time     on the pipeline clock
   *  @param sent_ns  when cameras receive it, g_get_monotonic_time */
  void add_trigger (GstClockTime time, std::int64_t sent_ns);

  void add_frame (int camera, CameraFrame frame);
  /** The next complete set, in order of time. @return false: none yet */
  bool next_set (ImageSet &set);

  /** When a camera's last frame came, complete or not, g_get_monotonic_time, ns; 0: none. */
  [[nodiscard]] std::int64_t last_frame_ns (int camera);
  PairingStatistics stats ();

private:
  /** A frame that waits for its partners; without a buffer it was lost, and they need not wait. */
  struct WaitingFrame {
    CameraFrame frame;
    std::int64_t key = 0;        ///< number of its trigger, or taken_ns
    std::int64_t taken_ns = 0;   ///< comparable between cameras; decides
    std::int64_t exposed_ns = 0; ///< by the cameras' clocks if known; for statistics
  };
  /** The frames of one camera that wait, in order of their keys. */
  struct Lane {
    std::array<WaitingFrame, kMaxWaiting + 1> ring; ///< next_set() keeps at most kMaxWaiting
    std::size_t first = 0, count = 0;
    std::optional<std::int64_t> last_key;
    MatchStream head;
    WaitingFrame &front () { return ring[first]; }
  };
  struct Trigger {
    GstClockTime time = 0;    ///< on the pipeline clock
    std::int64_t sent_ns = 0; ///< g_get_monotonic_time
  };
  static constexpr int kMaxTriggers = 64, kMaxLearningTriggers = 8;

  void add_triggered_frame (int camera, CameraFrame frame);
  void add_timed_frame (int camera, CameraFrame frame);
  std::optional<std::int64_t> capture_time (int camera, const CameraFrame &frame);
  std::optional<std::int64_t> exposure_time (int camera, const CameraFrame &frame);
  void update_tolerance (int camera, std::int64_t taken_ns);
  void queue (int camera, std::int64_t key, CameraFrame frame, std::int64_t taken_ns);
  bool complete (ImageSet &set);
  void pop (int camera);
  void drop (int camera, const char *reason);
  [[nodiscard]] std::int64_t answer_timeout () const;
  [[nodiscard]] bool all_answered () const;

  GstElement *element_;

  std::mutex lock_; /* guards all that follows */
  int cameras_ = 2, max_waiting_ = 1;
  TriggeredBy by_ = TriggeredBy::kCamera;
  std::int64_t period_ns_ = 0, exposure_ns_ = 0;

  std::array<Lane, kMaxCameras> lanes_;
  std::int64_t tolerance_ns_ = 0; ///< half of the time between images
  rangecast::RecentValues intervals_;
  unsigned counted_intervals_ = 0;
  std::array<std::int64_t, kMaxCameras> last_taken_ns_{};

  /* Triggers, and which of them a frame answers. */
  std::array<rangecast::TriggerMatcher, kMaxCameras> matchers_;
  std::array<Trigger, kMaxTriggers> triggers_; ///< ring
  std::int64_t n_triggers_ = 0;
  std::array<std::int64_t, kMaxCameras> answered_{}; ///< triggers, per camera
  int learning_triggers_ = 0;   ///< sent one at a time since delays are being learnt
  std::int64_t spacing_ns_ = 0; ///< between the last two triggers
  bool answers_owed_ = false; ///< while delays are learnt, late answers to older triggers may come

  /* Without triggers of this element: when frames were exposed. */
  std::array<rangecast::CameraClock, kMaxCameras> clocks_;
  std::array<std::optional<std::int64_t>, kMaxCameras> offsets_ns_;
  bool clocks_are_off_ = false;

  /* Statistics. */
  PairingStatistics counters_;
  rangecast::RecentValues spread_, delay_;
  std::array<std::int64_t, kMaxCameras> last_frame_ns_{};
  std::array<std::optional<std::uint64_t>, kMaxCameras> last_number_;
};
