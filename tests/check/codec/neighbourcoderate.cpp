/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The bit rate of neighbourcodeenc: properties target-bitrate, max-depth-threshold and
 * max-colour-threshold, with a person who moves before noisy cameras. */
#include "../coded-check.hpp"

#include <gst/app/gstappsink.h>

#include <functional>
#include <rangecast/neighbourcode/rate/rate_control.hpp>

using namespace rangecast;
using namespace rangecast::testing;

static constexpr int kFps = 15;
static constexpr int kTwoSeconds = 2 * kFps;
static constexpr const char *kProfiles[] = {"packed", "entropy"};

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
      properties + " ! appsink name=sink sync=false max-buffers=1";
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
        gsize size = 0; /* the rate is that of the slices */
        for (const auto &slice : slices_of (buffer))
          size += slice.size ();
        to.coded->push_back ({size, thresholds_of (to.encoder), bytes_of (buffer)});
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

/* Key frame sets have up to twice the bytes of the others here, and so have those in which a band
 * of rows is refreshed, half of the picture at this size. */
GST_START_TEST (test_temporal_is_within_a_tenth_of_the_target_and_thresholds_hardly_swing)
{
  const std::string properties = "temporal=true profile=packed key-interval=1000";
  const auto unlimited = play ("num-buffers=30", properties);
  const double wanted = 0.7 * rate_of (unlimited, 0, unlimited.size ());
  const auto coded = play ("num-buffers=105", properties + target (wanted));
  expect_windows_on_target (coded, kTwoSeconds, wanted);
  Thresholds least = coded.back ().thresholds, most = least;
  for (std::size_t i = kTwoSeconds; i < coded.size (); i++) {
    const Thresholds a = coded[i - 1].thresholds, b = coded[i].thresholds;
    fail_unless (std::abs (a.colour - b.colour) <= 3, "from %d to %d", a.colour, b.colour);
    least = {std::min (least.depth, b.depth), std::min (least.colour, b.colour)};
    most = {std::max (most.depth, b.depth), std::max (most.colour, b.colour)};
  }
  for (const auto &[low, high] : {std::pair{least.depth, most.depth}, {least.colour, most.colour}})
    fail_unless (high <= 1.7 * low, "%d to %d", low, high);
}
GST_END_TEST;

static Suite *
neighbourcoderate_suite ()
{
  Suite *suite = suite_create ("neighbourcoderate");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_any_two_seconds_are_within_a_tenth_of_the_target);
  tcase_add_test (tc, test_target_0_gives_the_bytes_of_the_thresholds_as_they_are);
  tcase_add_test (tc, test_target_changes_while_playing);
  tcase_add_test (tc, test_thresholds_stay_within_their_limits);
  tcase_add_test (tc, test_stats_tell_the_rate_of_the_last_two_seconds);
  tcase_add_test (tc, test_temporal_is_within_a_tenth_of_the_target_and_thresholds_hardly_swing);
  return suite;
}

GST_CHECK_MAIN (neighbourcoderate);
