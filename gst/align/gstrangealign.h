/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/base/gstbasetransform.h>

G_BEGIN_DECLS

#define GST_TYPE_RANGE_ALIGN (gst_range_align_get_type ())
G_DECLARE_FINAL_TYPE (GstRangeAlign, gst_range_align, GST, RANGE_ALIGN, GstBaseTransform)

GST_ELEMENT_REGISTER_DECLARE (rangealign);

G_END_DECLS
