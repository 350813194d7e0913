/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* rangealign: the corrected rig in its caps, views skipped, colours. */
#include <cstring>

#include "../scene-check.hpp"

using namespace rangecast;
using namespace rangecast::testing;

constexpr int kWidth = 320, kHeight = 240;
constexpr const char *kStill = "motion=0 noise=0";

/* The caps of a rig in which the pose of view 1 is wrong. */
static GstCaps *
nudged_caps (const Scene &scene, Vec3 metres, double degrees)
{
  gstrange::RangeInfo info;
  fail_unless_ok (gstrange::parse_caps (scene.caps, info));
  Pose &pose = info.rig.views[1].world_from_view;
  const double s = std::sin (degrees * M_PI / 180), c = std::cos (degrees * M_PI / 180);
  pose = {Mat3{c, 0, s, 0, 1, 0, -s, 0, c} * pose.rotation, pose.translation + metres};
  return gstrange::with_rig (scene.caps, info.rig);
}

static Vec3
place_of (GstCaps *caps, std::size_t view)
{
  gstrange::RangeInfo info;
  fail_unless_ok (gstrange::parse_caps (caps, info));
  return info.rig.views[view].world_from_view * Vec3{0, 0, 0.8};
}

struct Filter {
  GstHarness *h;
  guint64 frames = 0;
  int caps_events = 0;

  Filter (const char *launch, GstCaps *caps) : h (gst_harness_new_parse (launch))
  {
    gst_harness_set_src_caps (h, caps);
  }
  ~Filter () { gst_harness_teardown (h); }
  Filter (const Filter &) = delete;
  Filter &operator= (const Filter &) = delete;

  /* @return the frame set that comes out, to be unreffed */
  GstBuffer *push (const Scene &scene)
  {
    GstBuffer *in = gst_buffer_copy_deep (scene.frame_sets[0]);
    GST_BUFFER_PTS (in) = frames++ * Scene::kInterval;
    GstBuffer *out = gst_harness_push_and_pull (h, in);
    fail_unless (out != nullptr);
    while (GstEvent *event = gst_harness_try_pull_event (h)) {
      caps_events += GST_EVENT_TYPE (event) == GST_EVENT_CAPS;
      gst_event_unref (event);
    }
    return out;
  }
  void run (const Scene &scene, int count)
  {
    for (int i = 0; i < count; i++)
      gst_buffer_unref (push (scene));
  }
  GstElement *element () const /* transfer full */
  {
    return gst_harness_find_element (h, "rangealign");
  }
  void set (const char *property, const char *value) const
  {
    GstElement *filter = element ();
    gst_util_set_object_arg (G_OBJECT (filter), property, value);
    gst_object_unref (filter);
  }
  GstCaps *caps () const { return gst_pad_get_current_caps (h->sinkpad); }
};

GST_START_TEST (test_rig_that_is_right_goes_on_as_it_came)
{
  const Scene scene (4, kWidth, kHeight, 1, kStill);
  Filter filter ("rangealign", gst_caps_ref (scene.caps));
  filter.run (scene, 20);
  GstCaps *caps = filter.caps ();
  fail_unless (gst_caps_is_equal (caps, scene.caps));
  fail_unless_equals_int (filter.caps_events, 1);
  gst_caps_unref (caps);
}
GST_END_TEST;

GST_START_TEST (test_rig_that_is_off_goes_on_corrected_with_the_first_frame_set)
{
  const Scene scene (4, kWidth, kHeight, 1, kStill);
  GstCaps *wrong = nudged_caps (scene, {0.003, 0, 0.002}, 0);
  const Vec3 should = place_of (scene.caps, 1), was = place_of (wrong, 1);
  Filter filter ("rangealign", gst_caps_ref (wrong));
  filter.run (scene, 1);
  GstCaps *caps = filter.caps ();
  fail_unless_cmp (norm (place_of (caps, 1) - should), <, 0.5 * norm (was - should));
  GstCaps *back = gstrange::with_rig (caps, Rig{}), *plain = gstrange::with_rig (wrong, Rig{});
  fail_unless (gst_caps_is_equal (back, plain), "more than the rig changed");
  filter.run (scene, 29);
  fail_unless (filter.caps_events <= 4, "%d changes in 2 s", filter.caps_events);
  for (GstCaps *c : {caps, back, plain, wrong})
    gst_caps_unref (c);
}
GST_END_TEST;

