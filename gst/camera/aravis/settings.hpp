/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <optional>
#include <string>

/** What triggers an image. */
enum class TriggerMode {
  kFreeRun,  ///< the camera, at its frame rate
  kSoftware, ///< Camera::trigger_software(), one image per call
  kHardware, ///< a signal on a line
  kAction,   ///< a GigE Vision action command, which reaches all cameras at once
};

/** Who sets a value that a camera can adjust by itself. */
enum class AutoMode {
  kUnchanged, ///< left as it is
  kManual,    ///< fixed: at the value given, else at the current one
  kAuto,      ///< the camera, continuously
};

/** TriggerMode::kHardware. */
struct LineTrigger {
  std::string source = "Line1"; ///< TriggerSource of all cameras but the master
  /** This camera runs freely at its frame rate, and signals its exposure on `output_line`, which is
   *  wired to `source` of the others. */
  bool master = false;
  std::string output_line = "Line2"; ///< LineSelector, set to LineMode Output
};

/** TriggerMode::kAction: a camera reacts to commands that match these (see action_command.hpp). */
struct ActionTrigger {
  std::uint32_t device_key = 0x52414e47; ///< ActionDeviceKey
  std::uint32_t group_key = 1;           ///< ActionGroupKey
  std::uint32_t group_mask = 1; ///< ActionGroupMask; it reacts if this AND the command's is not 0
  bool ptp = false; ///< the camera's clock follows IEEE 1588, which scheduled commands need
};

/** Settings of one camera. 0, negative and empty leave the camera's setting, unless documented
 *  otherwise. */
struct CameraSettings {
  /// Image
  std::string pixel_format;  ///< name in GenICam's naming convention: Mono8, RGB8, BayerRG8, ...
  int width = 0, height = 0; ///< pixels; 0: all that is right of and below x, y
  int x = -1, y = -1;        ///< top-left corner on the sensor, pixels; -1: centred

  /// Acquisition
  double frame_rate = 0; ///< frames per second; free-running and line masters only
  TriggerMode trigger = TriggerMode::kFreeRun;
  LineTrigger line;
  ActionTrigger action;

  /// Imaging parameters
  AutoMode exposure_mode = AutoMode::kUnchanged;
  std::optional<double> exposure_us; ///< microseconds, for kManual
  AutoMode gain_mode = AutoMode::kUnchanged;
  std::optional<double> gain; ///< the camera's unit, usually dB, for kManual
  AutoMode white_balance_mode = AutoMode::kUnchanged;

  /// Any other features, set after all of the above and in this order: "Name=Value Name=Value ..."
  /// (see features.hpp)
  std::string features;

  /// Transport
  int packet_size =
      0; ///< GigE: bytes with IP and UDP headers; 0: the largest that passes; -1: unchanged
  std::int64_t packet_delay_ns = -1; ///< GigE: delay between packets; -1: unchanged
  bool packet_resend = true;         ///< GigE: request missing packets again
  int n_buffers = 8;                 ///< of the stream, in the camera layer and downstream; >= 2
};
