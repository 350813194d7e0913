/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "../rangecast-check.hpp"

#include <glib/gstdio.h>

#include <algorithm>
#include <vector>

using namespace rangecast;
using namespace rangecast::testing;

/* A wall 1.2 m away; with somebody, a red box of 60 x 80 pixels 0.7 m away before it. */
static GstBuffer *
scene (const Rig &rig, GstClockTime pts, bool somebody)
{
  GstBuffer *buffer = make_frame_set (rig, pts);
  gstrange::RangeFrameMap frame (buffer, GST_MAP_READWRITE);
  for (const RangeImage &image : frame.views ())
    for (int y = 0; y < image.roi.height; y++)
      for (int x = 0; x < image.roi.width; x++) {
        const bool person = somebody && x >= 100 && x < 160 && y >= 90 && y < 170;
        image.depth.at (x, y) = person ? 7000 : 12000;
        image.colour.at (x, y) = person ? Rgbx{200, 60, 50, 0} : Rgbx{110, 115, 120, 0};
      }
  return buffer;
}

static GstHarness *
roi_harness (const Rig &rig, const char *launch)
{
  GstHarness *h = gst_harness_new_parse (launch);
  gst_harness_set_src_caps (h, gstrange::make_range_caps (gstrange::make_info (rig, 30, 1)));
  return h;
}

static Roi
roi_of (GstBuffer *buffer, guint view_id)
{
  const GstRangeMeta *meta = gst_buffer_get_range_meta (buffer, view_id);
  return {int (meta->x), int (meta->y), int (meta->width), int (meta->height)};
}

/* Pushes one and gives the ROI of view 0 that came out. */
static Roi
push (GstHarness *h, GstBuffer *buffer)
{
  GstBuffer *output = gst_harness_push_and_pull (h, buffer);
  const Roi roi = roi_of (output, 0);
  gst_buffer_unref (output);
  return roi;
}

/* The ROIs of view 0 that upstream was told. */
static std::vector<Roi>
rois_told (GstHarness *h)
{
  std::vector<Roi> told;
  while (GstEvent *event = gst_harness_try_pull_upstream_event (h)) {
    const GstStructure *s = gst_event_get_structure (event);
    if (s && gst_structure_has_name (s, "GstRangeRoi")) {
      guint view, x, y, width, height;
      fail_unless (gst_structure_get (s, "view-id", G_TYPE_UINT, &view, "x", G_TYPE_UINT, &x, "y",
          G_TYPE_UINT, &y, "width", G_TYPE_UINT, &width, "height", G_TYPE_UINT, &height, nullptr));
      fail_unless_equals_int (view, 0);
      told.push_back ({int (x), int (y), int (width), int (height)});
    }
    gst_event_unref (event);
  }
  return told;
}

