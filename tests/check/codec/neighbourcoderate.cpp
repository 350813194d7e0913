/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The bit rate of neighbourcodeenc: properties target-bitrate, max-depth-threshold and
 * max-colour-threshold, with a person who moves before noisy cameras. */
#include "../coded-check.hpp"

#include <gst/app/gstappsink.h>
#include <gst/controller/gstdirectcontrolbinding.h>
#include <gst/controller/gstinterpolationcontrolsource.h>

#include <functional>
#include <rangecast/neighbourcode/rate/rate_control.hpp>

using namespace rangecast;
using namespace rangecast::testing;

static constexpr int kFps = 15;
static constexpr int kTwoSeconds = 2 * kFps;
static constexpr const char *kProfiles[] = {"plain", "packed", "entropy"};

struct Coded {
  gsize bytes;
  Thresholds thresholds;
  std::vector<guint8> data;
};

static Thresholds
thresholds_of (GstElement *encoder, guint64 *bitrate = nullptr)
{
  GstStructure *stats = nullptr;
  Thresholds t;
  guint64 rate = 0;
  g_object_get (encoder, "stats", &stats, nullptr);
  fail_unless (gst_structure_get (stats, "depth-threshold", G_TYPE_INT, &t.depth,
      "colour-threshold", G_TYPE_INT, &t.colour, "bitrate", G_TYPE_UINT64, &rate, nullptr));
  gst_structure_free (stats);
  if (bitrate)
    *bitrate = rate;
  return t;
}

/** Codes a scene to its end. `before` is called with the encoder before each frame set is asked
 *  for, which appsink holds back. */
