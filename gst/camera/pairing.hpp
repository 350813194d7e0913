/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include "camera/aravis/frame.hpp"
#include "camera/aravis/settings.hpp"
#include <array>
#include <mutex>
#include <optional>
#include <rangecast/sync/camera_clock.hpp>
#include <rangecast/sync/frame_associator.hpp>
#include <rangecast/sync/frame_sets.hpp>
#include <rangecast/sync/trigger_matcher.hpp>

using rangecast::kMaxCameras;

/** Pictures of all cameras that were taken at one moment. */
struct CamSourceSet {
  std::array<GstBufferPtr, kMaxCameras> pictures;
  GstClockTime tick = GST_CLOCK_TIME_NONE; ///< on the pipeline's clock; NONE: see taken_ns
  std::int64_t taken_ns = 0; ///< else when the left one was taken, g_get_monotonic_time
};

/** Counted since the beginning. */
struct CamSourcePairingStats {
  guint64 sets = 0;
  std::array<guint64, kMaxCameras> dropped{};    ///< whole pictures without partners
  std::array<guint64, kMaxCameras> incomplete{}; ///< pictures that lack packets, or did not come
  guint64 apart = 0;   ///< sets that were dropped because they were not taken at one moment
  guint64 unknown = 0; ///< pictures that answer no trigger of ours
  guint64 missing_packets = 0;
  bool has_spread = false;
  std::int64_t spread_p50_ns = 0, spread_p99_ns = 0; ///< of the exposures within a set
  std::int64_t delay_p50_ns = 0, delay_p99_ns = 0;   ///< from tick, or exposure, to the last packet
};

/** Puts frames of two or three cameras together: by the trigger that they answer, or, where this
 *  element sends none, by the time when they were taken. Any thread. */
class CamSourcePairing {
public:
  CamSourcePairing ();
  ~CamSourcePairing ();
  CamSourcePairing (const CamSourcePairing &) = delete;
  CamSourcePairing &operator= (const CamSourcePairing &) = delete;

  /** Who fires the cameras. */
  enum class Fired {
    kHere,      ///< this element: shots are told with fired()
    kElsewhere, ///< one signal, or command, that reaches all of them
    kAlone,     ///< each by itself
  };

  /** @param period     ns; 0 for single shots
   *  @param exposure   ns, as far as it is known
   *  @param waiting    pictures of one camera that may wait for partners */
  void start (int cameras, Fired fired, GstClockTime period, GstClockTime exposure, int waiting);
  /** Forgets frames, and what it learnt about the cameras' clocks, not what it counted. */
  void forget ();
  /** Lets waiting frames go. */
  void drop_waiting ();

  /** Of one camera's clock: add it to a time stamp for g_get_monotonic_time, ns. */
  void set_clock_offset (int camera, std::int64_t offset_ns);
  /** Once after each time that stamps contradict the offsets: read the clocks again. */
  bool clocks_are_off ();

  /** Whether a shot may be fired now. While a camera's delay is not known, one must be over before
   * the next.
   *  @param alone   no shot may be under way in any case: a camera that exposes takes no other
   *  @param now_ns  g_get_monotonic_time */
  bool may_fire (bool alone, std::int64_t now_ns);
  /** A shot is about to be fired: answers count from now on.
   *  @param tick  when it is due, on the pipeline's clock
   *  @param fired_ns  when the cameras are told, g_get_monotonic_time */
  void fired (GstClockTime tick, std::int64_t fired_ns);

  void take (int camera, CameraFrame frame);
  /** The next complete set, in order of time. */
  bool next (CamSourceSet &set);

  /** When the last frame of a camera came, whole or not, g_get_monotonic_time, ns; 0: none. */
  [[nodiscard]] std::int64_t last_arrival (int camera);
  CamSourcePairingStats stats ();

private:
  struct Held {
    CameraFrame frame;
    std::int64_t taken_ns = 0;   ///< comparable between cameras; decides
    std::int64_t exposed_ns = 0; ///< by the cameras' clocks if they tell; for the statistics
    Held *next_free = nullptr;
  };
  struct Tick {
    std::int64_t shot = -1;
    GstClockTime time = 0;
    std::int64_t fired_ns = 0;
  };
  static constexpr int kHeld = 40, kTicks = 64, kMaxLoneShots = 8;

  Held *hold (CameraFrame frame, std::int64_t taken_ns, std::int64_t exposed_ns);
  void let_go (Held *held);
  void place_by_shot (int camera, CameraFrame frame);
  void place_by_time (int camera, CameraFrame frame);
  void put (int camera, std::int64_t key, CameraFrame frame, std::int64_t taken);
  std::optional<std::int64_t> exposed_at (int camera, const CameraFrame &frame);
  std::int64_t answer_time () const;
  std::optional<std::int64_t> time_of (int camera, const CameraFrame &frame);
  void learn_interval (int camera, std::int64_t taken);
  void drop (rangecast::FrameSets::Set &set);
  bool hand_out (rangecast::FrameSets::Set &from, CamSourceSet &set);

  std::mutex lock_; /* guards all */
  int cameras_ = 2, waiting_ = 1;
  bool triggered_ = false, one_signal_ = false;
  GstClockTime period_ = 0, exposure_ = 0;
  rangecast::FrameSets sets_;
  std::array<rangecast::ShotFinder, kMaxCameras> finders_;
  std::array<rangecast::PartnerFinder, kMaxCameras> partners_; ///< of those beside the left one
  std::array<rangecast::CameraClock, kMaxCameras> clocks_;
  std::array<std::optional<std::int64_t>, kMaxCameras> offsets_;
  std::array<Tick, kTicks> ticks_;
  std::int64_t shots_ = 0;
  int lone_shots_ = 0;
  std::int64_t spacing_ = 0; ///< of the last two shots, ns
  bool owing_ = false; ///< while delays are learnt, answers may come that older shots are owed
  std::array<std::int64_t, kMaxCameras> answered_{}; ///< shot
  std::array<std::int64_t, kMaxCameras> last_arrival_ns_{};
  std::array<std::uint64_t, kMaxCameras> last_number_{};
  std::array<bool, kMaxCameras> has_number_{};
  std::array<Held, kHeld> held_;
  Held *free_ = nullptr;
  CamSourcePairingStats counts_;
  rangecast::RecentValues spread_, delay_, intervals_;
  std::int64_t tolerance_ = 0; ///< ns; half of the time between pictures
  unsigned counted_intervals_ = 0;
  std::array<std::int64_t, kMaxCameras> last_taken_ns_{};
  bool clocks_are_off_ = false;
};
