/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

G_BEGIN_DECLS

#define GST_TYPE_RTCP_REPORTS (gst_rtcp_reports_get_type ())
G_DECLARE_FINAL_TYPE (GstRtcpReports, gst_rtcp_reports, GST, RTCP_REPORTS, GstElement)

GST_ELEMENT_REGISTER_DECLARE (rtcpreports);

G_END_DECLS
