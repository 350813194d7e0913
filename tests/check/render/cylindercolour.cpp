/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What cylinderfilter does to colours: colour-balance, mode=blend. */
#include "../scene-check.hpp"

using namespace rangecast;
using namespace rangecast::testing;

constexpr int kWidth = 160, kHeight = 120;

/** A frame set of the scene, its view 0 darker. */
static GstBuffer *
dark_frame_set (const Scene &scene)
{
  GstBuffer *buffer = gst_buffer_copy_deep (scene.frame_sets[0]);
  gstrange::RangeFrameMap frame (buffer, GST_MAP_READWRITE);
  const RangeImage &image = frame.views ()[0];
  for (int y = 0; y < image.roi.height; y++)
    for (int x = 0; x < image.roi.width; x++) {
      Rgbx &pixel = image.colour.at (x, y);
      for (std::uint8_t *value : {&pixel.r, &pixel.g, &pixel.b})
        *value = static_cast<std::uint8_t> (*value * 8 / 10);
    }
  return buffer;
}

static Pixels
filtered (const Scene &scene, const char *launch)
{
  GstHarness *h = gst_harness_new_parse (launch);
  gst_harness_set_src_caps (h, gst_caps_ref (scene.caps));
  GstBuffer *out = gst_harness_push_and_pull (h, dark_frame_set (scene));
  fail_unless (out != nullptr);
  Pixels pixels = pixels_of (out, kWidth, kHeight);
  gst_buffer_unref (out);
  gst_harness_teardown (h);
  return pixels;
}

/** Of two results' pixels that are valid in both: how many differ. Which are valid must be alike.
 */
static std::size_t
different (const Pixels &a, const Pixels &b, std::size_t &valid)
{
  std::size_t n = valid = 0;
  for (const auto &[view, plane] : a)
    for (std::size_t i = 0; i < plane.size (); i++) {
      fail_unless_equals_int (plane[i] != 0, b.at (view)[i] != 0);
      valid += plane[i] != 0;
      n += plane[i] != b.at (view)[i];
    }
  return n;
}

GST_START_TEST (test_without_balance_and_blend_colours_are_the_cameras)
{
  const Scene scene (4, kWidth, kHeight, 1);
  GstBuffer *in = dark_frame_set (scene);
  const Pixels before = pixels_of (in, kWidth, kHeight);
  gst_buffer_unref (in);
  const Pixels after = filtered (scene, "cylinderfilter colour-balance=off");
  std::size_t kept = 0;
  for (const auto &[view, plane] : after)
    for (std::size_t i = 0; i < plane.size (); i++)
      if (plane[i]) {
        fail_unless_equals_uint64 (plane[i], before.at (view)[i]);
        kept++;
      }
  ck_assert_uint_gt (kept, 1000);
}
GST_END_TEST;

GST_START_TEST (test_balance_is_on_and_lifts_the_darker_camera)
{
  const Scene scene (4, kWidth, kHeight, 1);
  const auto brightness = [&] (const char *launch) {
    GstHarness *h = gst_harness_new_parse (launch);
    gst_harness_set_src_caps (h, gst_caps_ref (scene.caps));
    GstBuffer *out = gst_harness_push_and_pull (h, dark_frame_set (scene));
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
  };
  const double dark = brightness ("cylinderfilter colour-balance=off"),
               balanced = brightness ("cylinderfilter");
  /* 0.8 of one of four: all the way up, the others stay. */
  fail_unless (balanced > 1.2 * dark && balanced < 1.3 * dark, "%f, was %f", balanced, dark);
}
GST_END_TEST;

