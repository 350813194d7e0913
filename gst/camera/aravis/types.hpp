/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What the camera layer and its users exchange. Knows no Aravis. */
#pragma once

#include <cstdint>
#include <gst/gst.h>
#include <memory>
#include <optional>
#include <string>

inline constexpr int kMaxCameras = 3; ///< left, right, third

/* ---- status ---- */

/** Text of a device as valid UTF-8, for messages and properties. */
inline std::string
valid_utf8 (const std::string &text)
{
  gchar *valid = g_utf8_make_valid (text.c_str (), gssize (text.size ()));
  std::string copy = valid;
  g_free (valid);
  return copy;
}

inline std::string
valid_utf8 (const char *text)
{
  return text ? valid_utf8 (std::string (text)) : "";
}

/** What went wrong with a camera, for callers to decide whether to try again. The words in brackets
 *  are the GStreamer errors that fit. */
enum class CameraFault {
  kNone,
  kNotFound,     ///< no camera of that name answers (RESOURCE/NOT_FOUND); trying again may help
  kBusy,         ///< another program has control of it (RESOURCE/BUSY); trying again may help
  kNoPermission, ///< the system refuses the device or the port (RESOURCE/NOT_AUTHORIZED)
  kTimedOut,     ///< it was found but does not answer (RESOURCE/READ); trying again may help
  kLost,         ///< it was open and is gone (RESOURCE/READ); only a new open() helps
  kBadSetting,   ///< the camera has no such feature or refuses the value (RESOURCE/SETTINGS)
  kUnsupported,  ///< an unsupported pixel format or payload (STREAM/FORMAT)
  kFailed,       ///< anything else (RESOURCE/FAILED)
};

/** The result of a camera function: ok, or a fault and one sentence that names the camera and what
 *  was got. */
class [[nodiscard]] CameraStatus {
public:
  CameraStatus () = default;
  CameraStatus (CameraFault fault, const std::string &message)
      : fault_ (fault), message_ (valid_utf8 (message))
  {
  }

  [[nodiscard]] bool ok () const { return fault_ == CameraFault::kNone; }
  [[nodiscard]] CameraFault fault () const { return fault_; }
  [[nodiscard]] const std::string &message () const { return message_; }
  /** Whether the same call may work later, without the user changing any setting. */
  [[nodiscard]] bool may_recover () const
  {
    return fault_ == CameraFault::kNotFound || fault_ == CameraFault::kBusy ||
           fault_ == CameraFault::kTimedOut || fault_ == CameraFault::kLost;
  }

private:
  CameraFault fault_ = CameraFault::kNone;
  std::string message_;
};

/* ---- discovery ---- */

/** What discovery tells about a machine-vision camera without opening it. Strings are empty where
 *  the camera does not tell. */
struct CameraInfo {
  std::string id; ///< Aravis' name for it, as "Aravis-Fake-GV01"; unique on this host
  std::string vendor, model, serial;
  std::string address;      ///< GigE: IP address; USB: device node, or as Aravis says
  std::string physical_id;  ///< GigE: MAC address; USB: GUID
  std::string protocol;     ///< "GigEVision", "USB3Vision"
  std::string user_name;    ///< GigE: user-defined name
  std::string problem = {}; ///< why it cannot be opened and what to do; empty if it can

  bool operator== (const CameraInfo &) const = default;

  [[nodiscard]] bool is_gige () const { return protocol == "GigEVision"; }
  /** Whether both are one camera, whatever names they were found by. */
  [[nodiscard]] bool is_same (const CameraInfo &other) const
  {
    const auto same = [] (const std::string &a, const std::string &b) {
      return !a.empty () && a == b;
    };
    return same (id, other.id) || (is_gige () && same (address, other.address)) ||
           same (physical_id, other.physical_id);
  }
  /** Whether this camera is meant by a name as in the properties of stereocamsrc and rig files. */
  [[nodiscard]] bool is_called (const std::string &name) const
  {
    return !name.empty () && (name == id || name == serial || name == physical_id ||
                                 name == user_name || (is_gige () && name == address));
  }
};