GST_START_TEST (test_without_poses_the_rig_is_as_it_came)
{
  const Scene scene (4, kWidth, kHeight, 1, kStill);
  GstCaps *wrong = nudged_caps (scene, {0.003, 0, 0.002}, 0);
  for (const char *launch :
      {"rangealign corrections=none", "rangealign corrections=views+points+colours"}) {
    Filter filter (launch, gst_caps_ref (wrong));
    filter.run (scene, 5);
    GstCaps *caps = filter.caps ();
    fail_unless (gst_caps_is_equal (caps, wrong), "%s", launch);
    gst_caps_unref (caps);
  }
  gst_caps_unref (wrong);
}
GST_END_TEST;

GST_START_TEST (test_view_with_a_wrong_pose_is_skipped_and_a_warning_and_stats_say_so)
{
  const Scene scene (4, kWidth, kHeight, 1, kStill);
  for (const bool skips : {true, false}) {
    Filter filter (skips ? "rangealign" : "rangealign corrections=poses+colours",
        nudged_caps (scene, {0.03, 0.04, 0}, 5));
    GstElement *element = filter.element ();
    GstBus *bus = gst_bus_new ();
    gst_element_set_bus (element, bus);
    GstBuffer *out = filter.push (scene);
    gst_buffer_unref (filter.push (scene));
    int warnings = 0;
    while (GstMessage *message = gst_bus_pop_filtered (bus, GST_MESSAGE_WARNING)) {
      GError *warning = nullptr;
      gst_message_parse_warning (message, &warning, nullptr);
      fail_unless (std::strstr (warning->message, "View 1") != nullptr, "%s", warning->message);
      g_error_free (warning);
      gst_message_unref (message);
      warnings++;
    }
    fail_unless_equals_int (warnings, skips ? 1 : 0);
    gst_element_set_bus (element, nullptr);
    gst_object_unref (bus);
    for (const auto &[view, plane] : pixels_of (out, kWidth, kHeight)) {
      const bool empty = std::ranges::all_of (plane, [] (guint64 pixel) { return pixel == 0; });
      fail_unless_equals_int (empty, skips && view == 1);
    }
    gst_buffer_unref (out);
    GstStructure *stats = nullptr;
    g_object_get (element, "stats", &stats, nullptr);
    gst_object_unref (element);
    const GValue *views = gst_structure_get_value (stats, "views");
    fail_unless_equals_int (int (gst_value_array_get_size (views)), 4);
    for (guint i = 0; i < 4; i++) {
      const GstStructure *view = gst_value_get_structure (gst_value_array_get_value (views, i));
      int id = -1;
      gboolean skipped = FALSE;
      double consistency = -1, moved = -1, turned = -1;
      fail_unless (gst_structure_get (view, "view-id", G_TYPE_INT, &id, "skipped", G_TYPE_BOOLEAN,
          &skipped, "consistency", G_TYPE_DOUBLE, &consistency, "moved", G_TYPE_DOUBLE, &moved,
          "turned", G_TYPE_DOUBLE, &turned, nullptr));
      fail_unless_equals_int (id, int (i));
      fail_unless_equals_int (skipped, skips && i == 1);
      if (skips)
        fail_unless (i == 1 ? consistency < 0.35 : consistency > 0.9, "%u: %f", i, consistency);
      fail_unless_cmp (moved, >=, 0);
      fail_unless_cmp (turned, >=, 0);
    }
    gst_structure_free (stats);
  }
}
GST_END_TEST;

