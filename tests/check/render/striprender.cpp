/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "render-check.hpp"

#include <gst/controller/controller.h>
#include <gst/gl/gstglfuncs.h>
#include <gst/video/navigation.h>

#include <cstdlib>
#include <vector>

using namespace rangecast;
using namespace rangecast::testing;

/* A frame set whose ROI is the picture's middle: depth rises towards its edges. */
static GstBuffer *
small_roi (const Rig &rig)
{
  GstBuffer *buffer = make_frame_set (rig, 0, {100, 80, 60, 40});
  gstrange::RangeFrameMap frame (buffer, GST_MAP_READWRITE);
  for (int y = 0; y < 40; y++)
    for (int x = 0; x < 60; x++)
      frame.views ()[0].depth.at (x, y) = 7000 + 20 * std::abs (x - 30);
  return buffer;
}

GST_START_TEST (test_edges_of_a_smaller_roi_do_not_read_the_last_frame)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = render_harness (rig, "azimuth=60 mode=rectangles");
  const RenderedPicture fresh = render (h, small_roi (rig));
  GstBuffer *large = make_frame_set (rig);
  {
    gstrange::RangeFrameMap frame (large, GST_MAP_READWRITE);
    for (int y = 0; y < 240; y++)
      for (int x = 0; x < 320; x++)
        frame.views ()[0].depth.at (x, y) = 7500;
  }
  for (int i = 0; i < 2; i++) /* there may be two of each texture, in turns */
    render (h, gst_buffer_ref (large));
  gst_buffer_unref (large);
  fail_unless_cmp (render (h, small_roi (rig)).rgba, ==, fresh.rgba);
  gst_harness_teardown (h);
}
GST_END_TEST;

/* As that frame set, but rows lie further apart and colour comes before depth. */
static GstBuffer *
padded (GstBuffer *packed)
{
  constexpr guint depth_stride = 320 * 2 + 34, colour_stride = 320 * 4 + 20;
  gstrange::RangeFrameMap from (packed, GST_MAP_READ);
  const RangeImage &image = from.views ()[0];
  const gsize depth_offset = 240 * colour_stride + 6;
  GstBuffer *buffer = gst_buffer_new_allocate (nullptr, depth_offset + 240 * depth_stride, nullptr);
  gst_buffer_memset (buffer, 0, 0x55, depth_offset + 240 * depth_stride);
  for (int y = 0; y < 240; y++) {
    gst_buffer_fill (buffer, y * colour_stride, image.colour.row (y), 320 * 4);
    gst_buffer_fill (buffer, depth_offset + y * depth_stride, image.depth.row (y), 320 * 2);
  }
  auto meta =
      reinterpret_cast<GstRangeMeta *> (gst_buffer_add_meta (buffer, GST_RANGE_META_INFO, nullptr));
  meta->width = 320;
  meta->height = 240;
  meta->depth_offset = depth_offset;
  meta->depth_stride = depth_stride;
  meta->colour_stride = colour_stride;
  GST_BUFFER_PTS (buffer) = 0;
  return buffer;
}

