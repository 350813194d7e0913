/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "../rangecast-check.hpp"

using namespace rangecast::testing;

namespace {

/* A capturesync with two streams, in harnesses: frame sets and speech. */
struct Step {
  GstElement *element = gst_element_factory_make ("capturesync", nullptr);
  GstHarness *picture = gst_harness_new_with_element (element, "sink_0", "src_0");
  GstHarness *sound = gst_harness_new_with_element (element, "sink_1", "src_1");
  GstBus *bus = gst_bus_new ();

  explicit Step (const char *start_with = nullptr)
  {
    gst_element_set_bus (element, bus);
    g_object_set (element, "start-with", start_with, nullptr);
    gst_harness_set_src_caps_str (picture, "video/x-neighbour-code");
    gst_harness_set_src_caps_str (sound, "audio/x-opus");
  }
  ~Step ()
  {
    gst_element_set_bus (element, nullptr);
    gst_object_unref (bus);
    gst_harness_teardown (sound);
    gst_harness_teardown (picture);
    gst_object_unref (element);
  }
  Step (const Step &) = delete;
  Step &operator= (const Step &) = delete;
};

} // namespace

static GstBuffer *
buffer_at (GstClockTime pts, GstClockTime capture, const char *reference)
{
  GstBuffer *buffer = gst_buffer_new_allocate (nullptr, 10, nullptr);
  GST_BUFFER_PTS (buffer) = pts;
  GstCaps *caps = gst_caps_from_string (reference);
  if (GST_CLOCK_TIME_IS_VALID (capture))
    gst_buffer_add_reference_timestamp_meta (buffer, caps, capture, GST_CLOCK_TIME_NONE);
  gst_caps_unref (caps);
  return buffer;
}

static const char kFrameSet[] = "timestamp/x-range-capture", kRtp[] = "timestamp/x-ntp";

/* Pushes one and gives the PTS that it leaves with; none: it was dropped. */
static GstClockTime
pass (GstHarness *h, GstClockTime pts, GstClockTime capture, const char *reference,
    GstBufferFlags flags = {})
{
  GstBuffer *buffer = buffer_at (pts, capture, reference);
  GST_BUFFER_FLAG_SET (buffer, flags);
  fail_unless_equals_int (gst_harness_push (h, buffer), GST_FLOW_OK);
  buffer = gst_harness_try_pull (h);
  if (!buffer)
    return GST_CLOCK_TIME_NONE;
  const GstClockTime left = GST_BUFFER_PTS (buffer);
  gst_buffer_unref (buffer);
  return left;
}

static constexpr GstClockTime kMs = GST_MSECOND;

GST_START_TEST (test_quicker_stream_waits_for_the_slower_one)
{
  Step step;
  const GstClockTime begin = 7000 * GST_SECOND; /* of the cameras' clock */
  /* Captured at the same time: frame sets come 180 ms later, speech 50 ms later. */
  pass (step.picture, 180 * kMs, begin, kFrameSet);
  for (int i = 0; i < 50; i++) {
    const GstClockTime at = i * 20 * kMs;
    const GstClockTime due = pass (step.sound, 50 * kMs + at, begin + at, kRtp);
    fail_unless_equals_uint64 (due, 180 * kMs + at);
    if (i % 3 == 0)
      fail_unless_equals_uint64 (
          pass (step.picture, 180 * kMs + at, begin + at, kFrameSet), 180 * kMs + at);
  }
}
GST_END_TEST;

GST_START_TEST (test_stream_that_becomes_slower_is_a_step)
{
  Step step;
  GstBuffer *buffer = nullptr;
  int disconts = 0;
  for (int i = 0; i < 100; i++) { /* a host that computes longer from the 20th on */
    const GstClockTime capture = i * 40 * kMs, lag = (i < 20 ? 60 : 200) * kMs;
    pass (step.picture, capture + lag, capture, kFrameSet);
    gst_harness_push (step.sound, buffer_at (capture + 50 * kMs, capture, kRtp));
    gst_clear_buffer (&buffer);
    buffer = gst_harness_try_pull (step.sound);
    disconts += i > 0 && GST_BUFFER_IS_DISCONT (buffer);
  }
  fail_unless (disconts > 0); /* decoders would otherwise go on as before */
  fail_unless (GST_CLOCK_DIFF (99 * 40 * kMs + 200 * kMs, GST_BUFFER_PTS (buffer)) <= 0);
  fail_unless (GST_CLOCK_DIFF (99 * 40 * kMs + 190 * kMs, GST_BUFFER_PTS (buffer)) >= 0);
  gst_buffer_unref (buffer);
}
GST_END_TEST;