/* ---- settings ---- */

/** What triggers an image. */
enum class TriggerMode {
  kFreeRun,  ///< the camera, at its frame rate
  kSoftware, ///< Camera::trigger_software(), one image per call
  kHardware, ///< a signal on a line
  kAction,   ///< a GigE Vision action command, which reaches all cameras of a key together
};

/** Who sets a value that a camera can adjust by itself. */
enum class AutoMode {
  kUnchanged, ///< left as it is
  kManual,    ///< fixed: at the value given, else at the current one
  kAuto,      ///< the camera, continuously
};

/** Settings of one camera. 0, negative and empty leave the camera's setting, unless documented
 *  otherwise. */
struct CameraSettings {
  /// Image
  std::string pixel_format;  ///< name in GenICam's naming convention: Mono8, RGB8, BayerRG8, ...
  int width = 0, height = 0; ///< pixels, from the middle of the sensor

  /// Acquisition
  double frame_rate = 0; ///< frames per second; free-running and line masters only
  TriggerMode trigger = TriggerMode::kFreeRun;
  std::string trigger_line = "Line1"; ///< kHardware: TriggerSource
  /** kHardware: this camera runs freely at its frame rate, and signals its exposure on this line,
   *  which is wired to `trigger_line` of the others. */
  std::string output_line;
  std::uint32_t action_key = 0; ///< kAction: ActionDeviceKey

  /// Imaging parameters
  AutoMode exposure_mode = AutoMode::kUnchanged;
  std::optional<double> exposure_us; ///< microseconds, for kManual
  AutoMode gain_mode = AutoMode::kUnchanged;
  std::optional<double> gain; ///< the camera's unit, usually dB, for kManual
  AutoMode white_balance_mode = AutoMode::kUnchanged;

  /// Any other features, set after all of the above and in this order: "Name=Value Command ..."
  std::string features;

  /// Transport
  int packet_size =
      0; ///< GigE: bytes with IP and UDP headers; 0: the largest that passes; -1: unchanged
  std::int64_t packet_delay_ns = -1; ///< GigE: delay between packets; -1: unchanged
  bool packet_resend = true;         ///< GigE: request missing packets again
  int n_buffers = 8;                 ///< of the stream, in the camera layer and downstream; >= 2
};

/* ---- frames ---- */

struct GstBufferUnref {
  void operator() (GstBuffer *buffer) const { gst_buffer_unref (buffer); }
};
using GstBufferPtr = std::unique_ptr<GstBuffer, GstBufferUnref>;

/** Cameras that report a later time do not know it. Keeps sums of times from overflowing. */
inline constexpr std::uint64_t kMaxCameraTime_ns = std::uint64_t (1) << 62;

/** One image that arrived, or did not. Images for which no buffer was free (underruns), and those
 *  whose first packet never came, are not reported: their numbers are missing in the sequence. */
struct CameraFrame {
  /** The camera's frame id continued beyond 65535, from 0 for the camera's first id. Grows
   *  strictly; a gap is a lost image. Cameras should begin at their first id with start(), but not
   *  all do: pairing learns the difference from the arrival of their first frames. */
  std::uint64_t number = 0;
  /** Capture time (start of the exposure for most cameras), ns on the camera's clock, which may
   *  have any origin. 0: unknown. */
  std::uint64_t camera_time_ns = 0;
  std::int64_t arrived_us = 0; ///< arrival of its last packet, g_get_monotonic_time()
  /** Packets of this stream that were given up since the previous frame: usually this one's. */
  std::uint64_t missing_packets = 0;
  /** The pixels where Aravis put them, not copied; null if packets are missing, or if it has not
   *  the configured size and format. Has a GstVideoMeta for video/x-raw, and no time stamps. Its
   *  memory returns to the camera's stream when it is released, from any thread, also long after
   *  the camera was stopped or deleted. */
  GstBufferPtr buffer;
};
