/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include "camera/aravis/camera.hpp"
#include <array>
#include <memory>
#include <mutex>
#include <span>
#include <vector>

#include "caps.hpp"
#include "events.hpp"
#include "pairing.hpp"
#include "settings.hpp"

using Cameras = std::vector<std::shared_ptr<Camera>>; ///< left, right, perhaps third

/** The cameras of one session, from open() to close(): their format, settings, clocks and state.
 *  One thread at a time, which waits for cameras, but for statistics(). */
class CameraGroup {
public:
  /** @param settings, names, pads, pairing, events  outlive this */
  CameraGroup (GstElement *element, const StereoCamSettings &settings, const CameraNames &names,
      std::span<GstPad *const> pads, FramePairing &pairing, CameraEvents &events)
      : element_ (element), settings_ (settings), names_ (names), pads_ (pads), pairing_ (pairing),
        events_ (events)
  {
  }
  ~CameraGroup () { close (); }
  CameraGroup (const CameraGroup &) = delete;
  CameraGroup &operator= (const CameraGroup &) = delete;

  /* In this order; a failure leaves them open. */

  CameraStatus open ();
  /** Agrees with the peers of all pads on one format. */
  CameraStatus negotiate ();
  CameraStatus configure ();
  /** Reads the clocks, too. */
  CameraStatus start ();
  /** No frame comes after it. The cameras stay open. */
  void stop ();
  void close ();

  /* While open. */

  [[nodiscard]] const Cameras &cameras () const { return cameras_; }
  [[nodiscard]] const SourceFormat &format () const { return format_; }
  /** The longest exposure of all cameras, ns; 0: unknown. */
  [[nodiscard]] GstClockTime exposure () const { return exposure_; }
  /** ActionDeviceKey of all cameras. */
  [[nodiscard]] std::uint32_t action_key () const { return action_key_; }

  /* About ten times a second while streaming. */

  /** Whether a pad was linked to a peer that does not accept the format. */
  bool needs_negotiation ();
  /** @return kLost, kTimedOut: a camera sent no frame for longer than `max_ns` */
  CameraStatus check_frames (std::int64_t now_ns, std::int64_t since_ns, std::int64_t max_ns);
  /** Whether images were lost since the last call because downstream holds all buffers. */
  bool lacks_buffers ();
  /** Reads the cameras' clocks every 5 s, and when their timestamps contradict the last reading;
   *  copies the left camera's exposure, gain and white balance to the others twice a second.
   *  @return kLost: a camera did not answer; it was given up */
  CameraStatus synchronise (std::int64_t now_ns);

  /** Any thread: sum of all cameras since the session began. */
  CameraStatistics statistics ();

private:
  CameraStatus open_camera (std::size_t index);
  CameraStatus read_clocks ();
  CameraStatus follow_left ();

  GstElement *element_;
  const StereoCamSettings &settings_;
  const CameraNames &names_;
  const std::span<GstPad *const> pads_;
  FramePairing &pairing_;
  CameraEvents &events_;

  Cameras cameras_;
  std::vector<CameraAbilities> abilities_;
  SourceFormat format_;
  GstClockTime exposure_ = 0;
  std::uint32_t action_key_ = 0;

  /* While streaming. */
  std::array<std::uint64_t, kMaxCameras> underruns_{}; ///< at the last look
  std::int64_t clocks_read_ns_ = 0, followed_ns_ = 0;
  bool refused_ = false; ///< a camera refused the left one's values; it was logged

  std::mutex lock_;                 /* guards what follows; taken before a camera's */
  Cameras counted_;                 ///< for statistics(): those that stream
  CameraStatistics closed_total_{}; ///< of streams that have ended
};
