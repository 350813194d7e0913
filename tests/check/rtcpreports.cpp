/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "rangecast-check.hpp"

#include <gst/rtp/rtp.h>

static constexpr guint32 kSender = 0x1234, kReceiver = 0x77;

struct Session {
  GstElement *element = gst_element_factory_make ("rtcpreports", nullptr);
  GstHarness *rtp, *rtcp;

  Session ()
  {
    fail_unless (element != nullptr);
    rtp = gst_harness_new_with_element (element, "sink", "src");
    rtcp = gst_harness_new_with_element (element, "rtcp_sink", "rtcp_src");
    gst_harness_set_src_caps_str (
        rtp, "application/x-rtp, media=application, clock-rate=90000, payload=96");
    gst_harness_set_src_caps_str (rtcp, "application/x-rtcp");
    gst_harness_set_drop_buffers (rtp, FALSE);
  }
  ~Session ()
  {
    gst_harness_teardown (rtcp);
    gst_harness_teardown (rtp);
    gst_object_unref (element);
  }
  void push_rtp (guint32 ssrc = kSender)
  {
    GstBuffer *packet = gst_rtp_buffer_new_allocate (100, 0, 0);
    GstRTPBuffer mapped = GST_RTP_BUFFER_INIT;
    fail_unless (gst_rtp_buffer_map (packet, GST_MAP_WRITE, &mapped));
    gst_rtp_buffer_set_ssrc (&mapped, ssrc);
    gst_rtp_buffer_unmap (&mapped);
    gst_buffer_unref (gst_harness_push_and_pull (rtp, packet));
  }
  /* @return the events that come of it, as structures to free */
  std::vector<GstStructure *> push_rtcp (GstBuffer *packet)
  {
    const gsize size = gst_buffer_get_size (packet);
    GstBuffer *out = gst_harness_push_and_pull (rtcp, packet);
    fail_unless_equals_int (gst_buffer_get_size (out), size);
    gst_buffer_unref (out);
    std::vector<GstStructure *> reports;
    while (GstEvent *event = gst_harness_try_pull_upstream_event (rtp)) {
      const GstStructure *s = gst_event_get_structure (event);
      if (s && gst_structure_has_name (s, "RangecastReceiverReport"))
        reports.push_back (gst_structure_copy (s));
      gst_event_unref (event);
    }
    return reports;
  }
};

struct Report {
  guint32 sender = kSender;
  guint8 lost = 64;
  guint32 highest = 1000, jitter = 900, last_sr = 0, delay = 0;
};

static GstBuffer *
receiver_report (const std::vector<Report> &reports, bool of_sender = false)
{
  GstBuffer *buffer = gst_rtcp_buffer_new (1400);
  GstRTCPBuffer rtcp = GST_RTCP_BUFFER_INIT;
  GstRTCPPacket packet;
  fail_unless (gst_rtcp_buffer_map (buffer, GST_MAP_READWRITE, &rtcp));
  fail_unless (
      gst_rtcp_buffer_add_packet (&rtcp, of_sender ? GST_RTCP_TYPE_SR : GST_RTCP_TYPE_RR, &packet));
  if (of_sender)
    gst_rtcp_packet_sr_set_sender_info (&packet, kReceiver, 0, 0, 0, 0);
  else
    gst_rtcp_packet_rr_set_ssrc (&packet, kReceiver);
  for (const Report &r : reports)
    fail_unless (gst_rtcp_packet_add_rb (
        &packet, r.sender, r.lost, 5, r.highest, r.jitter, r.last_sr, r.delay));
  gst_rtcp_buffer_unmap (&rtcp);
  return buffer;
}

static void
free_all (std::vector<GstStructure *> &reports)
{
  for (GstStructure *report : reports)
    gst_structure_free (report);
}

GST_START_TEST (test_report_becomes_an_event_upstream)
{
  for (const bool of_sender : {false, true}) {
    Session session;
    session.push_rtp ();
    auto reports = session.push_rtcp (receiver_report ({{}}, of_sender));
    fail_unless_equals_int (reports.size (), 1);
    guint ssrc = 0, packets = 99;
    guint64 jitter = 0, trip = 99;
    double lost = 0;
    fail_unless (gst_structure_get (reports[0], "ssrc", G_TYPE_UINT, &ssrc, "fraction-lost",
        G_TYPE_DOUBLE, &lost, "packets", G_TYPE_UINT, &packets, "jitter", G_TYPE_UINT64, &jitter,
        "round-trip-time", G_TYPE_UINT64, &trip, nullptr));
    fail_unless_equals_int (ssrc, kReceiver);
    fail_unless_equals_float (lost, 0.25);
    fail_unless_equals_int (packets, 0);
    fail_unless_equals_uint64 (jitter, 10 * GST_MSECOND);
    fail_unless_equals_uint64 (trip, 0);
    free_all (reports);
  }
}
GST_END_TEST;

