/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "../coded-check.hpp"

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
    const char *encoder = "neighbourcodeenc profile=plain depth-bits=16 depth-threshold=0 "
                          "colour-threshold=0")
{
  GstHarness *h = harness (rig, encoder);
  gst_harness_set_sink_caps_str (h, kAccessUnitsOrSlices);
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
  GstBuffer *damaged = gst_harness_push_and_pull (h, without_units (coded, 1, 4));
  ck_assert_uint_lt (points (damaged), points (whole));
  ck_assert_uint_gt (points (damaged), points (whole) / 2);
  ck_assert_uint_gt (stat (h, "neighbourcodedec", "missing-pixels"), 0);
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
  ck_assert_uint_lt (points (after_flush), points (whole));
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
  ck_assert_uint_gt (stat (h, "neighbourcodedec", "bad-slices"), 100);
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
  ck_assert_uint_lt (sizes[1] - sizes[0], sizes[0] / 2);
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

/* What a view of the output has in one row; the whole frame set is as make_frame_set() made it. */
static std::vector<guint16>
depths_of_row (GstBuffer *buffer, int row)
{
  gstrange::RangeFrameMap frame (buffer, GST_MAP_READ);
  const RangeImage &image = frame.views ()[0];
  return {image.depth.row (row), image.depth.row (row) + image.roi.width};
}

GST_START_TEST (test_conceal_last_shows_the_last_good_pixels_of_damaged_slices)
{
  const Rig rig = ring_rig (1);
  const auto good = encoded_units (rig, make_frame_set (rig));
  auto bad = good;
  bad[3].push_back (0); /* a byte left over */
  bad[3][2]++;
  const int row = header_of (good[3]).first_row;
  for (const bool conceal : {false, true}) {
    GstHarness *h =
        decoder_harness (rig, conceal ? "neighbourcodedec conceal=last" : "neighbourcodedec");
    GstBuffer *whole = gst_harness_push_and_pull (h, buffer_of (good));
    for (GstClockTime time = 1; time < 4; time++) {
      GstBuffer *damaged = gst_harness_push_and_pull (h, buffer_of (bad, time));
      if (conceal)
        fail_unless_equals_int (points (damaged), points (whole));
      fail_unless_equals_int (depths_of_row (damaged, row) == depths_of_row (whole, row), conceal);
      gst_buffer_unref (damaged);
    }
    fail_unless_equals_uint64 (stat (h, "neighbourcodedec", "bad-slices"), 3);
    fail_unless_equals_uint64 (stat (h, "neighbourcodedec", "missing-pixels"), 0);
    gst_buffer_unref (whole);
    gst_harness_teardown (h);
  }
}
GST_END_TEST;

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

GST_START_TEST (test_discont_of_a_lost_packet_does_not_stop_concealment_but_a_jump_in_time_does)
{
  const Rig rig = ring_rig (1);
  auto units = encoded_units (rig, make_frame_set (rig));
  GstHarness *h = decoder_harness (rig, "neighbourcodedec conceal=last");
  GstBuffer *whole = gst_harness_push_and_pull (h, buffer_of (units));
  units.erase (units.begin () + 3);
  for (const GstClockTime time : {GST_SECOND / 30, 10 * GST_SECOND}) {
    GstBuffer *with_gap = buffer_of (units, time);
    GST_BUFFER_FLAG_SET (with_gap, GST_BUFFER_FLAG_DISCONT);
    GstBuffer *output = gst_harness_push_and_pull (h, with_gap);
    fail_unless_equals_int (points (output) == points (whole), time < GST_SECOND);
    gst_buffer_unref (output);
  }
  gst_buffer_unref (whole);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_stray_slice_that_comes_first_costs_only_itself)
{
  const Rig rig = ring_rig (1);
  const auto good = encoded_units (rig, make_frame_set (rig));
  const auto other_roi = encoded_units (rig, make_frame_set (rig, 0, {10, 10, 99, 50}));
  auto other_frame = good[2], other_rows = good[0];
  other_frame[8] = 99;
  other_rows[28] = 20;
  for (const auto &stray : {other_roi[1], other_frame, other_rows}) {
    GstHarness *h = decoder_harness (rig);
    GstBuffer *whole = gst_harness_push_and_pull (h, buffer_of (good));
    auto units = good;
    units.insert (units.begin (), stray);
    GstBuffer *output = gst_harness_push_and_pull (h, buffer_of (units));
    for (const int row : {0, 100, 239})
      fail_unless_cmp (depths_of_row (output, row), ==, depths_of_row (whole, row));
    ck_assert_uint_ge (stat (h, "neighbourcodedec", "slices"), 2 * good.size ());
    ck_assert_uint_le (stat (h, "neighbourcodedec", "bad-slices"), 1);
    gst_buffer_unref (whole);
    gst_buffer_unref (output);
    gst_harness_teardown (h);
  }
}
GST_END_TEST;

GST_START_TEST (test_repeated_slices_count_their_points_once)
{
  const Rig rig = ring_rig (1);
  auto units = encoded_units (rig, make_frame_set (rig));
  const auto n = units.size ();
  units.insert (units.end (), units.begin (), units.begin () + std::ptrdiff_t (n));
  GstHarness *h = decoder_harness (rig);
  GstBuffer *output = gst_harness_push_and_pull (h, buffer_of (units));
  fail_unless_equals_uint64 (stat (h, "neighbourcodedec", "points"), points (output));
  fail_unless_equals_uint64 (stat (h, "neighbourcodedec", "slices"), n);
  gst_buffer_unref (output);
  gst_harness_teardown (h);
}
GST_END_TEST;

/* ---- alignment=slice ---- */

static GstHarness *
slice_decoder (const Rig &rig, const char *properties = "")
{
  GstHarness *h = harness_of (std::string ("neighbourcodedec ") + properties);
  gst_harness_set_src_caps (h, coded_caps (rig, "slice"));
  return h;
}

static void
push_slices (GstHarness *h, const std::vector<std::vector<guint8>> &units, GstClockTime time,
    bool with_marker)
{
  for (std::size_t i = 0; i < units.size (); i++) {
    GstBuffer *slice = buffer_of ({units[i]}, time);
    if (with_marker && i + 1 == units.size ())
      GST_BUFFER_FLAG_SET (slice, GST_BUFFER_FLAG_MARKER);
    fail_unless_equals_int (gst_harness_push (h, slice), GST_FLOW_OK);
  }
}

static void
expect_frame_set (GstHarness *h, GstBuffer *expected, GstClockTime time)
{
  GstBuffer *output = gst_harness_try_pull (h);
  fail_unless (output != nullptr);
  fail_unless_equals_uint64 (GST_BUFFER_PTS (output), time);
  fail_unless_equals_uint64 (gst_range_buffer_get_capture_time (output), time);
  fail_if (GST_BUFFER_FLAG_IS_SET (output, GST_BUFFER_FLAG_MARKER));
  fail_unless_equals_int (points (output), points (expected));
  for (const int row : {0, 100, 239})
    fail_unless_cmp (depths_of_row (output, row), ==, depths_of_row (expected, row));
  gst_buffer_unref (output);
}

GST_START_TEST (test_frame_set_of_slices_ends_with_its_marker)
{
  const Rig rig = ring_rig (2);
  GstBuffer *input = make_frame_set (rig);
  const auto units = encoded_units (rig, gst_buffer_ref (input));
  GstHarness *h = slice_decoder (rig);
  for (GstClockTime time = 0; time < 3; time++) {
    push_slices (h, units, time, true);
    expect_frame_set (h, input, time);
  }
  gst_buffer_unref (input);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_frame_set_of_slices_without_marker_ends_at_the_next_capture_time)
{
  const Rig rig = ring_rig (2);
  GstBuffer *input = make_frame_set (rig);
  const auto units = encoded_units (rig, gst_buffer_ref (input));
  GstHarness *h = slice_decoder (rig);
  push_slices (h, units, 0, false);
  fail_unless_equals_int (gst_harness_buffers_received (h), 0);
  push_slices (h, {units[0]}, 1, true); /* ends two */
  expect_frame_set (h, input, 0);
  GstBuffer *second = gst_harness_try_pull (h);
  fail_unless_equals_int (gst_buffer_n_range_metas (second), 1);
  gst_buffer_unref (second);
  gst_buffer_unref (input);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_last_slices_come_out_before_eos_gap_and_new_caps)
{
  const Rig rig = ring_rig (1);
  GstBuffer *input = make_frame_set (rig);
  const auto units = encoded_units (rig, gst_buffer_ref (input));
  GstHarness *h = slice_decoder (rig);
  push_slices (h, units, 0, false);
  fail_unless (gst_harness_push_event (h, gst_event_new_gap (1, 1)));
  expect_frame_set (h, input, 0);
  push_slices (h, units, 2, false);
  gst_harness_set_src_caps (h, coded_caps (ring_rig (2), "slice"));
  expect_frame_set (h, input, 2);
  gst_harness_set_src_caps (h, coded_caps (rig));
  GstBuffer *output = gst_harness_push_and_pull (h, buffer_of (units, 3));
  fail_unless_equals_int (points (output), points (input));
  gst_buffer_unref (output);
  gst_harness_set_src_caps (h, coded_caps (rig, "slice"));
  push_slices (h, units, 4, false);
  fail_unless (gst_harness_push_event (h, gst_event_new_eos ()));
  expect_frame_set (h, input, 4);
  gst_buffer_unref (input);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_flush_and_null_drop_slices_that_wait)
{
  const Rig rig = ring_rig (1);
  const auto units = encoded_units (rig, make_frame_set (rig));
  GstHarness *h = slice_decoder (rig);
  push_slices (h, units, 0, false);
  flush (h);
  push_slices (h, units, 1, false);
  for (const GstState state : {GST_STATE_READY, GST_STATE_NULL, GST_STATE_NULL})
    ck_assert_int_eq (gst_element_set_state (h->element, state), GST_STATE_CHANGE_SUCCESS);
  gst_harness_play (h);
  gst_harness_set_src_caps (h, coded_caps (rig, "slice"));
  push_slices (h, units, 2, true);
  fail_unless_equals_int (gst_harness_buffers_received (h), 1);
  fail_unless_equals_uint64 (stat (h, "neighbourcodedec", "frames"), 1);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_slices_and_access_units_decode_to_the_same)
{
  const Rig rig = ring_rig (3);
  std::vector<GstBuffer *> outputs[2];
  for (const bool slices : {false, true}) {
    GstHarness *h = harness (
        rig, slices ? "neighbourcodeenc ! video/x-neighbour-code,alignment=slice ! neighbourcodedec"
                    : "neighbourcodeenc ! neighbourcodedec");
    for (GstClockTime time = 0; time < 3; time++)
      gst_harness_push (h, make_frame_set (rig, time));
    outputs[slices] = pull_all (h);
    gst_harness_teardown (h);
  }
  fail_unless_equals_int (outputs[1].size (), 3);
  for (std::size_t i = 0; i < 3; i++) {
    fail_unless_equals_int (points (outputs[0][i]), points (outputs[1][i]));
    fail_unless_cmp (depths_of_row (outputs[0][i], 99), ==, depths_of_row (outputs[1][i], 99));
  }
  unref_all (outputs[0]);
  unref_all (outputs[1]);
}
GST_END_TEST;

GST_START_TEST (test_endless_frame_set_of_slices_stays_below_32_MiB)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = slice_decoder (rig);
  const std::vector<guint8> chunk (1 << 20, kBitstreamVersion << 4 | 9);
  for (int i = 0; i < 40; i++)
    push_slices (h, {chunk}, 0, false);
  push_slices (h, {chunk}, 0, true);
  gst_buffer_unref (gst_harness_pull (h));
  ck_assert_uint_le (stat (h, "neighbourcodedec", "coded-bytes"), 32 << 20);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_latency_is_that_of_upstream)
{
  GstHarness *h = decoder_harness (ring_rig (1));
  gst_harness_set_upstream_latency (h, 40 * GST_MSECOND);
  fail_unless_equals_uint64 (gst_harness_query_latency (h), 40 * GST_MSECOND);
  gst_harness_teardown (h);
}
GST_END_TEST;