/* A seek moves no camera. Without poses no correction is made again, and one goes only 15 frame
 * sets after the last change. */
GST_START_TEST (test_corrections_outlast_a_flush_but_not_the_stream)
{
  const Scene scene (4, kWidth, kHeight, 1, kStill);
  GstCaps *wrong = nudged_caps (scene, {0.003, 0, 0.002}, 0);
  for (const bool other_stream : {false, true}) {
    Filter filter ("rangealign", gst_caps_ref (wrong));
    filter.run (scene, 2);
    GstCaps *corrected = filter.caps ();
    filter.set ("corrections", "views");
    gst_harness_push_event (filter.h, gst_event_new_flush_start ());
    gst_harness_push_event (filter.h, gst_event_new_flush_stop (TRUE));
    if (other_stream)
      gst_harness_push_event (filter.h, gst_event_new_stream_start ("another"));
    GstSegment segment;
    gst_segment_init (&segment, GST_FORMAT_TIME);
    gst_harness_push_event (filter.h, gst_event_new_segment (&segment));
    filter.run (scene, 1);
    GstCaps *caps = filter.caps ();
    fail_if (gst_caps_is_equal (corrected, wrong));
    fail_unless (gst_caps_is_equal (caps, other_stream ? wrong : corrected));
    gst_caps_unref (caps);
    gst_caps_unref (corrected);
  }
  gst_caps_unref (wrong);
}
GST_END_TEST;

/* A view whose colours are quite wrong. */
GST_START_TEST (test_without_colour_balance_a_dark_view_is_no_contradiction)
{
  const Scene scene (8, kWidth, kHeight, 1, kStill);
  {
    gstrange::RangeFrameMap frame (scene.frame_sets[0], GST_MAP_READWRITE);
    fail_unless_ok (frame.status ());
    const RangeImage &dark = frame.views ()[1];
    for (int y = 0; y < dark.colour.height; y++)
      std::fill_n (dark.colour.row (y), dark.colour.width, Rgbx{255, 0, 255});
  }
  Filter filter ("rangealign corrections=poses+views", gst_caps_ref (scene.caps));
  filter.run (scene, 20);
  GstBuffer *out = filter.push (scene);
  fail_unless (std::ranges::any_of (
      pixels_of (out, kWidth, kHeight).at (1), [] (guint64 pixel) { return pixel != 0; }));
  gst_buffer_unref (out);
}
GST_END_TEST;

GST_START_TEST (test_corrections_outlast_a_reconfigure_from_downstream)
{
  const Scene scene (4, kWidth, kHeight, 1, kStill);
  Filter filter ("rangealign", nudged_caps (scene, {0.003, 0, 0.002}, 0));
  filter.run (scene, 2);
  GstCaps *corrected = filter.caps ();
  filter.set ("corrections", "views"); /* so that nothing is corrected again */
  gst_harness_push_upstream_event (filter.h, gst_event_new_reconfigure ());
  filter.run (scene, 1);
  GstCaps *caps = filter.caps ();
  fail_unless (gst_caps_is_equal (caps, corrected));
  gst_caps_unref (caps);
  gst_caps_unref (corrected);
}
GST_END_TEST;

/* The mean of what view 0, darkened, has in green afterwards. */
static double
brightness (const Scene &scene, const char *launch)
{
  GstBuffer *dark = gst_buffer_copy_deep (scene.frame_sets[0]);
  {
    gstrange::RangeFrameMap frame (dark, GST_MAP_READWRITE);
    const RangeImage &image = frame.views ()[0];
    for (int y = 0; y < image.roi.height; y++)
      for (int x = 0; x < image.roi.width; x++)
        for (std::uint8_t *value :
            {&image.colour.at (x, y).r, &image.colour.at (x, y).g, &image.colour.at (x, y).b})
          *value = static_cast<std::uint8_t> (*value * 8 / 10);
  }
  GstHarness *h = gst_harness_new_parse (launch);
  gst_harness_set_src_caps (h, gst_caps_ref (scene.caps));
  GstBuffer *out = gst_harness_push_and_pull (h, dark);
  double sum = 0, n = 0;
  {
    gstrange::RangeFrameMap frame (out, GST_MAP_READ);
    const RangeImage &image = frame.views ()[0];
    for (int y = 0; y < image.roi.height; y++)
      for (int x = 0; x < image.roi.width; x++)
        if (image.depth.at (x, y))
          sum += image.colour.at (x, y).g, n++;
  }
  gst_buffer_unref (out);
  gst_harness_teardown (h);
  return sum / n;
}

