/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/base/gstbasetransform.h>

G_BEGIN_DECLS

#define GST_TYPE_CYLINDER_FILTER (gst_cylinder_filter_get_type ())
G_DECLARE_FINAL_TYPE (
    GstCylinderFilter, gst_cylinder_filter, GST, CYLINDER_FILTER, GstBaseTransform)

GST_ELEMENT_REGISTER_DECLARE (cylinderfilter);

G_END_DECLS
