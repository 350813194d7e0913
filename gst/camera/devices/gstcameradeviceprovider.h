/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

G_BEGIN_DECLS

#define GST_TYPE_CAMERA_DEVICE_PROVIDER (gst_camera_device_provider_get_type ())
G_DECLARE_FINAL_TYPE (GstCameraDeviceProvider, gst_camera_device_provider, GST,
    CAMERA_DEVICE_PROVIDER, GstDeviceProvider)

GST_DEVICE_PROVIDER_REGISTER_DECLARE (rangecastdeviceprovider);

G_END_DECLS
