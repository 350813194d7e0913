/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Frame sets that refer to one another: neighbourcodeenc temporal=true, neighbourcodedec, and what
 * lies between them. */
#include "../coded-check.hpp"

#include <gst/video/video.h>

using namespace rangecast;
using namespace rangecast::testing;

static constexpr GstClockTime kFrame = GST_SECOND / 30;
static const char *const kProfiles[] = {"plain", "packed", "entropy"};

static GstHarness *
encoder (const Rig &rig, const std::string &properties = "profile=entropy")
{
  GstHarness *h = harness_of ("neighbourcodeenc temporal=true " + properties);
  gst_harness_set_src_caps (h, range_caps (rig));
  return h;
}

static GstHarness *
decoder (const Rig &rig, const char *properties = "")
{
  GstHarness *h = harness_of (std::string ("neighbourcodedec ") + properties);
  gst_harness_set_src_caps (h, coded_caps (rig));
  return h;
}

/* Frame set number `i`; all show the same. */
static GstBuffer *
code (GstHarness *h, const Rig &rig, guint i)
{
  return gst_harness_push_and_pull (h, make_frame_set (rig, i * kFrame));
}

static bool
is_delta (GstBuffer *buffer)
{
  return GST_BUFFER_FLAG_IS_SET (buffer, GST_BUFFER_FLAG_DELTA_UNIT);
}

/* Codes frame sets from..to-1. @return whether each refers to an earlier one: 'd', or 'k' if not */
static std::string
kinds (GstHarness *h, const Rig &rig, guint from, guint to)
{
  std::string kinds;
  for (guint i = from; i < to; i++) {
    GstBuffer *coded = code (h, rig, i);
    kinds += is_delta (coded) ? 'd' : 'k';
    for (const auto &unit : units_of (bytes_of (coded)))
      fail_unless (header_of (unit).key || is_delta (coded));
    gst_buffer_unref (coded);
  }
  return kinds;
}

static guint
valid_pixels (GstBuffer *frame_set)
{
  gstrange::RangeFrameMap frame (frame_set, GST_MAP_READ);
  fail_unless_ok (frame.status ());
  guint count = 0;
  for (const RangeImage &image : frame.views ())
    for (int y = 0; y < image.roi.height; y++)
      for (int x = 0; x < image.roi.width; x++)
        count += image.depth.at (x, y) != 0;
  return count;
}

static bool
same_depths (GstBuffer *a, GstBuffer *b)
{
  gstrange::RangeFrameMap one (a, GST_MAP_READ), other (b, GST_MAP_READ);
  bool same = one.views ().size () == other.views ().size ();
  for (std::size_t v = 0; same && v < one.views ().size (); v++) {
    const RangeImage &p = one.views ()[v], &q = other.views ()[v];
    same = p.roi == q.roi;
    for (int y = 0; same && y < p.roi.height; y++)
      same = std::equal (p.depth.row (y), p.depth.row (y) + p.roi.width, q.depth.row (y));
  }
  return same;
}

/* Events of GstForceKeyUnit that wait in a queue of the harness. */
static int
count_requests (GstHarness *h, bool upstream)
{
  int count = 0;
  while (GstEvent *event =
             upstream ? gst_harness_try_pull_upstream_event (h) : gst_harness_try_pull_event (h)) {
    count += gst_video_event_is_force_key_unit (event);
    gst_event_unref (event);
  }
  return count;
}

GST_START_TEST (test_only_the_first_frame_set_is_a_key_one_and_a_still_scene_takes_few_bytes)
{
  const Rig rig = ring_rig (2);
  for (const char *profile : kProfiles) {
    GstHarness *h = encoder (rig, std::string ("refresh-period=0 profile=") + profile);
    GstBuffer *first = code (h, rig, 0), *second = code (h, rig, 1);
    fail_unless (!is_delta (first) && is_delta (second));
    /* Motion that smooths what thresholds changed may leave some pixels beyond them. */
    const double part = profile == std::string ("plain") ? 0.6 : 0.18;
    const double most = part * double (gst_buffer_get_size (first));
    fail_unless (double (gst_buffer_get_size (second)) < most,
        "%s: %" G_GSIZE_FORMAT " of %" G_GSIZE_FORMAT, profile, gst_buffer_get_size (second),
        gst_buffer_get_size (first));
    gst_buffer_unref (first);
    gst_buffer_unref (second);
    gst_harness_teardown (h);
  }
}
GST_END_TEST;

