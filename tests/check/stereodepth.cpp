/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "rangecast-check.hpp"

#include <glib/gstdio.h>
#include <gst/video/video.h>

#include <vector>

using namespace rangecast;
using namespace rangecast::testing;

static constexpr GstClockTime kFrame = GST_SECOND / 25;
static constexpr const char *kSmall = "video/x-raw,format=RGBx,width=160,height=120,framerate=25/1";
static constexpr const char *kProperties = "focal-length=160 baseline=0.1 near=0.3 far=1.5";

struct Stereo {
  GstHarness *left, *right;
  GstBus *bus = gst_bus_new ();

  explicit Stereo (const std::string &properties = kProperties,
      const char *left_caps = "video/x-raw,format=RGBx,width=160,height=120,framerate=25/1",
      const char *right_caps = "video/x-raw,format=RGBx,width=160,height=120,framerate=25/1")
  {
    GstElement *element = gst_parse_launch (("stereodepth " + properties).c_str (), nullptr);
    gst_element_set_bus (element, bus);
    left = gst_harness_new_with_element (element, "left", "src");
    right = gst_harness_new_with_element (element, "right", nullptr);
    gst_harness_set_live (left, FALSE);
    gst_harness_set_live (right, FALSE);
    gst_object_unref (element);
    gst_harness_set_src_caps_str (left, left_caps);
    gst_harness_set_src_caps_str (right, right_caps);
  }
  ~Stereo ()
  {
    gst_element_set_bus (left->element, nullptr);
    gst_object_unref (bus);
    gst_harness_teardown (right);
    gst_harness_teardown (left);
  }
  /* Random dots; the right picture sees them 20 pixels further left: 0.8 m away. */
  static GstBuffer *dots (bool is_right, GstClockTime pts)
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
  void push (GstHarness *h, GstClockTime pts) { gst_harness_push (h, dots (h == right, pts)); }
  guint64 stat (const char *field)
  {
    GstStructure *stats;
    guint64 value = G_MAXUINT64;
    g_object_get (left->element, "stats", &stats, nullptr);
    gst_structure_get_uint64 (stats, field, &value);
    gst_structure_free (stats);
    return value;
  }
};

