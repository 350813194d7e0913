/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "../rangecast-check.hpp"

#include <glib/gstdio.h>

#include <algorithm>
#include <vector>

using namespace rangecast;
using namespace rangecast::testing;

namespace {

constexpr Roi kPerson = {100, 90, 60, 80};

/* A wall 1.2 m away, of that level in red and green; red boxes 0.7 m away stand before it. */
GstBuffer *
scene (const Rig &rig, GstClockTime pts, const std::vector<Roi> &people, int wall = 110)
{
  GstBuffer *buffer = make_frame_set (rig, pts);
  gst_range_buffer_set_capture_time (buffer, pts + 1);
  gstrange::RangeFrameMap frame (buffer, GST_MAP_READWRITE);
  const auto level = static_cast<std::uint8_t> (wall);
  for (const RangeImage &image : frame.views ())
    for (int y = 0; y < image.roi.height; y++)
      for (int x = 0; x < image.roi.width; x++) {
        const bool person = std::ranges::any_of (people, [&] (const Roi &p) {
          return x >= p.x && x < p.x + p.width && y >= p.y && y < p.y + p.height;
        });
        image.depth.at (x, y) = person ? 7000 : 12000;
        image.colour.at (x, y) = person ? Rgbx{200, 60, 50, 0} : Rgbx{level, level, 80, 0};
      }
  return buffer;
}

struct Extract {
  GstHarness *h = nullptr;
  GstBus *bus = gst_bus_new ();

  explicit Extract (const std::string &properties, const Rig &rig = ring_rig (1))
  {
    GstElement *element = gst_parse_launch (("roiextract " + properties).c_str (), nullptr);
    gst_element_set_bus (element, bus);
    h = gst_harness_new_with_element (element, "sink", "src");
    gst_object_unref (element);
    set_rig (rig);
  }
  ~Extract ()
  {
    gst_element_set_bus (h->element, nullptr);
    gst_object_unref (bus);
    gst_harness_teardown (h);
  }
  void set_rig (const Rig &rig, int fps = 30)
  {
    gst_harness_set_src_caps (h, gstrange::make_range_caps (gstrange::make_info (rig, fps, 1)));
  }
  /* Gives the ROI of view 0 that comes out. */
  Roi push_buffer (GstBuffer *buffer)
  {
    GstBuffer *output = gst_harness_push_and_pull (h, buffer);
    const GstRangeMeta *meta = gst_buffer_get_range_meta (output, 0);
    const Roi roi = {int (meta->x), int (meta->y), int (meta->width), int (meta->height)};
    gst_buffer_unref (output);
    return roi;
  }
  Roi push (GstClockTime pts, const std::vector<Roi> &people = {}, int wall = 110)
  {
    return push_buffer (scene (ring_rig (1), pts, people, wall));
  }
  void capture_background () { g_signal_emit_by_name (h->element, "capture-background"); }

  /* The ROIs of view 0 that were requested from upstream. */
  std::vector<Roi> requests ()
  {
    std::vector<Roi> list;
    while (GstEvent *event = gst_harness_try_pull_upstream_event (h)) {
      const GstStructure *s = gst_event_get_structure (event);
      if (s && gst_structure_has_name (s, "GstRangeRoi")) {
        guint view, x, y, width, height;
        fail_unless (gst_structure_get (s, "view-id", G_TYPE_UINT, &view, "x", G_TYPE_UINT, &x, "y",
            G_TYPE_UINT, &y, "width", G_TYPE_UINT, &width, "height", G_TYPE_UINT, &height,
            nullptr));
        fail_unless_equals_int (view, 0);
        list.push_back ({int (x), int (y), int (width), int (height)});
      }
      gst_event_unref (event);
    }
    return list;
  }
};

/* The list of backgrounds and the image of view 0. */
struct BackgroundFile {
  std::string path = std::string (g_get_tmp_dir ()) + "/roi-" + std::to_string (getpid ()) + "-" +
                     std::to_string (g_random_int ());
  ~BackgroundFile ()
  {
    g_unlink ((path + ".yml").c_str ());
    g_unlink ((path + "-0.pgm").c_str ());
  }
  [[nodiscard]] std::string save () const { return " save-background=" + path + ".yml"; }
  [[nodiscard]] std::string load () const { return " background-file=" + path + ".yml"; }
};

} // namespace

