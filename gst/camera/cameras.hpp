/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include "camera/aravis/camera.hpp"
#include "camera/aravis/exposure_sync.hpp"
#include "camera/aravis/heartbeat.hpp"
#include <array>
#include <chrono>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <vector>

#include "caps.hpp"
#include "pad.hpp"
#include "pairing.hpp"
#include "settings.hpp"

using Cameras = std::vector<std::shared_ptr<Camera>>; ///< left, right, perhaps third

/** The fault of a call to a streaming camera: a camera that does not answer, or that another
 *  program controls now, is given up and reported as lost. */
CameraStatus loss_or_fault (Camera &camera, const CameraStatus &status);

/** The cameras of one session, from open() to close(): their format, settings, clocks and state.
 *  One thread, which waits for cameras, but for what is marked "any thread". */
class CameraGroup {
public:
  /** What the session does for its cameras. */
  struct Session {
    /** A frame came, or a camera was lost. From threads of Aravis. */
    std::function<void (int camera, CameraFrame frame)> add_frame;
    std::function<void (CameraStatus fault)> fail;
    /** @return false, soon: the session is to end or has failed */
    std::function<bool (std::chrono::milliseconds)> wait;
    /** Waits until older sessions of this process have released their cameras.
     *  @return whether there were any, and this one goes on */
    std::function<bool ()> wait_for_other_sessions;
  };

  /** @param settings, names, pads, pairing  outlive this */
  CameraGroup (GstElement *element, const StereoCamSettings &settings, const CameraNames &names,
      const CameraPads &pads, FramePairing &pairing, Session session);
  ~CameraGroup () { close (); }
  CameraGroup (const CameraGroup &) = delete;
  CameraGroup &operator= (const CameraGroup &) = delete;

  /* In this order; a failure leaves them open. */

  CameraStatus open ();
  /** Agrees with the peers of all pads on one format. */
  CameraStatus negotiate ();
  CameraStatus configure ();
  CameraStatus start ();
  /** Reads the clocks, waits for PTP, and lets the others follow the left camera's settings. */
  CameraStatus synchronise ();
  /** No frame comes after it. The cameras stay open. */
  void stop ();
  void close ();

  /* While open. */

  [[nodiscard]] const Cameras &cameras () const { return cameras_; }
  [[nodiscard]] const SourceFormat &format () const { return format_; }
  /** The longest exposure of all cameras, ns; 0: unknown. */
  [[nodiscard]] GstClockTime exposure () const { return exposure_; }

  /* About ten times a second while streaming. */

  /** Whether a pad was linked to a peer that does not accept the format. */
  bool needs_negotiation ();
  /** @return kLost: a camera does not answer; all that do not were given up */
  CameraStatus check_heartbeats (std::int64_t now_ns);
  /** @return kTimedOut: a camera answers, but sent no frame for longer than `max_ns` */
  CameraStatus check_frames (std::int64_t now_ns, std::int64_t since_ns, std::int64_t max_ns);
  /** Whether images were lost since the last call because downstream holds all buffers. */
  bool lacks_buffers ();
  /** Reads the cameras' clocks every 5 s, and when their timestamps contradict the last reading.
   *  @return kLost: a camera did not answer; it was given up */
  CameraStatus update_clocks (std::int64_t now_ns);

  /* Any thread. */

  /** Sum of all cameras since the session began. */
  CameraStatistics statistics ();
  /** @return false if a camera is still open after that time */
  bool wait_until_closed (std::chrono::milliseconds limit);

private:
  CameraStatus open_camera (std::size_t index);
  CameraStatus start_stream (std::size_t index);
  CameraStatus wait_for_ptp ();
  CameraStatus read_clocks ();
  void set_open (bool open);
  [[nodiscard]] std::vector<GstPad *> gst_pads () const;

  GstElement *element_;
  const StereoCamSettings &settings_;
  const CameraNames &names_;
  const CameraPads &pads_;
  FramePairing &pairing_;
  const Session session_;

  Cameras cameras_;
  std::vector<CameraAbilities> abilities_;
  SourceFormat format_;
  GstClockTime exposure_ = 0;

  /* While streaming. */
  ExposureSync exposure_sync_;
  std::array<Heartbeat, kMaxCameras> heartbeats_;
  std::array<std::uint64_t, kMaxCameras> underruns_{};             ///< at the last look
  std::array<std::int64_t, kMaxCameras> shortest_round_trip_us_{}; ///< of reading a camera's clock
  std::int64_t clocks_read_ns_ = 0;

  std::mutex lock_; /* guards what follows; held while no camera is called */
  std::condition_variable changed_;
  bool open_ = false;
  Cameras counted_;                 ///< for statistics(): those that stream
  CameraStatistics closed_total_{}; ///< of streams that have ended
};
