/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "rangecast-check.hpp"

#include <gst/video/navigation.h>

#include <cstdlib>
#include <vector>

using namespace rangecast;
using namespace rangecast::testing;

/* striprender and gldownload, 320x240 out; nullptr where there is no OpenGL. */
static GstHarness *
render_harness (const Rig &rig, const char *properties = "")
{
  GError *error = nullptr;
  GstElement *probe = gst_parse_launch ("gltestsrc num-buffers=1 ! gldownload ! fakesink", &error);
  g_clear_error (&error);
  if (!probe)
    return nullptr;
  gst_element_set_state (probe, GST_STATE_PAUSED);
  const bool usable =
      gst_element_get_state (probe, nullptr, nullptr, 20 * GST_SECOND) == GST_STATE_CHANGE_SUCCESS;
  gst_element_set_state (probe, GST_STATE_NULL);
  gst_object_unref (probe);
  if (!usable)
    return nullptr;
  const std::string launch =
      std::string ("striprender name=r ") + properties +
      " ! capsfilter caps=\"video/x-raw(memory:GLMemory),width=320,height=240\" ! "
      "gldownload";
  GstHarness *h = gst_harness_new_parse (launch.c_str ());
  gst_harness_set_sink_caps_str (h, "video/x-raw,format=RGBA");
  gst_harness_set_src_caps (h, gstrange::make_range_caps (gstrange::make_info (rig, 30, 1)));
  return h;
}

struct Rendered {
  std::vector<guint8> rgba;
  guint8 at (int x, int y, int channel) const { return rgba[4 * (320 * y + x) + channel]; }
};

static Rendered
render (GstHarness *h, GstBuffer *frame_set)
{
  GstBuffer *buffer = gst_harness_push_and_pull (h, frame_set);
  fail_unless (buffer != nullptr);
  Rendered picture;
  picture.rgba.resize (320 * 240 * 4);
  fail_unless_equals_int (
      gst_buffer_extract (buffer, 0, picture.rgba.data (), picture.rgba.size ()),
      picture.rgba.size ());
  gst_buffer_unref (buffer);
  return picture;
}

/* A flat wall 0.8 m before the first camera, in colours that change slowly. */
static GstBuffer *
wall (const Rig &rig, GstClockTime pts = 0)
{
  GstBuffer *buffer = make_frame_set (rig, pts);
  gstrange::RangeFrameMap frame (buffer, GST_MAP_READWRITE);
  for (const RangeImage &image : frame.views ())
    for (int y = 0; y < 240; y++)
      for (int x = 0; x < 320; x++) {
        const bool inside = image.view_id == 0 && x >= 40 && x < 280 && y >= 30 && y < 210;
        image.depth.at (x, y) = inside ? 8000 : 0;
        image.colour.at (x, y) = {guint8 (x / 2 + 50), guint8 (y), guint8 (200 - x / 2), 0};
      }
  return buffer;
}

GST_START_TEST (test_default_picture_is_the_first_views_own_in_every_mode)
{
  const Rig rig = ring_rig (4);
  for (const char *mode : {"mode=strips", "mode=rectangles", "mode=points point-size=1.5"}) {
    GstHarness *h = render_harness (rig, mode);
    if (!h)
      RANGECAST_SKIP ("no OpenGL context");
    const Rendered picture = render (h, wall (rig));
    double error = 0;
    for (int y = 35; y < 205; y++)
      for (int x = 45; x < 275; x++) {
        const int expected[] = {x / 2 + 50, y, 200 - x / 2};
        for (int c = 0; c < 3; c++)
          error += std::pow (picture.at (x, y, c) - expected[c], 2);
      }
    const double mse = error / (170 * 230 * 3);
    fail_unless (mse < 4, "%s: mean square error %f", mode, mse);
    fail_unless_equals_int (picture.at (10, 120, 0), 0x20); /* the background */
    fail_unless_equals_int (picture.at (160, 225, 2), 0x2a);
    gst_harness_teardown (h);
  }
}
GST_END_TEST;

