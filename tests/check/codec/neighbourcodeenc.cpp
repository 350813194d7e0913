/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "../coded-check.hpp"

#include <gst/video/video.h>

#include <algorithm>

using namespace rangecast;
using namespace rangecast::testing;

static GstHarness *
encoder (const Rig &rig, const char *properties = "")
{
  GstHarness *h = harness_of (std::string ("neighbourcodeenc ") + properties);
  gst_harness_set_src_caps (h, range_caps (rig));
  return h;
}

static std::vector<std::vector<guint8>>
push_and_pull_slices (GstHarness *h, GstBuffer *frame_set)
{
  GstBuffer *coded = gst_harness_push_and_pull (h, frame_set);
  const auto slices = slices_of (coded);
  gst_buffer_unref (coded);
  return slices;
}

GST_START_TEST (test_states_change_twice_and_frames_count_from_0_again)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = encoder (rig);
  for (int round = 0; round < 2; round++) {
    for (guint32 i = 0; i < 3; i++) {
      const auto units = push_and_pull_slices (h, make_frame_set (rig, i));
      fail_unless_equals_int (header_of (units[0]).frame_number, i);
    }
    for (const GstState state : {GST_STATE_READY, GST_STATE_READY, GST_STATE_NULL, GST_STATE_NULL})
      ck_assert_int_eq (gst_element_set_state (h->element, state), GST_STATE_CHANGE_SUCCESS);
    gst_harness_play (h);
    gst_harness_set_src_caps (h, range_caps (rig));
  }
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_new_caps_in_mid_stream_give_slices_of_the_new_rig)
{
  const Rig small = ring_rig (1, 64, 48), large = ring_rig (3, 128, 96);
  GstHarness *h = encoder (small);
  for (const Rig *rig : {&small, &large, &small}) {
    gst_harness_set_src_caps (h, range_caps (*rig));
    const auto units = push_and_pull_slices (h, make_frame_set (*rig));
    fail_unless_equals_int (header_of (units[0]).roi.width, rig->views[0].width);
    fail_unless_equals_int (header_of (units.back ()).view_id, int (rig->views.size ()) - 1);
    GstCaps *caps = gst_pad_get_current_caps (h->sinkpad);
    gstrange::RangeInfo info;
    fail_unless_ok (gstrange::parse_caps (caps, info));
    fail_unless_cmp (encode_rig (info.rig), ==, encode_rig (*rig));
    gst_caps_unref (caps);
  }
  gst_harness_teardown (h);
}
GST_END_TEST;

/* The same frame set with space behind its rows and between its planes. */
static GstBuffer *
with_padded_strides (GstBuffer *frame_set)
{
  constexpr guint kPad = 52;
  GstBuffer *padded = gst_buffer_new ();
  gst_buffer_copy_into (padded, frame_set, GST_BUFFER_COPY_METADATA, 0, -1);
  while (GstRangeMeta *meta = gst_buffer_get_range_meta (padded, 0))
    gst_buffer_remove_meta (padded, &meta->meta);
  const GstRangeMeta *old = gst_buffer_get_range_meta (frame_set, 0);
  const guint depth_stride = 2 * old->width + kPad, colour_stride = 4 * old->width + kPad;
  const gsize size = gsize (depth_stride + colour_stride) * old->height + kPad;
  gst_buffer_append_memory (padded, gst_allocator_alloc (nullptr, size, nullptr));
  gst_buffer_memset (padded, 0, 0x77, size);
  auto meta =
      reinterpret_cast<GstRangeMeta *> (gst_buffer_add_meta (padded, GST_RANGE_META_INFO, nullptr));
  const GstMeta base = meta->meta;
  *meta = *old;
  meta->meta = base;
  meta->depth_offset = 0;
  meta->depth_stride = depth_stride;
  meta->colour_offset = gsize{depth_stride} * old->height + kPad;
  meta->colour_stride = colour_stride;
  {
    gstrange::RangeFrameMap from (frame_set, GST_MAP_READ), to (padded, GST_MAP_WRITE);
    fail_unless_ok (from.status ());
    fail_unless_ok (to.status ());
    const RangeImage &source = from.views ()[0], &copy = to.views ()[0];
    for (int y = 0; y < source.depth.height; y++) {
      std::copy_n (source.depth.row (y), source.depth.width, copy.depth.row (y));
      std::copy_n (source.colour.row (y), source.depth.width, copy.colour.row (y));
    }
  }
  gst_buffer_unref (frame_set);
  return padded;
}

