/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* neighbourcodeenc adaptive-bitrate: events from receivers in, bit and frame rates out. */
#include "../coded-check.hpp"

#include <functional>

using namespace rangecast;
using namespace rangecast::testing;

static constexpr GstClockTime kInterval = GST_SECOND / 30;

/* Transport-wide feedback of a link, as rtpsession sends it: a packet in 2 ms of queue more for
 * each frame set where it is too narrow. */
struct Receiver {
  double queue_growth_s = 0; /* a frame set */
  int lost_of_10 = 0;
  double queue_s = 0;
  guint sequence = 0;
  int frame = 0;

  GstEvent *report (gsize bytes)
  {
    G_GNUC_BEGIN_IGNORE_DEPRECATIONS
    GValueArray *packets = g_value_array_new (0);
    queue_s += queue_growth_s;
    const int n = int (bytes / 1200) + 2;
    for (int i = 0; i < n; i++) {
      const bool lost = int (sequence % 10) < lost_of_10;
      const guint64 sent = GST_SECOND + guint64 (frame) * kInterval + guint64 (i) * 1000;
      GstStructure *packet = gst_structure_new ("RTPTWCCPacket", "seqnum", G_TYPE_UINT,
          sequence++ & 0xffff, "local-ts", G_TYPE_UINT64, sent, "remote-ts", G_TYPE_UINT64,
          lost ? GST_CLOCK_TIME_NONE : guint64 (double (sent) + 1e9 * queue_s + 5e9),
          "payload-type", G_TYPE_UCHAR, 96, "size", G_TYPE_UINT, guint (bytes / gsize (n)), "lost",
          G_TYPE_BOOLEAN, gboolean (lost), nullptr);
      GValue value = G_VALUE_INIT;
      g_value_init (&value, GST_TYPE_STRUCTURE);
      g_value_take_boxed (&value, packet);
      g_value_array_append (packets, &value);
      g_value_unset (&value);
    }
    frame++;
    GstStructure *all = gst_structure_new (
        "RTPTWCCPackets", "packets", g_value_array_get_type (), packets, nullptr);
    g_value_array_free (packets);
    G_GNUC_END_IGNORE_DEPRECATIONS
    return gst_event_new_custom (GST_EVENT_CUSTOM_UPSTREAM, all);
  }
};

struct Session {
  Rig rig = ring_rig (1);
  GstHarness *h;
  Receiver receiver;
  int frame = 0;
  std::vector<gsize> sizes;        /* of what came out */
  std::vector<GstClockTime> times; /* its PTS */

  explicit Session (const std::string &properties)
      : h (harness_of ("neighbourcodeenc profile=packed " + properties))
  {
    gst_harness_set_src_caps (h, range_caps (rig));
  }
  ~Session () { gst_harness_teardown (h); }
  void play (int n, bool reports = true)
  {
    for (const int end = frame + n; frame < end; frame++) {
      fail_unless_equals_int (
          gst_harness_push (h, make_frame_set (rig, GstClockTime (frame) * kInterval)),
          GST_FLOW_OK);
      gsize bytes = 0;
      while (GstBuffer *buffer = gst_harness_try_pull (h)) {
        bytes = gst_buffer_get_size (buffer);
        sizes.push_back (bytes);
        times.push_back (GST_BUFFER_PTS (buffer));
        gst_buffer_unref (buffer);
      }
      if (reports && bytes > 0)
        fail_unless (gst_harness_push_upstream_event (h, receiver.report (bytes)));
      else
        receiver.frame++;
    }
  }
  guint64 estimate () const { return stat ("estimated-bitrate"); }
  guint64 stat (const char *name) const { return stats_field (h->element, name); }
};

/* Bits/s of the default thresholds. */
static double
usual_rate ()
{
  Session session ("");
  session.play (10);
  return 8 * 30 * double (session.sizes.back ());
}

GST_START_TEST (test_without_trouble_thresholds_are_as_configured)
{
  Session plain (""), adaptive ("adaptive-bitrate=true");
  plain.play (30);
  adaptive.play (30);
  fail_unless_cmp (plain.sizes, ==, adaptive.sizes);
  fail_unless_equals_uint64 (adaptive.estimate (), 0);
  fail_unless_equals_uint64 (adaptive.stat ("receiver-reports"), 30);
}
GST_END_TEST;

GST_START_TEST (test_a_queue_that_grows_lowers_the_rate_and_its_end_raises_it)
{
  Session session ("adaptive-bitrate=true");
  session.play (15);
  const double before = 30 * 8 * double (session.sizes.back ());
  session.receiver.queue_growth_s = 0.004;
  session.play (15);
  const guint64 low = session.estimate ();
  fail_unless (low > 0 && double (low) < 0.95 * before, "%" G_GUINT64_FORMAT " of %g", low, before);
  ck_assert_uint_lt (session.sizes.back (), session.sizes.front ());
  session.receiver.queue_growth_s = -session.receiver.queue_s / 10;
  session.play (10);
  session.receiver.queue_growth_s = 0;
  /* Time between reports is that of the wall. */
  for (int i = 0; i < 20 && session.estimate () <= low; i++) {
    g_usleep (50000);
    session.play (10);
  }
  ck_assert_uint_gt (session.estimate (), low);
}
GST_END_TEST;

