/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/base/gstbaseparse.h>

G_BEGIN_DECLS

#define GST_TYPE_NEIGHBOUR_CODE_PARSE (gst_neighbour_code_parse_get_type ())
G_DECLARE_FINAL_TYPE (
    GstNeighbourCodeParse, gst_neighbour_code_parse, GST, NEIGHBOUR_CODE_PARSE, GstBaseParse)

GST_ELEMENT_REGISTER_DECLARE (neighbourcodeparse);

G_END_DECLS
