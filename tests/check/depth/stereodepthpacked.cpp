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

/* Depths of the first frame, the second time that the pipeline is started. */
std::vector<guint16>
depth_of (const std::string &source, const std::string &packing)
{
  GstElement *pipeline = gst_parse_launch (
      (source + "d.left " + kDepth + packing + " name=d ! appsink sync=false name=s").c_str (),
      nullptr);
  std::vector<guint16> depths;
  for (int i = 0; i < 2; i++) {
    gst_element_set_state (pipeline, GST_STATE_PLAYING);
    GstSample *sample = pull (pipeline, "s");
    fail_unless (sample != nullptr, "%s %s", source.c_str (), packing.c_str ());
    depths.clear ();
    {
      gstrange::RangeFrameMap frame (gst_sample_get_buffer (sample), GST_MAP_READ);
      const auto &depth = frame.views ()[0].depth;
      fail_unless_equals_int (depth.width, 320);
      for (int y = 0; y < depth.height; y++)
        depths.insert (depths.end (), depth.row (y), depth.row (y) + depth.width);
    }
    gst_sample_unref (sample);
    gst_element_set_state (pipeline, GST_STATE_NULL);
  }
  gst_object_unref (pipeline);
  return depths;
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

GST_START_TEST (test_halves_of_an_image_give_the_depth_of_two_cameras)
{
  const auto expected = depth_of (
      "avatartestsrc name=a num-buffers=3  a.right ! queue ! d.right  a.left ! queue ! ", "");
  ck_assert_int_gt (expected.size () - std::count (expected.begin (), expected.end (), 0), 5000);
  const auto by_caps = [] (const char *fields) {
    return std::string ("capssetter caps=video/x-raw,multiview-mode=") + fields + " ! ";
  };
  const std::string beside = packed_source ("RGBx", true), above = packed_source ("RGB", false);
  fail_unless (depth_of (beside, "packing=side-by-side") == expected);
  fail_unless (depth_of (above, "packing=top-bottom") == expected);
  fail_unless (depth_of (beside + by_caps ("side-by-side"), "") == expected);
  fail_unless (depth_of (above + by_caps ("top-bottom"), "") == expected);
  const std::string swapped =
      "avatartestsrc name=a num-buffers=3  a.right ! queue ! m.sink_0  a.left ! queue ! m.sink_1  "
      "compositor name=m sink_1::xpos=320 ! ";
  fail_unless (depth_of (swapped + by_caps ("side-by-side,multiview-flags="
                                            "(GstVideoMultiviewFlagsSet)1:ffffffff"),
                   "") == expected);
}
GST_END_TEST;

GST_START_TEST (test_input_that_cannot_be_divided_is_one_error)
{
  fail_unless_contains (
      error_of ("videotestsrc num-buffers=2 ! video/x-raw,width=641,height=48 ! d.left " + kDepth +
                "packing=side-by-side name=d ! fakesink"),
      "641x48 do not divide");
  fail_unless_contains (
      error_of (packed_source ("I420", true) + "tee name=t ! queue ! d.left t. ! queue ! d.right " +
                kDepth + "packing=side-by-side name=d ! fakesink"),
      "pad right is linked");
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
    fail_unless_contains (error_of (launch), "the packing of views changed");
  }
}
GST_END_TEST;

static Suite *
stereodepthpacked_suite ()
{
  Suite *suite = suite_create ("stereodepthpacked");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_halves_of_an_image_give_the_depth_of_two_cameras);
  tcase_add_test (tc, test_input_that_cannot_be_divided_is_one_error);
  tcase_add_test (tc, test_seeks);
  tcase_add_test (tc, test_another_packing_in_the_stream_is_one_error);
  return suite;
}

GST_CHECK_MAIN (stereodepthpacked);
