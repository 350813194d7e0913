/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Coded frame sets over RTP through a bad network (netsim), in real time: payloader to decoder. */
#include "coded-check.hpp"

#include <gst/app/gstappsink.h>
#include <gst/app/gstappsrc.h>

using namespace rangecast;
using namespace rangecast::testing;

static constexpr int kFrames = 60;
static constexpr GstClockTime kFrame = 20 * GST_MSECOND;

/* What came out of kFrames frame sets. */
struct Received {
  int frames = 0;
  int in_order = 0;        /* later than the one before */
  double right_pixels = 0; /* share of those that were sent, of the frame sets that came */
  guint64 points = 0, missing = 0, bad = 0;
};

static double
share_of_right_pixels (GstBuffer *expected, GstBuffer *buffer)
{
  gstrange::RangeFrameMap a (expected, GST_MAP_READ), b (buffer, GST_MAP_READ);
  int valid = 0, right = 0;
  for (const RangeImage &x : a.views ())
    for (int row = 0; row < x.roi.height; row++)
      for (int column = 0; column < x.roi.width; column++)
        valid += x.depth.at (column, row) != 0;
  for (const RangeImage &y : b.views ())
    for (const RangeImage &x : a.views ())
      for (int row = 0; x.view_id == y.view_id && row < x.roi.height; row++)
        for (int column = 0; column < x.roi.width; column++)
          right += x.depth.at (column, row) && x.depth.at (column, row) == y.depth.at (column, row);
  return double (right) / valid;
}

static bool
have_network_simulator ()
{
  for (const char *name : {"netsim", "rtpjitterbuffer"}) {
    GstElementFactory *factory = gst_element_factory_find (name);
    if (!factory)
      return false;
    gst_object_unref (factory);
  }
  return true;
}

static void
push_in_real_time (GstElement *pipeline, const Rig &rig)
{
  GstElement *source = gst_bin_get_by_name (GST_BIN (pipeline), "in");
  GstCaps *caps = range_caps (rig);
  gst_app_src_set_caps (GST_APP_SRC (source), caps);
  gst_caps_unref (caps);
  gst_element_get_state (pipeline, nullptr, nullptr, 5 * GST_SECOND);
  for (int i = 0; i < kFrames; i++) {
    GstBuffer *frame_set = make_frame_set (rig, gst_element_get_current_running_time (pipeline));
    fail_unless_equals_int (gst_app_src_push_buffer (GST_APP_SRC (source), frame_set), GST_FLOW_OK);
    g_usleep (kFrame / 1000);
  }
  g_usleep (100000); /* EOS overtakes packets that netsim delays */
  fail_unless_equals_int (gst_app_src_end_of_stream (GST_APP_SRC (source)), GST_FLOW_OK);
  gst_object_unref (source);
}

static Received
pull_everything (GstElement *pipeline, const Rig &rig)
{
  Received received;
  GstElement *sink = gst_bin_get_by_name (GST_BIN (pipeline), "out");
  GstBuffer *expected = make_frame_set (rig);
  GstClockTime last = GST_CLOCK_TIME_NONE;
  while (GstSample *sample = gst_app_sink_try_pull_sample (GST_APP_SINK (sink), 3 * GST_SECOND)) {
    GstBuffer *buffer = gst_sample_get_buffer (sample);
    const GstClockTime time = gst_range_buffer_get_capture_time (buffer);
    received.frames++;
    received.in_order += !GST_CLOCK_TIME_IS_VALID (last) || time > last;
    received.right_pixels += share_of_right_pixels (expected, buffer);
    last = time;
    gst_sample_unref (sample);
  }
  received.right_pixels /= std::max (received.frames, 1);
  gst_buffer_unref (expected);
  gst_object_unref (sink);
  return received;
}

static void
read_stats (GstElement *pipeline, Received &received)
{
  GstElement *decoder = gst_bin_get_by_name (GST_BIN (pipeline), "dec");
  GstStructure *stats;
  g_object_get (decoder, "stats", &stats, nullptr);
  gst_structure_get (stats, "points", G_TYPE_UINT64, &received.points, "missing-pixels",
      G_TYPE_UINT64, &received.missing, "bad-slices", G_TYPE_UINT64, &received.bad, nullptr);
  gst_structure_free (stats);
  gst_object_unref (decoder);
}

