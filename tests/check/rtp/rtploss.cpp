/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Coded frame sets over RTP through losses: through a bad network (netsim) in real time, and with
 * losses that the test chooses, of which every pixel is known. */
#include "../scene-check.hpp"

#include <gst/app/gstappsink.h>
#include <gst/app/gstappsrc.h>
#include <gst/rtp/gstrtpbuffer.h>

#include <random>

using namespace rangecast;
using namespace rangecast::testing;

static constexpr int kFrames = 60;
static constexpr GstClockTime kFrame = 20 * GST_MSECOND;

/* What came out of kFrames frame sets. */
struct Received {
  int frames = 0;
  int in_order = 0;        /* later than the one before */
  double right_pixels = 0; /* share of those that were sent, of the frame sets that came */
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

/* Sends kFrames frame sets, all alike but for their times, through netsim; an error fails. */
static Received
send (const Rig &rig, const char *network, const char *coded = "")
{
  const std::string launch =
      std::string ("appsrc name=in format=time is-live=true ! neighbourcodeenc profile=plain "
                   "depth-bits=16 depth-threshold=0 colour-threshold=0 ! ") +
      coded + " rtpneighbourcodepay config-interval=-1 ! netsim " + network +
      " ! rtpjitterbuffer latency=150 ! rtpneighbourcodedepay ! neighbourcodedec ! appsink "
      "name=out sync=false async=false";
  GstElement *pipeline = gst_parse_launch (launch.c_str (), nullptr);
  fail_unless (pipeline != nullptr);
  GstBus *bus = gst_element_get_bus (pipeline);
  gst_element_set_state (pipeline, GST_STATE_PLAYING);
  push_in_real_time (pipeline, rig);
  const Received received = pull_everything (pipeline, rig);
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
  fail_unless_cmp (received.right_pixels, ==, 1);
}
GST_END_TEST;

/* Before it knows their rate, rtpjitterbuffer starts over if 120 packets are out of order. */
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
      "video/x-neighbour-code,alignment=slice !");
  fail_unless (received.frames > kFrames - 5, "%d frames", received.frames);
  fail_unless_equals_int (received.in_order, received.frames);
  fail_unless (std::abs (received.right_pixels - 0.9) < 0.06, "%g right", received.right_pixels);
}
GST_END_TEST;

/* ---- losses that the test chooses ---- */

static const char *const kProfiles[] = {"plain", "packed", "entropy"};

/* A moving scene in packets, those of each frame set together. */
struct Packets {
  Scene scene;
  GstCaps *caps;
  std::vector<std::vector<GstBuffer *>> frame_sets;

  Packets (const std::string &encoder, int count, int views = 4)
      : scene (views, kWidth, kHeight, count)
  {
    GstHarness *h =
        gst_harness_new_parse (("neighbourcodeenc " + encoder + " ! rtpneighbourcodepay").c_str ());
    gst_harness_set_src_caps (h, gst_caps_ref (scene.caps));
    for (GstBuffer *frame_set : scene.frame_sets) {
      fail_unless_equals_int (gst_harness_push (h, gst_buffer_ref (frame_set)), GST_FLOW_OK);
      frame_sets.push_back (pull_all (h));
    }
    caps = gst_pad_get_current_caps (h->sinkpad);
    gst_harness_teardown (h);
  }
  ~Packets ()
  {
    for (auto &packets : frame_sets)
      unref_all (packets);
    gst_caps_unref (caps);
  }
  Packets (const Packets &) = delete;
  Packets &operator= (const Packets &) = delete;

  static constexpr int kWidth = 320, kHeight = 240;
};

/* Of each frame set, whether packets are lost. */
using Losses = std::vector<std::vector<bool>>;

static Losses
no_losses (const Packets &packets)
{
  Losses losses;
  for (const auto &frame_set : packets.frame_sets)
    losses.emplace_back (frame_set.size (), false);
  return losses;
}