GST_START_TEST (test_streams_of_different_clocks_pass_with_one_warning)
{
  Step step;
  for (int i = 0; i < 20; i++) {
    const GstClockTime at = i * 20 * kMs;
    fail_unless_equals_uint64 (pass (step.picture, 90 * kMs + at, at, kFrameSet), 90 * kMs + at);
    fail_unless_equals_uint64 (
        pass (step.sound, 40 * kMs + at, 3600 * GST_SECOND + at, kRtp), 40 * kMs + at);
  }
  const std::string text = next_message_text (step.bus, GST_MESSAGE_WARNING, 0);
  fail_unless (
      text.find ("3600.1 s apart") != text.npos || text.find ("3600.0 s apart") != text.npos, "%s",
      text.c_str ());
  fail_unless (next_message_text (step.bus, GST_MESSAGE_WARNING, 0).empty ());
}
GST_END_TEST;

GST_START_TEST (test_buffers_without_capture_time_pass_with_one_warning)
{
  Step step;
  for (int i = 0; i < 3; i++)
    fail_unless_equals_uint64 (pass (step.sound, i * kMs, GST_CLOCK_TIME_NONE, kRtp), i * kMs);
  const std::string text = next_message_text (step.bus, GST_MESSAGE_WARNING, 0);
  fail_unless (text.starts_with ("sink_1: buffers without a capture time"), "%s", text.c_str ());
  fail_unless (next_message_text (step.bus, GST_MESSAGE_WARNING, 0).empty ());
}
GST_END_TEST;

GST_START_TEST (test_recording_starts_with_the_first_key_frame_set)
{
  Step step ("sink_0");
  const GstClockTime begin = 900 * GST_SECOND;
  fail_if (GST_CLOCK_TIME_IS_VALID (pass (step.sound, 0, begin - 20 * kMs, kRtp)));
  fail_if (GST_CLOCK_TIME_IS_VALID (
      pass (step.picture, 0, begin - 10 * kMs, kFrameSet, GST_BUFFER_FLAG_DELTA_UNIT)));
  fail_unless_equals_uint64 (pass (step.picture, 77 * kMs, begin, kFrameSet), 0);
  fail_if (GST_CLOCK_TIME_IS_VALID (pass (step.sound, 20 * kMs, begin - 1, kRtp)));
  fail_unless_equals_uint64 (pass (step.sound, 40 * kMs, begin + 19 * kMs, kRtp), 19 * kMs);
  fail_unless_equals_uint64 (
      pass (step.picture, 99 * kMs, begin + 33 * kMs, kFrameSet, GST_BUFFER_FLAG_DELTA_UNIT),
      33 * kMs);
  GstEvent *event = gst_pad_get_sticky_event (step.sound->sinkpad, GST_EVENT_SEGMENT, 0);
  const GstSegment *segment;
  gst_event_parse_segment (event, &segment);
  fail_unless_equals_uint64 (segment->start, 0);
  gst_event_unref (event);
}
GST_END_TEST;

GST_START_TEST (test_recording_leaves_out_what_another_clock_captured)
{
  Step step ("sink_0");
  const GstClockTime begin = 900 * GST_SECOND;
  fail_unless_equals_uint64 (pass (step.picture, 50 * kMs, begin, kFrameSet), 0);
  fail_unless_equals_uint64 (pass (step.sound, 70 * kMs, begin + 20 * kMs, kRtp), 20 * kMs);
  for (GstClockTime other :
      {begin + 3600 * GST_SECOND, begin + 5 * GST_SECOND}) /* restarted hosts */
    fail_if (GST_CLOCK_TIME_IS_VALID (pass (step.sound, 90 * kMs, other, kRtp)));
  fail_unless_equals_uint64 (pass (step.sound, 110 * kMs, begin + 60 * kMs, kRtp), 60 * kMs);
  fail_if (GST_CLOCK_TIME_IS_VALID (pass (step.sound, 130 * kMs, 0, kRtp)));
  fail_unless (!next_message_text (step.bus, GST_MESSAGE_WARNING, 0).empty ());
  fail_unless (next_message_text (step.bus, GST_MESSAGE_WARNING, 0).empty ());
}
GST_END_TEST;