GST_START_TEST (test_colours_lift_the_darker_camera)
{
  const Scene scene (4, 160, 120, 1);
  const double dark = brightness (scene, "rangealign corrections=poses+views+points"),
               balanced = brightness (scene, "rangealign");
  /* 0.8 of one of four: all the way up, the others stay. */
  fail_unless (balanced > 1.2 * dark && balanced < 1.3 * dark, "%f, was %f", balanced, dark);
}
GST_END_TEST;

GST_START_TEST (test_caps_without_rig_and_views_that_the_rig_lacks_are_one_error_each)
{
  for (const bool has_rig : {false, true}) {
    GstHarness *h = gst_harness_new ("rangealign");
    GstBus *bus = gst_bus_new ();
    gst_element_set_bus (h->element, bus);
    GstCaps *caps = gstrange::make_range_caps (gstrange::make_info (ring_rig (2), 30, 1));
    if (!has_rig)
      gst_structure_remove_field (gst_caps_get_structure (caps, 0), "rig");
    gst_harness_set_src_caps (h, caps);
    gst_harness_push (h, make_frame_set (ring_rig (3)));
    fail_unless_contains (next_message_text (bus, GST_MESSAGE_ERROR), has_rig ? "view 2" : "rig");
    fail_if (has_rig && gst_bus_have_pending (bus));
    gst_element_set_bus (h->element, nullptr);
    gst_object_unref (bus);
    gst_harness_teardown (h);
  }
}
GST_END_TEST;

GST_START_TEST (test_goes_through_all_states_twice)
{
  const Scene scene (2, 160, 120, 1);
  GstElement *element =
      GST_ELEMENT (gst_object_ref_sink (gst_element_factory_make ("rangealign", nullptr)));
  for (int round = 0; round < 2; round++) {
    GstHarness *h = gst_harness_new_with_element (element, "sink", "src");
    gst_harness_set_src_caps (h, gst_caps_ref (scene.caps));
    gst_buffer_unref (gst_harness_push_and_pull (h, gst_buffer_copy_deep (scene.frame_sets[0])));
    fail_unless_equals_uint64 (stats_field (element, "frames"), 1);
    fail_unless (gst_harness_push_event (h, gst_event_new_eos ()));
    gst_harness_teardown (h); /* to NULL */
  }
  gst_object_unref (element);
}
GST_END_TEST;

static Suite *
rangealign_suite ()
{
  Suite *suite = suite_create ("rangealign");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_rig_that_is_right_goes_on_as_it_came);
  tcase_add_test (tc, test_rig_that_is_off_goes_on_corrected_with_the_first_frame_set);
  tcase_add_test (tc, test_without_poses_the_rig_is_as_it_came);
  tcase_add_test (tc, test_view_with_a_wrong_pose_is_skipped_and_a_warning_and_stats_say_so);
  tcase_add_test (tc, test_corrections_outlast_a_flush_but_not_the_stream);
  tcase_add_test (tc, test_without_colour_balance_a_dark_view_is_no_contradiction);
  tcase_add_test (tc, test_corrections_outlast_a_reconfigure_from_downstream);
  tcase_add_test (tc, test_colours_lift_the_darker_camera);
  tcase_add_test (tc, test_caps_without_rig_and_views_that_the_rig_lacks_are_one_error_each);
  tcase_add_test (tc, test_goes_through_all_states_twice);
  return suite;
}

GST_CHECK_MAIN (rangealign);
