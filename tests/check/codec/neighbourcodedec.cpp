/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "../scene-check.hpp"

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
      h, gstrange::make_neighbour_code_caps (gstrange::make_info (rig, 30, 1)));
  return h;
}

static GstBuffer *
encoded (const Rig &rig, GstBuffer *frame_set,
    const char *encoder = "neighbourcodeenc profile=plain depth-bits=16 depth-threshold=0 "
                          "colour-threshold=0")
{
  GstHarness *h = harness (rig, encoder);
  GstBuffer *buffer = gst_harness_push_and_pull (h, frame_set);
  gst_harness_teardown (h);
  return buffer;
}

/* The access unit without the slices number from..to-1. */
static GstBuffer *
without_slices (GstBuffer *coded, int from, int to)
{
  auto slices = slices_of (coded);
  slices.erase (slices.begin () + from, slices.begin () + to);
  return buffer_of (slices);
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
      fail_unless_cmp (x.roi, ==, y.roi);
      ck_assert_int_eq (x.view_id, y.view_id);
      for (int row = 0; row < x.roi.height; row++)
        for (int column = 0; column < x.roi.width; column++) {
          fail_unless_equals_int (x.depth.at (column, row), y.depth.at (column, row));
          if (x.depth.at (column, row))
            ck_assert_int_eq (
                memcmp (&x.colour.at (column, row), &y.colour.at (column, row), 3), 0);
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
  GstBuffer *damaged = gst_harness_push_and_pull (h, without_slices (coded, 1, 4));
  ck_assert_uint_lt (points (damaged), points (whole));
  ck_assert_uint_gt (points (damaged), points (whole) / 2);
  ck_assert_uint_gt (stats_field (h, "neighbourcodedec", "missing-pixels"), 0);
  gst_buffer_unref (whole);
  gst_buffer_unref (damaged);
  gst_buffer_unref (coded);
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
  GstHarness *h = decoder_harness (rig);
  GstBuffer *coded = encoded (rig, make_frame_set (rig));
  gst_buffer_unref (gst_harness_push_and_pull (h, gst_buffer_ref (coded)));
  gst_element_set_state (h->element, GST_STATE_NULL);
  gst_harness_play (h);
  gst_harness_set_src_caps (
      h, gstrange::make_neighbour_code_caps (gstrange::make_info (rig, 30, 1)));
  GstBuffer *output = gst_harness_push_and_pull (h, coded);
  fail_unless_equals_uint64 (stats_field (h, "neighbourcodedec", "frames"), 1);
  gst_buffer_unref (output);
  gst_harness_teardown (h);
}
GST_END_TEST;

/* What a view of the output has in one row; the whole frame set is as make_frame_set() made it. */
static std::vector<guint16>
depths_of_row (GstBuffer *buffer, int row)
{
  gstrange::RangeFrameMap frame (buffer, GST_MAP_READ);
  const RangeImage &image = frame.views ()[0];
  return {image.depth.row (row), image.depth.row (row) + image.roi.width};
}

static std::string
next_warning (GstBus *bus)
{
  return next_message_text (bus, GST_MESSAGE_WARNING, 0);
}

GST_START_TEST (test_first_damage_of_a_stream_is_a_warning_and_losses_are_not)
{
  const Rig rig = ring_rig (1);
  const auto good = encoded_units (rig, make_frame_set (rig));
  auto lossy = good, bad = good;
  lossy.erase (lossy.begin () + 3);
  bad[3].push_back (0); /* a byte left over */
  bad[3][2]++;
  GstHarness *h = decoder_harness (rig);
  GstBus *bus = gst_bus_new ();
  gst_element_set_bus (h->element, bus);
  gst_buffer_unref (gst_harness_push_and_pull (h, buffer_of (good)));
  gst_buffer_unref (gst_harness_push_and_pull (h, buffer_of (lossy, GST_SECOND)));
  fail_unless (next_warning (bus).empty ());
  gst_buffer_unref (gst_harness_push_and_pull (h, buffer_of (bad, 2 * GST_SECOND)));
  fail_unless_contains (next_warning (bus),
      "1 of " + std::to_string (bad.size ()) + " slices of the frame set at 0:00:02.000000000");
  gst_buffer_unref (gst_harness_push_and_pull (h, buffer_of (bad, 3 * GST_SECOND)));
  fail_unless (next_warning (bus).empty ());
  gst_harness_push_event (h, gst_event_new_stream_start ("another"));
  gst_buffer_unref (gst_harness_push_and_pull (h, buffer_of (bad, 4 * GST_SECOND)));
  fail_unless_contains (next_warning (bus), "0:00:04.000000000");
  gst_element_set_bus (h->element, nullptr);
  gst_object_unref (bus);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_rig_beyond_the_limit_is_an_error_that_names_it)
{
  GstHarness *h = harness_of ("neighbourcodedec");
  GstBus *bus = gst_bus_new ();
  gst_element_set_bus (h->element, bus);
  gst_harness_set_src_caps (h, coded_caps (ring_rig (64, 16384, 16384)));
  fail_unless_contains (next_message_text (bus, GST_MESSAGE_ERROR), "134217728");
  gst_element_set_bus (h->element, nullptr);
  gst_object_unref (bus);
  gst_harness_teardown (h);
}
GST_END_TEST;

/* A buffer of these bytes in memories that end at each of `ends` and at the end. */
static GstBuffer *
in_memories (std::span<const guint8> bytes, std::span<const std::size_t> ends)
{
  GstBuffer *buffer = gst_buffer_new ();
  std::size_t begin = 0;
  const auto append = [&] (std::size_t end) {
    GstMemory *memory = gst_allocator_alloc (nullptr, end - begin, nullptr);
    GstMapInfo map;
    fail_unless (gst_memory_map (memory, &map, GST_MAP_WRITE));
    std::ranges::copy (bytes.subspan (begin, end - begin), map.data);
    gst_memory_unmap (memory, &map);
    gst_buffer_append_memory (buffer, memory);
    begin = end;
  };
  for (const std::size_t end : ends)
    append (end);
  append (bytes.size ());
  GST_BUFFER_PTS (buffer) = 0;
  return buffer;
}

/* All pixels, and the decoder's counters. */
struct Decoded {
  std::vector<guint16> depths;
  guint64 slices, bad_slices, missing_pixels;
  bool operator== (const Decoded &) const = default;
};

static Decoded
decoded (const Rig &rig, GstBuffer *coded)
{
  GstHarness *h = harness_of ("neighbourcodedec");
  gst_harness_set_src_caps (h, coded_caps (rig));
  GstBuffer *output = gst_harness_push_and_pull (h, coded);
  fail_unless (output != nullptr);
  Decoded result = {{}, stats_field (h, "neighbourcodedec", "slices"),
      stats_field (h, "neighbourcodedec", "bad-slices"),
      stats_field (h, "neighbourcodedec", "missing-pixels")};
  {
    gstrange::RangeFrameMap frame (output, GST_MAP_READ);
    for (const RangeImage &image : frame.views ())
      for (int y = 0; y < image.roi.height; y++)
        for (int x = 0; x < image.roi.width; x++)
          result.depths.push_back (image.depth.at (x, y));
  }
  gst_buffer_unref (output);
  gst_harness_teardown (h);
  return result;
}

GST_START_TEST (test_memory_for_each_view_decodes_as_one_memory)
{
  const Rig rig = ring_rig (3);
  const auto units = encoded_units (rig, make_frame_set (rig));
  std::vector<guint8> bytes;
  std::vector<std::size_t> ends;
  int last_view = 0;
  for (const auto &unit : units) {
    if (header_of (unit).view_id != last_view)
      ends.push_back (bytes.size ());
    last_view = header_of (unit).view_id;
    bytes.insert (bytes.end (), unit.begin (), unit.end ());
  }
  fail_unless_equals_int (ends.size (), 2);
  const Decoded whole = decoded (rig, in_memories (bytes, {}));
  fail_unless_equals_uint64 (whole.slices, units.size ());
  fail_unless_cmp (decoded (rig, in_memories (bytes, ends)), ==, whole);
  /* An empty memory between them changes nothing. */
  ends.push_back (ends.back ());
  fail_unless_cmp (decoded (rig, in_memories (bytes, ends)), ==, whole);
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
  tcase_add_test (tc, test_new_caps_in_the_stream_are_taken);
  tcase_add_test (tc, test_works_again_after_null);
  tcase_add_test (tc, test_first_damage_of_a_stream_is_a_warning_and_losses_are_not);
  tcase_add_test (tc, test_rig_beyond_the_limit_is_an_error_that_names_it);
  tcase_add_test (tc, test_memory_for_each_view_decodes_as_one_memory);
  return suite;
}

GST_CHECK_MAIN (neighbourcodedec);
