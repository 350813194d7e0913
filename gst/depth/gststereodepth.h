/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/base/gstaggregator.h>

G_BEGIN_DECLS

#define GST_TYPE_STEREO_DEPTH (gst_stereo_depth_get_type ())
G_DECLARE_FINAL_TYPE (GstStereoDepth, gst_stereo_depth, GST, STEREO_DEPTH, GstAggregator)

GST_ELEMENT_REGISTER_DECLARE (stereodepth);

G_END_DECLS
