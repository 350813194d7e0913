/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* stereodepth with both views in one image. */
#include "../rangecast-check.hpp"

#include <gst/video/video.h>

#include <algorithm>
#include <string>
#include <vector>

using namespace rangecast::testing;

namespace {

const std::string kDepth = "stereodepth focal-length=320 baseline=0.1 near=0.45 far=1.3 ";

/* Two views of 320x240 in one image, side by side or one above the other. */
std::string
packed_source (const char *format, bool beside)
{
  return std::string (
             "avatartestsrc name=a num-buffers=3  a.left ! queue ! m.sink_0  a.right ! queue ! "
             "m.sink_1  compositor name=m sink_1::") +
         (beside ? "xpos=320" : "ypos=240") + " ! videoconvert ! video/x-raw,format=" + format +
         " ! ";
}

GstSample *
pull (GstElement *pipeline, const char *name)
{
  GstElement *sink = gst_bin_get_by_name (GST_BIN (pipeline), name);
  GstSample *sample = nullptr;
  g_signal_emit_by_name (sink, "try-pull-sample", guint64{20 * GST_SECOND}, &sample);
  gst_object_unref (sink);
  return sample;
}

/* Depth of the packed stream and of its cropped halves must be the same, and not empty. */
void
expect_depth_of_halves (const char *format, bool beside, const char *packing)
{
  const std::string crop = beside ? "videocrop right=320 ! e.left t. ! queue ! videocrop left=320"
                                  : "videocrop bottom=240 ! e.left t. ! queue ! videocrop top=240";
  const std::string launch = packed_source (format, beside) + "tee name=t  t. ! queue ! " + crop +
                             " ! e.right  t. ! queue ! d.left  " + kDepth +
                             "name=e ! appsink sync=false name=expected  " + kDepth + packing +
                             " name=d ! appsink sync=false name=packed";
  GError *error = nullptr;
  GstElement *pipeline = gst_parse_launch (launch.c_str (), &error);
  fail_unless (error == nullptr, "%s", error ? error->message : "");
  gst_element_set_state (pipeline, GST_STATE_PLAYING);
  for (int i = 0; i < 3; i++) {
    GstSample *expected = pull (pipeline, "expected"), *packed = pull (pipeline, "packed");
    fail_unless (expected && packed, "%s %d", format, i);
    fail_unless (gst_caps_is_equal (gst_sample_get_caps (expected), gst_sample_get_caps (packed)));
    {
      gstrange::RangeFrameMap from (gst_sample_get_buffer (expected), GST_MAP_READ);
      gstrange::RangeFrameMap to (gst_sample_get_buffer (packed), GST_MAP_READ);
      const auto &a = from.views ()[0], &b = to.views ()[0];
      fail_unless_equals_int (a.depth.width, 320);
      fail_unless_equals_int (a.depth.height, 240);
      int points = 0;
      for (int y = 0; y < a.depth.height; y++)
        for (int x = 0; x < a.depth.width; x++) {
          points += a.depth.at (x, y) != 0;
          fail_unless_equals_int (b.depth.at (x, y), a.depth.at (x, y));
          fail_unless_equals_int (b.colour.at (x, y).g, a.colour.at (x, y).g);
        }
      fail_unless (points > 5000, "%d points", points);
    }
    gst_sample_unref (expected);
    gst_sample_unref (packed);
  }
  gst_element_set_state (pipeline, GST_STATE_NULL);
  gst_object_unref (pipeline);
}

/* The error of a pipeline that fails. */
std::string
error_of (const std::string &launch)
{
  GstElement *pipeline = gst_parse_launch (launch.c_str (), nullptr);
  GstBus *bus = gst_element_get_bus (pipeline);
  gst_element_set_state (pipeline, GST_STATE_PLAYING);
  const std::string text = next_message_text (bus, GST_MESSAGE_ERROR, 60 * GST_SECOND);
  gst_element_set_state (pipeline, GST_STATE_NULL);
  gst_object_unref (bus);
  gst_object_unref (pipeline);
  return text;
}

} // namespace

GST_START_TEST (test_halves_of_every_layout_give_the_depth_of_two_cameras)
{
  for (const char *format : {"RGBx", "RGB", "I420", "NV12", "YUY2", "GRAY8"}) {
    expect_depth_of_halves (format, true, "packing=side-by-side");
    expect_depth_of_halves (format, false, "packing=top-bottom");
  }
}
GST_END_TEST;

