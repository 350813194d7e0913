/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "rangecast-check.hpp"

#include <cstring>
#include <string_view>
#include <vector>

using namespace rangecast;
using namespace rangecast::testing;

struct Ply {
  std::size_t points = 0;
  std::vector<float> xyz;
  std::vector<guint8> rgb, view_id;
};

static Ply
parse_ply (GstBuffer *buffer, bool with_view_id)
{
  GstMapInfo map;
  fail_unless (gst_buffer_map (buffer, &map, GST_MAP_READ));
  const std::string_view text (reinterpret_cast<const char *> (map.data), map.size);
  const auto end = text.find ("end_header\n");
  fail_unless (end != text.npos);
  fail_unless (text.starts_with ("ply\nformat binary_little_endian 1.0\n"));
  const auto element = text.find ("element vertex ");
  Ply ply;
  ply.points = std::strtoul (text.data () + element + 15, nullptr, 10);
  const guint8 *at = map.data + end + 11;
  const std::size_t stride = with_view_id ? 16 : 15;
  fail_unless_equals_int (map.size - (end + 11), ply.points * stride);
  for (std::size_t i = 0; i < ply.points; i++, at += stride) {
    float xyz[3];
    std::memcpy (xyz, at, sizeof xyz);
    ply.xyz.insert (ply.xyz.end (), xyz, xyz + 3);
    ply.rgb.insert (ply.rgb.end (), at + 12, at + 15);
    if (with_view_id)
      ply.view_id.push_back (at[15]);
  }
  gst_buffer_unmap (buffer, &map);
  return ply;
}

static GstHarness *
ply_harness (const Rig &rig)
{
  GstHarness *h = gst_harness_new ("plyenc");
  gst_harness_set_src_caps (h, gstrange::make_range_caps (gstrange::make_info (rig, 30, 1)));
  return h;
}

GST_START_TEST (test_point_is_where_the_camera_saw_it)
{
  const Rig rig = ring_rig (2);
  GstBuffer *input = make_frame_set (rig, 7);
  {
    gstrange::RangeFrameMap frame (input, GST_MAP_READWRITE);
    for (const auto &view : frame.views ())
      for (int y = 0; y < 240; y++)
        for (int x = 0; x < 320; x++)
          view.depth.at (x, y) = 0;
    frame.views ()[1].depth.at (319, 239) = 8000;
  }
  GstHarness *h = ply_harness (rig);
  g_object_set (h->element, "view-id", TRUE, nullptr);
  GstBuffer *output = gst_harness_push_and_pull (h, input);
  const Ply ply = parse_ply (output, true);
  fail_unless_equals_int (ply.points, 1);
  /* View 1 stands behind (-z) and looks along +z; its x axis is the world's -x. */
  fail_unless (std::abs (ply.xyz[0] - -159.5 / 320 * 0.8) < 1e-6);
  fail_unless (std::abs (ply.xyz[1] - -119.5 / 320 * 0.8) < 1e-6);
  fail_unless (std::abs (ply.xyz[2] - 0.0) < 1e-6);
  fail_unless_equals_int (ply.view_id[0], 1);
  fail_unless_equals_int (ply.rgb[0], 319 % 256);
  fail_unless_equals_int (ply.rgb[1], 239);
  fail_unless_equals_uint64 (gst_range_buffer_get_capture_time (output), 7);
  fail_unless_equals_int (gst_buffer_n_range_metas (output), 0);
  gst_buffer_unref (output);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_only_valid_pixels_of_the_roi_are_points)
{
  const Rig rig = ring_rig (3);
  GstBuffer *input = make_frame_set (rig, 0, {100, 50, 37, 41});
  std::size_t valid = 0;
  {
    gstrange::RangeFrameMap frame (input, GST_MAP_READ);
    for (const auto &view : frame.views ())
      for (int y = 0; y < 41; y++)
        for (int x = 0; x < 37; x++)
          valid += view.depth.at (x, y) != 0;
  }
  GstHarness *h = ply_harness (rig);
  GstBuffer *output = gst_harness_push_and_pull (h, input);
  fail_unless (valid > 1000);
  fail_unless_equals_int (parse_ply (output, false).points, valid);
  gst_buffer_unref (output);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_empty_frame_set_is_a_file_without_points)
{
  const Rig rig = ring_rig (1);
  GstBuffer *input = gst_range_buffer_new (1, 8, 8);
  gst_range_buffer_add_view (input, 0, 0, 0, 0, 0, 0);
  GstHarness *h = ply_harness (rig);
  GstBuffer *output = gst_harness_push_and_pull (h, input);
  fail_unless_equals_int (parse_ply (output, false).points, 0);
  gst_buffer_unref (output);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_view_that_the_rig_lacks_is_one_error)
{
  GstHarness *h = ply_harness (ring_rig (1));
  GstBus *bus = gst_bus_new ();
  gst_element_set_bus (h->element, bus);
  fail_unless_equals_int (gst_harness_push (h, make_frame_set (ring_rig (2))), GST_FLOW_ERROR);
  fail_unless (next_message_text (bus, GST_MESSAGE_ERROR).find ("no view 1") != std::string::npos);
  fail_if (gst_bus_have_pending (bus) && gst_bus_pop_filtered (bus, GST_MESSAGE_ERROR) != nullptr);
  gst_element_set_bus (h->element, nullptr);
  gst_object_unref (bus);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_works_again_after_null)
{
  GstElement *pipeline = gst_parse_launch ("appsrc name=a ! plyenc ! fakesink", nullptr);
  for (int i = 0; i < 2; i++) {
    fail_if (gst_element_set_state (pipeline, GST_STATE_PLAYING) == GST_STATE_CHANGE_FAILURE);
    fail_unless_equals_int (
        gst_element_set_state (pipeline, GST_STATE_NULL), GST_STATE_CHANGE_SUCCESS);
  }
  gst_object_unref (pipeline);
}
GST_END_TEST;

static Suite *
plyenc_suite ()
{
  Suite *suite = suite_create ("plyenc");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_point_is_where_the_camera_saw_it);
  tcase_add_test (tc, test_only_valid_pixels_of_the_roi_are_points);
  tcase_add_test (tc, test_empty_frame_set_is_a_file_without_points);
  tcase_add_test (tc, test_view_that_the_rig_lacks_is_one_error);
  tcase_add_test (tc, test_works_again_after_null);
  return suite;
}

GST_CHECK_MAIN (plyenc);