GST_START_TEST (test_each_row_is_coded_again_within_the_refresh_period)
{
  const Rig rig = ring_rig (1, 160, 200);
  GstHarness *h = encoder (rig, "profile=packed refresh-period=500");
  constexpr int kPeriod = 15; /* frame sets */
  std::vector<int> refreshed (200, 0);
  for (int i = 0; i < 60; i++) {
    GstBuffer *coded = code (h, rig, guint (i));
    for (const auto &unit : units_of (bytes_of (coded))) {
      const SliceHeader header = header_of (unit);
      for (int y = header.first_row; header.key && y < header.first_row + header.rows; y++)
        refreshed[std::size_t (y)] = i;
    }
    gst_buffer_unref (coded);
    for (int y = 0; y < 200; y++)
      fail_unless (i - refreshed[std::size_t (y)] < kPeriod, "row %d at %d, last at %d", y, i,
          refreshed[std::size_t (y)]);
  }
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_a_request_from_downstream_makes_a_key_frame_set_and_is_announced)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = encoder (rig);
  fail_unless_cmp (kinds (h, rig, 0, 3), ==, "kdd");
  fail_unless_equals_int (count_requests (h, false), 0);
  fail_unless (gst_harness_push_upstream_event (
      h, gst_video_event_new_upstream_force_key_unit (GST_CLOCK_TIME_NONE, TRUE, 7)));
  fail_unless_equals_int (count_requests (h, true), 0); /* it ends here */
  fail_unless_cmp (kinds (h, rig, 3, 6), ==, "kdd");
  fail_unless_equals_int (count_requests (h, false), 1);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_a_request_from_upstream_waits_for_its_running_time)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = encoder (rig);
  fail_unless_cmp (kinds (h, rig, 0, 2), ==, "kd");
  fail_unless (gst_harness_push_event (h, gst_video_event_new_downstream_force_key_unit (
                                              4 * kFrame, 4 * kFrame, 4 * kFrame, FALSE, 1)));
  fail_unless_equals_int (count_requests (h, false), 0);
  fail_unless_cmp (kinds (h, rig, 2, 7), ==, "ddkdd");
  fail_unless_equals_int (count_requests (h, false), 1);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_requests_for_several_times_are_all_answered)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = encoder (rig);
  fail_unless_cmp (kinds (h, rig, 0, 1), ==, "k");
  for (const guint frame : {5u, 3u})
    fail_unless (gst_harness_push_upstream_event (
        h, gst_video_event_new_upstream_force_key_unit (frame * kFrame, FALSE, frame)));
  fail_unless (gst_harness_push_upstream_event (
      h, gst_video_event_new_upstream_force_key_unit (GST_CLOCK_TIME_NONE, FALSE, 0)));
  fail_unless_cmp (kinds (h, rig, 1, 7), ==, "kdkdkd");
  fail_unless_equals_int (count_requests (h, false), 3);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_a_decoder_can_begin_at_every_frame_set_without_the_delta_flag)
{
  const Rig rig = ring_rig (2);
  GstHarness *enc = encoder (rig);
  const Roi whole = {10, 10, 200, 180};
  std::string kinds;
  for (guint i = 0; i < 8; i++) {
    GstBuffer *frame_set = make_frame_set (rig, i * kFrame, whole);
    if (i == 3) { /* nobody is there */
      gst_buffer_unref (frame_set);
      frame_set = gst_range_buffer_new (2, 320, 240);
      for (int id = 0; id < 2; id++)
        gst_range_buffer_add_view (frame_set, id, 0, 0, 0, 0, i * kFrame);
      gst_range_buffer_set_capture_time (frame_set, i * kFrame);
      GST_BUFFER_PTS (frame_set) = i * kFrame;
    }
    GstBuffer *coded = gst_harness_push_and_pull (enc, frame_set);
    kinds += is_delta (coded) ? 'd' : 'k';
    gst_buffer_unref (coded);
  }
  fail_unless_equals_string (kinds.c_str (), "kddkkddd");
  gst_harness_teardown (enc);
}
GST_END_TEST;

