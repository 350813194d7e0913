/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* One machine-vision camera (GigE Vision, USB3 Vision) through Aravis. Knows no GstElement:
 * elements decide what to do about faults, and when.
 *
 * Threads: open() and all members except those marked "any thread" are for one thread at a time,
 * and may wait for the camera: a call to a GigE camera that does not answer takes 3 s (six tries of
 * 0.5 s), open() up to 2 s more to find it. So none of them belongs in a state change or in a
 * streaming thread. Callbacks come from threads of Aravis: they must be quick, and must not call
 * start(), stop() or the destructor, which wait for those threads. */
#pragma once

#include <array>
#include <functional>
#include <gst/video/video.h>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "types.hpp"

/** The format of a configured camera's images. */
struct CameraFormat {
  std::uint32_t code = 0; ///< GenICam's number of the pixel format
  GstVideoFormat video_format =
      GST_VIDEO_FORMAT_UNKNOWN; ///< GRAY8, RGB, BGR; UNKNOWN if it is Bayer
  int width = 0, height = 0;    ///< pixels
  int stride = 0;               ///< bytes from row to row: cameras do not pad rows

  /** Bytes of an image. */
  [[nodiscard]] std::size_t size () const { return std::size_t (stride) * height; }
};

/** What a camera can be configured to, for caps. */
struct CameraAbilities {
  std::vector<std::string> pixel_formats; ///< supported ones, by GenICam's names: the current one
                                          ///< first, then in the camera's order
  std::vector<std::string> other_formats; ///< unsupported ones, for messages
  int max_width = 0, max_height = 0;      ///< pixels
  int min_width = 0, min_height = 0, width_step = 1, height_step = 1;
  double max_frame_rate = 0; ///< frames per second at the current settings; 0: not settable
};

/** The caps of a pixel format by GenICam's name, or of all supported ones: GRAY8, RGB, BGR and
 *  8-bit Bayer. Transfer full. */
GstCaps *camera_caps (const std::string &name = "");
/** GenICam's name of the first pixel format in `has` whose caps intersect these; empty: none. */
std::string pixel_format_for_caps (const GstCaps *caps, const std::vector<std::string> &has);

/** Counters since start(). */
struct CameraStatistics {
  std::uint64_t completed = 0;      ///< images that arrived complete
  std::uint64_t failures = 0;       ///< images that did not
  std::uint64_t underruns = 0;      ///< images for which no buffer was free
  std::uint64_t resent_packets = 0; ///< GigE: packets that came after a resend request
  int buffers_out = 0;              ///< images that are downstream now
};

/** The values that a camera can adjust by itself, to copy them to another one. Absent: it has no
 *  such feature. */
struct ImagingParameters {
  std::optional<double> exposure_us;
  std::optional<double> gain;
  std::array<std::optional<double>, 3> white_balance; ///< BalanceRatio of red, green, blue

  bool operator== (const ImagingParameters &) const = default;
};

class Camera {
public:
  using Arrived = std::function<void (CameraFrame)>;
  using Lost = std::function<void (CameraStatus)>;

  /** Finds, opens and takes control of a camera.
   *  @param name  its serial number, Aravis id (as "Aravis-Fake-GV01"), MAC address, IP address,
   *  user-defined name (GigE), or host name with a dot in it.
   *  @param[out] camera  set if ok
   *  @return kNotFound (the text says which cameras answered), kBusy (another program has control),
   *  kNoPermission (USB, the text says which udev rule), kTimedOut, kFailed. Any thread; calls wait
   *  for each other.
   *  @param[out] seen  what discovery tells about that camera, also if it is busy; may be null */
  static CameraStatus open (
      const std::string &name, std::unique_ptr<Camera> &camera, CameraInfo *seen = nullptr);

  Camera (const Camera &) = delete;
  Camera &operator= (const Camera &) = delete;
  /** Stops and releases control. Buffers that are downstream stay valid. */
  ~Camera ();

  [[nodiscard]] const CameraInfo &info () const;
  /** For messages: the name it was opened by, and vendor, model and serial number. */
  [[nodiscard]] const std::string &label () const;
  /** GigE: the address of this host's interface to it; empty for others. */
  [[nodiscard]] const std::string &interface_address () const;

  CameraStatus abilities (CameraAbilities &abilities);

  /** Applies the settings, while stopped. What was applied before a failure stays.
   *  @return kBadSetting (the text names feature and value), kUnsupported, kTimedOut, kLost */
  CameraStatus configure (const CameraSettings &settings);

  /** Starts streaming, once configured; frame numbers begin at 0.
   *  @param arrived  a frame came, or was given up; in order of `number`
   *  @param lost     at most once: the camera no longer responds, or another program took
   *  control. With GigE that takes up to 8 s. */
  CameraStatus start (Arrived arrived, Lost lost);
  /** No callback runs or comes after it. */
  void stop ();
  /** Any thread: the fault of a call, or, where the camera does not answer or another program
   *  controls it, its loss: then it is given up, and no later call waits for it. */
  CameraStatus loss_or_fault (const CameraStatus &status);

  /** Any thread: captures one image (TriggerMode::kSoftware). Returns when the camera has
   *  acknowledged, usually within a millisecond. */
  CameraStatus trigger_software ();
  CameraStatistics statistics () const; ///< any thread
  /** Any thread: the current values. Takes a few round trips. */
  CameraStatus read_imaging (ImagingParameters &parameters);
  /** Any thread: sets those values, within the ranges of this camera, where they differ by more
   *  than a thousandth from what was last written. Automatic adjustment must be off
   *  (AutoMode::kManual). */
  CameraStatus write_imaging (const ImagingParameters &parameters);
  /** Any thread: the camera's clock, ns, and when it was read (g_get_monotonic_time, middle of the
   *  round trip, microseconds), to compare the clocks of cameras. */
  CameraStatus read_clock (std::uint64_t &camera_time_ns, std::int64_t &read_at_us);

private:
  struct Impl;
  explicit Camera (std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};
