/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* stereodepth with two cameras, with three, and with both views in one image. */
#include "../rangecast-check.hpp"

#include <glib/gstdio.h>
#include <gst/video/video.h>

#include <atomic>
#include <rangecast/rigfile/rig_file.hpp>
#include <vector>

using namespace rangecast;
using namespace rangecast::testing;

namespace {

constexpr GstClockTime kFrame = GST_SECOND / 25;
const std::string kSize = "video/x-raw,format=RGBx,width=160,height=120,framerate=25/1";
const std::string kCalibration = "focal-length=160 baseline=0.1 near=0.3 far=1.5";

/* Random dots; the right image sees them 20 pixels further left: 0.8 m away. */
GstBuffer *
dots (bool is_right, GstClockTime pts)
{
  GRand *random = g_rand_new_with_seed (5);
  std::vector<guint8> pixels (160 * 120 * 4);
  for (int y = 0; y < 120; y++) {
    guint8 row[180];
    for (guint8 &c : row)
      c = guint8 (g_rand_int (random));
    for (int x = 0; x < 160; x++)
      for (int c = 0; c < 4; c++)
        pixels[4 * (160 * y + x) + c] = row[x + (is_right ? 20 : 0)];
  }
  g_rand_free (random);
  GstBuffer *buffer = gst_buffer_new_memdup (pixels.data (), pixels.size ());
  GST_BUFFER_PTS (buffer) = pts;
  return buffer;
}

/* An element in harnesses; the third one if there is a pad for it. */
struct Stereo {
  GstHarness *left, *right, *third = nullptr;
  GstBus *bus = gst_bus_new ();

  explicit Stereo (const std::string &properties = kCalibration,
      const std::string &left_caps = kSize, const std::string &right_caps = kSize,
      const std::string &third_caps = "")
  {
    GstElement *element = gst_parse_launch (("stereodepth " + properties).c_str (), nullptr);
    gst_element_set_bus (element, bus);
    left = gst_harness_new_with_element (element, "left", "src");
    right = gst_harness_new_with_element (element, "right", nullptr);
    if (!third_caps.empty ())
      third = gst_harness_new_with_element (element, "third", nullptr);
    gst_object_unref (element);
    const std::pair<GstHarness *, const std::string &> inputs[] = {
        {left, left_caps}, {right, right_caps}, {third, third_caps}};
    for (const auto &[h, caps] : inputs)
      if (h) {
        gst_harness_set_live (h, FALSE);
        gst_harness_set_src_caps_str (h, caps.c_str ());
      }
  }
  ~Stereo ()
  {
    gst_element_set_bus (left->element, nullptr);
    gst_object_unref (bus);
    for (GstHarness *h : {third, right, left})
      if (h)
        gst_harness_teardown (h);
  }
  void push (GstHarness *h, GstClockTime pts) { gst_harness_push (h, dots (h == right, pts)); }
  void push_pair (GstClockTime pts)
  {
    push (left, pts);
    push (right, pts);
  }
  /* Takes a frame off and gives the ROI of its view. */
  Roi pull (GstClockTime pts)
  {
    GstBuffer *output = gst_harness_pull (left);
    fail_unless (output != nullptr, "'%s'", next_message_text (bus, GST_MESSAGE_ERROR, 0).c_str ());
    fail_unless_equals_uint64 (GST_BUFFER_PTS (output), pts);
    const GstRangeMeta *meta = gst_buffer_get_range_meta (output, 0);
    const Roi roi = {int (meta->x), int (meta->y), int (meta->width), int (meta->height)};
    gst_buffer_unref (output);
    return roi;
  }
  guint64 stat (const char *field) { return stats_field (left->element, field); }
  void request (guint x, guint y, guint width, guint height)
  {
    GstStructure *roi =
        gst_structure_new ("GstRangeRoi", "view-id", G_TYPE_UINT, 0, "x", G_TYPE_UINT, x, "y",
            G_TYPE_UINT, y, "width", G_TYPE_UINT, width, "height", G_TYPE_UINT, height, nullptr);
    fail_unless (gst_harness_push_upstream_event (
        left, gst_event_new_custom (GST_EVENT_CUSTOM_UPSTREAM, roi)));
  }
};

/* A rig file of the ring's first view with cameras beside and above it, 320x240. */
struct RigFile {
  gchar *path = g_strdup_printf (
      "%s/stereodepth-%d-%d.yaml", g_get_tmp_dir (), int (getpid ()), g_random_int ());

