/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* One machine-vision camera (GigE Vision, USB3 Vision) over Aravis. Knows no GstElement: elements
 * decide what to do about faults, and when.
 *
 * Threads. open() and all members but the ones marked "any thread" are for one thread at a time,
 * and may wait for the camera: a GigE camera that is gone costs 3 s a call (six tries of 0.5 s),
 * open() besides up to 2 s of looking for it. So none of them belongs into a state change, or into
 * the thread that pushes. Callbacks come from threads of Aravis: they must be quick (queue the
 * frame and go), and must not call start(), stop() or the destructor, which wait for those threads.
 */
#pragma once

#include <functional>
#include <gst/video/video.h>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "frame.hpp"
#include "settings.hpp"
#include "status.hpp"

/** A camera as discovery sees it. */
struct CameraInfo {
  std::string id; ///< Aravis' name for it, unique: as "Aravis-Fake-GV01"
  std::string vendor, model, serial;
  std::string address;     ///< GigE: IP address; USB: USB vendor, product and serial
  std::string physical_id; ///< GigE: MAC address; USB: GUID
  std::string protocol;    ///< "GigEVision", "USB3Vision"

  /** Whether both are known to be one camera, whatever names they were found by. */
  [[nodiscard]] bool is_same (const CameraInfo &other) const
  {
    const auto same = [] (const std::string &a, const std::string &b) {
      return !a.empty () && a == b;
    };
    return same (id, other.id) || same (address, other.address) ||
           same (physical_id, other.physical_id);
  }
};

/** All cameras that answer now. Takes about a second, looks at every network interface and USB. Any
 * thread; calls wait for each other and for open(). */
std::vector<CameraInfo> list_cameras ();

/** What the pictures of a configured camera are. */
struct CameraFormat {
  std::string pixel_format; ///< GenICam's name, as "BayerRG8"
  GstVideoFormat video_format =
      GST_VIDEO_FORMAT_UNKNOWN; ///< GRAY8, RGB, BGR; UNKNOWN if it is Bayer
  std::string bayer;            ///< "rggb", "bggr", "gbrg", "grbg"; empty if it is not Bayer
  int width = 0, height = 0;    ///< pixels
  int stride = 0;               ///< bytes from row to row: cameras do not pad rows
  double frame_rate = 0; ///< frames a second that the camera runs at; 0: triggered or unknown

  /** Bytes of a picture. */
  [[nodiscard]] std::size_t size () const { return std::size_t (stride) * height; }
  /** video/x-raw or video/x-bayer with width and height, without a frame rate. Transfer full. */
  [[nodiscard]] GstCaps *caps () const;
  /** Whether rows lie where elements look that know no GstVideoMeta (and bayer2rgb): each begins at
   *  a multiple of 4 bytes. */
  [[nodiscard]] bool stride_is_default () const { return stride % 4 == 0; }
};

/** What a camera could be configured to, for caps: the pixel formats that can be carried, and
 * sizes. */
struct CameraAbilities {
  std::vector<std::string> pixel_formats; ///< GenICam's names; those that we can carry; the present
                                          ///< one, then the camera's order
  std::vector<std::string> other_formats; ///< the rest, for messages
  int max_width = 0, max_height = 0;      ///< pixels
  int min_width = 0, min_height = 0, width_step = 1, height_step = 1;
  double min_frame_rate = 0,
         max_frame_rate = 0; ///< frames a second at the present settings; 0: not settable
  bool software_trigger = false, line_trigger = false, action_trigger = false, ptp = false;
};

/** All caps that any camera can have here: GRAY8, RGB, BGR, and 8-bit Bayer. Transfer full. */
GstCaps *camera_caps ();
/** GenICam's name of the pixel format that has such caps (fixed or not: the first that fits of
 * those that the camera has); empty: none fits. */
std::string pixel_format_for_caps (const GstCaps *caps, const std::vector<std::string> &has);

/** Counted since start(). */
struct CameraStatistics {
  std::uint64_t completed = 0;       ///< pictures that arrived whole
  std::uint64_t failures = 0;        ///< pictures that did not
  std::uint64_t underruns = 0;       ///< pictures for which all buffers were downstream
  std::uint64_t resent_packets = 0;  ///< GigE: packets that came when asked for again
  std::uint64_t missing_packets = 0; ///< GigE: packets that never came
  int buffers_out = 0;               ///< pictures that are downstream now
};