GST_START_TEST (test_packets_are_those_since_the_report_before)
{
  Session session;
  session.push_rtp ();
  auto reports = session.push_rtcp (receiver_report ({{.highest = 0x1fff0}}));
  free_all (reports);
  reports = session.push_rtcp (receiver_report ({{.highest = 0x20050}}));
  guint packets = 0;
  fail_unless (gst_structure_get_uint (reports[0], "packets", &packets));
  fail_unless_equals_int (packets, 0x60);
  free_all (reports);
}
GST_END_TEST;

GST_START_TEST (test_round_trip_is_now_less_the_last_report_less_the_delay)
{
  Session session;
  session.push_rtp ();
  const auto ntp =
      guint32 (gst_util_uint64_scale (guint64 (g_get_real_time ()), 65536, G_USEC_PER_SEC) +
               (guint64{2208988800} << 16));
  auto reports =
      session.push_rtcp (receiver_report ({{.last_sr = ntp - 3 * 65536, .delay = 65536}}));
  guint64 trip = 0;
  fail_unless (gst_structure_get_uint64 (reports[0], "round-trip-time", &trip));
  fail_unless (trip >= 1990 * GST_MSECOND, "%" G_GUINT64_FORMAT, trip); /* later: more */
  free_all (reports);
  reports = session.push_rtcp (receiver_report ({{.last_sr = ntp + 9 * 65536}}));
  fail_unless (gst_structure_get_uint64 (reports[0], "round-trip-time", &trip));
  fail_unless_equals_uint64 (trip, 0); /* of the future: another clock */
  free_all (reports);
}
GST_END_TEST;

GST_START_TEST (test_reports_about_other_streams_are_none)
{
  Session session;
  auto reports = session.push_rtcp (receiver_report ({{}}));
  fail_unless_equals_int (reports.size (), 0); /* no stream yet */
  session.push_rtp ();
  reports = session.push_rtcp (receiver_report ({{.sender = 1}, {}, {.sender = 2}}));
  fail_unless_equals_int (reports.size (), 1);
  free_all (reports);
  session.push_rtp (1);
  reports = session.push_rtcp (receiver_report ({{}}));
  fail_unless_equals_int (reports.size (), 0);
}
GST_END_TEST;

GST_START_TEST (test_bytes_that_are_no_rtcp_go_on_and_tell_nothing)
{
  Session session;
  session.push_rtp ();
  GRand *random = g_rand_new_with_seed (1);
  for (int i = 0; i < 2000; i++) {
    GstBuffer *good = receiver_report ({{}});
    GstMapInfo map;
    gst_buffer_map (good, &map, GST_MAP_READWRITE);
    for (int k = 0; k < 3; k++)
      map.data[g_rand_int_range (random, 0, gint (map.size))] = guint8 (g_rand_int (random));
    const gsize size = gsize (g_rand_int_range (random, 1, gint (map.size) + 1));
    GstBuffer *bad = gst_buffer_new_memdup (map.data, size);
    gst_buffer_unmap (good, &map);
    gst_buffer_unref (good);
    auto reports = session.push_rtcp (bad);
    free_all (reports);
  }
  g_rand_free (random);
  auto reports = session.push_rtcp (receiver_report ({{}}));
  fail_unless_equals_int (reports.size (), 1);
  free_all (reports);
}
GST_END_TEST;

GST_START_TEST (test_events_of_one_stream_do_not_reach_the_other)
{
  Session session;
  session.push_rtp ();
  while (GstEvent *event = gst_harness_try_pull_event (session.rtp))
    gst_event_unref (event);
  while (GstEvent *event = gst_harness_try_pull_event (session.rtcp))
    gst_event_unref (event);
  gst_harness_push_event (session.rtcp, gst_event_new_eos ());
  fail_unless (gst_harness_try_pull_event (session.rtp) == nullptr);
  GstEvent *eos = gst_harness_try_pull_event (session.rtcp);
  fail_unless (eos && GST_EVENT_TYPE (eos) == GST_EVENT_EOS);
  gst_event_unref (eos);
  session.push_rtp ();
}
GST_END_TEST;

static Suite *
rtcpreports_suite ()
{
  Suite *suite = suite_create ("rtcpreports");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_report_becomes_an_event_upstream);
  tcase_add_test (tc, test_packets_are_those_since_the_report_before);
  tcase_add_test (tc, test_round_trip_is_now_less_the_last_report_less_the_delay);
  tcase_add_test (tc, test_reports_about_other_streams_are_none);
  tcase_add_test (tc, test_bytes_that_are_no_rtcp_go_on_and_tell_nothing);
  tcase_add_test (tc, test_events_of_one_stream_do_not_reach_the_other);
  return suite;
}

GST_CHECK_MAIN (rtcpreports);