  explicit RigFile (bool with_third = true)
  {
    Rig rig = ring_rig (1);
    View &view = rig.views[0];
    view.right = PartnerCamera{view.intrinsics, {}, {kIdentity3, {-0.1, 0, 0}}};
    if (with_third)
      view.third = PartnerCamera{view.intrinsics, {}, {kIdentity3, {0, 0.1, 0}}};
    fail_unless_ok (save_rig (path, rig));
  }
  ~RigFile ()
  {
    g_unlink (path);
    g_free (path);
  }
  [[nodiscard]] std::string property () const { return std::string ("rig=") + path; }
};

/* The text of the only error after a pair of images. */
std::string
error_of (const std::string &properties, const std::string &right_caps = kSize,
    const std::string &left_caps = kSize, const std::string &third_caps = "")
{
  Stereo s (properties, left_caps, right_caps, third_caps);
  if (s.third) {
    GstBuffer *buffer = gst_buffer_new_allocate (nullptr, 160 * 120 * 4, nullptr);
    gst_buffer_memset (buffer, 0, 77, 160 * 120 * 4);
    GST_BUFFER_PTS (buffer) = 0;
    gst_harness_push (s.third, buffer);
  }
  s.push_pair (0);
  const std::string text = next_message_text (s.bus, GST_MESSAGE_ERROR);
  GstMessage *another = gst_bus_pop_filtered (s.bus, GST_MESSAGE_ERROR);
  fail_unless (another == nullptr, "a second error after '%s'", text.c_str ());
  return text;
}

} // namespace

GST_START_TEST (test_depth_is_that_of_the_disparity_at_the_left_cameras_capture_time)
{
  Stereo s;
  GstBuffer *left = dots (false, 0);
  gst_range_buffer_set_capture_time (left, 987654321);
  gst_harness_push (s.left, left);
  s.push (s.right, 0);
  GstBuffer *output = gst_harness_pull (s.left);
  fail_unless_equals_uint64 (gst_range_buffer_get_capture_time (output), 987654321);
  fail_unless_equals_uint64 (GST_BUFFER_DURATION (output), kFrame);
  {
    gstrange::RangeFrameMap frame (output, GST_MAP_READ);
    const RangeImage &image = frame.views ()[0];
    fail_unless_cmp (image.roi, ==, (Roi{0, 0, 160, 120}));
    int right = 0;
    for (int y = 10; y < 110; y++)
      for (int x = 40; x < 150; x++)
        right += std::abs (image.depth.at (x, y) - 8000) < 100;
    fail_unless (right > 100 * 110 * 95 / 100, "%d pixels at 0.8 m", right);
  }
  gst_buffer_unref (output);
}
GST_END_TEST;

GST_START_TEST (test_pairs_by_pts_not_by_arrival)
{
  Stereo s;
  s.push (s.left, 0);
  s.push (s.right, kFrame);     /* the right image of frame 0 was lost */
  s.push (s.left, kFrame + 10); /* within half a frame */
  s.pull (kFrame + 10);
  fail_unless_equals_uint64 (s.stat ("dropped-left"), 1);
  fail_unless_equals_uint64 (s.stat ("dropped-right"), 0);
}
GST_END_TEST;

GST_START_TEST (test_only_the_requested_part_is_matched_until_the_refresh)
{
  Stereo s (kCalibration + " refresh-interval=3");
  for (int i = 0; i < 5; i++) {
    s.push_pair (i * kFrame);
    fail_unless_cmp (
        s.pull (i * kFrame), ==, (i == 0 || i == 3 ? Roi{0, 0, 160, 120} : Roi{50, 20, 60, 70}));
    if (i == 0)
      s.request (50, 20, 60, 70);
  }
  fail_unless_equals_uint64 (s.stat ("restricted-frames"), 3);
}
GST_END_TEST;