GST_START_TEST (test_stream_that_has_ended_delays_no_other)
{
  Step step;
  for (GstEventType end : {GST_EVENT_EOS, GST_EVENT_UNKNOWN}) { /* or is only silent */
    pass (step.picture, 180 * kMs, 0, kFrameSet);
    fail_unless_equals_uint64 (pass (step.sound, 50 * kMs, 0, kRtp), 180 * kMs);
    const GstClockTime later = end == GST_EVENT_EOS ? 20 * kMs : 10 * GST_SECOND;
    if (end == GST_EVENT_EOS)
      fail_unless (gst_harness_push_event (step.picture, gst_event_new_eos ()));
    fail_unless_equals_uint64 (pass (step.sound, 50 * kMs + later, later, kRtp), 50 * kMs + later);
    if (end == GST_EVENT_EOS) { /* the next file or call */
      fail_unless (gst_harness_push_event (step.picture, gst_event_new_stream_start ("next")));
      gst_harness_set_src_caps_str (step.picture, "video/x-neighbour-code");
    }
  }
}
GST_END_TEST;

GST_START_TEST (test_gap_moves_with_its_stream)
{
  Step step;
  pass (step.picture, 180 * kMs, 0, kFrameSet);
  pass (step.sound, 50 * kMs, 0, kRtp);
  GstEvent *gap = gst_event_new_gap (70 * kMs, 20 * kMs);
  gst_event_set_gap_flags (gap, GST_GAP_FLAG_MISSING_DATA);
  fail_unless (gst_harness_push_event (step.sound, gap));
  GstGapFlags flags = {};
  GstClockTime time = 0;
  while (GstEvent *event = gst_harness_try_pull_event (step.sound)) {
    if (GST_EVENT_TYPE (event) == GST_EVENT_GAP) {
      gst_event_parse_gap (event, &time, nullptr);
      gst_event_parse_gap_flags (event, &flags);
    }
    gst_event_unref (event);
  }
  fail_unless_equals_uint64 (time, 200 * kMs);
  fail_unless_equals_int (flags, GST_GAP_FLAG_MISSING_DATA);
}
GST_END_TEST;

GST_START_TEST (test_what_precedes_a_segment_passes_to_be_decoded_only)
{
  Step step;
  GstSegment segment;
  gst_segment_init (&segment, GST_FORMAT_TIME);
  segment.start = segment.time = 100 * kMs;
  fail_unless (gst_harness_push_event (step.picture, gst_event_new_segment (&segment)));
  fail_unless (gst_harness_push_event (step.picture, gst_event_new_gap (120 * kMs, 10 * kMs)));
  bool had_segment = false, had_gap = false;
  while (GstEvent *event = gst_harness_try_pull_event (step.picture)) {
    if (GST_EVENT_TYPE (event) == GST_EVENT_SEGMENT) {
      const GstSegment *sent;
      gst_event_parse_segment (event, &sent);
      had_segment = sent->start == segment.start && sent->time == segment.time;
    }
    had_gap |= had_segment && GST_EVENT_TYPE (event) == GST_EVENT_GAP;
    gst_event_unref (event);
  }
  fail_unless (had_gap); /* before the first buffer */
  for (const GstClockTime pts : {60 * kMs, 140 * kMs}) {
    GstBuffer *buffer = buffer_at (pts, pts, kFrameSet);
    GST_BUFFER_DTS (buffer) = pts;
    fail_unless_equals_int (gst_harness_push (step.picture, buffer), GST_FLOW_OK);
    buffer = gst_harness_try_pull (step.picture);
    fail_unless (buffer != nullptr);
    const bool is_before = pts < segment.start;
    fail_unless_equals_uint64 (GST_BUFFER_PTS (buffer), pts); /* before: sinks clip it */
    fail_unless_equals_uint64 (GST_BUFFER_DTS (buffer), is_before ? GST_CLOCK_TIME_NONE : pts);
    fail_unless (GST_BUFFER_FLAG_IS_SET (buffer, GST_BUFFER_FLAG_DECODE_ONLY) == is_before);
    gst_buffer_unref (buffer);
  }
}
GST_END_TEST;

static Suite *
capturesync_suite ()
{
  Suite *s = suite_create ("capturesync");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (s, tc);
  tcase_add_test (tc, test_quicker_stream_waits_for_the_slower_one);
  tcase_add_test (tc, test_stream_that_becomes_slower_is_a_step);
  tcase_add_test (tc, test_streams_of_different_clocks_pass_with_one_warning);
  tcase_add_test (tc, test_buffers_without_capture_time_pass_with_one_warning);
  tcase_add_test (tc, test_recording_starts_with_the_first_key_frame_set);
  tcase_add_test (tc, test_recording_leaves_out_what_another_clock_captured);
  tcase_add_test (tc, test_stream_that_has_ended_delays_no_other);
  tcase_add_test (tc, test_gap_moves_with_its_stream);
  tcase_add_test (tc, test_what_precedes_a_segment_passes_to_be_decoded_only);
  return s;
}

GST_CHECK_MAIN (capturesync);
