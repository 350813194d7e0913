/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

G_BEGIN_DECLS

#define GST_TYPE_CAPTURE_SYNC (gst_capture_sync_get_type ())
G_DECLARE_FINAL_TYPE (GstCaptureSync, gst_capture_sync, GST, CAPTURE_SYNC, GstElement)

GST_ELEMENT_REGISTER_DECLARE (capturesync);

G_END_DECLS