GST_START_TEST (test_everything_is_matched_after_a_break_or_a_change_and_not_after_a_lost_image)
{
  Stereo s (kCalibration + " refresh-interval=100");
  const struct {
    GstClockTime pts;
    bool full, changed; /* somebody comes in at the top */
  } frames[] = {{0, true, false}, {kFrame, false, false}, {3 * kFrame, false, false},
      {4 * kFrame, true, true}, {5 * kFrame, false, true}, {3 * GST_SECOND, true, true},
      {3 * GST_SECOND + kFrame, false, true}, {2 * kFrame, true, true}, {3 * kFrame, false, true}};
  for (const auto &frame : frames) {
    GstBuffer *left = dots (false, frame.pts);
    if (frame.changed)
      gst_buffer_memset (left, 0, 255, 160 * 4 * 60);
    gst_harness_push (s.left, left);
    s.push (s.right, frame.pts);
    fail_unless_equals_int (s.pull (frame.pts).width, frame.full ? 160 : 60);
    if (frame.pts == 0)
      s.request (50, 70, 60, 40);
  }
}
GST_END_TEST;

GST_START_TEST (test_latency_is_that_of_the_slower_camera_and_its_own)
{
  Stereo s (kCalibration + " latency=7000000");
  gst_harness_set_live (s.left, TRUE);
  gst_harness_set_live (s.right, TRUE);
  gst_harness_set_upstream_latency (s.left, 10 * GST_MSECOND);
  gst_harness_set_upstream_latency (s.right, 30 * GST_MSECOND);
  fail_unless_equals_uint64 (gst_harness_query_latency (s.left), 37 * GST_MSECOND);
}
GST_END_TEST;

GST_START_TEST (test_rig_of_another_size_is_scaled_to_the_images)
{
  RigFile rig;
  Stereo s (rig.property ());
  s.push_pair (0);
  s.pull (0);
  GstCaps *caps = gst_pad_get_current_caps (s.left->sinkpad);
  gstrange::RangeInfo info;
  fail_unless_ok (gstrange::parse_caps (caps, info));
  const View &view = info.rig.views[0];
  fail_unless_equals_int (view.width, 160);
  fail_unless_equals_int (view.height, 120);
  fail_unless_equals_float (view.intrinsics.fx, 160);
  fail_unless_equals_float (view.intrinsics.cx, 79.5); /* (159.5 + 0.5) / 2 - 0.5 */
  gst_caps_unref (caps);
}
GST_END_TEST;

GST_START_TEST (test_bad_settings_are_one_error_that_names_them)
{
  const std::string raw = "video/x-raw,format=RGBx,framerate=25/1,";
  fail_unless_contains (
      error_of (kCalibration, raw + "width=80,height=240"), "pad right is 80x240");
  fail_unless_contains (error_of (""), "focal-length");
  fail_unless_contains (error_of ("focal-length=0.8 baseline=0.1"), "focal-length in pixels");
  fail_unless_contains (error_of ("rig=/no/rig.yaml"), "/no/rig.yaml");
  fail_unless_contains (error_of ("focal-length=160 baseline=0.1 near=0.05"), "near");
  const RigFile rig, pair (false);
  fail_unless_contains (error_of (rig.property () + " view-id=7"), "no view with view-id 7");
  const std::string square = raw + "width=160,height=160";
  fail_unless_contains (error_of (rig.property (), square, square), "160x160");
  fail_unless_contains (error_of (pair.property (), kSize, kSize, kSize), "pad third");
  fail_unless_contains (
      error_of (rig.property (), kSize, kSize, raw + "width=80,height=60"), "pad third is 80x60");
}
GST_END_TEST;

GST_START_TEST (test_changes_states_twice)
{
  GstElement *pipeline = gst_parse_launch (
      "avatartestsrc name=c num-buffers=2 c.left ! queue ! d.left c.right ! queue ! "
      "d.right stereodepth name=d focal-length=320 baseline=0.1 ! fakesink",
      nullptr);
  for (int i = 0; i < 2; i++)
    play_to_the_end (pipeline);
  gst_object_unref (pipeline);
}
GST_END_TEST;