GST_START_TEST (test_a_late_slice_wipes_nothing_out)
{
  const Rig rig = ring_rig (1);
  GstHarness *enc = encoder (rig, "profile=packed refresh-period=0");
  GstHarness *dec = decoder (rig);
  guint all = 0;
  std::vector<guint8> first_slice;
  for (guint i = 0; i < 4; i++) {
    GstBuffer *coded = code (enc, rig, i);
    const auto units = units_of (bytes_of (coded));
    GstBuffer *shown = gst_harness_push_and_pull (dec, coded);
    all = std::max (all, valid_pixels (shown));
    fail_unless_equals_int (valid_pixels (shown), all);
    gst_buffer_unref (shown);
    /* One of this frame set again, and one of the frame set before. */
    for (const auto &late : {units[0], first_slice})
      if (!late.empty ())
        gst_buffer_unref (gst_harness_push_and_pull (dec, buffer_of ({late}, i * kFrame)));
    first_slice = units[0];
  }
  gst_harness_teardown (enc);
  gst_harness_teardown (dec);
}
GST_END_TEST;

GST_START_TEST (test_key_interval_flush_caps_and_changed_bits_start_over)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = encoder (rig, "profile=packed refresh-period=0 key-interval=100");
  fail_unless_cmp (kinds (h, rig, 0, 7), ==, "kddkddk");
  g_object_set (h->element, "key-interval", 0, nullptr);
  flush (h);
  fail_unless_cmp (kinds (h, rig, 7, 10), ==, "kdd");
  g_object_set (h->element, "depth-bits", 10, nullptr);
  fail_unless_cmp (kinds (h, rig, 10, 12), ==, "kd");
  g_object_set (h->element, "colour-threshold", 3, nullptr); /* the references stay good */
  fail_unless_cmp (kinds (h, rig, 12, 14), ==, "dd");
  const Rig other = ring_rig (2);
  gst_harness_set_src_caps (h, range_caps (other));
  fail_unless_cmp (kinds (h, other, 14, 16), ==, "kd");
  g_object_set (h->element, "temporal", FALSE, nullptr);
  fail_unless_cmp (kinds (h, other, 16, 18), ==, "kk");
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_lossless_stays_lossless)
{
  const Rig rig = ring_rig (2, 96, 80);
  for (const char *profile : kProfiles) {
    GstHarness *h = gst_harness_new_parse (
        (std::string ("neighbourcodeenc temporal=true depth-bits=16 depth-threshold=0 "
                      "colour-threshold=0 profile=") +
            profile + " ! neighbourcodedec")
            .c_str ());
    gst_harness_set_src_caps (h, range_caps (rig));
    for (guint i = 0; i < 5; i++) {
      GstBuffer *in = make_frame_set (rig, i * kFrame, {int (i), 3, 80, 70});
      GstBuffer *out = gst_harness_push_and_pull (h, gst_buffer_copy_deep (in));
      fail_unless (same_depths (in, out), "%s: frame set %u", profile, i);
      gst_buffer_unref (in);
      gst_buffer_unref (out);
    }
    gst_harness_teardown (h);
  }
}
GST_END_TEST;