GST_START_TEST (test_learns_then_crops_to_the_person_without_copying)
{
  const Rig rig = ring_rig (2);
  Extract e ("background-frames=3", rig);
  for (int i = 0; i < 3; i++)
    fail_unless (e.push_buffer (scene (rig, i, {})).empty ());
  fail_unless (e.push_buffer (scene (rig, 3, {})).empty ());
  GstBuffer *input = scene (rig, 4, {kPerson});
  GstMemory *memory = gst_buffer_peek_memory (input, 0);
  GstBuffer *output = gst_harness_push_and_pull (e.h, input);
  ck_assert_ptr_eq (gst_buffer_peek_memory (output, 0), memory);
  fail_unless_equals_uint64 (GST_BUFFER_PTS (output), 4);
  fail_unless_equals_uint64 (gst_range_buffer_get_capture_time (output), 5);
  {
    gstrange::RangeFrameMap frame (output, GST_MAP_READ);
    for (const RangeImage &image : frame.views ())
      fail_unless_cmp (image.roi, ==, kPerson);
    fail_unless_equals_int (frame.views ()[1].depth.at (0, 0), 7000);
    fail_unless_equals_int (frame.views ()[1].colour.at (59, 79).r, 200);
  }
  gst_buffer_unref (output);
}
GST_END_TEST;

