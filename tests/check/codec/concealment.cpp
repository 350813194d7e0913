/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* neighbourcodedec conceal=last where much is lost or damaged: what was shown stays. */
#include "../scene-check.hpp"

using namespace rangecast;
using namespace rangecast::testing;

static constexpr GstClockTime kStep = 100 * GST_MSECOND;
using Units = std::vector<std::vector<guint8>>;

/* A unit of a type that decoders pass over. */
static const Units kNothing = {{kBitstreamVersion << 4 | 9, 0, 8, 0, 1, 2, 3, 4}};

static GstHarness *
decoder (const Rig &rig)
{
  GstHarness *h = harness_of ("neighbourcodedec conceal=last");
  gst_harness_set_src_caps (h, coded_caps (rig));
  return h;
}

/* What is shown of an access unit of these units. */
static Pixels
show (GstHarness *h, const Units &units, GstClockTime time, bool discont = false)
{
  GstBuffer *coded = buffer_of (units, time);
  if (discont)
    GST_BUFFER_FLAG_SET (coded, GST_BUFFER_FLAG_DISCONT);
  GstBuffer *output = gst_harness_push_and_pull (h, coded);
  const Pixels pixels = pixels_of (output, 320, 240);
  gst_buffer_unref (output);
  return pixels;
}

static Units
of_view (const Units &units, int id)
{
  Units some = units;
  std::erase_if (some, [&] (const auto &unit) { return header_of (unit).view_id != id; });
  return some;
}

GST_START_TEST (test_view_of_which_nothing_comes_stays_for_a_second_and_goes)
{
  const Rig rig = ring_rig (2);
  const Units units = encoded_units (rig, make_frame_set (rig));
  GstHarness *h = decoder (rig);
  const Pixels whole = show (h, units, 0);
  for (int i = 1; i <= 10; i++)
    fail_unless (show (h, of_view (units, 1), GstClockTime (i) * kStep) == whole, "at %d", i);
  const Pixels one = show (h, of_view (units, 1), 11 * kStep);
  fail_unless (!one.contains (0));
  fail_unless_cmp (one.at (1), ==, whole.at (1));
  fail_unless_cmp (show (h, units, 12 * kStep), ==, whole);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_frame_sets_of_which_nothing_is_sound_leave_the_picture)
{
  const Rig rig = ring_rig (2);
  const Units units = encoded_units (rig, make_frame_set (rig));
  Units damaged = units;
  for (auto &unit : damaged)
    unit[6] = 99; /* depth bits */
  GstHarness *h = decoder (rig);
  const Pixels whole = show (h, units, 0);
  fail_unless_cmp (show (h, kNothing, kStep), ==, whole);
  fail_unless_cmp (show (h, damaged, 2 * kStep), ==, whole);
  fail_unless_cmp (show (h, {units[3]}, 3 * kStep), ==, whole);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_stray_slice_that_comes_alone_does_not_crop_the_picture)
{
  const Rig rig = ring_rig (1);
  const Units units = encoded_units (rig, make_frame_set (rig));
  const auto stray = encoded_units (rig, make_frame_set (rig, 0, {10, 20, 250, 99}))[1];
  const SliceHeader header = header_of (stray);
  GstHarness *h = decoder (rig);
  const Pixels whole = show (h, units, 0);
  const Pixels mixed = show (h, {stray}, kStep);
  const int first = header.roi.y + header.first_row;
  for (int y = 0; y < 240; y++)
    for (int x = 0; x < 320; x++) {
      const bool inside = y >= first && y < first + header.rows && x >= 10 && x < 260;
      const auto p = std::size_t (y * 320 + x);
      if (!inside && mixed.at (0)[p] != whole.at (0)[p])
        fail ("another pixel at %d, %d", x, y);
    }
  ck_assert_uint_eq (show (h, {units[2]}, 2 * kStep).at (0).size (), whole.at (0).size ());
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_region_that_shrinks_where_most_came_is_that_of_the_frame_set)
{
  const Rig rig = ring_rig (1);
  const Roi smaller = {60, 50, 200, 150};
  const Units units = encoded_units (rig, make_frame_set (rig, 0, smaller));
  GstHarness *h = decoder (rig);
  show (h, encoded_units (rig, make_frame_set (rig)), 0);
  Units most = units;
  most.pop_back ();
  GstBuffer *output = gst_harness_push_and_pull (h, buffer_of (most, kStep));
  const GstRangeMeta *meta = gst_buffer_get_range_meta (output, 0);
  ck_assert_int_eq (meta->x, 60);
  ck_assert_int_eq (meta->y, 50);
  ck_assert_int_eq (meta->width, 200);
  ck_assert_int_eq (meta->height, 150);
  gst_buffer_unref (output);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_damaged_time_of_one_frame_set_does_not_end_concealment_but_a_new_time_does)
{
  const Rig rig = ring_rig (1);
  const Units units = encoded_units (rig, make_frame_set (rig));
  Units some = units;
  some.erase (some.begin () + 2, some.begin () + 5);
  GstHarness *h = decoder (rig);
  const Pixels whole = show (h, units, 50 * kStep);
  GstClockTime time = 50 * kStep;
  for (const GstClockTime damaged : {700 * kStep, 3 * kStep}) {
    fail_unless_cmp (show (h, some, damaged, true), !=, whole);
    fail_unless_cmp (show (h, some, time += 2 * kStep, true), ==, whole);
    fail_unless_cmp (show (h, some, time += kStep), ==, whole);
  }
  fail_unless_cmp (show (h, some, 700 * kStep, true), !=, whole);
  fail_unless_cmp (show (h, some, 701 * kStep), !=, whole);
  fail_unless_cmp (show (h, units, 702 * kStep), ==, whole);
  fail_unless_cmp (show (h, some, 703 * kStep), ==, whole);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_damaged_time_does_not_end_the_second_for_which_a_view_may_stay)
{
  const Rig rig = ring_rig (2);
  const Units units = encoded_units (rig, make_frame_set (rig));
  for (const GstClockTime damaged : {700 * kStep, 3 * kStep}) {
    GstHarness *h = decoder (rig);
    const Pixels whole = show (h, units, 50 * kStep);
    show (h, units, damaged, true);
    fail_unless_cmp (show (h, of_view (units, 1), 52 * kStep, true), ==, whole);
    gst_harness_teardown (h);
  }
}
GST_END_TEST;

