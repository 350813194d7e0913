/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include <map> /* before GStreamer's check header, whose macros hide names of it */

#include "../coded-check.hpp"

#include <gst/app/gstappsink.h>
#include <gst/video/video.h>

using namespace rangecast;
using namespace rangecast::testing;

static constexpr GstClockTime kFrame = GST_SECOND / 30;

static Rig
views_of (const Rig &rig, std::initializer_list<int> ids)
{
  Rig some;
  for (int id : ids)
    some.views.push_back (rig.views[id]);
  return some;
}

/* A rangedemux whose pads are all linked, each to a harness. */
struct Demux {
  GstHarness *in;
  std::map<std::string, GstHarness *> out;
  std::string told; /* what pads were added (+), removed (-), and no-more-pads (.), in order */

  Demux () : in (harness_of_sink ())
  {
    g_signal_connect (in->element, "pad-added", G_CALLBACK (added), this);
    g_signal_connect (in->element, "pad-removed", G_CALLBACK (removed), this);
    g_signal_connect (in->element, "no-more-pads", G_CALLBACK (no_more), this);
    gst_harness_play (in);
  }
  ~Demux ()
  {
    gst_element_set_state (in->element, GST_STATE_NULL);
    for (auto &[name, h] : out)
      gst_harness_teardown (h);
    gst_harness_teardown (in);
  }
  Demux (const Demux &) = delete;
  Demux &operator= (const Demux &) = delete;

  GstHarness *operator[] (int view)
  {
    const auto it = out.find ("src_" + std::to_string (view));
    fail_unless (it != out.end (), "no pad for view %d", view);
    return it->second;
  }
  GstBuffer *pull (int view)
  {
    GstBuffer *buffer = gst_harness_try_pull ((*this)[view]);
    fail_unless (buffer != nullptr, "nothing of view %d", view);
    return buffer;
  }
  GstFlowReturn push (GstBuffer *buffer) { return gst_harness_push (in, buffer); }
  void set_caps (GstCaps *caps) { gst_harness_set_src_caps (in, caps); }

private:
  static GstHarness *harness_of_sink ()
  {
    GstElement *element = gst_element_factory_make ("rangedemux", nullptr);
    GstHarness *h = gst_harness_new_with_element (element, "sink", nullptr);
    gst_object_unref (element);
    return h;
  }
  static void added (GstElement *element, GstPad *pad, Demux *self)
  {
    self->told += std::string ("+") + GST_PAD_NAME (pad);
    GstHarness *h = gst_harness_new_with_element (element, nullptr, nullptr);
    gst_harness_add_element_src_pad (h, pad);
    GstHarness *&place = self->out[GST_PAD_NAME (pad)];
    if (place)
      gst_harness_teardown (place);
    place = h;
  }
  static void removed (GstElement *, GstPad *pad, Demux *self)
  {
    if (GST_PAD_IS_SRC (pad))
      self->told += std::string ("-") + GST_PAD_NAME (pad);
  }
  static void no_more (GstElement *, Demux *self) { self->told += "."; }
};

static Rig
rig_of_pad (GstHarness *h)
{
  GstCaps *caps = gst_pad_get_current_caps (h->sinkpad);
  fail_unless (caps != nullptr);
  gstrange::RangeInfo info;
  fail_unless_ok (gstrange::parse_caps (caps, info));
  fail_unless_equals_int (info.fps_n, 30);
  gst_caps_unref (caps);
  return info.rig;
}

static const guint16 *
first_depth (GstBuffer *buffer, guint view_id)
{
  GstRangeView view;
  const GstRangeMeta *meta = gst_buffer_get_range_meta (buffer, view_id);
  fail_unless (meta && gst_range_view_map (&view, buffer, meta, GST_MAP_READ));
  const guint16 *depth = view.depth;
  gst_range_view_unmap (&view);
  return depth;
}

GST_START_TEST (test_each_view_has_a_pad_with_its_own_rig)
{
  Demux demux;
  Rig rig = ring_rig (3);
  rig.views[2].width = 100;
  rig.views[2].height = 80;
  demux.set_caps (range_caps (rig));
  fail_unless_equals_string (demux.told.c_str (), "+src_0+src_1+src_2.");
  for (int id = 0; id < 3; id++) {
    const Rig one = rig_of_pad (demux[id]);
    fail_unless_cmp (encode_rig (one), ==, encode_rig (views_of (rig, {id})));
  }
  GstCaps *caps = gst_pad_get_current_caps (demux[2]->sinkpad);
  int width = 0;
  gst_structure_get_int (gst_caps_get_structure (caps, 0), "width", &width);
  fail_unless_equals_int (width, 100);
  gst_caps_unref (caps);
}
GST_END_TEST;

