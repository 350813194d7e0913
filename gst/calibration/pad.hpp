/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/base/gstaggregator.h>

#include <rangecast/calibration/observations.hpp>

G_BEGIN_DECLS

/* Sink pad of rigcalibrate, with the properties view and role. */
#define GST_TYPE_RIG_CALIBRATE_PAD (gst_rig_calibrate_pad_get_type ())
G_DECLARE_FINAL_TYPE (
    GstRigCalibratePad, gst_rig_calibrate_pad, GST, RIG_CALIBRATE_PAD, GstAggregatorPad)

G_END_DECLS

/** The pad's name, view and role, without the image size. Any thread. */
rangecast::CalibrationCamera calibration_camera (GstRigCalibratePad *pad);
/** Sets the default of `view`; before the pad is added. */
void set_default_view (GstRigCalibratePad *pad, int view_id);
