/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <rangecast/calibration/session.hpp>

/* The element messages of rigcalibrate, documented in docs/elements/rigcalibrate.md. Any thread,
 * without locks held. */

/** rigcalibrate-board, for a camera that had an image in the set. */
void post_board (GstElement *element, const rangecast::CalibrationSession &session, int camera,
    guint64 frame, GstClockTime running_time);
/** One rigcalibrate-coverage for each camera. */
void post_coverage (GstElement *element, const rangecast::CalibrationSession &session);
/** rigcalibrate-result. @param location  null: no file was written */
void post_result (GstElement *element, const rangecast::CalibrationSession &session,
    const rangecast::CalibrationResult &result, const char *location);
