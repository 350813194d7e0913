/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/base/gstbasetransform.h>

G_BEGIN_DECLS

#define GST_TYPE_NEIGHBOUR_CODE_ENC (gst_neighbour_code_enc_get_type ())
G_DECLARE_FINAL_TYPE (
    GstNeighbourCodeEnc, gst_neighbour_code_enc, GST, NEIGHBOUR_CODE_ENC, GstBaseTransform)

GST_ELEMENT_REGISTER_DECLARE (neighbourcodeenc);

G_END_DECLS