/* Points of each view of the one frame set that avatartestsrc with these properties gives. */
static std::vector<std::size_t>
points_by_view (const std::string &source, const char *rest)
{
  GstHarness *h = gst_harness_new_parse (("avatartestsrc num-buffers=1 " + source +
                                          " ! video/x-range,width=40,height=30 ! identity" + rest)
                                             .c_str ());
  gst_harness_play (h);
  GstBuffer *buffer = gst_harness_pull (h);
  fail_unless (buffer != nullptr);
  std::vector<std::size_t> counts;
  {
    gstrange::RangeFrameMap frame (buffer, GST_MAP_READ);
    fail_unless_ok (frame.status ());
    for (const RangeImage &image : frame.views ()) {
      fail_unless_equals_int (image.view_id, counts.size ());
      std::size_t n = 0;
      for (int y = 0; y < image.roi.height; y++)
        for (int x = 0; x < image.roi.width; x++)
          n += image.depth.at (x, y) != 0;
      counts.push_back (n);
    }
  }
  gst_buffer_unref (buffer);
  gst_harness_teardown (h);
  return counts;
}

static std::size_t
points_of_view_alone (int views, int view)
{
  GstHarness *h = gst_harness_new_parse (
      ("avatartestsrc num-buffers=1 views=" + std::to_string (views) +
          " view-id=" + std::to_string (view) + " ! video/x-range,width=40,height=30 ! identity")
          .c_str ());
  gst_harness_play (h);
  GstBuffer *buffer = gst_harness_pull (h);
  const std::size_t n = points (buffer);
  gst_buffer_unref (buffer);
  gst_harness_teardown (h);
  return n;
}

