/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

/** The debug category of rangewebsink, for all its files. */
GST_DEBUG_CATEGORY_EXTERN (gst_range_web_sink_debug);
#define GST_CAT_DEFAULT gst_range_web_sink_debug