GST_START_TEST (test_new_caps_keep_the_picture_where_the_views_are_alike)
{
  const Rig rig = ring_rig (1);
  const Units units = encoded_units (rig, make_frame_set (rig));
  Rig nearer = rig, other_unit = rig;
  nearer.views[0].near_m = 0.4;
  other_unit.views[0].depth_unit_m = 2e-4;
  for (const Rig &next : {nearer, other_unit}) {
    GstHarness *h = decoder (rig);
    const Pixels whole = show (h, units, 0);
    gst_harness_set_src_caps (h, coded_caps (next));
    const Pixels shown = show (h, kNothing, kStep);
    fail_unless (next.views[0].near_m > 0.3 ? shown == whole : shown.empty ());
    gst_harness_teardown (h);
  }
}
GST_END_TEST;

GST_START_TEST (test_flush_ends_concealment)
{
  const Rig rig = ring_rig (2);
  const Units units = encoded_units (rig, make_frame_set (rig));
  GstHarness *h = decoder (rig);
  show (h, units, 0);
  flush (h);
  fail_unless (show (h, kNothing, kStep).empty ());
  gst_harness_teardown (h);
}
GST_END_TEST;

static Suite *
concealment_suite (void)
{
  Suite *s = suite_create ("concealment");
  TCase *tc = tcase_create ("general");
  tcase_set_timeout (tc, 30);
  suite_add_tcase (s, tc);
  tcase_add_test (tc, test_view_of_which_nothing_comes_stays_for_a_second_and_goes);
  tcase_add_test (tc, test_frame_sets_of_which_nothing_is_sound_leave_the_picture);
  tcase_add_test (tc, test_stray_slice_that_comes_alone_does_not_crop_the_picture);
  tcase_add_test (tc, test_region_that_shrinks_where_most_came_is_that_of_the_frame_set);
  tcase_add_test (
      tc, test_damaged_time_of_one_frame_set_does_not_end_concealment_but_a_new_time_does);
  tcase_add_test (tc, test_damaged_time_does_not_end_the_second_for_which_a_view_may_stay);
  tcase_add_test (tc, test_new_caps_keep_the_picture_where_the_views_are_alike);
  tcase_add_test (tc, test_flush_ends_concealment);
  return s;
}

GST_CHECK_MAIN (concealment);