/* What a decoder makes of the packets that are not lost, frame set by frame set. */
static std::vector<Pixels>
receive (const Packets &packets, const Losses &losses, const char *decoder = "")
{
  GstHarness *h = gst_harness_new_parse (
      (std::string ("rtpneighbourcodedepay ! neighbourcodedec request-key-units=false ") + decoder)
          .c_str ());
  gst_harness_set_src_caps (h, gst_caps_ref (packets.caps));
  for (std::size_t i = 0; i < losses.size (); i++)
    for (std::size_t j = 0; j < losses[i].size (); j++)
      if (!losses[i][j])
        fail_unless_equals_int (
            gst_harness_push (h, gst_buffer_ref (packets.frame_sets[i][j])), GST_FLOW_OK);
  gst_harness_push_event (h, gst_event_new_eos ());
  std::vector<Pixels> received (losses.size ());
  while (GstBuffer *buffer = gst_harness_try_pull (h)) {
    const GstClockTime time = gst_range_buffer_get_capture_time (buffer);
    const auto i = std::size_t ((time + Scene::kInterval / 2) / Scene::kInterval);
    ck_assert_uint_lt (i, received.size ());
    fail_unless (received[i].empty ());
    received[i] = pixels_of (buffer, Packets::kWidth, Packets::kHeight);
    gst_buffer_unref (buffer);
  }
  gst_harness_teardown (h);
  return received;
}

/* The packet that gives each valid pixel of a frame set (intra profiles); by view-id. */
using Owners = std::map<int, std::vector<int>>;

/* From what each packet gives alone: for it ends a frame set if it has the marker. */
static std::vector<Owners>
owners_of (const Packets &packets)
{
  GstHarness *h = gst_harness_new_parse ("rtpneighbourcodedepay ! neighbourcodedec");
  gst_harness_set_src_caps (h, gst_caps_ref (packets.caps));
  std::vector<Owners> all;
  int twice = 0;
  for (const auto &frame_set : packets.frame_sets) {
    Owners &owners = all.emplace_back ();
    for (std::size_t j = 0; j < frame_set.size (); j++) {
      GstBuffer *packet = gst_buffer_copy_deep (frame_set[j]);
      GstRTPBuffer rtp = GST_RTP_BUFFER_INIT;
      fail_unless (gst_rtp_buffer_map (packet, GST_MAP_READWRITE, &rtp));
      gst_rtp_buffer_set_marker (&rtp, TRUE);
      gst_rtp_buffer_unmap (&rtp);
      fail_unless_equals_int (gst_harness_push (h, packet), GST_FLOW_OK);
      GstBuffer *part = gst_harness_try_pull (h);
      if (!part)
        continue; /* nothing but views of the rig */
      for (const auto &[id, plane] : pixels_of (part, Packets::kWidth, Packets::kHeight)) {
        owners[id].resize (plane.size (), -1);
        for (std::size_t i = 0; i < plane.size (); i++)
          if (plane[i]) {
            twice += owners[id][i] >= 0;
            owners[id][i] = int (j);
          }
      }
      gst_buffer_unref (part);
    }
  }
  gst_harness_teardown (h);
  fail_unless_equals_int (twice, 0);
  return all;
}

/* A frame set of which some packets are lost: the pixels of the others, nothing else. */
static Pixels
without_lost (const Pixels &whole, const Owners &owners, const std::vector<bool> &lost)
{
  Pixels left = whole;
  for (auto &[id, plane] : left)
    for (std::size_t i = 0; i < plane.size (); i++)
      if (plane[i] && lost[std::size_t (owners.at (id)[i])])
        plane[i] = 0;
  return left;
}

static void
lose_at_random (Losses &losses, unsigned seed, std::size_t first = 0, std::size_t end = 1000)
{
  std::mt19937 random (seed);
  for (std::size_t i = first; i < std::min (end, losses.size ()); i++)
    for (std::size_t j = 0; j < losses[i].size (); j++)
      losses[i][j] = random () % 20 == 0;
}

GST_START_TEST (test_at_5_percent_loss_exactly_the_pixels_of_packets_that_came_are_there_and_right)
{
  for (const char *profile : kProfiles) {
    const Packets packets (std::string ("profile=") + profile, 6);
    const auto whole = receive (packets, no_losses (packets));
    const auto owners = owners_of (packets);
    int lossy_sets = 0;
    for (const unsigned seed : {1, 2, 3, 4}) {
      Losses losses = no_losses (packets);
      lose_at_random (losses, seed);
      const auto lossy = receive (packets, losses);
      for (std::size_t i = 0; i < whole.size (); i++) {
        /* Of each frame set, so that damage is gone with the next one. */
        const Compared c = compare (without_lost (whole[i], owners[i], losses[i]), lossy[i]);
        fail_unless (
            c.right == c.valid && c.wrong == 0, "%s, seed %u, frame set %zu", profile, seed, i);
        lossy_sets += compare (whole[i], lossy[i]).right_share () < 1;
      }
    }
    ck_assert_int_gt (lossy_sets, 8);
  }
}
GST_END_TEST;