GST_START_TEST (test_caps_say_how_views_are_packed)
{
  for (const char *mode : {"side-by-side", "top-bottom"}) {
    const bool beside = g_str_equal (mode, "side-by-side");
    const std::string launch = packed_source ("I420", beside) +
                               "capssetter caps=video/x-raw,multiview-mode=" + mode + " ! d.left " +
                               kDepth + "name=d ! appsink sync=false name=packed";
    GstElement *pipeline = gst_parse_launch (launch.c_str (), nullptr);
    gst_element_set_state (pipeline, GST_STATE_PLAYING);
    GstSample *sample = pull (pipeline, "packed");
    fail_unless (sample != nullptr, "%s", mode);
    int width = 0, height = 0;
    const GstStructure *caps = gst_caps_get_structure (gst_sample_get_caps (sample), 0);
    gst_structure_get (caps, "width", G_TYPE_INT, &width, "height", G_TYPE_INT, &height, nullptr);
    fail_unless_equals_int (width, 320);
    fail_unless_equals_int (height, 240);
    gst_sample_unref (sample);
    gst_element_set_state (pipeline, GST_STATE_NULL);
    gst_object_unref (pipeline);
  }
}
GST_END_TEST;

GST_START_TEST (test_right_view_first_is_told_by_the_caps)
{
  const char *swapped = "avatartestsrc name=a num-buffers=1  a.right ! queue ! m.sink_0  a.left ! "
                        "queue ! m.sink_1  compositor name=m sink_1::xpos=320 ! capssetter "
                        "caps=video/x-raw,multiview-mode=side-by-side,multiview-flags="
                        "(GstVideoMultiviewFlagsSet)1:ffffffff ! d.left ";
  std::vector<guint16> depths[2];
  for (int i = 0; i < 2; i++) {
    const std::string source =
        i ? swapped
          : packed_source ("RGBx", true) +
                "capssetter caps=video/x-raw,multiview-mode=side-by-side ! d.left ";
    GstElement *pipeline = gst_parse_launch (
        (source + kDepth + "name=d ! appsink sync=false name=s").c_str (), nullptr);
    gst_element_set_state (pipeline, GST_STATE_PLAYING);
    GstSample *sample = pull (pipeline, "s");
    fail_unless (sample != nullptr);
    {
      gstrange::RangeFrameMap frame (gst_sample_get_buffer (sample), GST_MAP_READ);
      const auto &depth = frame.views ()[0].depth;
      for (int y = 0; y < depth.height; y++)
        depths[i].insert (depths[i].end (), depth.row (y), depth.row (y) + depth.width);
    }
    gst_sample_unref (sample);
    gst_element_set_state (pipeline, GST_STATE_NULL);
    gst_object_unref (pipeline);
  }
  ck_assert_int_gt (depths[0].size () - std::count (depths[0].begin (), depths[0].end (), 0), 5000);
  fail_unless (depths[0] == depths[1]);
}
GST_END_TEST;

GST_START_TEST (test_ends_and_starts_again)
{
  GstElement *pipeline = gst_parse_launch (
      (packed_source ("I420", true) + "d.left " + kDepth + "packing=side-by-side name=d ! fakesink")
          .c_str (),
      nullptr);
  for (int i = 0; i < 2; i++)
    play_to_the_end (pipeline);
  gst_object_unref (pipeline);
}
GST_END_TEST;

GST_START_TEST (test_seeks)
{
  GstElement *pipeline = gst_parse_launch (
      ("videotestsrc num-buffers=1000 ! video/x-raw,width=640,height=240 ! d.left " + kDepth +
          "packing=side-by-side name=d ! appsink sync=false max-buffers=1 name=packed")
          .c_str (),
      nullptr);
  gst_element_set_state (pipeline, GST_STATE_PLAYING);
  for (const GstClockTime time : {20 * GST_SECOND, 2 * GST_SECOND}) {
    gst_sample_unref (pull (pipeline, "packed"));
    gst_element_seek_simple (pipeline, GST_FORMAT_TIME, GST_SEEK_FLAG_FLUSH, gint64 (time));
    bool found = false;
    for (int i = 0; i < 5 && !found; i++) {
      GstSample *sample = pull (pipeline, "packed");
      fail_unless (sample != nullptr);
      const GstClockTime pts = GST_BUFFER_PTS (gst_sample_get_buffer (sample));
      found = pts >= time && pts < time + GST_SECOND;
      gst_sample_unref (sample);
    }
    fail_unless (found);
  }
  gst_element_set_state (pipeline, GST_STATE_NULL);
  gst_object_unref (pipeline);
}
GST_END_TEST;

