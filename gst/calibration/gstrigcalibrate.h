/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/base/gstaggregator.h>

G_BEGIN_DECLS

#define GST_TYPE_RIG_CALIBRATE (gst_rig_calibrate_get_type ())
G_DECLARE_FINAL_TYPE (GstRigCalibrate, gst_rig_calibrate, GST, RIG_CALIBRATE, GstAggregator)

GST_ELEMENT_REGISTER_DECLARE (rigcalibrate);

G_END_DECLS
