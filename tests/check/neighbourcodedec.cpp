/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "rangecast-check.hpp"

#include <rangecast/neighbourcode/unit.hpp>
#include <vector>

using namespace rangecast;
using namespace rangecast::testing;

static GstHarness *
harness (const Rig &rig, const char *launch)
{
  GstHarness *h = gst_harness_new_parse (launch);
  gst_harness_set_src_caps (h, gstrange::make_range_caps (gstrange::make_info (rig, 30, 1)));
  return h;
}

static GstHarness *
decoder_harness (const Rig &rig, const char *launch = "neighbourcodedec")
{
  GstHarness *h = gst_harness_new_parse (launch);
  gst_harness_set_src_caps (
      h, gstrange::make_neighbour_code_caps (gstrange::make_info (rig, 30, 1), "access-unit"));
  return h;
}

static GstBuffer *
encoded (const Rig &rig, GstBuffer *frame_set,
    const char *encoder = "neighbourcodeenc depth-bits=16 depth-threshold=0 colour-threshold=0")
{
  GstHarness *h = harness (rig, encoder);
  GstBuffer *buffer = gst_harness_push_and_pull (h, frame_set);
  gst_harness_teardown (h);
  return buffer;
}

/* The access unit without the units number from..to-1. */
static GstBuffer *
without_units (GstBuffer *coded, int from, int to)
{
  GstMapInfo map;
  gst_buffer_map (coded, &map, GST_MAP_READ);
  std::vector<guint8> kept;
  UnitReader units ({map.data, map.size});
  UnitHeader header;
  for (int i = 0; const auto unit = units.next (header); i++)
    if (i < from || i >= to)
      kept.insert (kept.end (), unit->begin (), unit->end ());
  gst_buffer_unmap (coded, &map);
  return gst_buffer_new_memdup (kept.data (), kept.size ());
}

static guint64
stat (GstHarness *h, const char *factory, const char *field)
{
  GstElement *element = gst_harness_find_element (h, factory);
  GstStructure *stats;
  guint64 value = G_MAXUINT64;
  g_object_get (element, "stats", &stats, nullptr);
  gst_structure_get_uint64 (stats, field, &value);
  gst_structure_free (stats);
  gst_object_unref (element);
  return value;
}

static std::size_t
points (GstBuffer *buffer)
{
  gstrange::RangeFrameMap frame (buffer, GST_MAP_READ);
  std::size_t n = 0;
  for (const RangeImage &image : frame.views ())
    for (int y = 0; y < image.roi.height; y++)
      for (int x = 0; x < image.roi.width; x++)
        n += image.depth.at (x, y) != 0;
  return n;
}