GST_START_TEST (test_pixels_are_shared_and_the_rest_is_kept)
{
  Demux demux;
  const Rig rig = ring_rig (2);
  demux.set_caps (range_caps (rig));
  GstBuffer *input = make_frame_set (rig, 5 * kFrame, {100, 60, 51, 43});
  GST_BUFFER_DURATION (input) = kFrame;
  gst_buffer_get_range_meta (input, 1)->capture_time = 5 * kFrame + 7;
  GST_BUFFER_FLAG_SET (input, GST_BUFFER_FLAG_MARKER);
  fail_unless_equals_int (demux.push (gst_buffer_ref (input)), GST_FLOW_OK);
  for (guint id : {0u, 1u}) {
    GstBuffer *view = demux.pull (int (id));
    fail_unless_equals_int (gst_buffer_n_range_metas (view), 1);
    ck_assert_ptr_eq (first_depth (view, id), first_depth (input, id));
    const GstRangeMeta *meta = gst_buffer_get_range_meta (view, id);
    fail_unless_equals_int (meta->x, 100);
    fail_unless_equals_int (meta->height, 43);
    ck_assert_uint_lt (gst_buffer_get_size (view), gst_buffer_get_size (input));
    fail_unless_equals_uint64 (GST_BUFFER_PTS (view), 5 * kFrame);
    fail_unless_equals_uint64 (GST_BUFFER_DURATION (view), kFrame);
    fail_unless_equals_uint64 (gst_range_buffer_get_capture_time (view), 5 * kFrame + 7 * id);
    fail_unless (GST_BUFFER_FLAG_IS_SET (view, GST_BUFFER_FLAG_MARKER));
    fail_unless (GST_BUFFER_IS_DISCONT (view)); /* the first of its pad */
    gst_buffer_unref (view);
  }
  gst_buffer_unref (input);
}
GST_END_TEST;

GST_START_TEST (test_planes_outside_their_buffer_are_a_gap)
{
  Demux demux;
  const Rig rig = ring_rig (2);
  demux.set_caps (range_caps (rig));
  GstBuffer *input = make_frame_set (rig);
  gst_buffer_get_range_meta (input, 0)->depth_offset = gst_buffer_get_size (input) - 2;
  fail_unless_equals_int (demux.push (input), GST_FLOW_OK);
  gst_buffer_unref (demux.pull (1));
  fail_unless (gst_harness_try_pull (demux[0]) == nullptr);
}
GST_END_TEST;

GST_START_TEST (test_64_views)
{
  Demux demux;
  const Rig rig = ring_rig (64, 16, 12);
  demux.set_caps (range_caps (rig));
  GstBuffer *input = make_frame_set (rig);
  fail_unless_equals_int (demux.push (gst_buffer_ref (input)), GST_FLOW_OK);
  for (int id = 0; id < 64; id++) {
    GstBuffer *view = demux.pull (id);
    ck_assert_ptr_eq (first_depth (view, guint (id)), first_depth (input, guint (id)));
    gst_buffer_unref (view);
  }
  gst_buffer_unref (input);
}
GST_END_TEST;

GST_START_TEST (test_rangemux_puts_together_what_came_apart)
{
  GstElement *pipeline = gst_parse_launch (
      "avatartestsrc views=2 num-buffers=4 ! video/x-range,width=64,height=48 ! rangedemux name=d "
      "d.src_0 ! queue ! mux. d.src_1 ! queue ! mux. rangemux name=mux ! appsink name=out "
      "sync=false",
      nullptr);
  fail_unless (pipeline != nullptr);
  gst_element_set_state (pipeline, GST_STATE_PLAYING);
  GstElement *sink = gst_bin_get_by_name (GST_BIN (pipeline), "out");
  for (guint64 i = 0; i < 4; i++) {
    GstSample *sample = gst_app_sink_try_pull_sample (GST_APP_SINK (sink), 60 * GST_SECOND);
    fail_unless (sample != nullptr);
    GstBuffer *again = gst_sample_get_buffer (sample);
    fail_unless_equals_int (gst_buffer_n_range_metas (again), 2);
    for (guint id : {0u, 1u})
      fail_unless (gst_buffer_get_range_meta (again, id) != nullptr);
    fail_unless_equals_uint64 (GST_BUFFER_PTS (again), gst_util_uint64_scale (i, GST_SECOND, 30));
    gst_sample_unref (sample);
  }
  gst_element_set_state (pipeline, GST_STATE_NULL);
  gst_object_unref (sink);
  gst_object_unref (pipeline);
}
GST_END_TEST;

/* ---- pads, events, flow ---- */