GST_START_TEST (test_learns_then_crops_to_the_person_without_copying)
{
  const Rig rig = ring_rig (2);
  GstHarness *h = roi_harness (rig, "roiextract background-frames=3");
  for (int i = 0; i < 3; i++)
    fail_unless (push (h, scene (rig, i, false)).empty ());
  GstBuffer *input = scene (rig, 3, true);
  GstMemory *memory = gst_buffer_peek_memory (input, 0);
  GstBuffer *output = gst_harness_push_and_pull (h, input);
  ck_assert_ptr_eq (gst_buffer_peek_memory (output, 0), memory);
  fail_unless_cmp (roi_of (output, 0), ==, (Roi{100, 90, 60, 80}));
  fail_unless_cmp (roi_of (output, 1), ==, (Roi{100, 90, 60, 80}));
  fail_unless_equals_uint64 (GST_BUFFER_PTS (output), 3);
  fail_unless_equals_uint64 (gst_range_buffer_get_capture_time (output), 3);
  {
    gstrange::RangeFrameMap frame (output, GST_MAP_READ);
    fail_unless_equals_int (frame.views ()[1].depth.at (0, 0), 7000);
    fail_unless_equals_int (frame.views ()[1].colour.at (59, 79).r, 200);
  }
  gst_buffer_unref (output);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_learning_is_reported_view_by_view)
{
  const Rig rig = ring_rig (2);
  GstHarness *h = roi_harness (rig, "roiextract background-frames=20");
  GstBus *bus = gst_bus_new ();
  gst_element_set_bus (h->element, bus);
  for (int i = 0; i < 25; i++)
    push (h, scene (rig, i, false));
  std::vector<int> frames[2];
  while (GstMessage *message = gst_bus_pop_filtered (bus, GST_MESSAGE_ELEMENT)) {
    const GstStructure *s = gst_message_get_structure (message);
    int view = -1, learnt = -1, of = -1;
    if (gst_structure_has_name (s, "roiextract-learning")) {
      fail_unless (gst_structure_get (s, "view-id", G_TYPE_INT, &view, "frames", G_TYPE_INT,
          &learnt, "of", G_TYPE_INT, &of, nullptr));
      fail_unless_equals_int (of, 20);
      frames[view].push_back (learnt);
    }
    gst_message_unref (message);
  }
  const std::vector<int> expected = {1, 3, 5, 7, 9, 11, 13, 15, 17, 19, 20};
  fail_unless (frames[0] == expected && frames[1] == expected);
  gst_element_set_bus (h->element, nullptr);
  gst_object_unref (bus);
  gst_harness_teardown (h);
}
GST_END_TEST;

/* A wall nearer than the one that was learnt, as after a camera was moved; in a quarter of its
 * pixels stereo finds no depth. */
GST_START_TEST (test_picture_that_is_all_foreground_is_one_warning)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = roi_harness (rig, "roiextract background-frames=2");
  GstBus *bus = gst_bus_new ();
  gst_element_set_bus (h->element, bus);
  for (int i = 0; i < 70; i++) {
    GstBuffer *buffer = scene (rig, i, false);
    if (i >= 2) {
      gstrange::RangeFrameMap frame (buffer, GST_MAP_READWRITE);
      const RangeImage &image = frame.views ()[0];
      for (int y = 0; y < image.roi.height; y++) {
        std::fill_n (image.depth.row (y), image.roi.width, guint16{8000});
        std::fill_n (image.depth.row (y), image.roi.width / 4, guint16{0});
      }
    }
    push (h, buffer);
  }
  fail_unless_contains (next_message_text (bus, GST_MESSAGE_WARNING), "capture-background");
  fail_unless (gst_bus_pop_filtered (bus, GST_MESSAGE_WARNING) == nullptr);
  gst_element_set_bus (h->element, nullptr);
  gst_object_unref (bus);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_nobody_is_an_empty_roi_and_no_error)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = roi_harness (rig, "roiextract background-frames=2");
  for (int i = 0; i < 5; i++)
    fail_unless (push (h, scene (rig, i, false)).empty ());
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_frames_before_the_camera_has_settled_teach_nothing)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = roi_harness (rig, "roiextract settle-frames=2 background-frames=1");
  for (int i = 0; i < 2; i++)
    fail_unless (push (h, scene (rig, i, true)).empty ());
  fail_unless (push (h, scene (rig, 2, false)).empty ());
  fail_unless_cmp (push (h, scene (rig, 3, true)), ==, (Roi{100, 90, 60, 80}));
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_margin_grows_the_roi)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = roi_harness (rig, "roiextract background-frames=1 margin=5");
  push (h, scene (rig, 0, false));
  fail_unless_cmp (push (h, scene (rig, 1, true)), ==, (Roi{95, 85, 70, 90}));
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_capture_background_learns_again)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = roi_harness (rig, "roiextract background-frames=2");
  for (int i = 0; i < 2; i++)
    push (h, scene (rig, i, false));
  fail_if (push (h, scene (rig, 2, true)).empty ());
  GstElement *element = gst_harness_find_element (h, "roiextract");
  g_signal_emit_by_name (element, "capture-background");
  gst_object_unref (element);
  for (int i = 3; i < 5; i++)
    fail_unless (push (h, scene (rig, i, true)).empty ());
  fail_unless (push (h, scene (rig, 5, true)).empty ());
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_learning_again_asks_for_the_whole_picture)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = roi_harness (rig, "roiextract background-frames=1");
  push (h, scene (rig, 0, false));
  push (h, scene (rig, 1, true));
  fail_unless_equals_int (rois_told (h).size (), 1);
  GstElement *element = gst_harness_find_element (h, "roiextract");
  g_signal_emit_by_name (element, "capture-background");
  gst_object_unref (element);
  push (h, scene (rig, 2, true));
  const std::vector<Roi> told = rois_told (h);
  fail_unless_equals_int (told.size (), 1);
  fail_unless (told[0].empty ());
  gst_harness_teardown (h);
}
GST_END_TEST;