GST_START_TEST (test_padded_strides_code_to_the_same)
{
  const Rig rig = ring_rig (1);
  const auto plain = encoded_units (rig, make_frame_set (rig));
  fail_unless_cmp (encoded_units (rig, with_padded_strides (make_frame_set (rig))), ==, plain);
}
GST_END_TEST;

/* Depth units; pixels may neither come nor go. */
static int
worst_depth_error (GstBuffer *sent, GstBuffer *got)
{
  gstrange::RangeFrameMap a (sent, GST_MAP_READ), b (got, GST_MAP_READ);
  fail_unless_equals_int (a.views ().size (), b.views ().size ());
  int worst = 0;
  for (std::size_t i = 0; i < a.views ().size (); i++) {
    const RangeImage &x = a.views ()[i], &y = b.views ()[i];
    fail_unless_cmp (x.roi, ==, y.roi);
    for (int row = 0; row < x.roi.height; row++)
      for (int column = 0; column < x.roi.width; column++) {
        const int before = x.depth.at (column, row), after = y.depth.at (column, row);
        fail_unless_equals_int (before == 0, after == 0);
        worst = std::max (worst, std::abs (before - after));
      }
  }
  return worst;
}

GST_START_TEST (test_max_depth_error_is_what_decoded_depths_come_to)
{
  const Rig rig = ring_rig (2);
  for (const char *profile : {"plain", "packed", "entropy"}) {
    GstHarness *h = harness_of (
        std::string ("neighbourcodeenc depth-bits=9 depth-threshold=2 ") + "profile=" + profile);
    GstHarness *decoder = harness_of ("neighbourcodedec");
    gst_harness_set_src_caps (h, range_caps (rig));
    gst_harness_set_src_caps (decoder, coded_caps (rig));
    GstBuffer *sent = make_frame_set (rig);
    GstBuffer *got =
        gst_harness_push_and_pull (decoder, gst_harness_push_and_pull (h, gst_buffer_ref (sent)));
    GstStructure *stats = nullptr;
    double stated = 0;
    g_object_get (h->element, "stats", &stats, nullptr);
    fail_unless (gst_structure_get_double (stats, "max-depth-error", &stated));
    gst_structure_free (stats);
    const double worst = worst_depth_error (sent, got) * rig.views[0].depth_unit_m;
    fail_unless (worst <= stated + 1e-9, "%s: %g m of %g", profile, worst, stated);
    fail_unless (worst >= stated / 5, "%s: %g m of %g", profile, worst, stated);
    gst_buffer_unref (sent);
    gst_buffer_unref (got);
    gst_harness_teardown (decoder);
    gst_harness_teardown (h);
  }
}
GST_END_TEST;

GST_START_TEST (test_no_slice_is_longer_than_max_slice_size_also_when_it_changes)
{
  const Rig rig = ring_rig (2);
  GstHarness *h = encoder (rig, "profile=plain depth-threshold=0 colour-threshold=0 depth-bits=16");
  for (const int limit : {256, 1200, 257, 65535, 500}) {
    g_object_set (h->element, "max-slice-size", limit, nullptr);
    gsize longest = 0;
    for (const auto &unit : push_and_pull_slices (h, make_frame_set (rig)))
      longest = std::max (longest, unit.size ());
    ck_assert_uint_le (longest, gsize (limit));
    ck_assert_uint_gt (longest, gsize (limit) / 2);
  }
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_view_that_the_rig_lacks_is_one_error)
{
  const Rig one = ring_rig (1), two = ring_rig (2);
  GstHarness *h = encoder (one);
  {
    ErrorCounter errors (h);
    fail_unless_equals_int (gst_harness_push (h, make_frame_set (two)), GST_FLOW_ERROR);
    fail_unless_equals_int (errors.take (), 1);
  }
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_caps_without_a_rig_are_an_error)
{
  GstHarness *h = gst_harness_new ("neighbourcodeenc");
  {
    ErrorCounter errors (h);
    gst_harness_set_src_caps_str (
        h, "video/x-range,format=Z16_RGBx,width=320,height=240,framerate=30/1,views=1");
    ck_assert_int_gt (
        errors.take (), 0); /* again with each event: GStreamer repeats refused caps */
  }
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_frame_set_without_views_has_no_slices)
{
  const Rig rig = ring_rig (2);
  GstHarness *h = encoder (rig);
  GstBuffer *coded = gst_harness_push_and_pull (h, gst_range_buffer_new (2, 320, 240));
  fail_unless (slices_of (coded).empty ());
  gst_buffer_unref (coded);
  gst_harness_teardown (h);
}
GST_END_TEST;