static std::vector<Coded>
play (const std::string &source, const std::string &properties,
    const std::function<void (GstElement *, int)> &before = {})
{
  const std::string launch =
      "avatartestsrc views=1 range-person-only=true " + source +
      " ! video/x-range,width=160,height=120,framerate=15/1 ! neighbourcodeenc name=encoder " +
      properties +
      " ! appsink name=sink sync=false max-buffers=1 "
      "caps=video/x-neighbour-code,alignment=access-unit";
  GstElement *pipeline = gst_parse_launch (launch.c_str (), nullptr);
  fail_unless (pipeline != nullptr);
  GstElement *encoder = gst_bin_get_by_name (GST_BIN (pipeline), "encoder");
  GstElement *sink = gst_bin_get_by_name (GST_BIN (pipeline), "sink");
  /* Where the coded frame set leaves, stats are still its own. */
  std::vector<Coded> coded;
  struct Probe {
    std::vector<Coded> *coded;
    GstElement *encoder;
    const std::function<void (GstElement *, int)> *before;
  } data = {&coded, encoder, &before};
  GstPad *pad = gst_element_get_static_pad (encoder, "src");
  gst_pad_add_probe (
      pad, GST_PAD_PROBE_TYPE_BUFFER,
      [] (GstPad *, GstPadProbeInfo *info, gpointer user) {
        auto &to = *static_cast<Probe *> (user);
        GstBuffer *buffer = GST_PAD_PROBE_INFO_BUFFER (info);
        to.coded->push_back (
            {gst_buffer_get_size (buffer), thresholds_of (to.encoder), bytes_of (buffer)});
        if (*to.before)
          (*to.before) (to.encoder, int (to.coded->size ()));
        return GST_PAD_PROBE_OK;
      },
      &data, nullptr);
  ck_assert_int_ne (gst_element_set_state (pipeline, GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE);
  while (GstSample *sample = gst_app_sink_pull_sample (GST_APP_SINK (sink)))
    gst_sample_unref (sample);
  gst_element_set_state (pipeline, GST_STATE_NULL);
  for (gpointer object : {gpointer (pad), gpointer (sink), gpointer (encoder), gpointer (pipeline)})
    gst_object_unref (object);
  return coded;
}

/* Bits per second of n frame sets. */
static double
rate_of (const std::vector<Coded> &coded, std::size_t first, std::size_t n)
{
  ck_assert_uint_le (first + n, coded.size ());
  double bytes = 0;
  for (std::size_t i = first; i < first + n; i++)
    bytes += double (coded[i].bytes);
  return 8 * bytes * kFps / double (n);
}

/* What some profile takes with its default settings. */
static double
usual_rate (const std::string &source, const std::string &properties)
{
  const auto coded = play (source + " num-buffers=5", properties);
  return rate_of (coded, 0, coded.size ());
}

static std::string
target (double bits_per_s)
{
  return " target-bitrate=" + std::to_string (guint (bits_per_s));
}

static void
expect_windows_on_target (const std::vector<Coded> &coded, std::size_t first, double bits_per_s)
{
  for (std::size_t i = first; i + kTwoSeconds <= coded.size (); i++) {
    const double rate = rate_of (coded, i, kTwoSeconds);
    fail_unless (std::abs (rate / bits_per_s - 1) < 0.1, "%g bits/s from frame set %d, not %g",
        rate, int (i), bits_per_s);
  }
}

GST_START_TEST (test_any_two_seconds_are_within_a_tenth_of_the_target)
{
  for (const char *profile : kProfiles) {
    const std::string properties = std::string ("profile=") + profile;
    const double wanted = 0.7 * usual_rate ("", properties);
    const auto coded = play ("num-buffers=60", properties + target (wanted));
    fail_unless_equals_int (coded.size (), 60);
    expect_windows_on_target (coded, 0, wanted);
  }
}
GST_END_TEST;

GST_START_TEST (test_scanned_head_is_within_a_tenth_of_the_target)
{
  const std::string model = data_dir () + "/lps_head/LeePerrySmith.glb";
  if (data_dir ().empty () || !g_file_test (model.c_str (), G_FILE_TEST_EXISTS))
    RANGECAST_SKIP ("no lps_head in the test data");
  const std::string source = "location=" + model;
  const double wanted = 0.75 * usual_rate (source, "profile=entropy");
  const auto coded = play (source + " num-buffers=75", "profile=entropy" + target (wanted));
  expect_windows_on_target (coded, kFps / 2, wanted);
}
GST_END_TEST;

GST_START_TEST (test_thresholds_move_by_one_code_at_most_and_seldom)
{
  for (const char *profile : kProfiles) {
    const std::string properties = std::string ("profile=") + profile;
    const auto coded =
        play ("num-buffers=60", properties + target (0.7 * usual_rate ("", properties)));
    int changes = 0;
    for (std::size_t i = kFps; i < coded.size (); i++) {
      const Thresholds a = coded[i - 1].thresholds, b = coded[i].thresholds;
      fail_unless (std::abs (a.depth - b.depth) <= 1 && std::abs (a.colour - b.colour) <= 1,
          "%s: from %d, %d to %d, %d", profile, a.depth, a.colour, b.depth, b.colour);
      changes += !(a == b);
    }
    fail_unless (changes < 20, "%s: %d changes in 45 frame sets", profile, changes);
  }
}
GST_END_TEST;

GST_START_TEST (test_target_0_gives_the_bytes_of_the_thresholds_as_they_are)
{
  for (const char *profile : kProfiles) {
    const std::string properties =
        std::string ("depth-threshold=4 colour-threshold=7 profile=") + profile;
    const auto without = play ("num-buffers=8", properties);
    const auto off = play ("num-buffers=8", properties + " max-depth-threshold=99" + target (0));
    const auto switched_off =
        play ("num-buffers=8", properties + target (1), [] (GstElement *encoder, int coded) {
          if (coded == 4)
            g_object_set (encoder, "target-bitrate", 0, nullptr);
        });
    for (std::size_t i = 0; i < 8; i++) {
      fail_unless_cmp (off[i].data, ==, without[i].data);
      fail_unless ((switched_off[i].data == without[i].data) == (i >= 4), "frame set %d", int (i));
      fail_unless_cmp (off[i].thresholds, ==, (Thresholds{4, 7}));
    }
  }
}
GST_END_TEST;

GST_START_TEST (test_target_changes_while_playing)
{
  const double usual = usual_rate ("", "profile=entropy");
  const auto coded = play ("num-buffers=135", "profile=entropy" + target (0.9 * usual),
      [&] (GstElement *encoder, int n) {
        if (n == 45)
          g_object_set (encoder, "target-bitrate", guint (0.6 * usual), nullptr);
        if (n == 90)
          g_object_set (encoder, "target-bitrate", guint (0.8 * usual), nullptr);
      });
  const auto part = [&] (int begin, int end) {
    return std::vector<Coded> (coded.begin () + begin, coded.begin () + end);
  };
  expect_windows_on_target (part (0, 45), 0, 0.9 * usual);
  expect_windows_on_target (part (45, 90), kFps / 2, 0.6 * usual);
  expect_windows_on_target (part (90, 135), kFps / 2, 0.8 * usual);
}
GST_END_TEST;

GST_START_TEST (test_thresholds_stay_within_their_limits)
{
  const std::string limits = "depth-threshold=5 colour-threshold=6 max-depth-threshold=12 "
                             "max-colour-threshold=20";
  const auto least = play ("num-buffers=10", limits + target (1));
  fail_unless_cmp (least.back ().thresholds, ==, (Thresholds{12, 20}));
  const auto most = play ("num-buffers=10", limits + target (4e9));
  fail_unless_cmp (most.back ().thresholds, ==, (Thresholds{5, 6}));
  for (const auto *coded : {&least, &most})
    for (const Coded &c : *coded)
      fail_unless (c.thresholds.depth >= 5 && c.thresholds.depth <= 12 &&
                   c.thresholds.colour >= 6 && c.thresholds.colour <= 20);
  const auto fixed =
      play ("num-buffers=10", "max-depth-threshold=0 max-colour-threshold=0 " + target (1));
  fail_unless (fixed.back ().thresholds == (Thresholds{8, 5}), "below the thresholds no limit");
}
GST_END_TEST;

/* Says once that a target cannot be met, after 2 s at the limits; nothing of one that is met. */
GST_START_TEST (test_target_below_what_the_limits_allow_warns_once)
{
  for (const double rate : {500., 4e6}) {
    const std::string launch = "avatartestsrc views=1 num-buffers=90 ! "
                               "video/x-range,width=160,height=120,framerate=15/1 ! "
                               "neighbourcodeenc " +
                               target (rate) + " ! fakesink";
    GstElement *pipeline = gst_parse_launch (launch.c_str (), nullptr);
    GstBus *bus = gst_element_get_bus (pipeline);
    gst_element_set_state (pipeline, GST_STATE_PLAYING);
    std::string warnings;
    int count = 0;
    for (bool ended = false; !ended;) {
      GstMessage *message = gst_bus_timed_pop_filtered (bus, GST_CLOCK_TIME_NONE,
          GstMessageType (GST_MESSAGE_EOS | GST_MESSAGE_ERROR | GST_MESSAGE_WARNING));
      ended = GST_MESSAGE_TYPE (message) != GST_MESSAGE_WARNING;
      if (!ended) {
        GError *error = nullptr;
        gst_message_parse_warning (message, &error, nullptr);
        warnings += error->message;
        g_error_free (error);
        count++;
      }
      gst_message_unref (message);
    }
    ck_assert_int_eq (count, rate < 1e6 ? 1 : 0);
    if (count)
      fail_unless_contains (warnings, "target-bitrate=500 cannot be met");
    gst_element_set_state (pipeline, GST_STATE_NULL);
    gst_object_unref (bus);
    gst_object_unref (pipeline);
  }
}
GST_END_TEST;

/* Frame sets coded without a target do not count against a later one. */
GST_START_TEST (test_target_that_comes_back_is_judged_by_itself)
{
  GstElement *pipeline =
      gst_parse_launch ("avatartestsrc views=1 num-buffers=180 ! "
                        "video/x-range,width=160,height=120,framerate=15/1 ! neighbourcodeenc "
                        "name=e target-bitrate=4000000 ! appsink name=s sync=false max-buffers=1",
          nullptr);
  GstElement *encoder = gst_bin_get_by_name (GST_BIN (pipeline), "e");
  GstElement *sink = gst_bin_get_by_name (GST_BIN (pipeline), "s");
  GstBus *bus = gst_element_get_bus (pipeline);
  gst_element_set_state (pipeline, GST_STATE_PLAYING);
  for (int frame = 0; frame < 180; frame++) {
    GstSample *sample = gst_app_sink_pull_sample (GST_APP_SINK (sink));
    fail_unless (sample != nullptr, "%d", frame);
    gst_sample_unref (sample);
    if (frame == 30 || frame == 90)
      g_object_set (encoder, "target-bitrate", frame == 30 ? 0 : 230000, nullptr);
  }
  fail_unless (gst_bus_pop_filtered (bus, GST_MESSAGE_WARNING) == nullptr);
  gst_element_set_state (pipeline, GST_STATE_NULL);
  gst_object_unref (bus);
  gst_object_unref (encoder);
  gst_object_unref (sink);
  gst_object_unref (pipeline);
}
GST_END_TEST;

GST_START_TEST (test_limits_change_while_playing)
{
  const auto coded =
      play ("num-buffers=10", "profile=packed" + target (1), [] (GstElement *encoder, int n) {
        if (n == 5)
          g_object_set (encoder, "max-depth-threshold", 20, "max-colour-threshold", 16, nullptr);
      });
  fail_unless_cmp (coded[4].thresholds, ==, (Thresholds{32, 32}));
  fail_unless_cmp (coded[5].thresholds, ==, (Thresholds{20, 16}));
}
GST_END_TEST;

GST_START_TEST (test_person_who_comes_back_finds_nothing_saved_up)
{
  const double wanted = 0.7 * usual_rate ("", "profile=packed");
  const auto coded = play ("num-buffers=75 empty-frames=30", "profile=packed" + target (wanted));
  ck_assert_uint_lt (coded[29].bytes, 100);
  ck_assert_uint_gt (coded[30].bytes, 1000);
  expect_windows_on_target (coded, 30, wanted);
}
GST_END_TEST;

GST_START_TEST (test_stats_tell_the_rate_of_the_last_two_seconds)
{
  const double wanted = 0.7 * usual_rate ("", "profile=plain");
  guint64 bitrate = 0;
  const auto coded = play ("num-buffers=60", "profile=plain" + target (wanted),
      [&] (GstElement *encoder, int) { thresholds_of (encoder, &bitrate); });
  const double expected = rate_of (coded, coded.size () - kTwoSeconds, kTwoSeconds);
  fail_unless_cmp (std::abs (double (bitrate) / expected - 1), <, 1e-3);
}
GST_END_TEST;

GST_START_TEST (test_max_depth_error_follows_the_thresholds)
{
  std::vector<double> errors;
  play ("num-buffers=10", target (1), [&] (GstElement *encoder, int n) {
    double error;
    g_object_get (encoder, "max-depth-error", &error, nullptr);
    errors.push_back (error);
    g_object_set (encoder, "target-bitrate", n < 5 ? 1u : 0u, nullptr);
  });
  fail_unless_equals_int (errors.size (), 10);
  fail_unless (errors[4] > 3 * errors[9], "%g and %g m", errors[4], errors[9]);
}
GST_END_TEST;

GST_START_TEST (test_target_follows_a_controller)
{
  const double usual = usual_rate ("", "profile=packed");
  const auto coded = play ("num-buffers=75", "profile=packed", [&] (GstElement *encoder, int n) {
    if (n != 1)
      return;
    GstControlSource *source = gst_interpolation_control_source_new ();
    g_object_set (source, "mode", GST_INTERPOLATION_MODE_NONE, nullptr);
    auto timed = GST_TIMED_VALUE_CONTROL_SOURCE (source);
    gst_timed_value_control_source_set (timed, 0, 0);
    gst_timed_value_control_source_set (timed, GST_SECOND, 0.7 * usual);
    gst_object_add_control_binding (GST_OBJECT (encoder),
        gst_direct_control_binding_new_absolute (GST_OBJECT (encoder), "target-bitrate", source));
    gst_object_unref (source);
  });
  for (std::size_t i = 0; i < kFps; i++)
    fail_unless_cmp (coded[i].thresholds, ==, (Thresholds{8, 5}));
  expect_windows_on_target (coded, kFps + kFps / 2, 0.7 * usual);
}
GST_END_TEST;

static gboolean
forget_time (GstBuffer *, GstMeta **meta, gpointer)
{
  if ((*meta)->info->api == GST_REFERENCE_TIMESTAMP_META_API_TYPE)
    *meta = nullptr;
  else if ((*meta)->info->api == GST_RANGE_META_API_TYPE)
    reinterpret_cast<GstRangeMeta *> (*meta)->capture_time = GST_CLOCK_TIME_NONE;
  return TRUE;
}

/* Bytes of frame sets pushed one after the other, of which the first has number `first`. */
static gsize
push_some (GstHarness *h, const Rig &rig, int first, int n, bool timed = true)
{
  gsize last = 0;
  for (int i = first; i < first + n; i++) {
    GstBuffer *input = make_frame_set (rig, GstClockTime (i) * GST_SECOND / 30);
    if (!timed) {
      GST_BUFFER_PTS (input) = GST_CLOCK_TIME_NONE;
      gst_buffer_foreach_meta (input, forget_time, nullptr);
    }
    GstBuffer *coded = gst_harness_push_and_pull (h, input);
    last = gst_buffer_get_size (coded);
    gst_buffer_unref (coded);
  }
  return last;
}

GST_START_TEST (test_goes_on_after_a_flush_and_starts_over_after_ready)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = harness_of ("neighbourcodeenc profile=packed target-bitrate=3500000");
  gst_harness_set_src_caps (h, range_caps (rig));
  push_some (h, rig, 0, 1);
  const Thresholds first = thresholds_of (h->element);
  push_some (h, rig, 1, 40);
  const Thresholds settled = thresholds_of (h->element);
  fail_unless (!(settled == first), "%d and %d", settled.colour, first.colour);
  flush (h);
  push_some (h, rig, 3, 10);
  const Thresholds flushed = thresholds_of (h->element);
  ck_assert_int_le (std::abs (flushed.colour - settled.colour), 2);
  gst_element_set_state (h->element, GST_STATE_READY);
  gst_harness_play (h);
  gst_harness_set_src_caps (h, range_caps (rig));
  push_some (h, rig, 0, 1);
  fail_unless_cmp (thresholds_of (h->element), ==, first);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_frame_sets_without_time_come_at_the_frame_rate_of_the_caps)
{
  const Rig rig = ring_rig (1);
  std::vector<Thresholds> settled;
  for (const bool timed : {true, false}) {
    GstHarness *h = harness_of ("neighbourcodeenc profile=packed target-bitrate=3500000");
    gst_harness_set_src_caps (h, range_caps (rig)); /* 30/1 */
    push_some (h, rig, 0, 60, timed);
    settled.push_back (thresholds_of (h->element));
    gst_harness_teardown (h);
  }
  fail_unless (std::abs (settled[0].colour - settled[1].colour) <= 1, "%d and %d",
      settled[0].colour, settled[1].colour);
}
GST_END_TEST;

