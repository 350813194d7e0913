/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/base/gstbasesink.h>

G_BEGIN_DECLS

#define GST_TYPE_RANGE_WEB_SINK (gst_range_web_sink_get_type ())
G_DECLARE_FINAL_TYPE (GstRangeWebSink, gst_range_web_sink, GST, RANGE_WEB_SINK, GstBaseSink)

GST_ELEMENT_REGISTER_DECLARE (rangewebsink);

G_END_DECLS
