/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The matcher of streams by time, and elements that use it. */
#include "common/matcher.hpp"

#include <atomic>
#include <deque>

#include "../rangecast-check.hpp"

using namespace rangecast::testing;

namespace {

using Head = MatchStream::Head;

/* Streams of which those with times have a frame. @return the step, and in bits what it is about */
struct Streams {
  explicit Streams (std::initializer_list<GstClockTime> times, int required = 2)
  {
    for (const GstClockTime time : times) {
      list.emplace_back ().required = int (list.size ()) < required;
      set (int (list.size ()) - 1, time);
    }
  }
  void set (int i, GstClockTime time, Head head = Head::kFrame, GstClockTime end = 0)
  {
    list[std::size_t (i)].head = time == kNone ? Head::kMissing : head;
    list[std::size_t (i)].time = time;
    list[std::size_t (i)].end = end;
  }
  std::pair<MatchStep, int> match (GstClockTime tolerance, bool timeout = false)
  {
    std::vector<MatchStream *> pointers;
    for (MatchStream &stream : list)
      pointers.push_back (&stream);
    MatchStream *dropped = nullptr;
    const MatchStep step = match_streams (pointers, tolerance, timeout, dropped);
    int bits = 0;
    for (std::size_t i = 0; i < list.size (); i++)
      bits |= (step == MatchStep::kSet ? list[i].in_set : pointers[i] == dropped) << i;
    return {step, step == MatchStep::kSet || step == MatchStep::kDrop ? bits : 0};
  }
  static constexpr GstClockTime kNone = GST_CLOCK_TIME_NONE;
  std::deque<MatchStream> list;
};

constexpr GstClockTime kNone = GST_CLOCK_TIME_NONE;
using Result = std::pair<MatchStep, int>;

GST_START_TEST (test_frames_within_the_tolerance_are_a_set)
{
  fail_unless (Streams ({100, 105}).match (5) == Result (MatchStep::kSet, 0b11));
  fail_unless (Streams ({106, 100}).match (5) == Result (MatchStep::kDrop, 0b10));
  fail_unless (Streams ({100, 105, 120}).match (5) == Result (MatchStep::kSet, 0b011));
  fail_unless (Streams ({100, 105, 90}).match (5) == Result (MatchStep::kDrop, 0b100));
  fail_unless (Streams ({100, 120, 105}, 0).match (5) == Result (MatchStep::kSet, 0b101));
}
GST_END_TEST;

GST_START_TEST (test_a_missing_stream_is_waited_for_until_the_deadline)
{
  for (const int required : {0, 2}) {
    fail_unless (Streams ({100, kNone}, required).match (5).first == MatchStep::kWait);
    fail_unless (Streams ({kNone, kNone}, required).match (5, true).first == MatchStep::kWait);
    fail_unless (Streams ({100, kNone}, required).match (5, true) ==
                 Result (required ? MatchStep::kDrop : MatchStep::kSet, 0b01));
    fail_unless (
        Streams ({100, 100, kNone}, required).match (5, true) == Result (MatchStep::kSet, 0b011));
  }
}
GST_END_TEST;

GST_START_TEST (test_a_gap_stands_for_its_frames_until_it_has_passed)
{
  for (const int required : {0, 2}) {
    Streams s ({100, 100}, required);
    s.set (1, 90, Head::kGap, 110);
    fail_unless (s.match (5) == Result (required ? MatchStep::kDrop : MatchStep::kSet, 0b01));
    s.set (0, 111);
    fail_unless (s.match (5) == Result (MatchStep::kDrop, 0b10)); /* the gap itself */
    s.set (0, 90, Head::kGap, 105);
    fail_unless (s.match (5) == Result (MatchStep::kDrop, 0b01)); /* the one that ends first */
  }
}
GST_END_TEST;

GST_START_TEST (test_the_end_is_that_of_a_required_stream_or_of_all)
{
  Streams s ({100, 100});
  s.set (1, 0, Head::kEnded);
  fail_unless (s.match (5).first == MatchStep::kEnd);
  Streams optional ({100, 100}, 0);
  optional.set (1, 0, Head::kEnded);
  fail_unless (optional.match (5) == Result (MatchStep::kSet, 0b01));
  optional.set (0, 0, Head::kEnded);
  fail_unless (optional.match (5).first == MatchStep::kEnd);
}
GST_END_TEST;

GST_START_TEST (test_frames_without_time_belong_to_any_set)
{
  Streams s ({100, 100});
  s.set (0, 0);
  for (MatchStream &stream : s.list)
    stream.head = Head::kFrame;
  s.list[1].time = kNone;
  fail_unless (s.match (5) == Result (MatchStep::kSet, 0b11));
  s.list[0].time = kNone;
  fail_unless (s.match (5) == Result (MatchStep::kSet, 0b11));
}
GST_END_TEST;

/* One live source feeds both pads through plain queues. While right images are missing, left ones
 * must not block it for good. */
GST_START_TEST (test_a_live_source_whose_right_images_are_missing_for_a_while_goes_on)
{
  GstElement *pipeline = gst_parse_launch (
      "avatartestsrc is-live=true name=c c.left ! video/x-raw,width=64,height=48,framerate=50/1 ! "
      "queue max-size-buffers=5 ! d.left c.right ! valve name=v ! queue ! d.right "
      "stereodepth name=d focal-length=64 baseline=0.1 ! fakesink name=o",
      nullptr);
  std::atomic<int> frames = 0;
  GstElement *sink = gst_bin_get_by_name (GST_BIN (pipeline), "o"),
             *valve = gst_bin_get_by_name (GST_BIN (pipeline), "v");
  g_object_set (sink, "signal-handoffs", TRUE, nullptr);
  g_signal_connect (sink, "handoff",
      G_CALLBACK (+[] (GstElement *, GstBuffer *, GstPad *, gpointer n) {
        (*static_cast<std::atomic<int> *> (n))++;
      }),
      &frames);
  const auto await = [&frames] (int n) {
    const int before = frames;
    for (int i = 0; i < 3000 && frames < before + n; i++)
      g_usleep (10000);
    fail_unless (frames >= before + n, "%d more frames", frames - before);
  };
  gst_element_set_state (pipeline, GST_STATE_PLAYING);
  await (3);
  g_object_set (valve, "drop", TRUE, nullptr);
  g_usleep (3 * G_USEC_PER_SEC / 2);
  g_object_set (valve, "drop", FALSE, nullptr);
  await (5);
  gst_element_set_state (pipeline, GST_STATE_NULL);
  for (GstElement *element : {sink, valve, pipeline})
    gst_object_unref (element);
}
GST_END_TEST;

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

Suite *
matcher_suite ()
{
  Suite *suite = suite_create ("matcher");
  TCase *tc = tcase_create ("general");
  tcase_set_timeout (tc, 120);
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_frames_within_the_tolerance_are_a_set);
  tcase_add_test (tc, test_a_missing_stream_is_waited_for_until_the_deadline);
  tcase_add_test (tc, test_a_gap_stands_for_its_frames_until_it_has_passed);
  tcase_add_test (tc, test_the_end_is_that_of_a_required_stream_or_of_all);
  tcase_add_test (tc, test_frames_without_time_belong_to_any_set);
  tcase_add_test (tc, test_a_live_source_whose_right_images_are_missing_for_a_while_goes_on);
  tcase_add_test (
      tc, test_a_pad_that_is_not_linked_is_an_error_that_names_it_and_one_that_waits_is_none);
  return suite;
}

} // namespace

GST_CHECK_MAIN (matcher)