GST_START_TEST (test_target_bitrate_is_the_most_and_min_bitrate_the_least)
{
  Session session ("adaptive-bitrate=true target-bitrate=2000000 min-bitrate=900000 "
                   "min-framerate=30/1");
  session.play (20);
  fail_unless_equals_uint64 (session.estimate (), 2000000);
  session.receiver.lost_of_10 = 9;
  session.play (200);
  fail_unless_equals_uint64 (session.estimate (), 900000);
  g_object_set (session.h->element, "min-bitrate", 3000000u, nullptr);
  session.play (2);
  fail_unless_equals_uint64 (session.estimate (), 2000000);
}
GST_END_TEST;

GST_START_TEST (test_without_adaptive_bitrate_events_change_nothing)
{
  Session session ("target-bitrate=2000000"), other ("target-bitrate=2000000");
  session.receiver.lost_of_10 = 9;
  session.play (60);
  other.play (60, false);
  fail_unless_cmp (session.sizes, ==, other.sizes);
  fail_unless_equals_uint64 (session.stat ("receiver-reports"), 60);
}
GST_END_TEST;

GST_START_TEST (test_below_the_worst_thresholds_whole_frame_sets_are_left_out_evenly)
{
  Session session ("adaptive-bitrate=true min-bitrate=10000 min-framerate=1/1 target-bitrate=" +
                   std::to_string (int (usual_rate () / 8)));
  session.play (90);
  session.times.clear ();
  const gsize events = gst_harness_events_received (session.h);
  const guint64 before = session.stat ("skipped");
  session.play (90);
  fail_unless (session.times.size () < 46, "%d frame sets", int (session.times.size ()));
  const GstClockTime step = session.times[1] - session.times[0];
  for (gsize i = 1; i < session.times.size (); i++)
    ck_assert_uint_eq (session.times[i] - session.times[i - 1], step);
  fail_unless_equals_uint64 (session.stat ("skipped") - before, 90 - session.times.size ());
  /* Each is a GAP downstream. */
  fail_unless_equals_int (
      gst_harness_events_received (session.h) - events, 90 - int (session.times.size ()));
  GstEvent *last = nullptr;
  while (GstEvent *event = gst_harness_try_pull_event (session.h)) {
    if (GST_EVENT_TYPE (event) == GST_EVENT_GAP)
      gst_event_replace (&last, event);
    gst_event_unref (event);
  }
  fail_unless (last != nullptr);
  GstClockTime time, duration;
  gst_event_parse_gap (last, &time, &duration);
  ck_assert_uint_gt (time, 88 * kInterval);
  ck_assert_uint_lt (time, 180 * kInterval);
  gst_event_unref (last);
}
GST_END_TEST;

GST_START_TEST (test_events_that_hold_nonsense_are_borne)
{
  Session session ("adaptive-bitrate=true");
  session.play (5);
  const char *const nonsense[] = {
      "RTPTWCCPackets", "RTPTWCCPackets, packets=(int)3", "RTPTWCCPackets, packets=(string)x"};
  for (const char *text : nonsense) {
    GstStructure *structure = gst_structure_from_string (text, nullptr);
    fail_unless (structure != nullptr, "%s", text);
    gst_harness_push_upstream_event (
        session.h, gst_event_new_custom (GST_EVENT_CUSTOM_UPSTREAM, structure));
    session.play (2);
  }
  G_GNUC_BEGIN_IGNORE_DEPRECATIONS
  GValueArray *packets = g_value_array_new (0);
  GValue number = G_VALUE_INIT;
  g_value_init (&number, G_TYPE_INT);
  g_value_array_append (packets, &number);
  GstStructure *structure =
      gst_structure_new ("RTPTWCCPackets", "packets", g_value_array_get_type (), packets, nullptr);
  g_value_array_free (packets);
  G_GNUC_END_IGNORE_DEPRECATIONS
  gst_harness_push_upstream_event (
      session.h, gst_event_new_custom (GST_EVENT_CUSTOM_UPSTREAM, structure));
  session.play (5);
  fail_unless_equals_int (int (session.sizes.size ()), session.frame);
}
GST_END_TEST;

static Suite *
adaptiverate_suite ()
{
  Suite *suite = suite_create ("adaptiverate");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_without_trouble_thresholds_are_as_configured);
  tcase_add_test (tc, test_a_queue_that_grows_lowers_the_rate_and_its_end_raises_it);
  tcase_add_test (tc, test_target_bitrate_is_the_most_and_min_bitrate_the_least);
  tcase_add_test (tc, test_without_adaptive_bitrate_events_change_nothing);
  tcase_add_test (tc, test_below_the_worst_thresholds_whole_frame_sets_are_left_out_evenly);
  tcase_add_test (tc, test_events_that_hold_nonsense_are_borne);
  return suite;
}

GST_CHECK_MAIN (adaptiverate);
