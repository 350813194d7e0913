/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Elements that match streams by time. */
#include <future>

#include "../rangecast-check.hpp"
#include <gst/check/gsttestclock.h>

using namespace rangecast::testing;

namespace {

/* Runs until there is an error, or for so long. @return the error's text, or "" */
std::string
error_of (const std::string &launch, GstClockTime wait = 60 * GST_SECOND)
{
  GstElement *pipeline = gst_parse_launch (launch.c_str (), nullptr);
  GstBus *bus = gst_element_get_bus (pipeline);
  gst_element_set_state (pipeline, GST_STATE_PLAYING);
  GstMessage *message = gst_bus_timed_pop_filtered (bus, wait, GST_MESSAGE_ERROR);
  std::string text;
  if (message) {
    GError *error = nullptr;
    gst_message_parse_error (message, &error, nullptr);
    text = error->message;
    g_error_free (error);
    gst_message_unref (message);
  }
  gst_element_set_state (pipeline, GST_STATE_NULL);
  gst_object_unref (bus);
  gst_object_unref (pipeline);
  return text;
}

GST_START_TEST (test_a_pad_that_is_not_linked_is_an_error_that_names_it_and_one_that_waits_is_none)
{
  const std::string left = "avatartestsrc name=s s.left ! video/x-raw,width=64,height=48 ! ";
  fail_unless_contains (
      error_of ("stereodepth name=d focal-length=64 baseline=0.1 ! fakesink " + left + "d.left"),
      "Sink pad not linked: right");
  const std::string combine = "rangecombine name=c focal-length=64 ! fakesink videotestsrc ! ";
  fail_unless_contains (error_of (combine + "c.colour"), "Sink pad not linked: depth");
  const std::string text =
      error_of (combine + "video/x-raw,framerate=2/1 ! c.colour appsrc "
                          "caps=video/x-raw,format=GRAY16_LE,width=320,height=240 ! c.depth",
          3 * GST_SECOND / 2);
  fail_unless (text.empty (), "%s", text.c_str ());
}
GST_END_TEST;

/* stereodepth feeds pad right itself; when it stops, the pad loses its caps before the timer is
 * due. */
GST_START_TEST (test_an_element_that_stops_reports_no_pad_as_not_linked)
{
  GstClock *clock = gst_test_clock_new ();
  gst_system_clock_set_default (clock);
  GstElement *pipeline = gst_parse_launch (
      "videotestsrc ! video/x-raw,width=128,height=48 ! stereodepth name=d packing=side-by-side "
      "focal-length=64 baseline=0.1 ! fakesink",
      nullptr);
  GstElement *depth = gst_bin_get_by_name (GST_BIN (pipeline), "d");
  GstPad *right = gst_element_get_static_pad (depth, "right");
  GstBus *bus = gst_element_get_bus (pipeline);
  gst_element_set_state (pipeline, GST_STATE_PAUSED);
  gst_element_get_state (pipeline, nullptr, nullptr, GST_CLOCK_TIME_NONE); /* fakesink waits */
  auto stopping = std::async (std::launch::async, gst_element_set_state, depth, GST_STATE_READY);
  while (gst_pad_is_active (right))
    g_usleep (1000);
  fail_unless (gst_test_clock_crank (GST_TEST_CLOCK (clock)));
  fail_if (gst_bus_pop_filtered (bus, GST_MESSAGE_ERROR));
  gst_element_set_state (pipeline, GST_STATE_NULL);
  stopping.wait ();
  for (gpointer object :
      {gpointer (bus), gpointer (right), gpointer (depth), gpointer (pipeline), gpointer (clock)})
    gst_object_unref (object);
  gst_system_clock_set_default (nullptr);
}
GST_END_TEST;

Suite *
matcher_suite ()
{
  Suite *suite = suite_create ("matcher");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (
      tc, test_a_pad_that_is_not_linked_is_an_error_that_names_it_and_one_that_waits_is_none);
  tcase_add_test (tc, test_an_element_that_stops_reports_no_pad_as_not_linked);
  return suite;
}

} // namespace

GST_CHECK_MAIN (matcher)