/* The list and the image of view 0. */
static void
remove_background (const gchar *path)
{
  std::string image = path;
  image.replace (image.rfind (".yml"), 4, "-0.pgm");
  g_unlink (path);
  fail_unless_equals_int (g_unlink (image.c_str ()), 0);
}

GST_START_TEST (test_new_caps_leave_a_captured_background_alone)
{
  const Rig rig = ring_rig (1);
  gchar *path = g_strdup_printf ("%s/roi-caps-%d.yml", g_get_tmp_dir (), int (getpid ()));
  gchar *save = g_strdup_printf ("roiextract background-frames=1 save-background=%s", path);
  gchar *load = g_strdup_printf ("roiextract background-frames=1 background-file=%s", path);
  GstHarness *h = roi_harness (rig, save);
  push (h, scene (rig, 0, false));
  gst_harness_teardown (h);
  h = roi_harness (rig, load);
  GstElement *element = gst_harness_find_element (h, "roiextract");
  g_signal_emit_by_name (element, "capture-background");
  gst_object_unref (element);
  push (h, scene (rig, 0, true)); /* the box belongs to the background from now on */
  gst_harness_set_src_caps (h, gstrange::make_range_caps (gstrange::make_info (rig, 60, 1)));
  fail_unless (push (h, scene (rig, 1, true)).empty ());
  gst_harness_teardown (h);
  remove_background (path);
  g_free (path);
  g_free (save);
  g_free (load);
}
GST_END_TEST;

GST_START_TEST (test_flush_gap_and_eos_keep_the_background)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = roi_harness (rig, "roiextract background-frames=1");
  push (h, scene (rig, 0, false));
  gst_harness_push_event (h, gst_event_new_gap (1, 1));
  fail_unless (gst_harness_push_event (h, gst_event_new_flush_start ()));
  fail_unless (gst_harness_push_event (h, gst_event_new_flush_stop (TRUE)));
  GstSegment segment;
  gst_segment_init (&segment, GST_FORMAT_TIME);
  gst_harness_push_event (h, gst_event_new_segment (&segment));
  fail_unless_cmp (push (h, scene (rig, 2, true)), ==, (Roi{100, 90, 60, 80}));
  fail_unless (gst_harness_push_event (h, gst_event_new_eos ()));
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_background_is_saved_and_loaded)
{
  const Rig rig = ring_rig (1);
  gchar *path = g_strdup_printf ("%s/roi-%d.yml", g_get_tmp_dir (), int (getpid ()));
  gchar *save = g_strdup_printf ("roiextract background-frames=2 save-background=%s", path);
  gchar *load = g_strdup_printf ("roiextract background-file=%s", path);
  GstHarness *h = roi_harness (rig, save);
  for (int i = 0; i < 2; i++)
    push (h, scene (rig, i, false));
  gst_harness_teardown (h);
  h = roi_harness (rig, load);
  fail_unless_cmp (push (h, scene (rig, 0, true)), ==, (Roi{100, 90, 60, 80}));
  gst_harness_teardown (h);
  remove_background (path);
  g_free (path);
  g_free (save);
  g_free (load);
}
GST_END_TEST;