GST_START_TEST (test_17_and_64_views_keep_the_points_of_each_view_alone)
{
  for (const int views : {17, 64}) {
    const std::string source = "views=" + std::to_string (views);
    const auto raw = points_by_view (source, "");
    fail_unless_equals_int (raw.size (), views);
    for (const int view : {0, 1, 15, 16, views - 1}) {
      ck_assert_uint_gt (raw[std::size_t (view)], 0);
      fail_unless_equals_int (raw[std::size_t (view)], points_of_view_alone (views, view));
    }
    fail_unless_cmp (raw, ==, points_by_view (source, " ! rangemux"));
    fail_unless_cmp (
        raw, ==, points_by_view (source, " ! neighbourcodeenc depth-bits=16 ! neighbourcodedec"));
  }
}
GST_END_TEST;

GST_START_TEST (test_64_views_with_other_rois_in_each_frame_set_decode_exactly)
{
  const Rig rig = ring_rig (64, 40, 30);
  GstHarness *h = harness (rig,
      "neighbourcodeenc depth-bits=16 depth-threshold=0 colour-threshold=0 ! neighbourcodedec");
  for (const Roi &roi : {Roi{0, 0, 40, 30}, Roi{3, 4, 11, 7}, Roi{1, 0, 39, 30}, Roi{0, 0, 2, 2}}) {
    GstBuffer *input = make_frame_set (rig, 1, roi);
    const std::size_t expected = points (input);
    GstBuffer *output = gst_harness_push_and_pull (h, input);
    fail_unless_equals_int (gst_buffer_n_range_metas (output), 64);
    fail_unless_equals_int (points (output), expected);
    gst_buffer_unref (output);
  }
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

/* A slice of `columns` invalid pixels in one row of a ROI that is the whole image. */
static std::vector<guint8>
thin_slice (const View &view, int row, int columns)
{
  SliceHeader header;
  header.key = true;
  header.view_id = decltype (header.view_id) (view.id);
  header.depth_bits = 10;
  header.colour_bits = 6;
  header.roi = {0, 0, view.width, view.height};
  header.first_row = row;
  header.rows = 1;
  header.columns = columns;
  std::vector<guint8> unit (kSliceHeaderSize + (3 * std::size_t (columns) + 7) / 8);
  write_slice_header (header, unit.size (), unit.data ());
  for (int x = 0; x < columns; x++)
    for (int bit = 0; bit < 3; bit++)
      if (5 >> bit & 1)
        unit[kSliceHeaderSize + std::size_t (3 * x + bit) / 8] |= guint8 (1 << (3 * x + bit) % 8);
  return unit;
}

GST_START_TEST (test_one_row_of_a_huge_image_makes_a_small_one)
{
  const Rig rig = ring_rig (2, 4096, 4096);
  GstHarness *h = decoder_harness (rig);
  GstBuffer *output = gst_harness_push_and_pull (
      h, buffer_of ({thin_slice (rig.views[0], 4000, 80), thin_slice (rig.views[1], 0, 80)}));
  GstRangeMeta *meta = gst_buffer_get_range_meta (output, 0);
  fail_unless_equals_int (meta->y, 4000);
  fail_unless_equals_int (meta->width, 80);
  fail_unless_equals_int (meta->height, 1);
  ck_assert_uint_lt (gst_buffer_get_size (output), 2000);
  fail_unless_equals_uint64 (
      stat (h, "neighbourcodedec", "missing-pixels"), 2 * (4096 * 4096 - 80));
  fail_unless_equals_uint64 (stat (h, "neighbourcodedec", "slices"), 2);
  gst_buffer_unref (output);
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
  Decoded result = {{}, stat (h, "neighbourcodedec", "slices"),
      stat (h, "neighbourcodedec", "bad-slices"), stat (h, "neighbourcodedec", "missing-pixels")};
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

GST_START_TEST (test_slices_across_memories_decode_as_in_one_memory)
{
  const Rig rig = ring_rig (2);
  const auto units = encoded_units (rig, make_frame_set (rig));
  std::vector<guint8> bytes;
  for (const auto &unit : units)
    bytes.insert (bytes.end (), unit.begin (), unit.end ());
  const Decoded whole = decoded (rig, in_memories (bytes, {}));
  const std::size_t second = units[0].size ();
  /* Within a unit header, behind one, within a slice; then two slices that cross three memories. */
  for (const std::size_t end : {std::size_t{1}, second + 3, second + 4, second + 100})
    fail_unless_cmp ((decoded (rig, in_memories (bytes, {{end}}))), ==, whole);
  fail_unless (
      decoded (rig, in_memories (bytes, {{second / 3, second / 2, second + 50}})) == whole);
}
GST_END_TEST;

GST_START_TEST (test_damage_in_memories_costs_what_it_costs_in_one)
{
  const Rig rig = ring_rig (2);
  const auto units = encoded_units (rig, make_frame_set (rig));
  std::vector<guint8> bytes;
  for (const auto &unit : units)
    bytes.insert (bytes.end (), unit.begin (), unit.end ());
  const std::size_t end = units[0].size () + units[1].size ();
  const Decoded sound = decoded (rig, in_memories (bytes, {}));
  constexpr guint8 kThisVersion = kBitstreamVersion << 4 | 1,
                   kPreviousVersion = (kBitstreamVersion - 1) << 4 | 1;
  for (const guint8 first_byte :
      {kPreviousVersion, kThisVersion}) { /* the latter with a size beyond the memory */
    bytes[units[0].size ()] = first_byte;
    bytes[units[0].size () + 3] = first_byte == kThisVersion ? 0xff : bytes[units[0].size () + 3];
    const Decoded whole = decoded (rig, in_memories (bytes, {}));
    ck_assert_int_lt (whole.slices, sound.slices);
    ck_assert_int_gt (whole.bad_slices, 0);
    fail_unless_cmp ((decoded (rig, in_memories (bytes, {{end}}))), ==, whole);
  }
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
  tcase_add_test (tc, test_conceal_last_shows_the_last_good_pixels_of_damaged_slices);
  tcase_add_test (tc, test_first_damage_of_a_stream_is_a_warning_and_losses_are_not);
  tcase_add_test (
      tc, test_discont_of_a_lost_packet_does_not_stop_concealment_but_a_jump_in_time_does);
  tcase_add_test (tc, test_stray_slice_that_comes_first_costs_only_itself);
  tcase_add_test (tc, test_repeated_slices_count_their_points_once);
  tcase_add_test (tc, test_frame_set_of_slices_ends_with_its_marker);
  tcase_add_test (tc, test_frame_set_of_slices_without_marker_ends_at_the_next_capture_time);
  tcase_add_test (tc, test_last_slices_come_out_before_eos_gap_and_new_caps);
  tcase_add_test (tc, test_flush_and_null_drop_slices_that_wait);
  tcase_add_test (tc, test_slices_and_access_units_decode_to_the_same);
  tcase_add_test (tc, test_endless_frame_set_of_slices_stays_below_32_MiB);
  tcase_add_test (tc, test_latency_is_that_of_upstream);
  tcase_add_test (tc, test_17_and_64_views_keep_the_points_of_each_view_alone);
  tcase_add_test (tc, test_64_views_with_other_rois_in_each_frame_set_decode_exactly);
  tcase_add_test (tc, test_rig_beyond_the_limit_is_an_error_that_names_it);
  tcase_add_test (tc, test_one_row_of_a_huge_image_makes_a_small_one);
  tcase_add_test (tc, test_memory_for_each_view_decodes_as_one_memory);
  tcase_add_test (tc, test_slices_across_memories_decode_as_in_one_memory);
  tcase_add_test (tc, test_damage_in_memories_costs_what_it_costs_in_one);
  return suite;
}

GST_CHECK_MAIN (neighbourcodedec);