/* Key frame sets have up to twice the bytes of the others here, and so have those in which a band
 * of rows is refreshed, half of the picture at this size. */
GST_START_TEST (test_temporal_is_within_a_tenth_of_the_target_and_thresholds_hardly_swing)
{
  for (const char *profile : kProfiles)
    for (const char *keys : {"", " key-interval=1000"}) {
      const std::string properties = std::string ("temporal=true profile=") + profile + keys;
      const auto unlimited = play ("num-buffers=30", properties);
      const double wanted = 0.7 * rate_of (unlimited, 0, unlimited.size ());
      const auto coded = play ("num-buffers=105", properties + target (wanted));
      expect_windows_on_target (coded, kTwoSeconds, wanted);
      Thresholds least = coded.back ().thresholds, most = least;
      for (std::size_t i = kTwoSeconds; i < coded.size (); i++) {
        const Thresholds a = coded[i - 1].thresholds, b = coded[i].thresholds;
        fail_unless (std::abs (a.colour - b.colour) <= 3, "%s%s: from %d to %d", profile, keys,
            a.colour, b.colour);
        least = {std::min (least.depth, b.depth), std::min (least.colour, b.colour)};
        most = {std::max (most.depth, b.depth), std::max (most.colour, b.colour)};
      }
      for (const auto &[low, high] :
          {std::pair{least.depth, most.depth}, {least.colour, most.colour}})
        fail_unless (high <= 1.7 * low, "%s%s: %d to %d", profile, keys, low, high);
    }
}
GST_END_TEST;

