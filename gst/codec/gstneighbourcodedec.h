/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/base/gstbasetransform.h>

G_BEGIN_DECLS

#define GST_TYPE_NEIGHBOUR_CODE_DEC (gst_neighbour_code_dec_get_type ())
G_DECLARE_FINAL_TYPE (
    GstNeighbourCodeDec, gst_neighbour_code_dec, GST, NEIGHBOUR_CODE_DEC, GstBaseTransform)

GST_ELEMENT_REGISTER_DECLARE (neighbourcodedec);

G_END_DECLS
