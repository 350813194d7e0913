/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <rangecast/calibration/session.hpp>
#include <string>

#include "common/properties.hpp"

enum class FrameSelection { kAuto, kAll, kSpread };

/** rigcalibrate's properties. Guarded by the element's lock. */
struct RigCalibrateSettings {
  rangecast::CalibrationSettings core;
  int max_frames = 100;
  FrameSelection selection = FrameSelection::kAuto;
  bool auto_finish = false;
  GstClockTime max_skew = 0;
  int tile_width = 480;
  std::string location;
};

PropertyTable<RigCalibrateSettings> &rig_calibrate_properties ();