GST_START_TEST (test_empty_frame_set_is_the_background)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = render_harness (rig, "background=0x80ff0000");
  if (!h)
    RANGECAST_SKIP ("no OpenGL context");
  GstBuffer *empty = gst_range_buffer_new (1, 8, 8);
  gst_range_buffer_add_view (empty, 0, 0, 0, 0, 0, 0);
  GST_BUFFER_PTS (empty) = 0;
  const Rendered picture = render (h, empty);
  fail_unless_equals_int (picture.at (160, 120, 0), 0xff);
  fail_unless_equals_int (picture.at (160, 120, 1), 0);
  fail_unless_equals_int (picture.at (160, 120, 3), 0x80);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_mouse_turns_and_zooms_and_r_goes_back)
{
  const Rig rig = ring_rig (4);
  GstHarness *h = render_harness (rig);
  if (!h)
    RANGECAST_SKIP ("no OpenGL context");
  render (h, wall (rig));
  GstElement *element = gst_harness_find_element (h, "striprender");
  GstPad *src = gst_element_get_static_pad (element, "src");
  const auto send = [&] (GstEvent *event) { gst_pad_send_event (src, event); };
  double azimuth = 0, distance = 0;
  send (gst_navigation_event_new_mouse_button_press (1, 160, 120, GST_NAVIGATION_MODIFIER_NONE));
  send (gst_navigation_event_new_mouse_move (80, 120, GST_NAVIGATION_MODIFIER_NONE));
  send (gst_navigation_event_new_mouse_button_release (1, 80, 120, GST_NAVIGATION_MODIFIER_NONE));
  send (gst_navigation_event_new_mouse_move (
      300, 120, GST_NAVIGATION_MODIFIER_NONE)); /* no button is down */
  g_object_get (element, "azimuth", &azimuth, nullptr);
  fail_unless (std::abs (azimuth - 45) < 1e-6, "azimuth %f", azimuth);
  send (gst_navigation_event_new_mouse_scroll (10, 10, 0, 1, GST_NAVIGATION_MODIFIER_NONE));
  g_object_get (element, "distance", &distance, nullptr);
  fail_unless (std::abs (distance - 0.8 / 1.1) < 1e-6, "distance %f", distance);
  send (gst_navigation_event_new_key_press ("r", GST_NAVIGATION_MODIFIER_NONE));
  g_object_get (element, "azimuth", &azimuth, "distance", &distance, nullptr);
  fail_unless (azimuth == 0 && distance == 0);
  gst_object_unref (src);
  gst_object_unref (element);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_keeps_pts_and_capture_time_and_counts)
{
  const Rig rig = ring_rig (2);
  GstHarness *h = render_harness (rig);
  if (!h)
    RANGECAST_SKIP ("no OpenGL context");
  GstBuffer *output = gst_harness_push_and_pull (h, wall (rig, 123456));
  fail_unless_equals_uint64 (GST_BUFFER_PTS (output), 123456);
  fail_unless_equals_uint64 (gst_range_buffer_get_capture_time (output), 123456);
  gst_buffer_unref (output);
  GstElement *element = gst_harness_find_element (h, "striprender");
  GstStructure *stats;
  guint64 points = 0, strips = 0, frames = 0;
  g_object_get (element, "stats", &stats, nullptr);
  gst_structure_get (stats, "points", G_TYPE_UINT64, &points, "strips", G_TYPE_UINT64, &strips,
      "frames", G_TYPE_UINT64, &frames, nullptr);
  fail_unless_equals_uint64 (points, 240 * 180);
  fail_unless_equals_uint64 (strips, 180);
  fail_unless_equals_uint64 (frames, 1);
  gst_structure_free (stats);
  gst_object_unref (element);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_new_rig_and_states_twice)
{
  Rig rig = ring_rig (1);
  GstHarness *h = render_harness (rig);
  if (!h)
    RANGECAST_SKIP ("no OpenGL context");
  const Rendered first = render (h, wall (rig));
  const Rig more = ring_rig (3);
  gst_harness_set_src_caps (h, gstrange::make_range_caps (gstrange::make_info (more, 30, 1)));
  render (h, wall (more));
  gst_element_set_state (h->element, GST_STATE_NULL);
  gst_harness_play (h);
  gst_harness_set_src_caps (h, gstrange::make_range_caps (gstrange::make_info (rig, 30, 1)));
  fail_unless (render (h, wall (rig)).rgba == first.rgba);
  gst_harness_teardown (h);
}
GST_END_TEST;

static Suite *
striprender_suite ()
{
  Suite *suite = suite_create ("striprender");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_default_picture_is_the_first_views_own_in_every_mode);
  tcase_add_test (tc, test_empty_frame_set_is_the_background);
  tcase_add_test (tc, test_mouse_turns_and_zooms_and_r_goes_back);
  tcase_add_test (tc, test_keeps_pts_and_capture_time_and_counts);
  tcase_add_test (tc, test_new_rig_and_states_twice);
  return suite;
}

GST_CHECK_MAIN (striprender);
