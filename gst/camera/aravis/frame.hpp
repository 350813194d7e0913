/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <gst/gst.h>
#include <memory>

inline constexpr int kMaxCameras = 3; ///< left, right, third

struct GstBufferUnref {
  void operator() (GstBuffer *buffer) const { gst_buffer_unref (buffer); }
};
using GstBufferPtr = std::unique_ptr<GstBuffer, GstBufferUnref>;

/** Cameras that report a later time do not know it. Keeps sums of times from overflowing. */
inline constexpr std::uint64_t kMaxCameraTime_ns = std::uint64_t (1) << 62;

/** What became of an image that a camera sent. */
enum class FrameState {
  kComplete, ///< `buffer` has all of it
  kMissing,  ///< packets are missing, or it came too late
  kUnfit,    ///< complete, but not in the configured size or pixel format
};

/** One image that arrived, or did not. Images for which no buffer was free (underruns), and those
 *  whose first packet never came, are not reported: their numbers are missing in the sequence. */
struct CameraFrame {
  FrameState state = FrameState::kMissing;
  std::uint64_t id =
      0; ///< the camera's own: GigE 1 to 65535 and again 1 (or 64 bits), USB 0 and on
  /** `id` continued beyond 65535, from 0 for the camera's first id. Grows strictly; a gap is a lost
   *  image. Cameras should begin at their first id with start(), but not all do: pairing learns the
   *  difference from the arrival of their first frames. */
  std::uint64_t number = 0;
  /** Capture time (start of the exposure for most cameras), ns on the camera's clock: its own, with
   *  any origin, or that of IEEE 1588 (see Camera::clock_is_ptp). 0: unknown. */
  std::uint64_t camera_time_ns = 0;
  std::int64_t arrived_us = 0; ///< arrival of its last packet, g_get_monotonic_time()
  /** Packets of this stream that were given up since the previous frame: usually this one's. */
  std::uint64_t missing_packets = 0;
  /** The pixels where Aravis put them, not copied; null unless complete. Has a GstVideoMeta for
   *  video/x-raw, and no time stamps. Its memory returns to the camera's stream when it is
   *  released, from any thread, also long after the camera was stopped or deleted. */
  GstBufferPtr buffer;
};