static bool
pulls_gap (GstHarness *h, GstClockTime expected, GstClockTime expected_duration)
{
  while (GstEvent *event = gst_harness_try_pull_event (h)) {
    GstClockTime time = 0, duration = 0;
    const bool gap = GST_EVENT_TYPE (event) == GST_EVENT_GAP;
    if (gap)
      gst_event_parse_gap (event, &time, &duration);
    gst_event_unref (event);
    if (gap)
      return time == expected && duration == expected_duration;
  }
  return false;
}

GST_START_TEST (test_view_that_a_frame_set_lacks_is_a_gap_on_its_pad)
{
  Demux demux;
  const Rig rig = ring_rig (2, 32, 24);
  demux.set_caps (range_caps (rig));
  fail_unless_equals_int (demux.push (make_frame_set (rig)), GST_FLOW_OK);
  fail_unless_equals_int (demux.push (make_frame_set (views_of (rig, {0}), kFrame)), GST_FLOW_OK);
  fail_unless_equals_int (demux.push (make_frame_set (rig, 2 * kFrame)), GST_FLOW_OK);
  fail_unless_equals_int (gst_harness_buffers_received (demux[0]), 3);
  fail_unless_equals_int (gst_harness_buffers_received (demux[1]), 2);
  fail_unless (pulls_gap (demux[1], kFrame, kFrame));
  fail_if (pulls_gap (demux[0], kFrame, kFrame));
}
GST_END_TEST;

GST_START_TEST (test_views_come_and_go_with_the_rig)
{
  Demux demux;
  const Rig rig = ring_rig (3, 32, 24);
  demux.set_caps (range_caps (views_of (rig, {0, 1})));
  fail_unless_equals_int (demux.push (make_frame_set (views_of (rig, {0, 1}))), GST_FLOW_OK);
  demux.told.clear ();
  GstHarness *old = demux[0];
  demux.set_caps (range_caps (views_of (rig, {1, 2})));
  fail_unless_equals_string (demux.told.c_str (), "+src_2-src_0.");
  fail_unless (pulls_event (old, GST_EVENT_EOS));
  fail_unless_equals_int (
      demux.push (make_frame_set (views_of (rig, {1, 2}), kFrame)), GST_FLOW_OK);
  fail_unless_equals_int (gst_harness_buffers_received (demux[1]), 2);
  fail_unless_equals_int (gst_harness_buffers_received (demux[2]), 1);
  demux.set_caps (range_caps (rig)); /* back again, on a new pad */
  fail_unless_equals_int (demux.push (make_frame_set (rig, 2 * kFrame)), GST_FLOW_OK);
  fail_unless_equals_int (gst_harness_buffers_received (demux[0]), 1);
  fail_unless_equals_int (gst_harness_buffers_received (demux[1]), 3);
}
GST_END_TEST;

GST_START_TEST (test_what_sticks_reaches_pads_that_come_later)
{
  Demux demux;
  const Rig rig = ring_rig (2);
  demux.set_caps (range_caps (views_of (rig, {0})));
  GstTagList *tags = gst_tag_list_new (GST_TAG_TITLE, "somebody", nullptr);
  fail_unless (gst_harness_push_event (demux.in, gst_event_new_tag (tags)));
  GstSegment segment;
  gst_segment_init (&segment, GST_FORMAT_TIME);
  segment.start = segment.time = 5 * GST_SECOND;
  fail_unless (gst_harness_push_event (demux.in, gst_event_new_segment (&segment)));
  GstCaps *caps = range_caps (rig); /* the harness would begin a segment of its own with them */
  fail_unless (gst_harness_push_event (demux.in, gst_event_new_caps (caps)));
  gst_caps_unref (caps);
  fail_unless_equals_int (demux.push (make_frame_set (rig, 5 * GST_SECOND)), GST_FLOW_OK);
  std::vector<GstEventType> order;
  GstClockTime start = 0;
  while (GstEvent *event = gst_harness_try_pull_event (demux[1])) {
    order.push_back (GST_EVENT_TYPE (event));
    const GstSegment *told;
    if (order.back () == GST_EVENT_SEGMENT) {
      gst_event_parse_segment (event, &told);
      start = told->start;
    }
    gst_event_unref (event);
  }
  const std::vector<GstEventType> expected = {
      GST_EVENT_STREAM_START, GST_EVENT_CAPS, GST_EVENT_SEGMENT, GST_EVENT_TAG};
  fail_unless_cmp (order, ==, expected);
  fail_unless_equals_uint64 (start, 5 * GST_SECOND);
}
GST_END_TEST;