GST_START_TEST (test_lossless_settings_give_every_pixel_back)
{
  const Rig rig = ring_rig (3);
  GstBuffer *input = make_frame_set (rig, 42, {20, 10, 133, 120});
  gst_buffer_ref (input);
  GstHarness *h = harness (rig,
      "neighbourcodeenc depth-bits=16 depth-threshold=0 colour-threshold=0 ! neighbourcodedec");
  GstBuffer *output = gst_harness_push_and_pull (h, input);
  {
    gstrange::RangeFrameMap a (input, GST_MAP_READ), b (output, GST_MAP_READ);
    fail_unless_equals_int (b.views ().size (), 3);
    for (int i = 0; i < 3; i++) {
      const RangeImage &x = a.views ()[i], &y = b.views ()[i];
      fail_unless (x.roi == y.roi && x.view_id == y.view_id);
      for (int row = 0; row < x.roi.height; row++)
        for (int column = 0; column < x.roi.width; column++) {
          fail_unless_equals_int (x.depth.at (column, row), y.depth.at (column, row));
          if (x.depth.at (column, row))
            fail_unless (memcmp (&x.colour.at (column, row), &y.colour.at (column, row), 3) == 0);
        }
    }
  }
  fail_unless_equals_uint64 (GST_BUFFER_PTS (output), 42);
  fail_unless_equals_uint64 (gst_range_buffer_get_capture_time (output), 42);
  gst_buffer_unref (input);
  gst_buffer_unref (output);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_lost_slices_leave_invalid_pixels_and_no_error)
{
  const Rig rig = ring_rig (1);
  GstBuffer *coded = encoded (rig, make_frame_set (rig));
  GstHarness *h = decoder_harness (rig);
  GstBuffer *whole = gst_harness_push_and_pull (h, gst_buffer_ref (coded));
  GstBuffer *damaged = gst_harness_push_and_pull (h, without_units (coded, 1, 4));
  fail_unless (points (damaged) < points (whole));
  fail_unless (points (damaged) > points (whole) / 2);
  fail_unless (stat (h, "neighbourcodedec", "missing-pixels") > 0);
  gst_buffer_unref (whole);
  gst_buffer_unref (damaged);
  gst_buffer_unref (coded);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_conceal_last_keeps_the_pixels_of_lost_slices)
{
  const Rig rig = ring_rig (1);
  GstBuffer *coded = encoded (rig, make_frame_set (rig));
  GstHarness *h = decoder_harness (rig, "neighbourcodedec conceal=last");
  GstBuffer *whole = gst_harness_push_and_pull (h, gst_buffer_ref (coded));
  GstBuffer *concealed = gst_harness_push_and_pull (h, without_units (coded, 1, 4));
  fail_unless_equals_int (points (concealed), points (whole));
  gst_harness_push_event (h, gst_event_new_flush_start ());
  gst_harness_push_event (h, gst_event_new_flush_stop (TRUE));
  GstSegment segment;
  gst_segment_init (&segment, GST_FORMAT_TIME);
  gst_harness_push_event (h, gst_event_new_segment (&segment));
  GstBuffer *after_flush = gst_harness_push_and_pull (h, without_units (coded, 1, 4));
  fail_unless (points (after_flush) < points (whole));
  gst_buffer_unref (after_flush);
  gst_buffer_unref (whole);
  gst_buffer_unref (concealed);
  gst_buffer_unref (coded);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_view_that_did_not_come_is_left_out)
{
  const Rig rig = ring_rig (2);
  Rig second;
  second.views = {rig.views[1]};
  GstBuffer *coded = encoded (second, make_frame_set (second, 9));
  GstHarness *h = decoder_harness (rig);
  GstBuffer *output = gst_harness_push_and_pull (h, coded);
  fail_unless_equals_int (gst_buffer_n_range_metas (output), 1);
  fail_unless (gst_buffer_get_range_meta (output, 1) != nullptr);
  gst_buffer_unref (output);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_noise_gives_empty_frame_sets_and_no_error)
{
  const Rig rig = ring_rig (2);
  GstHarness *h = decoder_harness (rig);
  GRand *random = g_rand_new_with_seed (1);
  for (int i = 0; i < 200; i++) {
    guint8 bytes[333];
    for (guint8 &byte : bytes)
      byte = guint8 (g_rand_int (random));
    GstBuffer *output = gst_harness_push_and_pull (h, gst_buffer_new_memdup (bytes, sizeof bytes));
    fail_unless_equals_int (points (output), 0);
    gst_buffer_unref (output);
  }
  g_rand_free (random);
  fail_unless (stat (h, "neighbourcodedec", "bad-slices") > 100);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_settings_change_while_playing)
{
  const Rig rig = ring_rig (1);
  GstHarness *h =
      harness (rig, "neighbourcodeenc depth-threshold=0 colour-threshold=0 ! neighbourcodedec");
  GstElement *encoder = gst_harness_find_element (h, "neighbourcodeenc");
  gsize sizes[2];
  for (int i = 0; i < 2; i++) {
    GstBuffer *output = gst_harness_push_and_pull (h, make_frame_set (rig, i));
    gst_buffer_unref (output);
    sizes[i] = stat (h, "neighbourcodeenc", "coded-bytes");
    g_object_set (encoder, "colour-threshold", 40, "depth-threshold", 60, nullptr);
  }
  fail_unless (sizes[1] - sizes[0] < sizes[0] / 2);
  gst_object_unref (encoder);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_new_caps_in_the_stream_are_taken)
{
  const Rig rig = ring_rig (1), larger = ring_rig (2, 640, 480);
  GstHarness *h = harness (rig, "neighbourcodeenc ! neighbourcodedec");
  gst_buffer_unref (gst_harness_push_and_pull (h, make_frame_set (rig)));
  gst_harness_set_src_caps (h, gstrange::make_range_caps (gstrange::make_info (larger, 30, 1)));
  GstBuffer *output = gst_harness_push_and_pull (h, make_frame_set (larger));
  fail_unless_equals_int (gst_buffer_get_range_meta (output, 1)->width, 640);
  gst_buffer_unref (output);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_works_again_after_null)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = decoder_harness (rig, "neighbourcodedec conceal=last");
  GstBuffer *coded = encoded (rig, make_frame_set (rig));
  gst_buffer_unref (gst_harness_push_and_pull (h, gst_buffer_ref (coded)));
  gst_element_set_state (h->element, GST_STATE_NULL);
  gst_harness_play (h);
  gst_harness_set_src_caps (
      h, gstrange::make_neighbour_code_caps (gstrange::make_info (rig, 30, 1), "access-unit"));
  GstBuffer *output = gst_harness_push_and_pull (h, coded);
  fail_unless_equals_uint64 (stat (h, "neighbourcodedec", "frames"), 1);
  gst_buffer_unref (output);
  gst_harness_teardown (h);
}
GST_END_TEST;

static Suite *
neighbourcodedec_suite ()
{
  Suite *suite = suite_create ("neighbourcodedec");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_lossless_settings_give_every_pixel_back);
  tcase_add_test (tc, test_lost_slices_leave_invalid_pixels_and_no_error);
  tcase_add_test (tc, test_conceal_last_keeps_the_pixels_of_lost_slices);
  tcase_add_test (tc, test_view_that_did_not_come_is_left_out);
  tcase_add_test (tc, test_noise_gives_empty_frame_sets_and_no_error);
  tcase_add_test (tc, test_settings_change_while_playing);
  tcase_add_test (tc, test_new_caps_in_the_stream_are_taken);
  tcase_add_test (tc, test_works_again_after_null);
  return suite;
}

GST_CHECK_MAIN (neighbourcodedec);
