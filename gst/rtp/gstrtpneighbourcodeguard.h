/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

G_BEGIN_DECLS

#define GST_TYPE_RTP_NEIGHBOUR_CODE_GUARD (gst_rtp_neighbour_code_guard_get_type ())
G_DECLARE_FINAL_TYPE (GstRtpNeighbourCodeGuard, gst_rtp_neighbour_code_guard, GST,
    RTP_NEIGHBOUR_CODE_GUARD, GstElement)

GST_ELEMENT_REGISTER_DECLARE (rtpneighbourcodeguard);

G_END_DECLS