GST_START_TEST (test_what_refers_to_a_lost_frame_set_is_left_out_and_a_key_one_is_asked_for)
{
  const Rig rig = ring_rig (2);
  for (const char *profile : kProfiles) {
    GstHarness *enc = encoder (rig, std::string ("refresh-period=0 profile=") + profile);
    GstHarness *dec = decoder (rig);
    GstBuffer *whole = gst_harness_push_and_pull (dec, code (enc, rig, 0));
    const guint all = valid_pixels (whole);
    gst_buffer_unref (code (enc, rig, 1)); /* is lost */
    fail_unless_equals_int (count_requests (dec, true), 0);
    GstBuffer *holes = gst_harness_push_and_pull (dec, code (enc, rig, 2));
    fail_unless (valid_pixels (holes) < all / 4, "%s", profile);
    fail_unless_equals_int (count_requests (dec, true), 1);
    gst_buffer_unref (gst_harness_push_and_pull (dec, code (enc, rig, 3)));
    fail_unless_equals_int (count_requests (dec, true), 0); /* not so soon again */
    gst_harness_push_upstream_event (
        enc, gst_video_event_new_upstream_force_key_unit (GST_CLOCK_TIME_NONE, FALSE, 0));
    GstBuffer *again = gst_harness_push_and_pull (dec, code (enc, rig, 4));
    fail_unless_equals_int (valid_pixels (again), all);
    for (GstBuffer *buffer : {whole, holes, again})
      gst_buffer_unref (buffer);
    gst_harness_teardown (enc);
    gst_harness_teardown (dec);
  }
}
GST_END_TEST;

GST_START_TEST (test_a_lost_slice_is_whole_again_after_the_refresh_period_without_requests)
{
  const Rig rig = ring_rig (1);
  GstHarness *enc = encoder (rig, "profile=entropy refresh-period=400");
  GstHarness *dec = decoder (rig, "request-key-units=false");
  guint all = 0;
  for (guint i = 0; i < 20; i++) {
    GstBuffer *coded = code (enc, rig, i);
    auto units = units_of (bytes_of (coded));
    gst_buffer_unref (coded);
    if (i == 3)
      units.erase (units.begin ());
    GstBuffer *shown = gst_harness_push_and_pull (dec, buffer_of (units, i * kFrame));
    all = std::max (all, valid_pixels (shown));
    if (i == 3 || i == 4)
      ck_assert_int_lt (valid_pixels (shown), all);
    if (i < 3 || i >= 3 + 12)
      fail_unless_equals_int (valid_pixels (shown), all);
    gst_buffer_unref (shown);
  }
  fail_unless_equals_int (count_requests (dec, true), 0);
  gst_harness_teardown (enc);
  gst_harness_teardown (dec);
}
GST_END_TEST;

GST_START_TEST (test_concealment_fills_what_refers_to_something_lost)
{
  const Rig rig = ring_rig (1);
  GstHarness *enc = encoder (rig, "profile=packed refresh-period=0");
  GstHarness *dec = decoder (rig, "conceal=last");
  GstBuffer *whole = gst_harness_push_and_pull (dec, code (enc, rig, 0));
  gst_buffer_unref (code (enc, rig, 1));
  GstBuffer *filled = gst_harness_push_and_pull (dec, code (enc, rig, 2));
  fail_unless_equals_int (valid_pixels (filled), valid_pixels (whole));
  gst_buffer_unref (whole);
  gst_buffer_unref (filled);
  gst_harness_teardown (enc);
  gst_harness_teardown (dec);
}
GST_END_TEST;

GST_START_TEST (test_frame_sets_that_others_refer_to_are_decoded_also_when_late)
{
  const Rig rig = ring_rig (1);
  GstHarness *enc = encoder (rig), *dec = decoder (rig);
  gst_buffer_unref (gst_harness_push_and_pull (dec, code (enc, rig, 0)));
  gst_harness_push_upstream_event (
      dec, gst_event_new_qos (GST_QOS_TYPE_UNDERFLOW, 0.1, GST_SECOND, 0));
  for (guint i = 1; i < 4; i++) {
    fail_unless_equals_int (gst_harness_push (dec, code (enc, rig, i)), GST_FLOW_OK);
    GstBuffer *shown = gst_harness_try_pull (dec);
    fail_unless (shown != nullptr);
    gst_buffer_unref (shown);
  }
  gst_harness_teardown (enc);
  gst_harness_teardown (dec);
}
GST_END_TEST;

