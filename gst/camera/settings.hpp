/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include "camera/aravis/settings.hpp"
#include <array>
#include <rangecast/base/status.hpp>
#include <rangecast/sync/frame_sets.hpp>
#include <string>

#include "common/properties.hpp"

using CameraNames = std::array<std::string, rangecast::kMaxCameras>; ///< left, right, third

/** What an application wants of stereocamsrc. Any thread, under the element's lock. */
struct StereoCamSettings {
  CameraNames names;  ///< empty third: two cameras
  std::string rig;    ///< file that names them, unless `names` does
  int view_id = 0;    ///< in it
  std::string format; ///< GenICam pixel format; empty: what downstream takes
  int offset_x = -1, offset_y = -1;
  TriggerMode trigger = TriggerMode::kFreeRun;
  double exposure_us = 0, gain = -1; ///< 0, -1: as the cameras are set
  bool auto_exposure = false, auto_gain = false, auto_white_balance = false;
  bool lock_exposure = true;
  std::string features;
  int packet_size = 0, n_buffers = 8;
  gint64 packet_delay_ns = -1;
  bool packet_resend = true;
  std::string trigger_line = "Line1", output_line; ///< output line empty: the trigger is foreign
  guint action_device_key = 0x52414e47, action_group_key = 1, action_group_mask = 1;
  bool action_send = true, action_scheduled = false; ///< send: this element tells the cameras
  bool single_shot = false, reconnect = false;
  int num_buffers = -1;
  std::string clock_server;

  /** The names, from the rig file where there is none.
   *  @return kNotFound, kBadValue: the text says which property, or the file */
  rangecast::Status find_names (CameraNames &found) const;
  /** Whether the properties go together. @return kBadValue: the text says which do not */
  [[nodiscard]] rangecast::Status check () const;
  /** For one camera. Size and frame rate are still to be set. @param camera  0 is the left one */
  [[nodiscard]] CameraSettings for_camera (int camera) const;
  /** Whether this element triggers the cameras. */
  [[nodiscard]] bool triggers_cameras () const
  {
    return trigger == TriggerMode::kSoftware || (trigger == TriggerMode::kAction && action_send);
  }
  /** Whether the left camera's automatic settings are copied to the others. */
  [[nodiscard]] bool follows_left () const
  {
    return lock_exposure && (auto_exposure || auto_gain || auto_white_balance);
  }
};

/** Their properties, which may change in NULL and READY. */
PropertyTable<StereoCamSettings> &camera_properties ();

GType gst_stereo_cam_src_trigger_get_type (void);
#define GST_TYPE_STEREO_CAM_SRC_TRIGGER (gst_stereo_cam_src_trigger_get_type ())