GST_START_TEST (test_end_reaches_all_pads_and_another_stream_may_follow)
{
  Demux demux;
  const Rig rig = ring_rig (2);
  demux.set_caps (range_caps (rig));
  fail_unless_equals_int (demux.push (make_frame_set (rig)), GST_FLOW_OK);
  fail_unless (gst_harness_push_event (demux.in, gst_event_new_eos ()));
  fail_unless (pulls_event (demux[0], GST_EVENT_EOS));
  fail_unless (pulls_event (demux[1], GST_EVENT_EOS));
  fail_unless (gst_harness_push_event (demux.in, gst_event_new_stream_start ("again")));
  demux.set_caps (range_caps (rig));
  GstSegment segment;
  gst_segment_init (&segment, GST_FORMAT_TIME);
  fail_unless (gst_harness_push_event (demux.in, gst_event_new_segment (&segment)));
  fail_unless_equals_int (demux.push (make_frame_set (rig)), GST_FLOW_OK);
  fail_unless_equals_int (gst_harness_buffers_received (demux[1]), 2);
}
GST_END_TEST;

GST_START_TEST (test_end_without_caps_is_one_error)
{
  Demux demux;
  ErrorCounter errors (demux.in);
  gst_harness_push_event (demux.in, gst_event_new_eos ());
  fail_unless_equals_int (errors.take (), 1);
}
GST_END_TEST;

GST_START_TEST (test_unlinked_pad_does_not_stop_the_others)
{
  Demux demux;
  const Rig rig = ring_rig (2);
  demux.set_caps (range_caps (rig));
  GstPad *src = gst_pad_get_peer (demux[0]->sinkpad);
  gst_pad_unlink (src, demux[0]->sinkpad);
  fail_unless_equals_int (demux.push (make_frame_set (rig)), GST_FLOW_OK);
  gst_buffer_unref (demux.pull (1));
  gst_pad_link (src, demux[0]->sinkpad);
  fail_unless_equals_int (demux.push (make_frame_set (rig)), GST_FLOW_OK);
  gst_buffer_unref (demux.pull (0));
  gst_object_unref (src);
}
GST_END_TEST;

static int
upstream_events (GstHarness *h, GstEventType type)
{
  int n = 0;
  while (GstEvent *event = gst_harness_try_pull_upstream_event (h)) {
    n += GST_EVENT_TYPE (event) == type;
    gst_event_unref (event);
  }
  return n;
}

GST_START_TEST (test_seek_of_all_sinks_goes_upstream_once_and_others_each)
{
  Demux demux;
  demux.set_caps (range_caps (ring_rig (2)));
  upstream_events (demux.in, GST_EVENT_SEEK);
  for (int again : {1, 2}) {
    GstEvent *seek = gst_event_new_seek (1, GST_FORMAT_TIME, GST_SEEK_FLAG_NONE, GST_SEEK_TYPE_SET,
        again * GST_SECOND, GST_SEEK_TYPE_NONE, 0);
    for (int id : {0, 1})
      fail_unless (gst_harness_push_upstream_event (demux[id], gst_event_ref (seek)));
    gst_event_unref (seek);
    fail_unless_equals_int (upstream_events (demux.in, GST_EVENT_SEEK), 1);
  }
  for (int id : {0, 1})
    gst_harness_push_upstream_event (
        demux[id], gst_event_new_qos (GST_QOS_TYPE_UNDERFLOW, 2, 5, kFrame));
  fail_unless_equals_int (upstream_events (demux.in, GST_EVENT_QOS), 2);
  gst_harness_push_upstream_event (
      demux[1], gst_video_event_new_upstream_force_key_unit (GST_CLOCK_TIME_NONE, FALSE, 0));
  fail_unless_equals_int (upstream_events (demux.in, GST_EVENT_CUSTOM_UPSTREAM), 1);
}
GST_END_TEST;

static Suite *
rangedemux_suite ()
{
  Suite *suite = suite_create ("rangedemux");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_each_view_has_a_pad_with_its_own_rig);
  tcase_add_test (tc, test_pixels_are_shared_and_the_rest_is_kept);
  tcase_add_test (tc, test_planes_outside_their_buffer_are_a_gap);
  tcase_add_test (tc, test_64_views);
  tcase_add_test (tc, test_rangemux_puts_together_what_came_apart);
  tcase_add_test (tc, test_view_that_a_frame_set_lacks_is_a_gap_on_its_pad);
  tcase_add_test (tc, test_views_come_and_go_with_the_rig);
  tcase_add_test (tc, test_what_sticks_reaches_pads_that_come_later);
  tcase_add_test (tc, test_end_reaches_all_pads_and_another_stream_may_follow);
  tcase_add_test (tc, test_end_without_caps_is_one_error);
  tcase_add_test (tc, test_unlinked_pad_does_not_stop_the_others);
  tcase_add_test (tc, test_seek_of_all_sinks_goes_upstream_once_and_others_each);
  return suite;
}

GST_CHECK_MAIN (rangedemux);
