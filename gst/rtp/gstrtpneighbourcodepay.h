/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/rtp/gstrtpbasepayload.h>

G_BEGIN_DECLS

#define GST_TYPE_RTP_NEIGHBOUR_CODE_PAY (gst_rtp_neighbour_code_pay_get_type ())
G_DECLARE_FINAL_TYPE (GstRtpNeighbourCodePay, gst_rtp_neighbour_code_pay, GST,
    RTP_NEIGHBOUR_CODE_PAY, GstRTPBasePayload)

GST_ELEMENT_REGISTER_DECLARE (rtpneighbourcodepay);

G_END_DECLS
