/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/base/gstbasetransform.h>

G_BEGIN_DECLS

#define GST_TYPE_ROI_EXTRACT (gst_roi_extract_get_type ())
G_DECLARE_FINAL_TYPE (GstRoiExtract, gst_roi_extract, GST, ROI_EXTRACT, GstBaseTransform)

GST_ELEMENT_REGISTER_DECLARE (roiextract);

G_END_DECLS