GST_START_TEST (test_what_cannot_be_divided_is_one_error)
{
  const auto of = [] (const std::string &caps) {
    return error_of ("videotestsrc num-buffers=2 ! video/x-raw," + caps + " ! d.left " + kDepth +
                     "packing=side-by-side name=d ! fakesink");
  };
  fail_unless_contains (of ("format=RGBx,width=641,height=48"), "width 641 does not divide");
  fail_unless_contains (of ("format=I420,width=642,height=48"), "multiple of 4");
  fail_unless_contains (of ("format=Y41B,width=644,height=48"), "multiple of 8");
  fail_unless_contains (of ("format=v210,width=640,height=48"), "cannot be divided");
  fail_unless_contains (
      error_of (packed_source ("I420", true) + "tee name=t ! queue ! d.left t. ! queue ! d.right " +
                kDepth + "packing=side-by-side name=d ! fakesink"),
      "the other sink pad is linked");
}
GST_END_TEST;

GST_START_TEST (test_other_pad_linked_while_images_come_is_one_error)
{
  GstElement *pipeline = gst_parse_launch (
      ("videotestsrc is-live=true ! video/x-raw,width=640,height=240 ! d.left " + kDepth +
          "packing=side-by-side name=d ! appsink sync=false name=packed  videotestsrc name=other")
          .c_str (),
      nullptr);
  GstBus *bus = gst_element_get_bus (pipeline);
  GstElement *other = gst_bin_get_by_name (GST_BIN (pipeline), "other");
  GstElement *depth = gst_bin_get_by_name (GST_BIN (pipeline), "d");
  gst_element_set_locked_state (other, TRUE);
  gst_element_set_state (pipeline, GST_STATE_PLAYING);
  gst_sample_unref (pull (pipeline, "packed"));
  fail_unless (gst_element_link_pads (other, "src", depth, "right"));
  fail_unless_contains (next_message_text (bus, GST_MESSAGE_ERROR), "the other sink pad is linked");
  gst_element_set_state (pipeline, GST_STATE_NULL);
  gst_object_unref (depth);
  gst_object_unref (other);
  gst_object_unref (bus);
  gst_object_unref (pipeline);
}
GST_END_TEST;

/* Two streams, one after the other. */
GST_START_TEST (test_another_packing_in_the_stream_is_one_error)
{
  for (const bool begins_packed : {false, true}) {
    const auto part = [] (bool packed) {
      return std::string ("videotestsrc num-buffers=2 ! video/x-raw,width=640,height=240 ! "
                          "capssetter caps=video/x-raw,multiview-mode=") +
             (packed ? "side-by-side" : "mono") + " ! c. ";
    };
    const std::string launch =
        "concat name=c ! d.left " + part (begins_packed) + part (!begins_packed) + kDepth +
        "name=d ! fakesink " +
        (begins_packed ? "" : "videotestsrc ! video/x-raw,width=640,height=240 ! d.right");
    fail_unless_contains (error_of (launch), begins_packed
                                                 ? "images of one view after images of two"
                                                 : "images of two views after images of one");
  }
}
GST_END_TEST;

static Suite *
stereodepthpacked_suite ()
{
  Suite *suite = suite_create ("stereodepthpacked");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_halves_of_every_layout_give_the_depth_of_two_cameras);
  tcase_add_test (tc, test_caps_say_how_views_are_packed);
  tcase_add_test (tc, test_ends_and_starts_again);
  tcase_add_test (tc, test_seeks);
  tcase_add_test (tc, test_what_cannot_be_divided_is_one_error);
  tcase_add_test (tc, test_other_pad_linked_while_images_come_is_one_error);
  tcase_add_test (tc, test_right_view_first_is_told_by_the_caps);
  tcase_add_test (tc, test_another_packing_in_the_stream_is_one_error);
  return suite;
}

GST_CHECK_MAIN (stereodepthpacked);