GST_START_TEST (test_learning_is_reported_view_by_view)
{
  const Rig rig = ring_rig (2);
  Extract e ("background-frames=20", rig);
  for (int i = 0; i < 25; i++)
    e.push_buffer (scene (rig, i, {}));
  std::vector<int> frames[2];
  while (GstMessage *message = gst_bus_pop_filtered (e.bus, GST_MESSAGE_ELEMENT)) {
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
}
GST_END_TEST;

/* A wall nearer than the one that was learnt, as after a camera was moved; in a quarter of its
 * pixels stereo finds no depth. */
GST_START_TEST (test_picture_that_is_all_foreground_is_one_warning)
{
  Extract e ("background-frames=2");
  for (int i = 0; i < 70; i++) {
    GstBuffer *buffer = scene (ring_rig (1), i, {});
    if (i >= 2) {
      gstrange::RangeFrameMap frame (buffer, GST_MAP_READWRITE);
      const RangeImage &image = frame.views ()[0];
      for (int y = 0; y < image.roi.height; y++) {
        std::fill_n (image.depth.row (y), image.roi.width, guint16{8000});
        std::fill_n (image.depth.row (y), image.roi.width / 4, guint16{0});
      }
    }
    e.push_buffer (buffer);
  }
  fail_unless_contains (next_message_text (e.bus, GST_MESSAGE_WARNING), "capture-background");
  fail_unless (gst_bus_pop_filtered (e.bus, GST_MESSAGE_WARNING) == nullptr);
}
GST_END_TEST;

GST_START_TEST (test_foreground_that_does_not_move_for_a_minute_is_one_warning)
{
  Extract e ("background-frames=1");
  int i = 0;
  e.push (0);
  for (; i < 70; i++) /* somebody who sits still moves a little */
    e.push (i * GST_SECOND, {{kPerson.x + 3 * (i % 2), kPerson.y, kPerson.width, kPerson.height}});
  for (; i < 125; i++)
    e.push (i * GST_SECOND, {kPerson});
  fail_unless (gst_bus_pop_filtered (e.bus, GST_MESSAGE_WARNING) == nullptr);
  for (; i < 200; i++)
    e.push (i * GST_SECOND, {kPerson});
  fail_unless_contains (next_message_text (e.bus, GST_MESSAGE_WARNING), "60x80 pixels at 100, 90");
  fail_unless (gst_bus_pop_filtered (e.bus, GST_MESSAGE_WARNING) == nullptr);
}
GST_END_TEST;

GST_START_TEST (test_frames_before_the_camera_has_settled_are_not_learnt)
{
  Extract e ("settle-frames=2 background-frames=1");
  for (int i = 0; i < 2; i++)
    fail_unless (e.push (i, {kPerson}).empty ());
  fail_unless (e.push (2).empty ());
  fail_unless_cmp (e.push (3, {kPerson}), ==, kPerson);
}
GST_END_TEST;

GST_START_TEST (test_capture_background_learns_again_from_the_whole_image)
{
  Extract e ("background-frames=1");
  e.push (0);
  fail_if (e.push (1, {kPerson}).empty ());
  fail_unless_equals_int (e.requests ().size (), 1);
  e.capture_background ();
  fail_unless (e.push (2, {kPerson}).empty ());
  const std::vector<Roi> requests = e.requests ();
  fail_unless (requests.size () == 1 && requests[0].empty ());
  fail_unless (e.push (3, {kPerson}).empty ());
}
GST_END_TEST;

GST_START_TEST (test_background_survives_flush_and_same_size_and_not_another_size_or_null)
{
  const Rig larger = ring_rig (1, 640, 480);
  Extract e ("background-frames=1");
  e.push (0);
  gst_harness_push_event (e.h, gst_event_new_gap (1, 1));
  fail_unless (gst_harness_push_event (e.h, gst_event_new_flush_start ()));
  fail_unless (gst_harness_push_event (e.h, gst_event_new_flush_stop (TRUE)));
  GstSegment segment;
  gst_segment_init (&segment, GST_FORMAT_TIME);
  gst_harness_push_event (e.h, gst_event_new_segment (&segment));
  fail_unless_cmp (e.push (2, {kPerson}), ==, kPerson);
  e.set_rig (ring_rig (1), 60);
  fail_unless_cmp (e.push (3, {kPerson}), ==, kPerson);
  e.set_rig (larger);
  fail_unless (e.push_buffer (scene (larger, 4, {kPerson})).empty ());
  gst_element_set_state (e.h->element, GST_STATE_NULL);
  gst_harness_play (e.h);
  e.set_rig (larger);
  fail_unless (e.push_buffer (scene (larger, 5, {})).empty ());
  fail_unless_cmp (e.push_buffer (scene (larger, 6, {kPerson})), ==, kPerson);
}
GST_END_TEST;

GST_START_TEST (test_background_is_saved_as_it_has_become_and_loaded)
{
  const BackgroundFile file;
  int i = 0;
  {
    Extract e ("background-frames=2 follow-light=false adapt-time=1" + file.save ());
    for (; i < 40; i++)
      e.push (i * GST_SECOND / 2, {}, 80 + 2 * i);
    fail_unless (gst_harness_push_event (e.h, gst_event_new_eos ()));
  }
  Extract e ("follow-light=false" + file.load ());
  fail_unless (e.push (0, {}, 80 + 2 * i).empty ()); /* yellow, grey at first */
  fail_unless_cmp (e.push (1, {kPerson}, 80 + 2 * i), ==, kPerson);
}
GST_END_TEST;

/* At start, before a background is learnt in vain. */
GST_START_TEST (test_path_that_a_background_cannot_be_saved_to_is_one_error_at_start)
{
  GstElement *element = gst_element_factory_make ("roiextract", nullptr);
  GstBus *bus = gst_bus_new ();
  gst_element_set_bus (element, bus);
  g_object_set (element, "save-background", "/nowhere/b.yml", nullptr);
  fail_unless_equals_int (
      gst_element_set_state (element, GST_STATE_PAUSED), GST_STATE_CHANGE_FAILURE);
  fail_unless_contains (next_message_text (bus, GST_MESSAGE_ERROR), "/nowhere/b.yml");
  fail_unless (gst_bus_pop_filtered (bus, GST_MESSAGE_ERROR) == nullptr);
  gst_element_set_state (element, GST_STATE_NULL);
  gst_element_set_bus (element, nullptr);
  gst_object_unref (bus);
  gst_object_unref (element);
}
GST_END_TEST;

GST_START_TEST (test_stream_too_short_for_a_background_is_a_warning)
{
  for (const bool saves : {false, true}) {
    const BackgroundFile file;
    Extract e ("background-frames=9" + (saves ? file.save () : ""));
    for (int i = 0; i < 2; i++)
      e.push (i);
    fail_unless (gst_harness_push_event (e.h, gst_event_new_eos ()));
    fail_unless_contains (next_message_text (e.bus, GST_MESSAGE_WARNING),
        saves ? "not written: view 0 ended after 2 frames" : "view 0 ended after 2 frames");
    fail_if (g_file_test ((file.path + ".yml").c_str (), G_FILE_TEST_EXISTS));
  }
}
GST_END_TEST;

GST_START_TEST (test_background_file_that_cannot_be_read_is_an_error_that_names_it)
{
  const BackgroundFile file;
  const std::string path = file.path + ".yml";
  for (const char *text : {"", "%YAML:1.0\n---\nrangecast_background: 1\n"}) {
    fail_unless (!*text || g_file_set_contents (path.c_str (), text, -1, nullptr));
    Extract e (file.load ());
    fail_unless_contains (next_message_text (e.bus, GST_MESSAGE_ERROR), path);
  }
}
GST_END_TEST;

GST_START_TEST (test_requests_the_roi_once_for_a_person_who_stays)
{
  Extract e ("background-frames=1");
  e.push (0);
  for (int i = 1; i < 4; i++)
    e.push (i, {kPerson});
  const std::vector<Roi> requests = e.requests ();
  fail_unless_equals_int (requests.size (), 1);
  fail_unless_cmp (requests[0], ==, (Roi{84, 74, 92, 112}));
}
GST_END_TEST;

GST_START_TEST (test_growing_person_is_requested_before_the_edge_is_reached)
{
  Extract e ("background-frames=1");
  e.push (0);
  int width = 0;
  for (int grown = 0; grown <= 40; grown++) { /* one column a frame, within what was requested */
    fail_unless (width == 0 || kPerson.x + kPerson.width + grown <= 84 + width);
    e.push (grown + 1, {{kPerson.x, kPerson.y, kPerson.width + grown, kPerson.height}});
    for (const Roi &roi : e.requests ())
      width = roi.width;
  }
  ck_assert_int_ge (width, 60 + 40 + 16);
}
GST_END_TEST;

GST_START_TEST (test_who_sits_still_stays_and_the_wall_may_change_slowly)
{
  for (const bool adapts : {true, false}) { /* the wall gets yellow: only adaptation can know it */
    Extract e (
        std::string ("background-frames=5 follow-light=false adapt-time=") + (adapts ? "2" : "0"));
    int i = 0;
    for (; i < 5; i++)
      e.push (i * GST_SECOND / 2, {}, 80);
    Roi last;
    for (; i < 100; i++)
      last = e.push (i * GST_SECOND / 2, {kPerson}, 80 + i);
    ck_assert_int_eq (adapts, (last == kPerson)); /* else the wall is as new as the person */
  }
}
GST_END_TEST;

GST_START_TEST (test_place_that_a_person_leaves_is_background_and_learnt)
{
  for (const char *cue : {"both", "depth"}) {
    Extract e (std::string ("background-frames=5 cue=") + cue);
    int i = 0;
    for (; i < 5; i++)
      e.push (i * GST_SECOND / 5, {kPerson});
    for (; i < 105; i++) /* 20 s */
      fail_unless (e.push (i * GST_SECOND / 5).empty ());
    fail_unless_cmp (e.push (i * GST_SECOND / 5, {kPerson}), ==, kPerson);
  }
}
GST_END_TEST;

/* stereodepth matches the whole image only now and then; the rest of the wall catches up. */
GST_START_TEST (test_wall_outside_of_the_roi_is_adapted_when_it_is_seen)
{
  Extract e ("background-frames=5 follow-light=false adapt-time=2 margin=0");
  int i = 0;
  for (; i < 5; i++)
    e.push (i * 120 * GST_MSECOND, {}, 60);
  Roi last;
  for (; i < 330; i++) { /* 40 s, in which the wall gets more than twice as bright */
    GstBuffer *buffer = scene (ring_rig (1), i * 120 * GST_MSECOND, {kPerson}, 60 + i * 80 / 330);
    const bool whole = i % 10 == 0;
    if (!whole) {
      gstrange::RangeFrameMap frame (buffer, GST_MAP_READWRITE);
      frame.crop (0, {80, 70, 120, 130});
    }
    const Roi found = e.push_buffer (buffer);
    if (whole)
      last = found;
  }
  fail_unless_cmp (last, ==, kPerson);
}
GST_END_TEST;

GST_START_TEST (test_roi_holds_the_regions_that_the_properties_keep)
{
  const std::vector<Roi> people = {{20, 90, 40, 80}, {100, 60, 60, 100}, {260, 100, 20, 40}};
  const std::pair<const char *, Roi> cases[] = {{"background-frames=1", {20, 60, 260, 110}},
      {"background-frames=1 margin=5", {15, 55, 270, 120}},
      {"background-frames=1 min-area=1000", {20, 60, 140, 110}},
      {"background-frames=1 max-people=1", {100, 60, 60, 100}}};
  for (const auto &[properties, box] : cases) {
    Extract e (properties);
    e.push (0);
    fail_unless_cmp (e.push (1, people), ==, box);
  }
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
  tcase_add_test (tc, test_foreground_that_does_not_move_for_a_minute_is_one_warning);
  tcase_add_test (tc, test_frames_before_the_camera_has_settled_are_not_learnt);
  tcase_add_test (tc, test_capture_background_learns_again_from_the_whole_image);
  tcase_add_test (tc, test_background_survives_flush_and_same_size_and_not_another_size_or_null);
  tcase_add_test (tc, test_background_is_saved_as_it_has_become_and_loaded);
  tcase_add_test (tc, test_path_that_a_background_cannot_be_saved_to_is_one_error_at_start);
  tcase_add_test (tc, test_stream_too_short_for_a_background_is_a_warning);
  tcase_add_test (tc, test_background_file_that_cannot_be_read_is_an_error_that_names_it);
  tcase_add_test (tc, test_requests_the_roi_once_for_a_person_who_stays);
  tcase_add_test (tc, test_growing_person_is_requested_before_the_edge_is_reached);
  tcase_add_test (tc, test_who_sits_still_stays_and_the_wall_may_change_slowly);
  tcase_add_test (tc, test_place_that_a_person_leaves_is_background_and_learnt);
  tcase_add_test (tc, test_wall_outside_of_the_roi_is_adapted_when_it_is_seen);
  tcase_add_test (tc, test_roi_holds_the_regions_that_the_properties_keep);
  return suite;
}

GST_CHECK_MAIN (roiextract);
