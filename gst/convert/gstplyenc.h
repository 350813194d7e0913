/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/base/gstbasetransform.h>

G_BEGIN_DECLS

#define GST_TYPE_PLY_ENC (gst_ply_enc_get_type ())
G_DECLARE_FINAL_TYPE (GstPlyEnc, gst_ply_enc, GST, PLY_ENC, GstBaseTransform)

GST_ELEMENT_REGISTER_DECLARE (plyenc);

G_END_DECLS
