/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/base/gstaggregator.h>

G_BEGIN_DECLS

#define GST_TYPE_RANGE_MUX (gst_range_mux_get_type ())
G_DECLARE_FINAL_TYPE (GstRangeMux, gst_range_mux, GST, RANGE_MUX, GstAggregator)

GST_ELEMENT_REGISTER_DECLARE (rangemux);

G_END_DECLS
