/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

G_BEGIN_DECLS

#define GST_TYPE_STEREO_WEBCAM_PROVIDER (gst_stereo_webcam_provider_get_type ())
G_DECLARE_FINAL_TYPE (GstStereoWebcamProvider, gst_stereo_webcam_provider, GST,
    STEREO_WEBCAM_PROVIDER, GstDeviceProvider)

#define GST_TYPE_STEREO_WEBCAM (gst_stereo_webcam_get_type ())
G_DECLARE_FINAL_TYPE (GstStereoWebcam, gst_stereo_webcam, GST, STEREO_WEBCAM, GstDevice)

G_END_DECLS