/* At start, before a background is learnt in vain. */
GST_START_TEST (test_place_that_a_background_cannot_be_saved_to_is_one_error_at_start)
{
  const std::pair<const char *, const char *> cases[] = {
      {"/nowhere/b.yml", "/nowhere/b.yml: its folder does not exist"},
      {"b.txt", "b.txt: cannot be written; expected a file name that ends in .yml"}};
  for (const auto &[path, text] : cases) {
    GstElement *element = gst_element_factory_make ("roiextract", nullptr);
    GstBus *bus = gst_bus_new ();
    gst_element_set_bus (element, bus);
    g_object_set (element, "save-background", path, nullptr);
    fail_unless_equals_int (
        gst_element_set_state (element, GST_STATE_PAUSED), GST_STATE_CHANGE_FAILURE);
    const std::string said = next_message_text (bus, GST_MESSAGE_ERROR);
    fail_unless_contains (said, text);
    fail_unless (gst_bus_pop_filtered (bus, GST_MESSAGE_ERROR) == nullptr);
    gst_element_set_state (element, GST_STATE_NULL);
    gst_element_set_bus (element, nullptr);
    gst_object_unref (bus);
    gst_object_unref (element);
  }
  fail_if (g_file_test ("b.txt", G_FILE_TEST_EXISTS));
}
GST_END_TEST;

GST_START_TEST (test_stream_too_short_for_a_background_to_save_is_a_warning)
{
  const Rig rig = ring_rig (1);
  gchar *path = g_strdup_printf ("%s/roi-short-%d.yml", g_get_tmp_dir (), int (getpid ()));
  gchar *save = g_strdup_printf ("roiextract background-frames=9 save-background=%s", path);
  GstHarness *h = roi_harness (rig, save);
  GstBus *bus = gst_bus_new ();
  gst_element_set_bus (h->element, bus);
  for (int i = 0; i < 2; i++)
    push (h, scene (rig, i, false));
  fail_unless (gst_harness_push_event (h, gst_event_new_eos ()));
  const std::string said = next_message_text (bus, GST_MESSAGE_WARNING);
  fail_unless_contains (said, "not written: view 0 ended after 2 frames");
  fail_if (g_file_test (path, G_FILE_TEST_EXISTS));
  gst_element_set_bus (h->element, nullptr);
  gst_object_unref (bus);
  gst_harness_teardown (h);
  g_free (path);
  g_free (save);
}
GST_END_TEST;