/* Sends kFrames frame sets, all alike but for their times, through netsim; an error fails. */
static Received
send (const Rig &rig, const char *network, const char *decoder = "", const char *coded = "")
{
  const std::string launch =
      std::string ("appsrc name=in format=time is-live=true ! neighbourcodeenc depth-bits=16 "
                   "depth-threshold=0 colour-threshold=0 ! ") +
      coded + " rtpneighbourcodepay config-interval=-1 ! netsim " + network +
      " ! rtpjitterbuffer latency=150 ! rtpneighbourcodedepay ! neighbourcodedec name=dec " +
      decoder + " ! appsink name=out sync=false async=false";
  GstElement *pipeline = gst_parse_launch (launch.c_str (), nullptr);
  fail_unless (pipeline != nullptr);
  GstBus *bus = gst_element_get_bus (pipeline);
  gst_element_set_state (pipeline, GST_STATE_PLAYING);
  push_in_real_time (pipeline, rig);
  Received received = pull_everything (pipeline, rig);
  read_stats (pipeline, received);
  GstMessage *error = gst_bus_pop_filtered (bus, GST_MESSAGE_ERROR);
  fail_unless (error == nullptr);
  gst_element_set_state (pipeline, GST_STATE_NULL);
  gst_object_unref (bus);
  gst_object_unref (pipeline);
  return received;
}

#define NEED_NETSIM                                                                                \
  if (!have_network_simulator ())                                                                  \
  RANGECAST_SKIP ("no netsim or rtpjitterbuffer")

GST_START_TEST (test_good_network_loses_nothing)
{
  NEED_NETSIM;
  const Received received = send (ring_rig (2, 160, 120), "");
  fail_unless_equals_int (received.frames, kFrames);
  fail_unless_equals_int (received.in_order, kFrames);
  fail_unless (received.right_pixels == 1);
}
GST_END_TEST;

GST_START_TEST (test_share_of_right_pixels_is_that_of_packets_that_come)
{
  NEED_NETSIM;
  for (const double loss : {0.05, 0.3}) {
    const std::string network = "drop-probability=" + std::to_string (loss);
    const Received received = send (ring_rig (2, 160, 120), network.c_str ());
    fail_unless (received.frames > kFrames - 5, "%d frames", received.frames);
    fail_unless_equals_int (received.in_order, received.frames);
    fail_unless (std::abs (received.right_pixels - (1 - loss)) < 0.05, "%g right at loss %g",
        received.right_pixels, loss);
    fail_unless_equals_uint64 (received.bad, 0);
  }
}
GST_END_TEST;

GST_START_TEST (test_conceal_last_fills_what_is_lost)
{
  NEED_NETSIM;
  const Received received = send (ring_rig (2, 160, 120), "drop-probability=0.1", "conceal=last");
  fail_unless (received.frames > kFrames - 5, "%d frames", received.frames);
  fail_unless (received.missing > 0);
  /* Only what was lost from the first frame set on stays away until it comes once. */
  fail_unless (received.right_pixels > 0.99, "%g right", received.right_pixels);
}
GST_END_TEST;

GST_START_TEST (test_repeated_packets_change_nothing)
{
  NEED_NETSIM;
  const Rig rig = ring_rig (2, 160, 120);
  const Received once = send (rig, ""), twice = send (rig, "duplicate-probability=0.5");
  fail_unless_equals_int (twice.frames, kFrames);
  fail_unless (twice.right_pixels == 1);
  fail_unless_equals_uint64 (twice.points, once.points);
}
GST_END_TEST;

/* Before it knows their rate, rtpjitterbuffer starts anew if 120 packets are out of order. */
GST_START_TEST (test_packets_out_of_order_change_nothing)
{
  NEED_NETSIM;
  const Received received = send (ring_rig (2, 160, 120),
      "delay-probability=0.2 min-delay=1 max-delay=40 allow-reordering=true");
  fail_unless_equals_int (received.frames, kFrames);
  fail_unless_equals_int (received.in_order, kFrames);
  fail_unless (received.right_pixels > 0.98, "%g right", received.right_pixels);
}
GST_END_TEST;

GST_START_TEST (test_slices_sent_one_by_one_come_through_loss_and_disorder)
{
  NEED_NETSIM;
  const Received received = send (ring_rig (2, 160, 120),
      "drop-probability=0.1 duplicate-probability=0.1 delay-probability=0.2 min-delay=1 "
      "max-delay=30",
      "", "application/x-neighbour-code,alignment=slice !");
  fail_unless (received.frames > kFrames - 5, "%d frames", received.frames);
  fail_unless_equals_int (received.in_order, received.frames);
  fail_unless (std::abs (received.right_pixels - 0.9) < 0.06, "%g right", received.right_pixels);
}
GST_END_TEST;

static Suite *
rtploss_suite ()
{
  Suite *suite = suite_create ("rtploss");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_good_network_loses_nothing);
  tcase_add_test (tc, test_share_of_right_pixels_is_that_of_packets_that_come);
  tcase_add_test (tc, test_conceal_last_fills_what_is_lost);
  tcase_add_test (tc, test_repeated_packets_change_nothing);
  tcase_add_test (tc, test_packets_out_of_order_change_nothing);
  tcase_add_test (tc, test_slices_sent_one_by_one_come_through_loss_and_disorder);
  return suite;
}

GST_CHECK_MAIN (rtploss);