/* The next GAP that comes out, after whatever must be before it. */
static void
expect_gap (Stereo &s, GstClockTime begin, GstClockTime length)
{
  GstEventType type = GST_EVENT_UNKNOWN;
  GstClockTime time = 0, duration = 0;
  while (type != GST_EVENT_GAP) {
    GstEvent *event = gst_harness_pull_event (s.left);
    fail_unless (event != nullptr, "no GAP");
    type = GST_EVENT_TYPE (event);
    if (type == GST_EVENT_GAP)
      gst_event_parse_gap (event, &time, &duration);
    gst_event_unref (event);
  }
  GstEvent *segment = gst_pad_get_sticky_event (s.left->sinkpad, GST_EVENT_SEGMENT, 0);
  fail_unless (segment != nullptr, "a GAP before the segment");
  gst_event_unref (segment);
  fail_unless_equals_uint64 (time, begin);
  fail_unless_equals_uint64 (duration, length);
}

GST_START_TEST (test_gaps_are_gaps_of_the_output)
{
  Stereo s;
  s.push_pair (0);
  s.pull (0);
  for (GstHarness *h : {s.left, s.right})
    gst_harness_push_event (h, gst_event_new_gap (kFrame, 9 * kFrame));
  expect_gap (s, kFrame, 9 * kFrame);
  s.push_pair (10 * kFrame);
  s.pull (10 * kFrame);
  s.push (s.left, 11 * kFrame); /* dropped, too */
  gst_harness_push_event (s.right, gst_event_new_gap (11 * kFrame, kFrame));
  expect_gap (s, 11 * kFrame, kFrame);
}
GST_END_TEST;

GST_START_TEST (test_gap_after_a_flush_follows_a_segment)
{
  Stereo s;
  s.push_pair (0);
  s.pull (0);
  const guint32 seek = gst_util_seqnum_next (); /* the same for both: one flush of the element */
  for (const bool start : {true, false})
    for (GstHarness *h : {s.left, s.right}) {
      GstEvent *event = start ? gst_event_new_flush_start () : gst_event_new_flush_stop (TRUE);
      gst_event_set_seqnum (event, seek);
      gst_harness_push_event (h, event);
    }
  while (GstEvent *event = gst_harness_try_pull_event (s.left))
    gst_event_unref (event);
  GstSegment segment;
  gst_segment_init (&segment, GST_FORMAT_TIME);
  for (GstHarness *h : {s.left, s.right}) {
    gst_harness_push_event (h, gst_event_new_segment (&segment));
    gst_harness_push_event (h, gst_event_new_gap (0, kFrame));
  }
  expect_gap (s, 0, kFrame);
}
GST_END_TEST;

GST_START_TEST (test_late_frames_are_dropped_before_matching_and_reported)
{
  for (const bool qos : {true, false}) {
    Stereo s (kCalibration + (qos ? "" : " qos=false"));
    s.push_pair (0);
    s.pull (0);
    gst_harness_push_upstream_event (
        s.left, gst_event_new_qos (GST_QOS_TYPE_UNDERFLOW, 2.0, kFrame, 0));
    for (int i = 1; i < 4; i++)
      s.push_pair (i * kFrame);
    /* Not live, as many frames again as are late are skipped. */
    GstBuffer *output = gst_harness_pull (s.left);
    fail_unless_equals_uint64 (GST_BUFFER_PTS (output), (qos ? 3 : 1) * kFrame);
    fail_unless_equals_int (GST_BUFFER_IS_DISCONT (output), qos);
    gst_buffer_unref (output);
    fail_unless_equals_uint64 (s.stat ("dropped-late"), qos ? 2 : 0);
    GstMessage *message = gst_bus_pop_filtered (s.bus, GST_MESSAGE_QOS);
    ck_assert_int_eq ((message != nullptr), qos);
    gst_clear_message (&message);
  }
}
GST_END_TEST;