GST_START_TEST (test_camera_that_sends_nothing_gives_no_warning_at_the_end)
{
  GstHarness *h = roi_harness (ring_rig (2), "roiextract background-frames=2");
  GstBus *bus = gst_bus_new ();
  gst_element_set_bus (h->element, bus);
  for (int i = 0; i < 3; i++)
    push (h, scene (ring_rig (1), i, false));
  fail_unless (gst_harness_push_event (h, gst_event_new_eos ()));
  fail_unless (gst_bus_pop_filtered (bus, GST_MESSAGE_WARNING) == nullptr);
  gst_element_set_bus (h->element, nullptr);
  gst_object_unref (bus);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_stream_that_ends_while_learning_is_a_warning)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = roi_harness (rig, "roiextract background-frames=9");
  GstBus *bus = gst_bus_new ();
  gst_element_set_bus (h->element, bus);
  push (h, scene (rig, 0, false));
  fail_unless (gst_harness_push_event (h, gst_event_new_eos ()));
  fail_unless_contains (
      next_message_text (bus, GST_MESSAGE_WARNING), "view 0 ended after 1 frames");
  gst_element_set_bus (h->element, nullptr);
  gst_object_unref (bus);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_missing_background_file_is_an_error_that_names_it)
{
  GstHarness *h = gst_harness_new_parse ("roiextract background-file=/nowhere/b.yml");
  GstBus *bus = gst_bus_new ();
  gst_element_set_bus (h->element, bus);
  gst_harness_set_src_caps (
      h, gstrange::make_range_caps (gstrange::make_info (ring_rig (1), 30, 1)));
  fail_unless_contains (next_message_text (bus, GST_MESSAGE_ERROR), "/nowhere/b.yml");
  gst_element_set_bus (h->element, nullptr);
  gst_object_unref (bus);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_tells_upstream_the_roi_once_for_a_person_who_stays)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = roi_harness (rig, "roiextract background-frames=1");
  push (h, scene (rig, 0, false));
  for (int i = 1; i < 4; i++)
    push (h, scene (rig, i, true));
  const std::vector<Roi> told = rois_told (h);
  fail_unless_equals_int (told.size (), 1);
  fail_unless_cmp (told[0], ==, (Roi{84, 74, 92, 112}));
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_growing_person_is_told_before_the_edge_is_reached)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = roi_harness (rig, "roiextract background-frames=1");
  push (h, scene (rig, 0, false));
  int told_width = 0;
  for (int grown = 0; grown <= 40; grown++) { /* one column a frame, within what was told */
    GstBuffer *buffer = scene (rig, grown + 1, true);
    {
      gstrange::RangeFrameMap frame (buffer, GST_MAP_READWRITE);
      for (int y = 90; y < 170; y++)
        for (int x = 160; x < 160 + grown; x++) {
          fail_unless (told_width == 0 || x < 84 + told_width);
          frame.views ()[0].depth.at (x, y) = 7000;
          frame.views ()[0].colour.at (x, y) = {200, 60, 50, 0};
        }
    }
    push (h, buffer);
    for (const Roi &roi : rois_told (h))
      told_width = roi.width;
  }
  ck_assert_int_ge (told_width, 60 + 40 + 16);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_new_size_is_learnt_again_and_same_size_keeps_the_background)
{
  const Rig rig = ring_rig (1), larger = ring_rig (1, 640, 480);
  GstHarness *h = roi_harness (rig, "roiextract background-frames=1");
  push (h, scene (rig, 0, false));
  gst_harness_set_src_caps (h, gstrange::make_range_caps (gstrange::make_info (rig, 60, 1)));
  fail_if (push (h, scene (rig, 1, true)).empty ());
  gst_harness_set_src_caps (h, gstrange::make_range_caps (gstrange::make_info (larger, 30, 1)));
  fail_unless (push (h, scene (larger, 2, true)).empty ());
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_stats_count_points)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = roi_harness (rig, "roiextract background-frames=1");
  push (h, scene (rig, 0, false));
  push (h, scene (rig, 1, true));
  GstElement *element = gst_harness_find_element (h, "roiextract");
  GstStructure *stats;
  guint64 in = 0, out = 0, frames = 0;
  g_object_get (element, "stats", &stats, nullptr);
  gst_structure_get (stats, "points-in", G_TYPE_UINT64, &in, "points-out", G_TYPE_UINT64, &out,
      "frames", G_TYPE_UINT64, &frames, nullptr);
  fail_unless_equals_uint64 (in, 2 * 320 * 240);
  fail_unless_equals_uint64 (out, 60 * 80);
  fail_unless_equals_uint64 (frames, 2);
  gst_structure_free (stats);
  gst_object_unref (element);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_forgets_the_background_in_null)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = roi_harness (rig, "roiextract background-frames=1");
  push (h, scene (rig, 0, false));
  gst_element_set_state (h->element, GST_STATE_NULL);
  gst_harness_play (h);
  gst_harness_set_src_caps (h, gstrange::make_range_caps (gstrange::make_info (rig, 30, 1)));
  fail_unless (push (h, scene (rig, 1, true)).empty ());
  gst_harness_teardown (h);
}
GST_END_TEST;

/* A wall, grey at level 80, and the yellower the higher; boxes of one red stand before it. */
static GstBuffer *
boxes (const Rig &rig, GstClockTime pts, int wall, const std::vector<Roi> &people)
{
  GstBuffer *buffer = make_frame_set (rig, pts);
  gst_range_buffer_set_capture_time (buffer, pts + 1);
  gstrange::RangeFrameMap frame (buffer, GST_MAP_READWRITE);
  const RangeImage &image = frame.views ()[0];
  for (int y = 0; y < image.roi.height; y++)
    for (int x = 0; x < image.roi.width; x++) {
      const bool person = std::ranges::any_of (people, [&] (const Roi &p) {
        return x >= p.x && x < p.x + p.width && y >= p.y && y < p.y + p.height;
      });
      image.depth.at (x, y) = person ? 7000 : 12000;
      const auto level = static_cast<std::uint8_t> (wall);
      image.colour.at (x, y) = person ? Rgbx{200, 60, 50, 0} : Rgbx{level, level, 80, 0};
    }
  return buffer;
}