static constexpr GstClockTime kFrame = GST_SECOND / 30;

static void
ask_for_key (GstHarness *h, gboolean all_headers = FALSE)
{
  fail_unless (gst_harness_push_upstream_event (
      h, gst_video_event_new_upstream_force_key_unit (GST_CLOCK_TIME_NONE, all_headers, 1)));
}

/* Rig views of a buffer that has so many bytes in front of its units. */
static int
count_rig_views (GstBuffer *buffer, std::size_t before)
{
  const auto bytes = bytes_of (buffer);
  int count = 0;
  for (const auto &unit : units_of (std::span (bytes).subspan (before)))
    count += (unit[0] & 15) == int (UnitType::kRigView);
  return count;
}

GST_START_TEST (test_key_frame_sets_hold_the_rig_which_the_payloader_repeats_for_all_headers)
{
  const Rig rig = ring_rig (2, 64, 48);
  const struct {
    const char *launch;
    std::size_t before; /* RTP header */
    std::string all_headers, none;
  } cases[] = {
      {"identity", 0, "20020", "20020"},
      {"rtpneighbourcodepay config-interval=3600 mtu=60000", 12, "20020", "20000"},
      {"rtpneighbourcodepay config-interval=0 mtu=60000", 12, "00000", "00000"},
  };
  for (const auto &c : cases)
    for (const bool all_headers : {true, false}) {
      GstHarness *h = gst_harness_new_parse (
          (std::string ("neighbourcodeenc temporal=true profile=packed ! ") + c.launch).c_str ());
      gst_harness_set_src_caps (h, range_caps (rig));
      std::string rig_views;
      for (guint i = 0; i < 5; i++) {
        if (i == 3)
          ask_for_key (h, all_headers);
        gst_harness_push (h, make_frame_set (rig, i * kFrame));
        auto buffers = pull_all (h);
        fail_if (buffers.empty ());
        int count = 0;
        for (GstBuffer *buffer : buffers)
          count += count_rig_views (buffer, c.before);
        rig_views += std::to_string (count);
        unref_all (buffers);
      }
      const std::string &expected = all_headers ? c.all_headers : c.none;
      fail_unless_equals_string (rig_views.c_str (), expected.c_str ());
      gst_harness_teardown (h);
    }
}
GST_END_TEST;

GST_START_TEST (test_frame_that_begins_before_the_segment_passes)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = encoder (rig);
  GstBuffer *out = push_before_the_segment (h, rig, GST_SECOND);
  fail_unless (out != nullptr);
  gst_buffer_unref (out);
  gst_harness_teardown (h);
}
GST_END_TEST;

static Suite *
neighbourcodeenc_suite ()
{
  Suite *suite = suite_create ("neighbourcodeenc");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_states_change_twice_and_frames_count_from_0_again);
  tcase_add_test (tc, test_new_caps_in_mid_stream_give_slices_of_the_new_rig);
  tcase_add_test (tc, test_padded_strides_code_to_the_same);
  tcase_add_test (tc, test_max_depth_error_is_what_decoded_depths_come_to);
  tcase_add_test (tc, test_no_slice_is_longer_than_max_slice_size_also_when_it_changes);
  tcase_add_test (tc, test_view_that_the_rig_lacks_is_one_error);
  tcase_add_test (tc, test_caps_without_a_rig_are_an_error);
  tcase_add_test (tc, test_frame_set_without_views_has_no_slices);
  tcase_add_test (tc, test_key_frame_sets_hold_the_rig_which_the_payloader_repeats_for_all_headers);
  tcase_add_test (tc, test_frame_that_begins_before_the_segment_passes);
  return suite;
}

GST_CHECK_MAIN (neighbourcodeenc);