/** What the camera's own regulators steer, to give it to another camera. Absent: it has no such
 * feature. */
struct ImagingParameters {
  std::optional<double> exposure_us;
  std::optional<double> gain;
  std::optional<double> white_balance_red, white_balance_green,
      white_balance_blue; ///< BalanceRatio

  bool operator== (const ImagingParameters &) const = default;
};

class Camera {
public:
  using Arrived = std::function<void (CameraFrame)>;
  using Lost = std::function<void (CameraStatus)>;

  /** Finds, opens and takes control of a camera.
   *  @param name  its serial number, Aravis id (as "Aravis-Fake-GV01"), MAC address, IP address,
   * user-defined name (GigE), or host name with a dot in it. Empty: the only camera that there is.
   *  @param[out] camera  set if ok
   *  @return kNotFound (the text says which cameras answered), kBusy (another program has control),
   * kNoPermission (USB, the text says which udev rule), kTimedOut, kFailed. Any thread; calls wait
   * for each other.
   *  @param[out] seen  what is known of the camera of that name, also if it is busy; may be null */
  static CameraStatus open (
      const std::string &name, std::unique_ptr<Camera> &camera, CameraInfo *seen = nullptr);

  Camera (const Camera &) = delete;
  Camera &operator= (const Camera &) = delete;
  /** Stops, gives up control. Buffers that are downstream stay valid. */
  ~Camera ();

  [[nodiscard]] const CameraInfo &info () const;
  /** How messages name it: the name it was opened by, and what it is. */
  [[nodiscard]] const std::string &label () const;
  [[nodiscard]] bool is_gige () const;
  /** GigE: the address of this host's interface that it is reached by; empty for others. */
  [[nodiscard]] const std::string &interface_address () const;

  CameraStatus abilities (CameraAbilities &abilities);

  /** Applies the settings; while stopped. The camera keeps what was applied before a failure.
   *  @return kBadSetting (the text says the feature, the value, and what the camera accepts),
   * kUnsupported, kTimedOut, kLost */
  CameraStatus configure (const CameraSettings &settings);
  /** Valid after configure(). */
  [[nodiscard]] const CameraFormat &format () const;
  /** Bytes a packet, as negotiated; 0 for USB, and before start(). */
  [[nodiscard]] int packet_size () const;

  /** Begins to stream; numbers of frames begin at 0.
   *  @param arrived  a frame came, or was given up; in order of `number`
   *  @param lost     at most once: the camera does not answer any more, or another program took
   * control. GigE tells so after its heartbeat, within about 6 s; who wants to know sooner has a
   * Heartbeat. */
  CameraStatus start (Arrived arrived, Lost lost);
  /** No callback runs or comes after it. */
  void stop ();
  [[nodiscard]] bool is_lost () const; ///< any thread
  /** Any thread: it is gone, as somebody else noticed: nothing waits for it any more. */
  void give_up ();

  /** Any thread: takes one picture (TriggerMode::kSoftware). Returns when the camera has
   * acknowledged, mostly within a millisecond. */
  CameraStatus trigger_software ();
  CameraStatistics statistics () const; ///< any thread
  /** Any thread: the values that the camera has now, as its regulators left them. A few round
   * trips. */
  CameraStatus read_imaging (ImagingParameters &parameters);
  /** Any thread: sets those values, within the ranges of this camera, where they differ by more
   * than a thousandth from what was last written. Its own regulators must be off
   * (AutoMode::kManual). */
  CameraStatus write_imaging (const ImagingParameters &parameters);
  /** Any thread: whether the camera's clock follows IEEE 1588 now (PtpStatus Slave or Master). */
  bool clock_is_ptp ();
  /** Any thread: the camera's clock now, ns, and when it was read (g_get_monotonic_time, middle of
   * the round trip, microseconds), to compare clocks of cameras that do not follow IEEE 1588. */
  CameraStatus read_clock (std::uint64_t &camera_time_ns, std::int64_t &read_at_us);

private:
  struct Impl;
  explicit Camera (std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};