GST_START_TEST (test_blend_changes_colours_about_seams_and_no_depth)
{
  const Scene scene (4, kWidth, kHeight, 1);
  std::size_t valid;
  const Pixels winner = filtered (scene, "cylinderfilter overlap=1 colour-balance=off"),
               blend = filtered (scene, "cylinderfilter overlap=1 colour-balance=off mode=blend"),
               wide = filtered (
                   scene, "cylinderfilter overlap=1 colour-balance=off mode=blend blend-width=0.1"),
               none = filtered (
                   scene, "cylinderfilter overlap=1 colour-balance=off mode=blend blend-width=0");
  const std::size_t some = different (winner, blend, valid);
  fail_unless (some > valid / 50 && some < valid * 7 / 10, "%zu of %zu", some, valid);
  ck_assert_uint_gt (different (winner, wide, valid), some * 5 / 4);
  fail_unless_equals_uint64 (different (winner, none, valid), 0);
}
GST_END_TEST;

GST_START_TEST (test_gains_start_over_after_a_flush)
{
  const Scene scene (4, kWidth, kHeight, 1);
  GstHarness *h = gst_harness_new_parse ("cylinderfilter");
  gst_harness_set_src_caps (h, gst_caps_ref (scene.caps));
  GstBuffer *out = gst_harness_push_and_pull (h, dark_frame_set (scene));
  const Pixels first = pixels_of (out, kWidth, kHeight);
  gst_buffer_unref (out);
  for (int i = 0; i < 5; i++)
    gst_buffer_unref (gst_harness_push_and_pull (h, gst_buffer_copy_deep (scene.frame_sets[0])));
  gst_harness_push_event (h, gst_event_new_flush_start ());
  gst_harness_push_event (h, gst_event_new_flush_stop (TRUE));
  GstSegment segment;
  gst_segment_init (&segment, GST_FORMAT_TIME);
  gst_harness_push_event (h, gst_event_new_segment (&segment));
  out = gst_harness_push_and_pull (h, dark_frame_set (scene));
  const Pixels again = pixels_of (out, kWidth, kHeight);
  gst_buffer_unref (out);
  gst_harness_teardown (h);
  /* The grid is another one, so gains may differ a little; what the five frames taught is gone. */
  double sum[2] = {}, n = 0;
  for (std::size_t i = 0; i < first.at (0).size (); i++)
    if (first.at (0)[i] && again.at (0)[i]) {
      sum[0] += static_cast<double> (first.at (0)[i] >> 8 & 0xff);
      sum[1] += static_cast<double> (again.at (0)[i] >> 8 & 0xff);
      n++;
    }
  fail_unless_cmp (n, >, 500);
  fail_unless (std::abs (sum[1] / sum[0] - 1) < 0.02, "%f", sum[1] / sum[0]);
}
GST_END_TEST;

GST_START_TEST (test_colour_properties_can_be_controlled)
{
  GstElement *element = gst_element_factory_make ("cylinderfilter", nullptr);
  for (const char *name : {"colour-balance", "blend-width", "mode"}) {
    GParamSpec *spec = g_object_class_find_property (G_OBJECT_GET_CLASS (element), name);
    fail_unless (spec && spec->flags & GST_PARAM_CONTROLLABLE, "%s", name);
  }
  int balance = -1;
  double width = -1;
  g_object_set (element, "blend-width", 0.07, nullptr);
  gst_util_set_object_arg (G_OBJECT (element), "colour-balance", "off");
  g_object_get (element, "blend-width", &width, "colour-balance", &balance, nullptr);
  fail_unless_equals_float (width, 0.07);
  fail_unless_equals_int (balance, 0);
  gst_object_unref (element);
}
GST_END_TEST;

static Suite *
cylindercolour_suite ()
{
  Suite *suite = suite_create ("cylindercolour");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_without_balance_and_blend_colours_are_the_cameras);
  tcase_add_test (tc, test_balance_is_on_and_lifts_the_darker_camera);
  tcase_add_test (tc, test_blend_changes_colours_about_seams_and_no_depth);
  tcase_add_test (tc, test_gains_start_over_after_a_flush);
  tcase_add_test (tc, test_colour_properties_can_be_controlled);
  return suite;
}

GST_CHECK_MAIN (cylindercolour);