GST_START_TEST (test_who_sits_still_stays_and_the_wall_may_change_slowly)
{
  const Rig rig = ring_rig (1);
  /* The wall gets yellow: only adaptation can know it. */
  for (const bool adapts : {true, false}) {
    GstHarness *h = roi_harness (
        rig, adapts ? "roiextract background-frames=5 follow-light=false adapt-time=2"
                    : "roiextract background-frames=5 follow-light=false adapt-time=0");
    const Roi person{100, 90, 60, 80};
    int i = 0;
    for (; i < 5; i++)
      push (h, boxes (rig, i * GST_SECOND / 2, 80, {}));
    Roi last;
    for (; i < 100; i++)
      last = push (h, boxes (rig, i * GST_SECOND / 2, 80 + i, {person}));
    ck_assert_int_eq (adapts, (last == person)); /* else the wall is as new as the person */
    gst_harness_teardown (h);
  }
}
GST_END_TEST;

/* stereodepth matches the whole picture only now and then; what the ROI leaves out catches up. */
GST_START_TEST (test_wall_that_is_seen_now_and_then_is_followed_too)
{
  const Rig rig = ring_rig (1);
  for (const int phase : {0, 2}) {
    GstHarness *h = roi_harness (
        rig, "roiextract background-frames=5 follow-light=false adapt-time=2 margin=0");
    const Roi person{100, 90, 60, 80}, around{80, 70, 120, 130};
    int i = 0;
    for (; i < 5; i++)
      push (h, boxes (rig, i * 40 * GST_MSECOND, 60, {}));
    Roi last;
    for (; i < 1000; i++) { /* 40 s, in which the wall gets more than twice as bright */
      GstBuffer *buffer = boxes (rig, i * 40 * GST_MSECOND, 60 + i * 80 / 1000, {person});
      const bool whole = i % 30 == phase;
      if (!whole) {
        gstrange::RangeFrameMap frame (buffer, GST_MAP_READWRITE);
        frame.crop (0, around);
      }
      const Roi found = push (h, buffer);
      if (whole)
        last = found;
    }
    fail_unless (last == person, "phase %d: %dx%d", phase, last.width, last.height);
    gst_harness_teardown (h);
  }
}
GST_END_TEST;

GST_START_TEST (test_view_that_is_there_twice_is_one_error)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = roi_harness (rig, "roiextract background-frames=1");
  GstBuffer *buffer = make_frame_set (rig, 0);
  GstRangeMeta copy = *gst_buffer_get_range_meta (buffer, 0);
  auto twin = (GstRangeMeta *)gst_buffer_add_meta (buffer, copy.meta.info, nullptr);
  copy.meta = twin->meta;
  *twin = copy;
  GstBus *bus = gst_bus_new ();
  gst_element_set_bus (h->element, bus);
  fail_unless_equals_int (gst_harness_push (h, buffer), GST_FLOW_ERROR);
  const std::string said = next_message_text (bus, GST_MESSAGE_ERROR);
  fail_unless_contains (said, "view 0 is there twice");
  fail_unless (gst_bus_pop_filtered (bus, GST_MESSAGE_ERROR) == nullptr);
  gst_element_set_bus (h->element, nullptr);
  gst_object_unref (bus);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_bytes_without_a_view_are_one_error)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = roi_harness (rig, "roiextract background-frames=1");
  GstBus *bus = gst_bus_new ();
  gst_element_set_bus (h->element, bus);
  GstBuffer *buffer = gst_buffer_new_allocate (nullptr, 1000, nullptr);
  GST_BUFFER_PTS (buffer) = 0;
  ck_assert_int_eq (gst_harness_push (h, buffer), GST_FLOW_ERROR);
  fail_unless_contains (
      next_message_text (bus, GST_MESSAGE_ERROR), "1000 bytes without a GstRangeMeta");
  gst_element_set_bus (h->element, nullptr);
  gst_object_unref (bus);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_several_people_are_in_the_roi_and_max_people_keeps_the_largest)
{
  const Rig rig = ring_rig (1);
  const std::vector<Roi> people = {{20, 90, 40, 80}, {100, 60, 60, 100}, {260, 100, 20, 40}};
  const struct {
    const char *launch;
    Roi box;
  } cases[] = {{"roiextract background-frames=1", {20, 60, 260, 110}},
      {"roiextract background-frames=1 min-area=1000", {20, 60, 140, 110}},
      {"roiextract background-frames=1 max-people=1", {100, 60, 60, 100}}};
  for (const auto &c : cases) {
    GstHarness *h = roi_harness (rig, c.launch);
    push (h, boxes (rig, 0, 110, {}));
    fail_unless_cmp (push (h, boxes (rig, 1, 110, people)), ==, c.box);
    gst_harness_teardown (h);
  }
}
GST_END_TEST;

