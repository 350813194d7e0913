/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <rangecast/calibration/session.hpp>
#include <string>

#include "common/properties.hpp"

/* Which frames are kept. */
enum class CalibrationSelection { kAuto, kAll, kSpread };

/* rigcalibrate's properties as the application wants them. */
struct CalibrationProperties {
  rangecast::CalibrationSettings core;
  int max_frames = 100;
  CalibrationSelection selection = CalibrationSelection::kAuto;
  bool auto_finish = false;
  GstClockTime max_skew = 0;
  int tile_width = 480;
  std::string location;
};

/** Their properties, which may change in NULL and READY. */
PropertyTable<CalibrationProperties> &calibration_properties ();
