/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Sink pads without a stream, of the elements that wait for one on each pad. */
#include "../rangecast-check.hpp"

namespace {

/* Runs until there is an error, or for two seconds. @return the error's text, or "" */
std::string
error_of (const std::string &launch)
{
  GError *problem = nullptr;
  GstElement *pipeline = gst_parse_launch (launch.c_str (), &problem);
  fail_unless (pipeline && !problem, "%s", problem ? problem->message : "");
  gst_element_set_state (pipeline, GST_STATE_PLAYING);
  GstBus *bus = gst_element_get_bus (pipeline);
  GstMessage *message = gst_bus_timed_pop_filtered (bus, 2 * GST_SECOND, GST_MESSAGE_ERROR);
  std::string text;
  if (message) {
    GError *error = nullptr;
    gst_message_parse_error (message, &error, nullptr);
    text = error->message;
    fail_unless (g_error_matches (error, GST_CORE_ERROR, GST_CORE_ERROR_PAD), "%s", text.c_str ());
    g_error_free (error);
    gst_message_unref (message);
  }
  gst_element_set_state (pipeline, GST_STATE_NULL);
  gst_object_unref (bus);
  gst_object_unref (pipeline);
  return text;
}

const std::string kCamera =
    "avatartestsrc name=scene scene.left ! video/x-raw,width=64,height=48 ! ";

GST_START_TEST (test_pad_that_is_not_linked_is_one_error_that_names_it)
{
  const std::string stereo = "stereodepth name=d focal-length=64 baseline=0.1 ! fakesink ";
  fail_unless_contains (
      error_of (stereo + kCamera + "queue ! d.left"), "Sink pad not linked: right");
  const std::string combine = "rangecombine name=c focal-length=64 ! fakesink videotestsrc ! ";
  fail_unless_contains (error_of (combine + "c.colour"), "Sink pad not linked: depth");
  fail_unless_contains (
      error_of (combine + "video/x-raw,format=GRAY16_LE ! c.depth"), "Sink pad not linked: colour");
}
GST_END_TEST;

GST_START_TEST (test_pads_that_are_linked_may_wait)
{
  const std::string launch =
      "rangecombine name=c focal-length=64 ! fakesink "
      "videotestsrc ! video/x-raw,framerate=2/1 ! c.colour "
      "appsrc caps=video/x-raw,format=GRAY16_LE,width=320,height=240 ! c.depth";
  const std::string text = error_of (launch);
  fail_unless (text.empty (), "%s", text.c_str ());
}
GST_END_TEST;

GST_START_TEST (test_an_element_that_stops_before_posts_nothing)
{
  GstElement *pipeline = gst_parse_launch (
      "rangecombine name=c focal-length=64 ! fakesink videotestsrc ! c.colour", nullptr);
  GstBus *bus = gst_element_get_bus (pipeline);
  for (int i = 0; i < 2; i++) {
    gst_element_set_state (pipeline, GST_STATE_PAUSED);
    g_usleep (G_USEC_PER_SEC / 5);
    gst_element_set_state (pipeline, GST_STATE_NULL);
  }
  gst_bus_set_flushing (bus, FALSE);
  fail_unless (gst_bus_timed_pop_filtered (bus, 3 * GST_SECOND / 2, GST_MESSAGE_ERROR) == nullptr);
  gst_object_unref (bus);
  gst_object_unref (pipeline);
}
GST_END_TEST;

Suite *
padlinks_suite ()
{
  Suite *suite = suite_create ("padlinks");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_pad_that_is_not_linked_is_one_error_that_names_it);
  tcase_add_test (tc, test_pads_that_are_linked_may_wait);
  tcase_add_test (tc, test_an_element_that_stops_before_posts_nothing);
  return suite;
}

} // namespace

GST_CHECK_MAIN (padlinks)