GST_START_TEST (test_padded_strides_give_the_same_picture)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = render_harness (rig, "azimuth=20");
  GstBuffer *packed = make_frame_set (rig);
  GstBuffer *wide = padded (packed);
  const RenderedPicture expected = render (h, packed);
  fail_unless_cmp (render (h, wide).rgba, ==, expected.rgba);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_mouse_turns_and_zooms_and_r_goes_back)
{
  const Rig rig = ring_rig (4);
  GstHarness *h = render_harness (rig);
  render (h, wall (rig));
  GstElement *element = gst_harness_find_element (h, "striprender");
  GstPad *src = gst_element_get_static_pad (element, "src");
  const auto send = [&] (GstEvent *event) { gst_pad_send_event (src, event); };
  double azimuth = 0, distance = 0;
  send (gst_navigation_event_new_mouse_button_press (1, 160, 120, GST_NAVIGATION_MODIFIER_NONE));
  send (gst_navigation_event_new_mouse_move (80, 120, GST_NAVIGATION_MODIFIER_NONE));
  send (gst_navigation_event_new_mouse_button_release (1, 80, 120, GST_NAVIGATION_MODIFIER_NONE));
  send (gst_navigation_event_new_mouse_move (
      300, 120, GST_NAVIGATION_MODIFIER_NONE)); /* no button is down */
  g_object_get (element, "azimuth", &azimuth, nullptr);
  fail_unless (std::abs (azimuth - 45) < 1e-6, "azimuth %f", azimuth);
  send (gst_navigation_event_new_mouse_scroll (10, 10, 0, 1, GST_NAVIGATION_MODIFIER_NONE));
  g_object_get (element, "distance", &distance, nullptr);
  fail_unless (std::abs (distance - 0.8 / 1.1) < 1e-6, "distance %f", distance);
  send (gst_navigation_event_new_key_press ("r", GST_NAVIGATION_MODIFIER_NONE));
  g_object_get (element, "azimuth", &azimuth, "distance", &distance, nullptr);
  fail_unless_cmp (azimuth, ==, 0);
  fail_unless_cmp (distance, ==, 0);
  gst_object_unref (src);
  gst_object_unref (element);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_moving_with_the_mouse_follows_the_hand)
{
  const Rig rig = ring_rig (4);
  for (const char *properties : {"", "field-of-view=60", "auto-orbit=40"}) {
    GstHarness *h = render_harness (rig, properties);
    /* a dot where all axes meet, which stays in the middle of the picture */
    const auto dot = [&] (GstClockTime pts) {
      GstBuffer *buffer = wall (rig, pts);
      gstrange::RangeFrameMap frame (buffer, GST_MAP_READWRITE);
      for (const RangeImage &image : frame.views ())
        for (int y = 0; y < 240; y++)
          for (int x = 0; x < 320; x++)
            image.depth.at (x, y) =
                image.view_id == 0 && std::abs (2 * x - 319) <= 3 && std::abs (2 * y - 239) <= 3
                    ? 8000
                    : 0;
      return buffer;
    };
    render (h, dot (0));
    render (h, dot (GST_SECOND));
    GstElement *element = gst_harness_find_element (h, "striprender");
    GstPad *src = gst_element_get_static_pad (element, "src");
    const auto send = [&] (GstEvent *event) { gst_pad_send_event (src, event); };
    send (gst_navigation_event_new_mouse_button_press (3, 100, 100, GST_NAVIGATION_MODIFIER_NONE));
    send (gst_navigation_event_new_mouse_move (140, 70, GST_NAVIGATION_MODIFIER_NONE));
    const RenderedPicture moved = render (h, dot (GST_SECOND));
    fail_unless (moved.at (200, 90, 1) > 0x60, "%s: the dot is not where the hand is", properties);
    fail_unless_equals_int (moved.at (160, 120, 1), 0x24);
    gst_object_unref (src);
    gst_object_unref (element);
    gst_harness_teardown (h);
  }
}
GST_END_TEST;

/* An element without a stream, to be sent navigation events; and its camera. */
struct Idle {
  GstElement *element = gst_element_factory_make ("striprender", nullptr);
  GstPad *src = gst_element_get_static_pad (element, "src");

  Idle () { gst_element_set_state (element, GST_STATE_PAUSED); }
  ~Idle ()
  {
    gst_element_set_state (element, GST_STATE_NULL);
    gst_object_unref (src);
    gst_object_unref (element);
  }
  void key (const char *name)
  {
    gst_pad_send_event (
        src, gst_navigation_event_new_key_press (name, GST_NAVIGATION_MODIFIER_NONE));
  }
  void drag (int button, double from_x, double from_y, double to_x, double to_y)
  {
    const auto none = GST_NAVIGATION_MODIFIER_NONE;
    gst_pad_send_event (
        src, gst_navigation_event_new_mouse_button_press (button, from_x, from_y, none));
    gst_pad_send_event (src, gst_navigation_event_new_mouse_move (to_x, to_y, none));
    gst_pad_send_event (
        src, gst_navigation_event_new_mouse_button_release (button, to_x, to_y, none));
  }
  double get (const char *property)
  {
    double value = 0;
    g_object_get (element, property, &value, nullptr);
    return value;
  }
};

GST_START_TEST (test_plus_and_minus_zoom_on_every_keyboard)
{
  for (auto [in, out] :
      {std::pair{"plus", "minus"}, {"equal", "minus"}, {"KP_Add", "KP_Subtract"}}) {
    Idle idle;
    idle.key (in);
    fail_unless (
        std::abs (idle.get ("distance") - 1 / 1.1) < 1e-9, "%s: %f", in, idle.get ("distance"));
    idle.key (out);
    fail_unless (std::abs (idle.get ("distance") - 1) < 1e-9, "%s: %f", out, idle.get ("distance"));
  }
}
GST_END_TEST;

