/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <rangecast/calibration/session.hpp>
#include <string>

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

/* The ids of the properties, from 1 on; the element's own follow from kCalibrationLast on. */
enum CalibrationPropertyId {
  kCalibrationNone,
  kCalibrationBoard,
  kCalibrationColumns,
  kCalibrationRows,
  kCalibrationSquareSize,
  kCalibrationMarkerSize,
  kCalibrationDictionary,
  kCalibrationLocation,
  kCalibrationMinFrames,
  kCalibrationMaxFrames,
  kCalibrationSelection,
  kCalibrationDistortion,
  kCalibrationWorld,
  kCalibrationNear,
  kCalibrationFar,
  kCalibrationAutoFinish,
  kCalibrationMaxSkew,
  kCalibrationTileWidth,
  kCalibrationLast
};

void install_calibration_properties (GObjectClass *object_class);
/* @return false if the id is none of ours. The caller holds the lock that guards the properties. */
bool set_calibration_property (CalibrationProperties &p, guint id, const GValue *value);
bool get_calibration_property (const CalibrationProperties &p, guint id, GValue *value);