GST_START_TEST (test_background_at_eos_is_the_one_that_it_has_become)
{
  const Rig rig = ring_rig (1);
  gchar *path = g_strdup_printf ("%s/roi-eos-%d.yml", g_get_tmp_dir (), int (getpid ()));
  gchar *save = g_strdup_printf (
      "roiextract background-frames=2 follow-light=false adapt-time=1 save-background=%s", path);
  gchar *load = g_strdup_printf ("roiextract follow-light=false background-file=%s", path);
  GstHarness *h = roi_harness (rig, save);
  int i = 0;
  for (; i < 40; i++)
    push (h, boxes (rig, i * GST_SECOND / 2, 80 + 2 * i, {}));
  fail_unless (gst_harness_push_event (h, gst_event_new_eos ()));
  gst_harness_teardown (h);
  h = roi_harness (rig, load);
  fail_unless (push (h, boxes (rig, 0, 80 + 2 * i, {})).empty ()); /* yellow, grey at first */
  gst_harness_teardown (h);
  remove_background (path);
  g_free (path);
  g_free (save);
  g_free (load);
}
GST_END_TEST;

GST_START_TEST (test_nobody_goes_through_coder_and_splitter_as_a_tiny_frame_set)
{
  const Rig rig = ring_rig (2);
  GstHarness *coder = roi_harness (rig, "roiextract background-frames=1 ! neighbourcodeenc");
  gst_harness_set_sink_caps_str (coder, kAccessUnitsOrSlices);
  GstHarness *whole =
      roi_harness (rig, "roiextract background-frames=1 ! neighbourcodeenc ! neighbourcodedec "
                        "! rangesplit name=s s.depth ! identity");
  for (int i = 0; i < 4; i++) {
    GstBuffer *coded = gst_harness_push_and_pull (coder, scene (rig, i * GST_MSECOND, false));
    ck_assert_uint_lt (gst_buffer_get_size (coded), 500);
    gst_buffer_unref (coded);
    GstBuffer *depth = gst_harness_push_and_pull (whole, scene (rig, i * GST_MSECOND, false));
    fail_unless_equals_uint64 (GST_BUFFER_PTS (depth), i * GST_MSECOND);
    GstMapInfo map;
    gst_buffer_map (depth, &map, GST_MAP_READ);
    ck_assert_uint_gt (map.size, 0);
    fail_unless (
        std::all_of (map.data, map.data + map.size, [] (guint8 byte) { return byte == 0; }));
    gst_buffer_unmap (depth, &map);
    gst_buffer_unref (depth);
  }
  gst_harness_teardown (coder);
  gst_harness_teardown (whole);
}
GST_END_TEST;

