/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/base/gstaggregator.h>

#include <rangecast/calibration/observations.hpp>

G_BEGIN_DECLS

/* A camera of rigcalibrate: a sink pad that knows its view and its role there. */
#define GST_TYPE_RIG_CALIBRATE_PAD (gst_rig_calibrate_pad_get_type ())
G_DECLARE_FINAL_TYPE (
    GstRigCalibratePad, gst_rig_calibrate_pad, GST, RIG_CALIBRATE_PAD, GstAggregatorPad)

G_END_DECLS

/* The pad's properties; size is left out. Any thread. */
rangecast::CalibrationCamera calibration_camera (GstRigCalibratePad *pad);
/* The view that the pad has until somebody says otherwise; before the pad is added. */
void set_default_view (GstRigCalibratePad *pad, int view_id);