GST_START_TEST (test_azimuth_can_be_controlled)
{
  const Rig rig = ring_rig (4);
  GstHarness *h = render_harness (rig);
  GstElement *element = gst_harness_find_element (h, "striprender");
  GstControlSource *source = gst_interpolation_control_source_new ();
  g_object_set (source, "mode", GST_INTERPOLATION_MODE_LINEAR, nullptr);
  gst_object_add_control_binding (GST_OBJECT (element),
      gst_direct_control_binding_new_absolute (GST_OBJECT (element), "azimuth", source));
  auto values = GST_TIMED_VALUE_CONTROL_SOURCE (source);
  gst_timed_value_control_source_set (values, 0, 0);
  gst_timed_value_control_source_set (values, GST_SECOND, 90);
  const RenderedPicture straight = render (h, wall (rig, 0));
  const RenderedPicture turned = render (h, wall (rig, GST_SECOND / 2));
  double azimuth = 0;
  g_object_get (element, "azimuth", &azimuth, nullptr);
  fail_unless (std::abs (azimuth - 45) < 1e-6, "azimuth %f", azimuth);
  fail_unless_cmp (straight.rgba, !=, turned.rgba);
  gst_object_unref (source);
  gst_object_unref (element);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_output_size_changes_in_mid_stream)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = render_harness (rig);
  const RenderedPicture before = render (h, wall (rig));
  set_output_caps (h->element, "width=160,height=120");
  GstBuffer *small = gst_harness_push_and_pull (h, wall (rig));
  fail_unless_equals_int (gst_buffer_get_size (small), 160 * 120 * 4);
  guint8 middle[4];
  gst_buffer_extract (small, 4 * (160 * 60 + 80), middle, 4);
  fail_unless (std::abs (middle[0] - 130) <= 2, "%d", middle[0]);
  gst_buffer_unref (small);
  set_output_caps (h->element, "width=320,height=240");
  fail_unless_cmp (render (h, wall (rig)).rgba, ==, before.rgba);
  gst_harness_teardown (h);
}
GST_END_TEST;

/* The next event downstream that is of that type; those before it are dropped. */
static bool
event_arrives (GstHarness *h, GstEventType type)
{
  while (GstEvent *event = gst_harness_pull_event (h)) {
    const bool found = GST_EVENT_TYPE (event) == type;
    gst_event_unref (event);
    if (found)
      return true;
  }
  return false;
}

GST_START_TEST (test_gap_before_the_first_frame_set_passes_with_its_segment)
{
  for (const char *output : {"width=320,height=240", "width=320,height=240,framerate=10/1"}) {
    GstHarness *h = render_harness (ring_rig (1), {"", output});
    gst_harness_push_event (h, gst_event_new_gap (0, GST_SECOND / 30));
    fail_unless (event_arrives (h, GST_EVENT_SEGMENT));
    fail_unless (event_arrives (h, GST_EVENT_GAP));
    gst_harness_teardown (h);
  }
}
GST_END_TEST;

GST_START_TEST (test_gap_and_eos_and_flush_pass_and_it_goes_on)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = render_harness (rig);
  const RenderedPicture first = render (h, wall (rig));
  gst_harness_push_event (h, gst_event_new_gap (GST_SECOND / 30, GST_SECOND / 30));
  fail_unless (event_arrives (h, GST_EVENT_GAP));
  gst_harness_push_event (h, gst_event_new_flush_start ());
  gst_harness_push_event (h, gst_event_new_flush_stop (TRUE));
  fail_unless (event_arrives (h, GST_EVENT_FLUSH_STOP));
  GstSegment segment;
  gst_segment_init (&segment, GST_FORMAT_TIME);
  gst_harness_push_event (h, gst_event_new_segment (&segment));
  GstBuffer *untimed = gst_buffer_new ();
  GST_BUFFER_FLAG_SET (untimed, GST_BUFFER_FLAG_GAP);
  gst_harness_push (h, untimed);
  gst_harness_push_event (h, gst_event_new_gap (0, GST_SECOND / 30));
  fail_unless (event_arrives (h, GST_EVENT_SEGMENT));
  fail_unless (event_arrives (h, GST_EVENT_GAP));
  fail_unless_cmp (render (h, wall (rig)).rgba, ==, first.rgba);
  gst_harness_push_event (h, gst_event_new_eos ());
  fail_unless (event_arrives (h, GST_EVENT_EOS));
  gst_harness_teardown (h);
}
GST_END_TEST;