GST_START_TEST (test_depth_is_that_of_the_disparity)
{
  Stereo s;
  s.push (s.left, 0);
  s.push (s.right, 0);
  GstBuffer *output = gst_harness_pull (s.left);
  {
    gstrange::RangeFrameMap frame (output, GST_MAP_READ);
    const RangeImage &image = frame.views ()[0];
    fail_unless (image.roi == (Roi{0, 0, 160, 120}));
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
  s.push (s.right, kFrame);     /* the right picture of frame 0 was lost */
  s.push (s.left, kFrame + 10); /* within half a frame */
  GstBuffer *output = gst_harness_pull (s.left);
  fail_unless_equals_uint64 (GST_BUFFER_PTS (output), kFrame + 10);
  fail_unless_equals_uint64 (s.stat ("dropped-left"), 1);
  fail_unless_equals_uint64 (s.stat ("dropped-right"), 0);
  gst_buffer_unref (output);
}
GST_END_TEST;

GST_START_TEST (test_capture_time_is_the_left_cameras)
{
  Stereo s;
  GstBuffer *left = Stereo::dots (false, 0);
  gst_range_buffer_set_capture_time (left, 987654321);
  gst_harness_push (s.left, left);
  s.push (s.right, 0);
  GstBuffer *output = gst_harness_pull (s.left);
  fail_unless_equals_uint64 (gst_range_buffer_get_capture_time (output), 987654321);
  fail_unless_equals_uint64 (GST_BUFFER_DURATION (output), kFrame);
  gst_buffer_unref (output);
}
GST_END_TEST;

static std::string
error_of (const std::string &properties, const char *right_caps,
    const char *left_caps = "video/x-raw,format=RGBx,width=160,height=120,framerate=25/1")
{
  Stereo s (properties, left_caps, right_caps);
  s.push (s.left, 0);
  s.push (s.right, 0);
  const std::string text = next_message_text (s.bus, GST_MESSAGE_ERROR);
  GstMessage *another = gst_bus_pop_filtered (s.bus, GST_MESSAGE_ERROR);
  fail_unless (another == nullptr, "a second error after '%s'", text.c_str ());
  return text;
}

static void
want (Stereo &s, guint x, guint y, guint width, guint height)
{
  GstStructure *roi = gst_structure_new ("GstRangeRoi", "view-id", G_TYPE_UINT, 0, "x", G_TYPE_UINT,
      x, "y", G_TYPE_UINT, y, "width", G_TYPE_UINT, width, "height", G_TYPE_UINT, height, nullptr);
  fail_unless (gst_harness_push_upstream_event (
      s.left, gst_event_new_custom (GST_EVENT_CUSTOM_UPSTREAM, roi)));
}

GST_START_TEST (test_only_the_wanted_part_is_matched_until_the_refresh)
{
  Stereo s (std::string (kProperties) + " refresh-interval=3");
  for (int i = 0; i < 5; i++) {
    s.push (s.left, i * kFrame);
    s.push (s.right, i * kFrame);
    GstBuffer *output = gst_harness_pull (s.left);
    const GstRangeMeta *meta = gst_buffer_get_range_meta (output, 0);
    const bool full = i == 0 || i == 3;
    fail_unless_equals_int (meta->width, full ? 160 : 60);
    fail_unless_equals_int (meta->x, full ? 0 : 50);
    gst_buffer_unref (output);
    if (i == 0)
      want (s, 50, 20, 60, 70);
  }
  fail_unless_equals_uint64 (s.stat ("restricted-frames"), 3);
}
GST_END_TEST;

GST_START_TEST (test_a_change_outside_the_wanted_part_is_matched_at_once)
{
  Stereo s (std::string (kProperties) + " refresh-interval=1000");
  for (int i = 0; i < 4; i++) {
    GstBuffer *left = Stereo::dots (false, i * kFrame);
    if (i >= 2) /* somebody comes in at the left */
      gst_buffer_memset (left, 0, 255, 160 * 4 * 60);
    gst_harness_push (s.left, left);
    s.push (s.right, i * kFrame);
    GstBuffer *output = gst_harness_pull (s.left);
    const bool full = i == 0 || i == 2; /* and stays: in picture 3 nothing is new */
    fail_unless_equals_int (gst_buffer_get_range_meta (output, 0)->width, full ? 160 : 60);
    gst_buffer_unref (output);
    if (i == 0)
      want (s, 50, 70, 60, 40);
  }
}
GST_END_TEST;

/* Pushes a pair of that format with rows that are longer than they need be; gives what is seen
 * 0.8 m away, in per cent of the right half, where the right camera sees all. */
static int
seen_right (Stereo &s, GstVideoFormat format, int padding)
{
  for (GstHarness *h : {s.left, s.right}) {
    GstBuffer *rgbx = Stereo::dots (h == s.right, 0);
    GstMapInfo from;
    gst_buffer_map (rgbx, &from, GST_MAP_READ);
    GstVideoInfo info;
    gst_video_info_set_format (&info, format, 160, 120);
    const int n = GST_VIDEO_INFO_COMP_PSTRIDE (&info, 0), stride = 160 * n + padding;
    gsize offset[GST_VIDEO_MAX_PLANES] = {gsize (padding), gsize (padding) + 120 * stride,
        gsize (padding) + 120 * stride + 60 * stride};
    gint strides[GST_VIDEO_MAX_PLANES] = {stride, stride, stride};
    GstBuffer *buffer = gst_buffer_new_allocate (nullptr, padding + 240 * stride, nullptr);
    gst_buffer_memset (buffer, 0, 128, gst_buffer_get_size (buffer));
    for (int y = 0; y < 120; y++)
      for (int x = 0; x < 160; x++)
        for (int c = 0; c < n; c++)
          gst_buffer_fill (
              buffer, offset[0] + y * stride + x * n + c, from.data + 4 * (160 * y + x), 1);
    gst_buffer_add_video_meta_full (buffer, GST_VIDEO_FRAME_FLAG_NONE, format, 160, 120,
        GST_VIDEO_INFO_N_PLANES (&info), offset, strides);
    gst_buffer_unmap (rgbx, &from);
    gst_buffer_unref (rgbx);
    GST_BUFFER_PTS (buffer) = 0;
    gst_harness_push (h, buffer);
  }
  GstBuffer *output = gst_harness_pull (s.left);
  fail_unless (output != nullptr);
  int seen = 0;
  {
    gstrange::RangeFrameMap frame (output, GST_MAP_READ);
    for (int y = 0; y < 120; y++)
      for (int x = 80; x < 160; x++)
        seen += std::abs (frame.views ()[0].depth.at (x, y) - 8000) < 100;
  }
  gst_buffer_unref (output);
  return 100 * seen / (80 * 120);
}

GST_START_TEST (test_every_format_and_padded_rows_give_the_same_depth)
{
  for (GstVideoFormat format :
      {GST_VIDEO_FORMAT_RGBx, GST_VIDEO_FORMAT_BGR, GST_VIDEO_FORMAT_GRAY8, GST_VIDEO_FORMAT_I420})
    for (int padding : {0, 48}) {
      const std::string caps =
          std::string ("video/x-raw,width=160,height=120,framerate=25/1,format=") +
          gst_video_format_to_string (format);
      Stereo s (kProperties, caps.c_str (), caps.c_str ());
      const int seen = seen_right (s, format, padding);
      fail_unless (seen >= 90, "%s, %d bytes padding: %d %%", gst_video_format_to_string (format),
          padding, seen);
    }
}
GST_END_TEST;

GST_START_TEST (test_flush_forgets_the_picture_that_waited)
{
  Stereo s;
  s.push (s.left, 0);
  for (GstHarness *h : {s.left, s.right}) {
    gst_harness_push_event (h, gst_event_new_flush_start ());
    gst_harness_push_event (h, gst_event_new_flush_stop (TRUE));
    GstSegment segment;
    gst_segment_init (&segment, GST_FORMAT_TIME);
    gst_harness_push_event (h, gst_event_new_segment (&segment));
  }
  s.push (s.left, 5 * kFrame);
  s.push (s.right, 5 * kFrame);
  GstBuffer *output = gst_harness_pull (s.left);
  fail_unless_equals_uint64 (GST_BUFFER_PTS (output), 5 * kFrame);
  gst_buffer_unref (output);
  fail_unless_equals_uint64 (s.stat ("frames"), 1);
  fail_unless_equals_uint64 (s.stat ("dropped-left"), 0);
}
GST_END_TEST;

GST_START_TEST (test_new_size_in_the_stream_gives_new_caps)
{
  Stereo s;
  s.push (s.left, 0);
  s.push (s.right, 0);
  gst_buffer_unref (gst_harness_pull (s.left));
  for (GstHarness *h : {s.left, s.right})
    gst_harness_set_src_caps_str (h, "video/x-raw,format=RGBx,width=80,height=120,framerate=25/1");
  for (GstHarness *h : {s.left, s.right}) {
    GstBuffer *half = Stereo::dots (h == s.right, kFrame);
    gst_buffer_set_size (half, 80 * 120 * 4);
    gst_harness_push (h, half);
  }
  GstBuffer *output = gst_harness_pull (s.left);
  fail_unless_equals_int (gst_buffer_get_range_meta (output, 0)->width, 80);
  gst_buffer_unref (output);
  GstCaps *caps = gst_pad_get_current_caps (s.left->sinkpad);
  gint width = 0;
  gst_structure_get_int (gst_caps_get_structure (caps, 0), "width", &width);
  fail_unless_equals_int (width, 80);
  gst_caps_unref (caps);
}
GST_END_TEST;

GST_START_TEST (test_gap_on_one_pad_costs_the_others_picture_and_nothing_else)
{
  Stereo s;
  gst_harness_push_event (s.right, gst_event_new_gap (0, kFrame));
  s.push (s.left, 0);
  s.push (s.left, kFrame);
  s.push (s.right, kFrame);
  GstBuffer *output = gst_harness_pull (s.left);
  fail_unless_equals_uint64 (GST_BUFFER_PTS (output), kFrame);
  gst_buffer_unref (output);
  fail_unless_equals_uint64 (s.stat ("dropped-left"), 1);
}
GST_END_TEST;

GST_START_TEST (test_latency_is_that_of_the_slower_camera_and_its_own)
{
  Stereo s (std::string (kProperties) + " latency=7000000");
  gst_harness_set_live (s.left, TRUE);
  gst_harness_set_live (s.right, TRUE);
  gst_harness_set_upstream_latency (s.left, 10 * GST_MSECOND);
  gst_harness_set_upstream_latency (s.right, 30 * GST_MSECOND);
  fail_unless_equals_uint64 (gst_harness_query_latency (s.left), 37 * GST_MSECOND);
}
GST_END_TEST;

/* A rig file of the ring's first view with cameras beside and above it, 320x240. */
struct RigFile {
  gchar *path;

  explicit RigFile (bool with_third = true)
      : path (g_strdup_printf (
            "%s/stereodepth-%d-%d.yaml", g_get_tmp_dir (), int (getpid ()), g_random_int ()))
  {
    Rig rig = ring_rig (1);
    View &view = rig.views[0];
    view.right = PartnerCamera{view.intrinsics, {}, {kIdentity3, {-0.1, 0, 0}}};
    if (with_third)
      view.third = PartnerCamera{view.intrinsics, {}, {kIdentity3, {0, 0.1, 0}}};
    fail_unless (save_rig (path, rig).ok ());
  }
  ~RigFile ()
  {
    g_unlink (path);
    g_free (path);
  }
  std::string property () const { return std::string ("rig=") + path; }
};

GST_START_TEST (test_rig_without_the_view_or_of_another_shape_is_one_error)
{
  const char *same = "video/x-raw,format=RGBx,width=160,height=120,framerate=25/1";
  const char *square = "video/x-raw,format=RGBx,width=160,height=160,framerate=25/1";
  RigFile rig;
  const std::string missing = error_of (rig.property () + " view-id=7", same);
  fail_unless (missing.find ("no view with view-id 7") != std::string::npos, missing.c_str ());
  const std::string shape = error_of (rig.property (), square, square);
  fail_unless (shape.find (rig.path) != std::string::npos, shape.c_str ());
  fail_unless (shape.find ("320x240") != std::string::npos, shape.c_str ());
  fail_unless (shape.find ("160x160") != std::string::npos, shape.c_str ());
}
GST_END_TEST;

GST_START_TEST (test_rig_of_another_size_is_scaled_to_the_pictures)
{
  RigFile rig;
  Stereo s (rig.property ());
  s.push (s.left, 0);
  s.push (s.right, 0);
  GstBuffer *output = gst_harness_pull (s.left);
  fail_unless (output != nullptr, "%s", next_message_text (s.bus, GST_MESSAGE_ERROR).c_str ());
  GstCaps *caps = gst_pad_get_current_caps (s.left->sinkpad);
  gstrange::RangeInfo info;
  fail_unless (gstrange::parse_caps (caps, info).ok ());
  const View &view = info.rig.views[0];
  fail_unless_equals_int (view.width, 160);
  fail_unless_equals_int (view.height, 120);
  fail_unless_equals_float (view.intrinsics.fx, 160);
  fail_unless_equals_float (view.intrinsics.cx, 79.5); /* (159.5 + 0.5) / 2 - 0.5 */
  {
    gstrange::RangeFrameMap frame (output, GST_MAP_READ);
    fail_unless (std::abs (frame.views ()[0].depth.at (100, 60) - 8000) < 100);
  }
  gst_caps_unref (caps);
  gst_buffer_unref (output);
}
GST_END_TEST;

GST_START_TEST (test_bad_settings_are_one_error_that_names_them)
{
  const char *same = "video/x-raw,format=RGBx,width=160,height=120,framerate=25/1";
  const char *larger = "video/x-raw,format=RGBx,width=80,height=240,framerate=25/1";
  fail_unless (error_of (kProperties, larger).find ("pad right is 80x240") != std::string::npos);
  fail_unless (error_of ("", same).find ("focal-length") != std::string::npos);
  fail_unless (error_of ("rig=/no/rig.yaml", same).find ("/no/rig.yaml") != std::string::npos);
  fail_unless (error_of ("focal-length=160 baseline=0.1 near=0.05", same).find ("near") !=
               std::string::npos);
  fail_unless (error_of (std::string (kProperties) + " block-size=4", same).find ("block size") !=
               std::string::npos);
}
GST_END_TEST;

GST_START_TEST (test_end_of_one_pad_ends_the_stream)
{
  Stereo s;
  s.push (s.left, 0);
  s.push (s.right, 0);
  gst_buffer_unref (gst_harness_pull (s.left));
  gst_harness_push_event (s.right, gst_event_new_eos ());
  s.push (s.left, kFrame);
  bool eos = false;
  while (!eos) {
    GstEvent *event = gst_harness_pull_event (s.left);
    fail_unless (event != nullptr);
    eos = GST_EVENT_TYPE (event) == GST_EVENT_EOS;
    gst_event_unref (event);
  }
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

/* A pipeline of the test scene whose rig is exported, run to its end. @param links  of element d;
 * gives the element, transfer full, and what its bus said. */
static std::string
play_scene (const std::string &source, const std::string &links, const std::string &properties,
    GstMessageType wanted, GstStructure **stats)
{
  gchar *rig = g_strdup_printf ("%s/stereodepth-scene-%d.yaml", g_get_tmp_dir (), int (getpid ()));
  GstElement *exporter = gst_parse_launch (
      (std::string ("avatartestsrc views=1 rig-export=") + rig).c_str (), nullptr);
  gst_element_set_state (exporter, GST_STATE_PAUSED);
  gst_element_set_state (exporter, GST_STATE_NULL);
  gst_object_unref (exporter);
  const std::string line = "avatartestsrc views=1 name=c " + source + " " + links +
                           " stereodepth name=d rig=" + rig + " " + properties + " ! fakesink";
  GError *error = nullptr;
  GstElement *pipeline = gst_parse_launch (line.c_str (), &error);
  fail_unless (pipeline && !error, "%s: %s", line.c_str (), error ? error->message : "");
  gst_element_set_state (pipeline, GST_STATE_PLAYING);
  GstBus *bus = gst_element_get_bus (pipeline);
  std::string text;
  for (bool end = false; !end;) {
    GstMessage *message = gst_bus_timed_pop_filtered (bus, 60 * GST_SECOND,
        GstMessageType (GST_MESSAGE_EOS | GST_MESSAGE_ERROR | GST_MESSAGE_WARNING));
    fail_unless (message != nullptr, "no end");
    end = GST_MESSAGE_TYPE (message) != GST_MESSAGE_WARNING;
    if (GST_MESSAGE_TYPE (message) == wanted && wanted != GST_MESSAGE_EOS) {
      GError *said = nullptr;
      if (wanted == GST_MESSAGE_ERROR)
        gst_message_parse_error (message, &said, nullptr);
      else
        gst_message_parse_warning (message, &said, nullptr);
      text += std::string (said->message) + "\n";
      g_error_free (said);
    } else
      fail_unless (GST_MESSAGE_TYPE (message) != GST_MESSAGE_ERROR, "an error");
    gst_message_unref (message);
  }
  GstElement *d = gst_bin_get_by_name (GST_BIN (pipeline), "d");
  if (stats)
    g_object_get (d, "stats", stats, nullptr);
  gst_object_unref (d);
  gst_object_unref (bus);
  gst_element_set_state (pipeline, GST_STATE_NULL);
  gst_object_unref (pipeline);
  g_unlink (rig);
  g_free (rig);
  return text;
}

static guint64
field (const GstStructure *stats, const char *name)
{
  guint64 value = G_MAXUINT64;
  fail_unless (gst_structure_get_uint64 (stats, name, &value), "no %s", name);
  return value;
}

static const std::string kLeftRight = "c.left ! queue ! d.left c.right ! queue ! d.right";

GST_START_TEST (test_third_camera_takes_part_in_every_frame)
{
  GstStructure *stats = nullptr;
  play_scene ("num-buffers=4", kLeftRight + " c.third ! queue ! d.third", "steady=0.5 n-threads=2",
      GST_MESSAGE_EOS, &stats);
  fail_unless_equals_uint64 (field (stats, "frames"), 4);
  fail_unless_equals_uint64 (field (stats, "third-frames"), 4);
  gst_structure_free (stats);
}
GST_END_TEST;

GST_START_TEST (test_third_camera_of_half_the_rate_takes_part_in_half_of_the_frames)
{
  GstStructure *stats = nullptr;
  play_scene ("num-buffers=8",
      kLeftRight + " c.third ! video/x-raw,framerate=25/1 ! videorate drop-only=true ! "
                   "video/x-raw,framerate=25/2 ! queue ! "
                   "d.third",
      "", GST_MESSAGE_EOS, &stats);
  fail_unless_equals_uint64 (field (stats, "frames"), 8);
  const guint64 third = field (stats, "third-frames");
  fail_unless (third >= 3 && third <= 5, "%d of 8", int (third));
  gst_structure_free (stats);
}
GST_END_TEST;

GST_START_TEST (test_third_camera_that_ends_leaves_two)
{
  GstStructure *stats = nullptr;
  play_scene ("num-buffers=6", kLeftRight + " c.third ! identity eos-after=2 ! queue ! d.third", "",
      GST_MESSAGE_EOS, &stats);
  fail_unless_equals_uint64 (field (stats, "frames"), 6);
  fail_unless (field (stats, "third-frames") < 6);
  gst_structure_free (stats);
}
GST_END_TEST;

GST_START_TEST (test_right_camera_of_half_the_rate_halves_the_output)
{
  GstStructure *stats = nullptr;
  play_scene ("num-buffers=8",
      "c.left ! queue ! d.left c.right ! video/x-raw,framerate=25/1 ! videorate drop-only=true ! "
      "video/x-raw,framerate=25/2 ! "
      "queue ! d.right",
      "", GST_MESSAGE_EOS, &stats);
  const guint64 frames = field (stats, "frames");
  fail_unless (frames >= 3 && frames <= 4, "%d of 8", int (frames));
  fail_unless (field (stats, "dropped-left") >= 3);
  fail_unless_equals_uint64 (field (stats, "dropped-right"), 0);
  gst_structure_free (stats);
}
GST_END_TEST;

GST_START_TEST (test_exchanged_cameras_are_one_warning_that_names_the_cure)
{
  const std::string text =
      play_scene ("num-buffers=3", "c.left ! queue ! d.right c.right ! queue ! d.left",
          "refresh-interval=1", GST_MESSAGE_WARNING, nullptr);
  fail_unless (text.find ("swap") != std::string::npos, "'%s'", text.c_str ());
  fail_unless (text.find ('\n') == text.size () - 1, "more than one: %s", text.c_str ());
  fail_unless (play_scene ("num-buffers=3", kLeftRight, "", GST_MESSAGE_WARNING, nullptr).empty ());
}
GST_END_TEST;

/* Left, right and a third camera of a rig, 160x120. */
struct Trio {
  RigFile rig;
  Stereo s;
  GstPad *pad;
  GstHarness *third;

  explicit Trio (const char *properties = "", bool calibrated = true)
      : rig (calibrated), s (rig.property () + " " + properties)
  {
    pad = gst_element_request_pad_simple (s.left->element, "third");
    third = gst_harness_new_with_element (s.left->element, "third", nullptr);
    gst_harness_set_live (third, FALSE);
    gst_harness_set_src_caps_str (third, kSmall);
  }
  ~Trio ()
  {
    gst_harness_teardown (third);
    gst_object_unref (pad);
  }
  void push_pair (GstClockTime pts)
  {
    s.push (s.left, pts);
    s.push (s.right, pts);
  }
  /* A picture of random bytes. */
  static void push_noise (GstHarness *h, int width, int height, int bytes, GstClockTime pts)
  {
    GstBuffer *buffer = gst_buffer_new_allocate (nullptr, width * height * bytes, nullptr);
    gst_buffer_memset (buffer, 0, 77, gst_buffer_get_size (buffer));
    GST_BUFFER_PTS (buffer) = pts;
    gst_harness_push (h, buffer);
  }
  void pull (GstClockTime pts, int width = 160)
  {
    GstBuffer *output = gst_harness_pull (s.left);
    fail_unless (output != nullptr, "'%s'", next_message_text (s.bus, GST_MESSAGE_ERROR).c_str ());
    fail_unless_equals_uint64 (GST_BUFFER_PTS (output), pts);
    fail_unless_equals_int (gst_buffer_get_range_meta (output, 0)->width, width);
    gst_buffer_unref (output);
  }
};

static void
expect_one_error (Trio &t, const char *what)
{
  const std::string text = next_message_text (t.s.bus, GST_MESSAGE_ERROR);
  fail_unless (text.find ("pad third") != std::string::npos, "'%s'", text.c_str ());
  fail_unless (text.find (what) != std::string::npos, "'%s'", text.c_str ());
  GstMessage *another = gst_bus_pop_filtered (t.s.bus, GST_MESSAGE_ERROR);
  fail_unless (another == nullptr, "a second error after '%s'", text.c_str ());
}

GST_START_TEST (test_third_camera_without_calibration_is_one_error)
{
  Trio t ("", false);
  t.s.push (t.third, 0);
  t.push_pair (0);
  expect_one_error (t, "no calibration");
}
GST_END_TEST;

GST_START_TEST (test_third_camera_of_another_size_is_one_error)
{
  Trio t;
  gst_harness_set_src_caps_str (
      t.third, "video/x-raw,format=GRAY8,width=80,height=60,framerate=25/1");
  Trio::push_noise (t.third, 80, 60, 1, 0);
  t.push_pair (0);
  expect_one_error (t, "80x60");
}
GST_END_TEST;

/* Left and right change from grey to colour, whose pictures are larger, while a grey pair waits for
 * its third picture. */
GST_START_TEST (test_pair_that_waits_for_the_third_is_read_as_it_came)
{
  Trio t;
  t.s.push (t.third, 0);
  for (GstHarness *h : {t.s.left, t.s.right}) {
    gst_harness_set_src_caps_str (
        h, "video/x-raw,format=GRAY8,width=160,height=120,framerate=25/1");
    Trio::push_noise (h, 160, 120, 1, kFrame);
  }
  for (GstHarness *h : {t.s.left, t.s.right})
    gst_harness_set_src_caps_str (h, kSmall);
  t.push_pair (2 * kFrame);
  t.s.push (t.third, kFrame);
  t.pull (kFrame);
  t.s.push (t.third, 2 * kFrame);
  t.pull (2 * kFrame);
  fail_unless_equals_uint64 (t.s.stat ("third-frames"), 2);
}
GST_END_TEST;

GST_START_TEST (test_all_three_cameras_may_change_their_size_one_after_the_other)
{
  static const char *kLarge = "video/x-raw,format=GRAY8,width=320,height=240,framerate=25/1";
  Trio t;
  t.push_pair (0);
  /* The third camera's picture 0 was lost; its next is larger, as are those of the others. */
  gst_harness_set_src_caps_str (t.third, kLarge);
  Trio::push_noise (t.third, 320, 240, 1, kFrame);
  t.pull (0);
  for (GstHarness *h : {t.s.left, t.s.right}) {
    gst_harness_set_src_caps_str (h, kLarge);
    Trio::push_noise (h, 320, 240, 1, kFrame);
  }
  t.pull (kFrame, 320);
  fail_unless_equals_uint64 (t.s.stat ("third-frames"), 1);
}
GST_END_TEST;

GST_START_TEST (test_third_pad_that_is_released_is_forgotten)
{
  Trio t ("", false); /* not calibrated: an error if it counted */
  GstQuery *query = gst_query_new_allocation (nullptr, FALSE);
  gst_pad_peer_query (t.third->srcpad, query); /* after it, the caps have been seen */
  gst_query_unref (query);
  gst_element_release_request_pad (t.s.left->element, t.pad);
  t.push_pair (0);
  t.pull (0);
}
GST_END_TEST;

GST_START_TEST (test_live_a_silent_third_camera_costs_the_latency_and_no_frame)
{
  RigFile rig;
  GstElement *element =
      gst_parse_launch (("stereodepth latency=20000000 " + rig.property ()).c_str (), nullptr);
  GstHarness *left = gst_harness_new_with_element (element, "left", "src");
  GstHarness *right = gst_harness_new_with_element (element, "right", nullptr);
  GstHarness *third = gst_harness_new_with_element (element, "third", nullptr);
  gst_object_unref (element);
  gst_harness_use_testclock (left);
  for (GstHarness *h : {left, right, third}) {
    gst_harness_set_live (h, TRUE);
    gst_harness_set_src_caps_str (h, kSmall);
  }
  gst_harness_play (left);
  for (int i = 0; i < 4; i++) {
    gst_harness_push (left, Stereo::dots (false, i * kFrame));
    gst_harness_push (right, Stereo::dots (true, i * kFrame));
    if (i == 3) /* it is back */
      gst_harness_push (third, Stereo::dots (false, i * kFrame));
    else {
      fail_unless (gst_harness_wait_for_clock_id_waits (left, 1, 5));
      GstTestClock *clock = gst_harness_get_testclock (left);
      GstClockID waited = nullptr;
      gst_test_clock_wait_for_next_pending_id (clock, &waited);
      const GstClockTime deadline = gst_clock_id_get_time (waited) - i * kFrame;
      fail_unless (deadline <= 20 * GST_MSECOND && (i > 0 || deadline == 20 * GST_MSECOND));
      gst_clock_id_unref (waited);
      gst_object_unref (clock);
      fail_unless (gst_harness_crank_single_clock_wait (left));
    }
    GstBuffer *output = gst_harness_pull (left);
    fail_unless (output != nullptr);
    fail_unless_equals_uint64 (GST_BUFFER_PTS (output), i * kFrame);
    gst_buffer_unref (output);
  }
  GstStructure *stats;
  g_object_get (left->element, "stats", &stats, nullptr);
  fail_unless_equals_uint64 (field (stats, "third-frames"), 1);
  fail_unless_equals_uint64 (field (stats, "dropped-left"), 0);
  gst_structure_free (stats);
  for (GstHarness *h : {third, right, left})
    gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_live_the_stream_ends_though_the_third_camera_is_silent)
{
  RigFile rig;
  const std::string camera = std::string ("videotestsrc is-live=true num-buffers=3 ! ") + kSmall;
  const std::string line = camera + " ! d.left " + camera + " ! d.right " + camera +
                           " ! valve drop=true ! d.third stereodepth name=d latency=40000000 " +
                           rig.property () + " ! fakesink";
  GstElement *pipeline = gst_parse_launch (line.c_str (), nullptr);
  play_to_the_end (pipeline);
  gst_object_unref (pipeline);
}
GST_END_TEST;

GST_START_TEST (test_wanted_part_outlives_caps_of_the_same_size)
{
  Stereo s (std::string (kProperties) + " refresh-interval=1000");
  s.push (s.left, 0);
  s.push (s.right, 0);
  gst_buffer_unref (gst_harness_pull (s.left));
  want (s, 50, 20, 60, 70);
  for (GstHarness *h : {s.left, s.right})
    gst_harness_set_src_caps_str (h, "video/x-raw,format=RGBA,width=160,height=120,framerate=25/1");
  for (int i = 1; i < 3; i++) { /* the first one as a whole: nothing is known of it */
    s.push (s.left, i * kFrame);
    s.push (s.right, i * kFrame);
    GstBuffer *output = gst_harness_pull (s.left);
    if (i == 2)
      fail_unless_equals_int (gst_buffer_get_range_meta (output, 0)->width, 60);
    gst_buffer_unref (output);
  }
}
GST_END_TEST;

/* The next GAP that comes out, and nothing but what must be before it. */
static void
expect_gap (Stereo &s, GstClockTime begin, GstClockTime length)
{
  for (bool segment = false;;) {
    GstEvent *event = gst_harness_pull_event (s.left);
    fail_unless (event != nullptr, "no GAP");
    const GstEventType type = GST_EVENT_TYPE (event);
    GstClockTime time = 0, duration = 0;
    if (type == GST_EVENT_GAP)
      gst_event_parse_gap (event, &time, &duration);
    gst_event_unref (event);
    segment |= type == GST_EVENT_SEGMENT;
    if (type != GST_EVENT_GAP)
      continue;
    fail_unless (segment, "a GAP before the segment");
    fail_unless_equals_uint64 (time, begin);
    fail_unless_equals_uint64 (duration, length);
    return;
  }
}

GST_START_TEST (test_gap_on_both_pads_is_a_gap)
{
  Stereo s;
  for (GstHarness *h : {s.left, s.right})
    gst_harness_push_event (h, gst_event_new_gap (0, 10 * kFrame));
  expect_gap (s, 0, 10 * kFrame);
  s.push (s.left, 10 * kFrame);
  s.push (s.right, 10 * kFrame);
  gst_buffer_unref (gst_harness_pull (s.left));
}
GST_END_TEST;

GST_START_TEST (test_gap_that_takes_a_picture_with_it_is_a_gap)
{
  Stereo s;
  s.push (s.left, 0);
  gst_harness_push_event (s.right, gst_event_new_gap (0, kFrame));
  expect_gap (s, 0, kFrame);
}
GST_END_TEST;

GST_START_TEST (test_gap_after_a_flush_follows_a_segment)
{
  Stereo s;
  s.push (s.left, 0);
  s.push (s.right, 0);
  gst_buffer_unref (gst_harness_pull (s.left));
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

GST_START_TEST (test_late_frames_are_dropped_before_matching_and_said)
{
  for (const bool qos : {true, false}) {
    Stereo s (std::string (kProperties) + (qos ? "" : " qos=false"));
    s.push (s.left, 0);
    s.push (s.right, 0);
    gst_buffer_unref (gst_harness_pull (s.left));
    gst_harness_push_upstream_event (
        s.left, gst_event_new_qos (GST_QOS_TYPE_UNDERFLOW, 2.0, kFrame, 0));
    for (int i = 1; i < 4; i++) {
      s.push (s.left, i * kFrame);
      s.push (s.right, i * kFrame);
    }
    GstBuffer *output = gst_harness_pull (s.left);
    /* Not live, twice what is late already is left out. */
    fail_unless_equals_uint64 (GST_BUFFER_PTS (output), (qos ? 3 : 1) * kFrame);
    fail_unless_equals_int (GST_BUFFER_IS_DISCONT (output), qos);
    gst_buffer_unref (output);
    fail_unless_equals_uint64 (s.stat ("dropped-late"), qos ? 2 : 0);
    GstMessage *message = gst_bus_pop_filtered (s.bus, GST_MESSAGE_QOS);
    fail_unless ((message != nullptr) == qos);
    gst_clear_message (&message);
  }
}
GST_END_TEST;

GST_START_TEST (test_sources_with_padded_rows_need_not_copy)
{
  Stereo s;
  GstCaps *caps = gst_caps_from_string (kSmall);
  GstQuery *query = gst_query_new_allocation (caps, FALSE);
  fail_unless (gst_pad_peer_query (s.left->srcpad, query));
  fail_unless (gst_query_find_allocation_meta (query, GST_VIDEO_META_API_TYPE, nullptr));
  gst_query_unref (query);
  gst_caps_unref (caps);
}
GST_END_TEST;

GST_START_TEST (test_without_a_framerate_pictures_5_ms_apart_are_a_pair)
{
  const char *caps = "video/x-raw,format=RGBx,width=160,height=120,framerate=0/1";
  Stereo s (kProperties, caps, caps);
  s.push (s.left, kFrame);
  s.push (s.right, kFrame + 5 * GST_MSECOND);
  gst_buffer_unref (gst_harness_pull (s.left));
  s.push (s.left, 2 * kFrame);
  s.push (s.right, 2 * kFrame + 5 * GST_MSECOND + 1); /* too far */
  s.push (s.left, 3 * kFrame);
  s.push (s.right, 3 * kFrame);
  GstBuffer *output = gst_harness_pull (s.left);
  fail_unless_equals_uint64 (GST_BUFFER_PTS (output), 3 * kFrame);
  gst_buffer_unref (output);
}
GST_END_TEST;

GST_START_TEST (test_cameras_that_never_take_a_picture_at_once_are_one_warning)
{
  const char *caps = "video/x-raw,format=RGBx,width=160,height=120,framerate=0/1";
  Stereo s (kProperties, caps, caps);
  for (int i = 0; i < 150; i++) {
    s.push (s.left, i * kFrame);
    s.push (s.right, i * kFrame + kFrame / 2);
  }
  const std::string text = next_message_text (s.bus, GST_MESSAGE_WARNING);
  fail_unless (text.find ("pairs") != std::string::npos, "'%s'", text.c_str ());
  fail_unless (gst_bus_pop_filtered (s.bus, GST_MESSAGE_WARNING) == nullptr);
}
GST_END_TEST;

static Suite *
stereodepth_suite ()
{
  Suite *suite = suite_create ("stereodepth");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_depth_is_that_of_the_disparity);
  tcase_add_test (tc, test_pairs_by_pts_not_by_arrival);
  tcase_add_test (tc, test_capture_time_is_the_left_cameras);
  tcase_add_test (tc, test_only_the_wanted_part_is_matched_until_the_refresh);
  tcase_add_test (tc, test_a_change_outside_the_wanted_part_is_matched_at_once);
  tcase_add_test (tc, test_every_format_and_padded_rows_give_the_same_depth);
  tcase_add_test (tc, test_flush_forgets_the_picture_that_waited);
  tcase_add_test (tc, test_new_size_in_the_stream_gives_new_caps);
  tcase_add_test (tc, test_gap_on_one_pad_costs_the_others_picture_and_nothing_else);
  tcase_add_test (tc, test_latency_is_that_of_the_slower_camera_and_its_own);
  tcase_add_test (tc, test_rig_without_the_view_or_of_another_shape_is_one_error);
  tcase_add_test (tc, test_rig_of_another_size_is_scaled_to_the_pictures);
  tcase_add_test (tc, test_bad_settings_are_one_error_that_names_them);
  tcase_add_test (tc, test_end_of_one_pad_ends_the_stream);
  tcase_add_test (tc, test_changes_states_twice);
  tcase_add_test (tc, test_third_camera_takes_part_in_every_frame);
  tcase_add_test (tc, test_third_camera_of_half_the_rate_takes_part_in_half_of_the_frames);
  tcase_add_test (tc, test_third_camera_that_ends_leaves_two);
  tcase_add_test (tc, test_right_camera_of_half_the_rate_halves_the_output);
  tcase_add_test (tc, test_exchanged_cameras_are_one_warning_that_names_the_cure);
  tcase_add_test (tc, test_third_camera_without_calibration_is_one_error);
  tcase_add_test (tc, test_third_camera_of_another_size_is_one_error);
  tcase_add_test (tc, test_pair_that_waits_for_the_third_is_read_as_it_came);
  tcase_add_test (tc, test_all_three_cameras_may_change_their_size_one_after_the_other);
  tcase_add_test (tc, test_third_pad_that_is_released_is_forgotten);
  tcase_add_test (tc, test_live_a_silent_third_camera_costs_the_latency_and_no_frame);
  tcase_add_test (tc, test_live_the_stream_ends_though_the_third_camera_is_silent);
  tcase_add_test (tc, test_wanted_part_outlives_caps_of_the_same_size);
  tcase_add_test (tc, test_gap_on_both_pads_is_a_gap);
  tcase_add_test (tc, test_gap_that_takes_a_picture_with_it_is_a_gap);
  tcase_add_test (tc, test_gap_after_a_flush_follows_a_segment);
  tcase_add_test (tc, test_late_frames_are_dropped_before_matching_and_said);
  tcase_add_test (tc, test_sources_with_padded_rows_need_not_copy);
  tcase_add_test (tc, test_without_a_framerate_pictures_5_ms_apart_are_a_pair);
  tcase_add_test (tc, test_cameras_that_never_take_a_picture_at_once_are_one_warning);
  return suite;
}

GST_CHECK_MAIN (stereodepth);
