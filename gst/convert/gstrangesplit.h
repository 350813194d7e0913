/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

G_BEGIN_DECLS

#define GST_TYPE_RANGE_SPLIT (gst_range_split_get_type ())
G_DECLARE_FINAL_TYPE (GstRangeSplit, gst_range_split, GST, RANGE_SPLIT, GstElement)

GST_ELEMENT_REGISTER_DECLARE (rangesplit);

G_END_DECLS
