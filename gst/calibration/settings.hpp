/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <rangecast/calibration/session.hpp>
#include <string>

#include "common/properties.hpp"

/** rigcalibrate's properties. Guarded by the element's lock. */
struct RigCalibrateSettings {
  rangecast::CalibrationSettings core;
  bool auto_finish = false;
  std::string location;
};

PropertyTable<RigCalibrateSettings> &rig_calibrate_properties ();