GST_START_TEST (test_cameras_whose_images_never_pair_up_are_one_warning)
{
  const std::string caps = "video/x-raw,format=RGBx,width=160,height=120,framerate=0/1";
  Stereo s (kCalibration, caps, caps);
  for (int i = 0; i < 150; i++) {
    s.push (s.left, i * kFrame);
    s.push (s.right, i * kFrame + kFrame / 2);
  }
  fail_unless_contains (next_message_text (s.bus, GST_MESSAGE_WARNING), "do not pair up");
  fail_unless (gst_bus_pop_filtered (s.bus, GST_MESSAGE_WARNING) == nullptr);
}
GST_END_TEST;

/* With GStreamer 1.26 the tee's thread would wait for ever, and its other branch not end. */
GST_START_TEST (test_a_tee_before_a_stream_ends_with_the_other_stream)
{
  RigFile rig;
  const std::string line = "videotestsrc num-buffers=2 ! " + kSize +
                           " ! d.left videotestsrc num-buffers=50 ! " + kSize +
                           " ! tee name=t ! queue max-size-buffers=1 ! d.right t. ! queue ! "
                           "fakesink stereodepth name=d " +
                           rig.property () + " ! ";
  for (const char *sink : {"fakesink", "fakesink num-buffers=1"}) { /* EOS from downstream, too */
    GstElement *pipeline = gst_parse_launch ((line + sink).c_str (), nullptr);
    play_to_the_end (pipeline);
    gst_object_unref (pipeline);
  }
}
GST_END_TEST;

/* As after the end of one stream: a flush begins anew. */
GST_START_TEST (test_inputs_that_have_ended_take_a_new_stream)
{
  const std::string caps = "video/x-raw,format=RGBx,width=160,height=120,framerate=25/1";
  Stereo s (kCalibration, caps, caps);
  s.push_pair (0);
  s.pull (0);
  gst_harness_push_event (s.left, gst_event_new_eos ());
  GstFlowReturn flow = GST_FLOW_OK;
  for (int i = 1; flow == GST_FLOW_OK && i < 50; i++)
    flow = gst_harness_push (s.right, gst_harness_create_buffer (s.right, 160 * 120 * 4));
  fail_unless_equals_int (flow, GST_FLOW_EOS);
  const guint32 seqnum = gst_util_seqnum_next ();
  for (const bool stop : {false, true})
    for (GstHarness *h : {s.left, s.right}) {
      GstEvent *event = stop ? gst_event_new_flush_stop (TRUE) : gst_event_new_flush_start ();
      gst_event_set_seqnum (event, seqnum);
      gst_harness_push_event (h, event);
    }
  GstSegment segment;
  gst_segment_init (&segment, GST_FORMAT_TIME);
  for (GstHarness *h : {s.left, s.right})
    gst_harness_push_event (h, gst_event_new_segment (&segment));
  s.push_pair (0);
  s.pull (0);
}
GST_END_TEST;

/* ---- three cameras ---- */

/* At half of the rate, until it ends. */
GST_START_TEST (test_third_camera_takes_part_while_it_has_images)
{
  RigFile rig;
  const std::string camera = "videotestsrc num-buffers=8 ! " + kSize;
  const std::string line =
      camera + " ! d.left " + camera + " ! d.right " + camera +
      " ! videorate drop-only=true ! video/x-raw,framerate=25/2 ! identity eos-after=3 ! d.third "
      "stereodepth name=d n-threads=2 " +
      rig.property () + " ! fakesink";
  GstElement *pipeline = gst_parse_launch (line.c_str (), nullptr);
  GstElement *d = gst_bin_get_by_name (GST_BIN (pipeline), "d");
  play_to_the_end (pipeline);
  fail_unless_equals_uint64 (stats_field (d, "frames"), 8);
  fail_unless_equals_uint64 (stats_field (d, "third-frames"), 2);
  gst_object_unref (d);
  gst_object_unref (pipeline);
}
GST_END_TEST;