static constexpr std::size_t kRefresh = 6; /* frame sets: a period of 400 ms */

static std::string
temporal (const char *profile)
{
  return std::string ("temporal=true refresh-period=400 profile=") + profile;
}

GST_START_TEST (test_temporal_pixels_are_right_or_invalid_and_all_right_after_the_refresh_period)
{
  for (const char *profile : kProfiles) {
    const Packets packets (temporal (profile), 14);
    const auto whole = receive (packets, no_losses (packets));
    for (const unsigned seed : {1, 2, 3}) {
      Losses losses = no_losses (packets);
      lose_at_random (losses, seed, 2, 5);
      const auto lossy = receive (packets, losses);
      bool lingers = false;
      for (std::size_t i = 0; i < whole.size (); i++) {
        const Compared c = compare (whole[i], lossy[i]);
        fail_unless (c.wrong == 0, "%s, seed %u, frame set %zu: %d wrong pixels", profile, seed, i,
            int (c.wrong));
        if (i < 2 || i >= 5 + kRefresh - 1)
          fail_unless (c.right == c.valid, "%s, seed %u, frame set %zu: %g right", profile, seed, i,
              c.right_share ());
        lingers = lingers || (i == 5 && c.right < c.valid);
      }
      fail_unless (lingers, "%s, seed %u: nothing referred to what was lost", profile, seed);
    }
  }
}
GST_END_TEST;

/* Pixels with concealment that are not those of the frame set itself. */
struct Concealed {
  guint64 old = 0;   /* those shown last at their places */
  guint64 holes = 0; /* valid without losses, but nothing is shown */
  guint64 wrong = 0; /* instead of one that came, or neither that nor the one shown last */
};

/* One view: without losses, with them, with them concealed, and what was shown before. */
static void
check_concealed (std::span<const guint64> whole, std::span<const guint64> bare,
    std::span<const guint64> filled, std::span<const guint64> before, Concealed &count)
{
  for (std::size_t p = 0; p < whole.size (); p++) {
    count.wrong += bare[p] ? filled[p] != bare[p] : filled[p] != 0 && filled[p] != before[p];
    count.old += filled[p] && !bare[p];
    count.holes += whole[p] && !filled[p];
  }
}

GST_START_TEST (test_conceal_last_changes_no_pixel_that_came_and_shows_those_from_before_elsewhere)
{
  for (const char *profile : kProfiles)
    for (const bool is_temporal : {false, true}) {
      const Packets packets (
          is_temporal ? temporal (profile) : std::string ("profile=") + profile, 7);
      Losses losses = no_losses (packets);
      lose_at_random (losses, 7, 2);
      const auto whole = receive (packets, no_losses (packets)), bare = receive (packets, losses),
                 filled = receive (packets, losses, "conceal=last");
      Concealed count;
      for (std::size_t i = 2; i < whole.size (); i++)
        for (const auto &[id, plane] : whole[i])
          check_concealed (plane, bare[i].at (id), filled[i].at (id), filled[i - 1].at (id), count);
      fail_unless_equals_uint64 (count.wrong, 0);
      /* But for edges of what moves, which had no pixel before. */
      fail_unless (count.old > 20 * count.holes, "%s: %d filled, %d not", profile, int (count.old),
          int (count.holes));
    }
}
GST_END_TEST;

static Suite *
rtploss_suite ()
{
  Suite *suite = suite_create ("rtploss");
  TCase *tc = tcase_create ("general");
  tcase_set_timeout (tc, 120);
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_good_network_loses_nothing);
  tcase_add_test (tc, test_packets_out_of_order_change_nothing);
  tcase_add_test (tc, test_slices_sent_one_by_one_come_through_loss_and_disorder);
  tcase_add_test (
      tc, test_at_5_percent_loss_exactly_the_pixels_of_packets_that_came_are_there_and_right);
  tcase_add_test (
      tc, test_temporal_pixels_are_right_or_invalid_and_all_right_after_the_refresh_period);
  tcase_add_test (
      tc, test_conceal_last_changes_no_pixel_that_came_and_shows_those_from_before_elsewhere);
  return suite;
}

GST_CHECK_MAIN (rtploss);