static constexpr GLenum kStates[] = {GL_CULL_FACE, GL_DEPTH_TEST, GL_SCISSOR_TEST, 0x8642};

/* Bits of kStates, the last of which is GL_PROGRAM_POINT_SIZE. */
static void
read_states (GstGLContext *context, gpointer user_data)
{
  const auto is_enabled = reinterpret_cast<GLboolean (*) (GLenum)> (
      gst_gl_context_get_proc_address (context, "glIsEnabled"));
  for (std::size_t i = 0; i < std::size (kStates); i++)
    if (is_enabled (kStates[i]))
      *static_cast<guint *> (user_data) |= 1u << i;
}

GST_START_TEST (test_opengl_is_left_as_it_was)
{
  SKIP_WITHOUT_OPENGL ();
  const Rig rig = ring_rig (1);
  for (const char *properties :
      {"mode=points", "mode=strips", "mode=rectangles tint-views=true background=0"}) {
    GstHarness *h = render_harness (rig, {.properties = properties, .opengl = true});
    render (h, wall (rig));
    GstElement *element = gst_harness_find_element (h, "gldownload");
    GstGLContext *context = nullptr;
    g_object_get (element, "context", &context, nullptr);
    guint enabled = 0;
    gst_gl_context_thread_add (context, read_states, &enabled);
    fail_unless (enabled == 0, "%s: %u", properties, enabled);
    gst_object_unref (context);
    gst_object_unref (element);
    gst_harness_teardown (h);
  }
}
GST_END_TEST;

GST_START_TEST (test_backend_that_does_not_fit_downstream_is_an_error_that_says_how)
{
  const std::pair<const char *, const char *> cases[] = {
      {"backend=opengl ! video/x-raw", "add gldownload"},
      {"backend=software ! video/x-raw(memory:GLMemory)", "add glupload"},
      {"! video/x-raw,framerate=5000/1", "1000/1"}};
  for (const auto &[output, cure] : cases) {
    const auto line =
        std::string ("avatartestsrc num-buffers=1 ! striprender ") + output + " ! fakesink";
    GstElement *pipeline = gst_parse_launch (line.c_str (), nullptr);
    GstBus *bus = gst_element_get_bus (pipeline);
    gst_element_set_state (pipeline, GST_STATE_PAUSED);
    GstMessage *message = gst_bus_timed_pop_filtered (bus, GST_CLOCK_TIME_NONE, GST_MESSAGE_ERROR);
    GError *error = nullptr;
    gst_message_parse_error (message, &error, nullptr);
    fail_unless (strstr (error->message, cure), "%s: %s", output, error->message);
    g_error_free (error);
    gst_message_unref (message);
    gst_element_set_state (pipeline, GST_STATE_NULL);
    gst_object_unref (bus);
    gst_object_unref (pipeline);
  }
}
GST_END_TEST;

/* Mesa's variables make an OpenGL that is too old. */
GST_START_TEST (test_old_opengl_is_one_error_that_says_so)
{
  SKIP_WITHOUT_OPENGL ();
  g_setenv ("GST_GL_API", "gles2", TRUE);
  g_setenv ("MESA_GLES_VERSION_OVERRIDE", "2.0", TRUE);
  GstElement *pipeline = gst_parse_launch (
      "avatartestsrc name=s num-buffers=1 ! striprender name=r backend=opengl ! fakesink", nullptr);
  GstElement *element = gst_bin_get_by_name (GST_BIN (pipeline), "r");
  gst_element_set_state (pipeline, GST_STATE_PLAYING);
  GstBus *bus = gst_element_get_bus (pipeline);
  int ours = 0;
  for (bool waiting = true; waiting;) {
    GstMessage *message = gst_bus_timed_pop_filtered (bus, ours ? GST_SECOND : GST_CLOCK_TIME_NONE,
        GstMessageType (GST_MESSAGE_ERROR | GST_MESSAGE_EOS));
    waiting = message && GST_MESSAGE_SRC (message) == GST_OBJECT (element);
    if (waiting) {
      GError *error = nullptr;
      gst_message_parse_error (message, &error, nullptr);
      fail_unless (strstr (error->message, "OpenGL ES 3.0"), "%s", error->message);
      g_error_free (error);
      ours++;
    }
    g_clear_pointer (&message, gst_message_unref);
  }
  gst_element_set_state (pipeline, GST_STATE_NULL);
  g_unsetenv ("GST_GL_API");
  g_unsetenv ("MESA_GLES_VERSION_OVERRIDE");
  gst_object_unref (bus);
  gst_object_unref (element);
  gst_object_unref (pipeline);
  fail_unless_equals_int (ours, 1);
}
GST_END_TEST;