GST_START_TEST (test_live_a_silent_third_camera_costs_the_latency_and_no_frame)
{
  RigFile rig;
  Stereo s ("latency=20000000 " + rig.property (), kSize, kSize, kSize);
  gst_harness_use_testclock (s.left);
  for (GstHarness *h : {s.left, s.right, s.third})
    gst_harness_set_live (h, TRUE);
  gst_harness_play (s.left);
  for (int i = 0; i < 4; i++) {
    s.push_pair (i * kFrame);
    if (i == 3) { /* it is back */
      s.push (s.third, i * kFrame);
    } else {
      fail_unless (gst_harness_wait_for_clock_id_waits (s.left, 1, 5));
      GstTestClock *clock = gst_harness_get_testclock (s.left);
      GstClockID waited = nullptr;
      gst_test_clock_wait_for_next_pending_id (clock, &waited);
      const GstClockTime deadline = gst_clock_id_get_time (waited) - i * kFrame;
      ck_assert_uint_le (deadline, 20 * GST_MSECOND);
      fail_unless ((i > 0 || deadline == 20 * GST_MSECOND));
      gst_clock_id_unref (waited);
      gst_object_unref (clock);
      fail_unless (gst_harness_crank_single_clock_wait (s.left));
    }
    s.pull (i * kFrame);
  }
  fail_unless_equals_uint64 (s.stat ("third-frames"), 1);
  fail_unless_equals_uint64 (s.stat ("dropped-left"), 0);
}
GST_END_TEST;

/* ---- both views in one image ---- */

static GstSample *
pull_sample (GstElement *pipeline)
{
  GstElement *sink = gst_bin_get_by_name (GST_BIN (pipeline), "out");
  GstSample *sample = nullptr;
  g_signal_emit_by_name (sink, "try-pull-sample", guint64{600 * GST_SECOND}, &sample);
  gst_object_unref (sink);
  fail_unless (sample != nullptr);
  return sample;
}

static const std::string kDepth = "stereodepth focal-length=320 baseline=0.1 near=0.45 far=1.3 ";

/* Depths of the first frame. */
static std::vector<guint16>
depth_of (const std::string &source, const std::string &packing)
{
  GstElement *pipeline = gst_parse_launch (
      (source + "d.left " + kDepth + packing + " name=d ! appsink sync=false name=out").c_str (),
      nullptr);
  gst_element_set_state (pipeline, GST_STATE_PLAYING);
  GstSample *sample = pull_sample (pipeline);
  std::vector<guint16> depths;
  {
    gstrange::RangeFrameMap frame (gst_sample_get_buffer (sample), GST_MAP_READ);
    const auto &depth = frame.views ()[0].depth;
    fail_unless_equals_int (depth.width, 320);
    for (int y = 0; y < depth.height; y++)
      depths.insert (depths.end (), depth.row (y), depth.row (y) + depth.width);
  }
  gst_sample_unref (sample);
  gst_element_set_state (pipeline, GST_STATE_NULL);
  gst_object_unref (pipeline);
  return depths;
}

/* Halves of an image have rows that are longer than they need be. */
GST_START_TEST (test_halves_of_an_image_give_the_depth_of_two_cameras)
{
  const auto packed = [] (const char *first, const char *second, const char *place,
                          const std::string &after) {
    return std::string ("avatartestsrc name=a num-buffers=2  a.") + first +
           " ! queue ! m.sink_0  a." + second +
           " ! queue ! m.sink_1  compositor name=m sink_1::" + place + "  ! " + after + " ! ";
  };
  const std::string caps = "capssetter caps=video/x-raw,multiview-mode=";
  const auto expected = depth_of (
      "avatartestsrc name=a num-buffers=2  a.right ! queue ! d.right  a.left ! queue ! ", "");
  ck_assert_int_gt (expected.size () - std::count (expected.begin (), expected.end (), 0), 5000);
  fail_unless (depth_of (packed ("left", "right", "xpos=320", "identity"),
                   "packing=side-by-side") == expected);
  fail_unless (
      depth_of (packed ("left", "right", "ypos=240", caps + "top-bottom"), "") == expected);
  fail_unless (
      depth_of (packed ("left", "right", "ypos=240", "videoconvert ! video/x-raw,format=BGR"),
          "packing=top-bottom") == expected);
  fail_unless (depth_of (packed ("right", "left", "xpos=320",
                             caps + "side-by-side,multiview-flags="
                                    "(GstVideoMultiviewFlagsSet)1:ffffffff"),
                   "") == expected);
}
GST_END_TEST;