GST_START_TEST (test_rtp_and_the_parser_keep_the_delta_flag)
{
  const Rig rig = ring_rig (2);
  for (const char *between : {"rtpneighbourcodepay ! rtpneighbourcodedepay",
           "neighbourcodeparse ! capsfilter "
           "caps=video/x-neighbour-code,alignment=byte-stream ! "
           "neighbourcodeparse ! capsfilter "
           "caps=video/x-neighbour-code,alignment=access-unit"}) {
    GstHarness *h = gst_harness_new_parse (
        (std::string ("neighbourcodeenc temporal=true profile=entropy ! ") + between).c_str ());
    gst_harness_set_src_caps (h, range_caps (rig));
    for (guint i = 0; i < 4; i++)
      gst_harness_push (h, make_frame_set (rig, i * kFrame));
    gst_harness_push_event (h, gst_event_new_eos ());
    auto buffers = pull_all (h);
    fail_unless_equals_int (int (buffers.size ()), 4);
    for (std::size_t i = 0; i < 4; i++)
      fail_unless (is_delta (buffers[i]) == (i > 0), "%s: %zu", between, i);
    unref_all (buffers);
    gst_harness_teardown (h);
  }
}
GST_END_TEST;

/* A decoder that held the one's frame sets would take them for those that the other refers to. */
GST_START_TEST (test_encoders_have_other_numbers_also_where_temporal_is_switched_on_later)
{
  const Rig rig = ring_rig (1);
  for (const bool later : {false, true}) {
    guint32 numbers[2];
    for (guint32 &number : numbers) {
      GstHarness *h = encoder (rig, later ? "temporal=false" : "");
      gst_buffer_unref (code (h, rig, 0));
      g_object_set (h->element, "temporal", TRUE, nullptr);
      GstBuffer *coded = code (h, rig, 1);
      number = header_of (units_of (bytes_of (coded))[0]).frame_number;
      gst_buffer_unref (coded);
      gst_harness_teardown (h);
    }
    fail_unless (numbers[0] != numbers[1], "later: %d, both %u", later, numbers[0]);
  }
}
GST_END_TEST;

static Suite *
temporal_suite (void)
{
  Suite *s = suite_create ("temporal");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (s, tc);
  tcase_add_test (tc, test_only_the_first_frame_set_is_a_key_one_and_a_still_scene_takes_few_bytes);
  tcase_add_test (tc, test_each_row_is_coded_again_within_the_refresh_period);
  tcase_add_test (tc, test_a_request_from_downstream_makes_a_key_frame_set_and_is_announced);
  tcase_add_test (tc, test_a_request_from_upstream_waits_for_its_running_time);
  tcase_add_test (tc, test_requests_for_several_times_are_all_answered);
  tcase_add_test (tc, test_a_decoder_can_begin_at_every_frame_set_without_the_delta_flag);
  tcase_add_test (tc, test_a_late_slice_wipes_nothing_out);
  tcase_add_test (tc, test_key_interval_flush_caps_and_changed_bits_start_over);
  tcase_add_test (tc, test_lossless_stays_lossless);
  tcase_add_test (tc, test_what_refers_to_a_lost_frame_set_is_left_out_and_a_key_one_is_asked_for);
  tcase_add_test (tc, test_a_lost_slice_is_whole_again_after_the_refresh_period_without_requests);
  tcase_add_test (tc, test_concealment_fills_what_refers_to_something_lost);
  tcase_add_test (tc, test_frame_sets_that_others_refer_to_are_decoded_also_when_late);
  tcase_add_test (tc, test_rtp_and_the_parser_keep_the_delta_flag);
  tcase_add_test (tc, test_encoders_have_other_numbers_also_where_temporal_is_switched_on_later);
  return s;
}

GST_CHECK_MAIN (temporal);
