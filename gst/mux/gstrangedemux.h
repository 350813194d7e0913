/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

G_BEGIN_DECLS

#define GST_TYPE_RANGE_DEMUX (gst_range_demux_get_type ())
G_DECLARE_FINAL_TYPE (GstRangeDemux, gst_range_demux, GST, RANGE_DEMUX, GstElement)

GST_ELEMENT_REGISTER_DECLARE (rangedemux);

G_END_DECLS