GST_START_TEST (test_input_that_cannot_be_divided_is_one_error)
{
  const std::pair<const char *, const char *> cases[] = {
      {"videotestsrc num-buffers=2 ! video/x-raw,width=641,height=48 ! d.left ",
          "641x48 do not divide"},
      {"videotestsrc num-buffers=2 ! video/x-raw,width=640,height=48 ! d.left "
       "videotestsrc num-buffers=2 ! d.right ",
          "pad right is linked"}};
  for (const auto &[source, error] : cases) {
    GstElement *pipeline = gst_parse_launch (
        (source + kDepth + "packing=side-by-side name=d ! fakesink").c_str (), nullptr);
    GstBus *bus = gst_element_get_bus (pipeline);
    gst_element_set_state (pipeline, GST_STATE_PLAYING);
    fail_unless_contains (next_message_text (bus, GST_MESSAGE_ERROR), error);
    gst_element_set_state (pipeline, GST_STATE_NULL);
    gst_object_unref (bus);
    gst_object_unref (pipeline);
  }
}
GST_END_TEST;

GST_START_TEST (test_seeks)
{
  GstElement *pipeline =
      gst_parse_launch (("videotestsrc num-buffers=1000 ! video/x-raw,width=640,height=240 ! "
                         "d.left " +
                            kDepth +
                            "packing=side-by-side name=d ! appsink sync=false max-buffers=1 "
                            "name=out")
                            .c_str (),
          nullptr);
  gst_element_set_state (pipeline, GST_STATE_PLAYING);
  for (const GstClockTime time : {20 * GST_SECOND, 2 * GST_SECOND}) {
    gst_sample_unref (pull_sample (pipeline));
    gst_element_seek_simple (pipeline, GST_FORMAT_TIME, GST_SEEK_FLAG_FLUSH, gint64 (time));
    bool found = false;
    for (int i = 0; i < 5 && !found; i++) {
      GstSample *sample = pull_sample (pipeline);
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

static Suite *
stereodepth_suite ()
{
  Suite *suite = suite_create ("stereodepth");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_depth_is_that_of_the_disparity_at_the_left_cameras_capture_time);
  tcase_add_test (tc, test_pairs_by_pts_not_by_arrival);
  tcase_add_test (tc, test_only_the_requested_part_is_matched_until_the_refresh);
  tcase_add_test (
      tc, test_everything_is_matched_after_a_break_or_a_change_and_not_after_a_lost_image);
  tcase_add_test (tc, test_latency_is_that_of_the_slower_camera_and_its_own);
  tcase_add_test (tc, test_rig_of_another_size_is_scaled_to_the_images);
  tcase_add_test (tc, test_bad_settings_are_one_error_that_names_them);
  tcase_add_test (tc, test_changes_states_twice);
  tcase_add_test (tc, test_gaps_are_gaps_of_the_output);
  tcase_add_test (tc, test_gap_after_a_flush_follows_a_segment);
  tcase_add_test (tc, test_late_frames_are_dropped_before_matching_and_reported);
  tcase_add_test (tc, test_cameras_whose_images_never_pair_up_are_one_warning);
  tcase_add_test (tc, test_a_tee_before_a_stream_ends_with_the_other_stream);
  tcase_add_test (tc, test_inputs_that_have_ended_take_a_new_stream);
  tcase_add_test (tc, test_third_camera_takes_part_while_it_has_images);
  tcase_add_test (tc, test_live_a_silent_third_camera_costs_the_latency_and_no_frame);
  tcase_add_test (tc, test_halves_of_an_image_give_the_depth_of_two_cameras);
  tcase_add_test (tc, test_input_that_cannot_be_divided_is_one_error);
  tcase_add_test (tc, test_seeks);
  return suite;
}

GST_CHECK_MAIN (stereodepth);
