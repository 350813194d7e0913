/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

G_BEGIN_DECLS

#define GST_TYPE_RANGE_RENDER (gst_range_render_get_type ())
G_DECLARE_FINAL_TYPE (GstRangeRender, gst_range_render, GST, RANGE_RENDER, GstBin)

GST_ELEMENT_REGISTER_DECLARE (rangerender);

G_END_DECLS
