/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/base/gstaggregator.h>

G_BEGIN_DECLS

#define GST_TYPE_RANGE_COMBINE (gst_range_combine_get_type ())
G_DECLARE_FINAL_TYPE (GstRangeCombine, gst_range_combine, GST, RANGE_COMBINE, GstAggregator)

GST_ELEMENT_REGISTER_DECLARE (rangecombine);

G_END_DECLS
