/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include "camera/aravis/types.hpp"
#include <array>
#include <rangecast/base/status.hpp>
#include <rangecast/geometry/rig.hpp>
#include <string>

#include "common/properties.hpp"

using CameraNames = std::array<std::string, kMaxCameras>; ///< left, right, third

/** The cameras of a rig's view; empty where it names none. */
inline CameraNames
camera_names (const rangecast::View &view)
{
  return {view.camera, view.right ? view.right->camera : "", view.third ? view.third->camera : ""};
}

/** Property values of stereocamsrc, which may change in NULL and READY. */
struct StereoCamSettings {
  CameraNames names;  ///< empty third: two cameras
  std::string rig;    ///< file that names them, if names are empty
  int view_id = 0;    ///< in the rig file
  std::string format; ///< GenICam pixel format; empty: negotiated
  TriggerMode trigger = TriggerMode::kFreeRun;
  double exposure_us = 0, gain = -1; ///< 0, -1: unchanged
  bool auto_exposure = false, auto_gain = false, auto_white_balance = false;
  bool lock_exposure = true;
  std::string features;
  int packet_size = 0, n_buffers = 8;
  gint64 packet_delay_ns = -1;
  bool packet_resend = true;
  std::string trigger_line = "Line1", output_line; ///< output line empty: external signal
  bool reconnect = false;
  int num_buffers = -1;
  std::string clock_server;

  /** The names, from the rig file if left and right are empty.
   *  @return kNotFound, kBadValue: the text says which property, or the file */
  rangecast::Status find_names (CameraNames &found) const;
  /** Settings of one camera, without size and frame rate. @param camera  0 is the left one */
  [[nodiscard]] CameraSettings for_camera (int camera) const;
  /** Whether this element triggers the cameras. */
  [[nodiscard]] bool triggers_cameras () const
  {
    return trigger == TriggerMode::kSoftware || trigger == TriggerMode::kAction;
  }
  /** Whether the left camera's automatic settings are copied to the others. */
  [[nodiscard]] bool follows_left () const
  {
    return lock_exposure && (auto_exposure || auto_gain || auto_white_balance);
  }
};

PropertyTable<StereoCamSettings> &stereo_cam_properties ();
