/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/rtp/gstrtpbasedepayload.h>

G_BEGIN_DECLS

#define GST_TYPE_RTP_NEIGHBOUR_CODE_DEPAY (gst_rtp_neighbour_code_depay_get_type ())
G_DECLARE_FINAL_TYPE (GstRtpNeighbourCodeDepay, gst_rtp_neighbour_code_depay, GST,
    RTP_NEIGHBOUR_CODE_DEPAY, GstRTPBaseDepayload)

GST_ELEMENT_REGISTER_DECLARE (rtpneighbourcodedepay);

G_END_DECLS