GST_START_TEST (test_pictures_larger_than_opengl_has_are_one_error)
{
  SKIP_WITHOUT_OPENGL ();
  GstElement *pipeline = gst_parse_launch ("avatartestsrc num-buffers=3 ! striprender name=r ! "
                                           "video/x-raw(memory:GLMemory),width=70000,height=16 ! "
                                           "fakesink",
      nullptr);
  GstElement *element = gst_bin_get_by_name (GST_BIN (pipeline), "r");
  GstBus *bus = gst_element_get_bus (pipeline);
  gst_element_set_state (pipeline, GST_STATE_PLAYING);
  const std::string found = next_message_text (bus, GST_MESSAGE_ERROR);
  fail_unless (found.find ("70000x16") != std::string::npos, "'%s'", found.c_str ());
  while (GstMessage *more = gst_bus_timed_pop_filtered (bus, GST_SECOND / 4, GST_MESSAGE_ERROR)) {
    ck_assert_ptr_ne (GST_MESSAGE_SRC (more), GST_OBJECT (element));
    gst_message_unref (more);
  }
  gst_element_set_state (pipeline, GST_STATE_NULL);
  gst_object_unref (bus);
  gst_object_unref (element);
  gst_object_unref (pipeline);
}
GST_END_TEST;

GST_START_TEST (test_view_that_the_rig_lacks_is_one_error)
{
  GstHarness *h = render_harness (ring_rig (1));
  GstElement *element = gst_harness_find_element (h, "striprender");
  GstBus *bus = gst_bus_new ();
  gst_element_set_bus (element, bus);
  gst_harness_push (h, make_frame_set (ring_rig (2)));
  const std::string found = next_message_text (bus, GST_MESSAGE_ERROR);
  fail_unless_contains (found, "view 1 is not in the rig");
  fail_unless (gst_bus_pop_filtered (bus, GST_MESSAGE_ERROR) == nullptr);
  gst_element_set_bus (element, nullptr);
  gst_object_unref (bus);
  gst_object_unref (element);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_keeps_pts_and_capture_time_and_counts)
{
  const Rig rig = ring_rig (2);
  GstHarness *h = render_harness (rig);
  GstBuffer *output = gst_harness_push_and_pull (h, wall (rig, 123456));
  fail_unless_equals_uint64 (GST_BUFFER_PTS (output), 123456);
  fail_unless_equals_uint64 (gst_range_buffer_get_capture_time (output), 123456);
  gst_buffer_unref (output);
  fail_unless_equals_uint64 (stats_field (h, "striprender", "points"), 240 * 180);
  fail_unless_equals_uint64 (stats_field (h, "striprender", "strips"), 180);
  fail_unless_equals_uint64 (stats_field (h, "striprender", "frames"), 1);
  gst_harness_teardown (h);
}
GST_END_TEST;

static Suite *
striprender_suite ()
{
  Suite *suite = suite_create ("striprender");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_edges_of_a_smaller_roi_do_not_read_the_last_frame);
  tcase_add_test (tc, test_padded_strides_give_the_same_picture);
  tcase_add_test (tc, test_mouse_turns_and_zooms_and_r_goes_back);
  tcase_add_test (tc, test_moving_with_the_mouse_follows_the_hand);
  tcase_add_test (tc, test_plus_and_minus_zoom_on_every_keyboard);
  tcase_add_test (tc, test_azimuth_can_be_controlled);
  tcase_add_test (tc, test_output_size_changes_in_mid_stream);
  tcase_add_test (tc, test_gap_before_the_first_frame_set_passes_with_its_segment);
  tcase_add_test (tc, test_gap_and_eos_and_flush_pass_and_it_goes_on);
  tcase_add_test (tc, test_opengl_is_left_as_it_was);
  tcase_add_test (tc, test_backend_that_does_not_fit_downstream_is_an_error_that_says_how);
  tcase_add_test (tc, test_old_opengl_is_one_error_that_says_so);
  tcase_add_test (tc, test_pictures_larger_than_opengl_has_are_one_error);
  tcase_add_test (tc, test_view_that_the_rig_lacks_is_one_error);
  tcase_add_test (tc, test_keeps_pts_and_capture_time_and_counts);
  return suite;
}

GST_CHECK_MAIN (striprender);
