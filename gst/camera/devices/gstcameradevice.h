/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

G_BEGIN_DECLS

#define GST_TYPE_CAMERA_DEVICE (gst_camera_device_get_type ())
G_DECLARE_FINAL_TYPE (GstCameraDevice, gst_camera_device, GST, CAMERA_DEVICE, GstDevice)

G_END_DECLS