static Suite *
neighbourcoderate_suite ()
{
  Suite *suite = suite_create ("neighbourcoderate");
  TCase *tc = tcase_create ("general");
  tcase_set_timeout (tc, 120);
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_any_two_seconds_are_within_a_tenth_of_the_target);
  tcase_add_test (tc, test_scanned_head_is_within_a_tenth_of_the_target);
  tcase_add_test (tc, test_thresholds_move_by_one_code_at_most_and_seldom);
  tcase_add_test (tc, test_target_0_gives_the_bytes_of_the_thresholds_as_they_are);
  tcase_add_test (tc, test_target_changes_while_playing);
  tcase_add_test (tc, test_thresholds_stay_within_their_limits);
  tcase_add_test (tc, test_target_below_what_the_limits_allow_warns_once);
  tcase_add_test (tc, test_target_that_comes_back_is_judged_by_itself);
  tcase_add_test (tc, test_limits_change_while_playing);
  tcase_add_test (tc, test_person_who_comes_back_finds_nothing_saved_up);
  tcase_add_test (tc, test_stats_tell_the_rate_of_the_last_two_seconds);
  tcase_add_test (tc, test_max_depth_error_follows_the_thresholds);
  tcase_add_test (tc, test_target_follows_a_controller);
  tcase_add_test (tc, test_goes_on_after_a_flush_and_starts_over_after_ready);
  tcase_add_test (tc, test_frame_sets_without_time_come_at_the_frame_rate_of_the_caps);
  tcase_add_test (tc, test_temporal_is_within_a_tenth_of_the_target_and_thresholds_hardly_swing);
  return suite;
}

GST_CHECK_MAIN (neighbourcoderate);
