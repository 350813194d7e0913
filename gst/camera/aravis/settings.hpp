/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <optional>
#include <string>

/** Who says when a picture is taken. */
enum class TriggerMode {
  kFreeRun,  ///< the camera, at its frame rate
  kSoftware, ///< Camera::trigger_software(), one picture a call
  kHardware, ///< a signal on a line
  kAction,   ///< a GigE Vision action command, which reaches all cameras at once
};

/** Who decides about a value that a camera can steer by itself. */
enum class AutoMode {
  kUnchanged, ///< as the camera is set
  kManual,    ///< fixed: the value beside it where there is one, else the value it has now
  kAuto,      ///< the camera, continuously
};

/** TriggerMode::kHardware. */
struct LineTrigger {
  std::string source = "Line1";          ///< TriggerSource of all cameras but the master
  std::string activation = "RisingEdge"; ///< TriggerActivation
  /** This camera runs free at its frame rate, and shows its exposure on `output_line`, which is
   * wired to `source` of the others. */
  bool master = false;
  std::string output_line = "Line2";            ///< LineSelector, set to LineMode Output
  std::string output_source = "ExposureActive"; ///< LineSource of that line
};

/** TriggerMode::kAction: what a camera must have in common with the command (see
 * action_command.hpp). */
struct ActionTrigger {
  std::uint32_t device_key = 0x52414e47; ///< ActionDeviceKey
  std::uint32_t group_key = 1;           ///< ActionGroupKey
  std::uint32_t group_mask = 1; ///< ActionGroupMask; it reacts if this AND the command's is not 0
  bool ptp = false; ///< the camera's clock follows IEEE 1588, which scheduled commands need
};

/** What the application wants of one camera. 0, negative and empty mean "as the camera is set"
 * where nothing else is said. Plain values, copied freely. */
struct CameraSettings {
  /// Image
  std::string pixel_format;  ///< name in GenICam's naming convention: Mono8, RGB8, BayerRG8, ...
  int width = 0, height = 0; ///< pixels; 0: as much as there is right of and below x, y
  int x = -1, y = -1; ///< top-left corner on the sensor, pixels; -1: the region is in the middle

  /// Acquisition
  double frame_rate = 0; ///< frames a second; free-running and line masters only
  TriggerMode trigger = TriggerMode::kFreeRun;
  LineTrigger line;
  ActionTrigger action;

  /// Look
  AutoMode exposure_mode = AutoMode::kUnchanged;
  std::optional<double> exposure_us; ///< microseconds, for kManual
  AutoMode gain_mode = AutoMode::kUnchanged;
  std::optional<double> gain; ///< the camera's unit, mostly dB, for kManual
  AutoMode white_balance_mode = AutoMode::kUnchanged;

  /// Any other feature, set after all of the above and in this order: "Name=Value Name=Value ..."
  /// (see camera_features.hpp). Set last, so that it wins.
  std::string features;

  /// Transport
  int packet_size =
      0; ///< GigE: bytes with IP and UDP headers; 0: the largest that gets through; -1: as set
  std::int64_t packet_delay_ns = -1; ///< GigE: pause between packets; -1: as set
  /** GigE: packets come through a memory-mapped packet socket, where the process may have one
   *  (CAP_NET_RAW): less work, but later (see docs/guide/cameras.md). */
  bool packet_socket = false;
  bool packet_resend = true; ///< GigE: missing packets are asked for again
  int socket_buffer = 0;     ///< GigE: receive buffer, bytes; 0: two pictures, at least 1 MiB. The
                             ///< system gives no more than net.core.rmem_max
  int packet_timeout_us = 20000;   ///< GigE: when a packet counts as missing and is asked for
  int frame_retention_us = 100000; ///< GigE: when a picture that lacks packets is given up
  int n_buffers = 8; ///< pictures that may be under way at once, in the camera and downstream; >= 2
};
