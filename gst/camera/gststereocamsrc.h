/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

G_BEGIN_DECLS

#define GST_TYPE_STEREO_CAM_SRC (gst_stereo_cam_src_get_type ())
G_DECLARE_FINAL_TYPE (GstStereoCamSrc, gst_stereo_cam_src, GST, STEREO_CAM_SRC, GstElement)

GST_ELEMENT_REGISTER_DECLARE (stereocamsrc);

G_END_DECLS