GST_START_TEST (test_background_file_of_another_version_is_one_error)
{
  gchar *path = g_strdup_printf ("%s/roi-bad-%d.yml", g_get_tmp_dir (), int (getpid ()));
  fail_unless (
      g_file_set_contents (path, "%YAML:1.0\n---\nrangecast_background: 1\n", -1, nullptr));
  gchar *launch = g_strdup_printf ("roiextract background-file=%s", path);
  GstHarness *h = gst_harness_new_parse (launch);
  GstBus *bus = gst_bus_new ();
  gst_element_set_bus (h->element, bus);
  gst_harness_set_src_caps (
      h, gstrange::make_range_caps (gstrange::make_info (ring_rig (1), 30, 1)));
  const std::string text = next_message_text (bus, GST_MESSAGE_ERROR);
  fail_unless_contains (text, path);
  fail_unless_contains (text, "save the background again");
  gst_element_set_bus (h->element, nullptr);
  gst_object_unref (bus);
  gst_harness_teardown (h);
  g_unlink (path);
  g_free (path);
  g_free (launch);
}
GST_END_TEST;

GST_START_TEST (test_frame_that_begins_before_the_segment_passes)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = roi_harness (rig, "roiextract");
  GstBuffer *out = push_before_the_segment (h, rig, GST_SECOND);
  fail_unless (out != nullptr);
  gst_buffer_unref (out);
  gst_harness_teardown (h);
}
GST_END_TEST;

static Suite *
roiextract_suite ()
{
  Suite *suite = suite_create ("roiextract");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_learns_then_crops_to_the_person_without_copying);
  tcase_add_test (tc, test_learning_is_reported_view_by_view);
  tcase_add_test (tc, test_picture_that_is_all_foreground_is_one_warning);
  tcase_add_test (tc, test_nobody_is_an_empty_roi_and_no_error);
  tcase_add_test (tc, test_frames_before_the_camera_has_settled_teach_nothing);
  tcase_add_test (tc, test_margin_grows_the_roi);
  tcase_add_test (tc, test_capture_background_learns_again);
  tcase_add_test (tc, test_learning_again_asks_for_the_whole_picture);
  tcase_add_test (tc, test_new_caps_leave_a_captured_background_alone);
  tcase_add_test (tc, test_flush_gap_and_eos_keep_the_background);
  tcase_add_test (tc, test_background_is_saved_and_loaded);
  tcase_add_test (tc, test_place_that_a_background_cannot_be_saved_to_is_one_error_at_start);
  tcase_add_test (tc, test_stream_too_short_for_a_background_to_save_is_a_warning);
  tcase_add_test (tc, test_stream_that_ends_while_learning_is_a_warning);
  tcase_add_test (tc, test_camera_that_sends_nothing_gives_no_warning_at_the_end);
  tcase_add_test (tc, test_missing_background_file_is_an_error_that_names_it);
  tcase_add_test (tc, test_tells_upstream_the_roi_once_for_a_person_who_stays);
  tcase_add_test (tc, test_growing_person_is_told_before_the_edge_is_reached);
  tcase_add_test (tc, test_new_size_is_learnt_again_and_same_size_keeps_the_background);
  tcase_add_test (tc, test_stats_count_points);
  tcase_add_test (tc, test_forgets_the_background_in_null);
  tcase_add_test (tc, test_who_sits_still_stays_and_the_wall_may_change_slowly);
  tcase_add_test (tc, test_wall_that_is_seen_now_and_then_is_followed_too);
  tcase_add_test (tc, test_view_that_is_there_twice_is_one_error);
  tcase_add_test (tc, test_bytes_without_a_view_are_one_error);
  tcase_add_test (tc, test_several_people_are_in_the_roi_and_max_people_keeps_the_largest);
  tcase_add_test (tc, test_background_at_eos_is_the_one_that_it_has_become);
  tcase_add_test (tc, test_nobody_goes_through_coder_and_splitter_as_a_tiny_frame_set);
  tcase_add_test (tc, test_background_file_of_another_version_is_one_error);
  tcase_add_test (tc, test_frame_that_begins_before_the_segment_passes);
  return suite;
}

GST_CHECK_MAIN (roiextract);
