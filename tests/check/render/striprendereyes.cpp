/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* striprender beside its strips: stereoscopic pictures, near and far plane, touch, overlays, alpha.
 */
#include <gst/gl/gstglfuncs.h>
#include <gst/video/video.h>

#include <rangecast/surface/view_tint.hpp>

#include "render-check.hpp"

using namespace rangecast;
using namespace rangecast::testing;

/* ring_rig (1) with a white square of 9x9 pixels at the picture's middle, at that depth. */
static GstBuffer *
dot (const Rig &rig, int depth, GstClockTime pts = 0)
{
  GstBuffer *buffer = make_frame_set (rig, pts);
  gstrange::RangeFrameMap frame (buffer, GST_MAP_READWRITE);
  for (const RangeImage &image : frame.views ())
    for (int y = 0; y < 240; y++)
      for (int x = 0; x < 320; x++) {
        const bool in_dot =
            image.view_id == 0 && std::abs (x - 160) <= 4 && std::abs (y - 120) <= 4;
        image.depth.at (x, y) = in_dot ? guint16 (depth) : 0;
        image.colour.at (x, y) = {255, 255, 255, 0};
      }
  return buffer;
}

struct Spot {
  double x = 0, y = 0;
  int pixels = 0;
};

/* The middle of what is bright. */
static Spot
bright (const RenderedPicture &picture)
{
  Spot spot;
  for (int y = 0; y < picture.height; y++)
    for (int x = 0; x < picture.width; x++)
      if (picture.at (x, y)[0] > 200) {
        spot.x += x;
        spot.y += y;
        spot.pixels++;
      }
  fail_unless (spot.pixels > 0, "nothing is to be seen");
  spot.x /= spot.pixels;
  spot.y /= spot.pixels;
  return spot;
}

/* One picture of a dot in caps of that multiview-mode. */
static RenderedPicture
eyes (const char *properties, const std::string &output, int width, int depth)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = render_harness (rig, {properties, output.c_str ()});
  RenderedPicture picture = render (h, dot (rig, depth), width);
  gst_harness_teardown (h);
  return picture;
}

/* What two eyes see of the dot: how much further right it is in the left picture, pixels. The
 * target of one view is at the harmonic mean of near and far, 0.5 m; 320 pixels of focal length. */
static double
disparity (const char *properties, int depth)
{
  const RenderedPicture both =
      eyes (properties, "width=640,height=240,multiview-mode=side-by-side", 640, depth);
  const Spot left = bright (both.part (0, 0, 320, 240));
  const Spot right = bright (both.part (320, 0, 320, 240));
  fail_unless (std::abs (left.y - right.y) < 0.1, "one eye is higher than the other");
  fail_unless (std::abs (left.x + right.x - 320) < 1, "the eyes are not beside the camera");
  return left.x - right.x;
}

GST_START_TEST (test_known_point_has_the_disparity_of_its_distance)
{
  const double f_times_eye = 320 * 0.1;
  for (auto [depth, metres] : {std::pair{4000, 0.4}, {5000, 0.5}, {10000, 1.0}}) {
    const double expected = f_times_eye * (1 / metres - 1 / 0.5);
    const double found = disparity ("eye-distance=0.1", depth);
    fail_unless (std::abs (found - expected) < 0.6, "%f m: %f, not %f", metres, found, expected);
  }
  const double parallel = disparity ("eye-distance=0.1 convergence=1000", 10000);
  fail_unless (std::abs (parallel - f_times_eye) < 0.6, "in parallel: %f", parallel);
  fail_unless_cmp (std::abs (disparity ("eye-distance=0", 10000)), <, 0.01);
}
GST_END_TEST;

static int
pixels_that_differ (const RenderedPicture &a, const RenderedPicture &b)
{
  fail_unless_equals_int (a.rgba.size (), b.rgba.size ());
  int differ = 0;
  for (std::size_t i = 0; i < a.rgba.size (); i += 4)
    differ += std::abs (a.rgba[i] - b.rgba[i]) > 8;
  return differ;
}

GST_START_TEST (test_all_packings_hold_the_same_two_pictures)
{
  const char *size = "width=320,height=240,multiview-mode=";
  const std::string single = size;
  const RenderedPicture left = eyes ("tint-views=false", single + "left", 320, 8000);
  const RenderedPicture right = eyes ("", single + "right", 320, 8000);
  const RenderedPicture mono = eyes ("", single + "mono", 320, 8000);
  fail_unless (bright (left).x > bright (mono).x + 1 || bright (left).x < bright (mono).x - 1);
  const RenderedPicture wide =
      eyes ("", "width=640,height=240,multiview-mode=side-by-side", 640, 8000);
  fail_unless_equals_int (pixels_that_differ (wide.part (0, 0, 320, 240), left), 0);
  fail_unless_equals_int (pixels_that_differ (wide.part (320, 0, 320, 240), right), 0);
  const RenderedPicture high =
      eyes ("", "width=320,height=480,multiview-mode=top-bottom", 320, 8000);
  fail_unless_equals_int (pixels_that_differ (high.part (0, 0, 320, 240), left), 0);
  fail_unless_equals_int (pixels_that_differ (high.part (0, 240, 320, 240), right), 0);
  const RenderedPicture swapped = eyes ("",
      "width=640,height=240,multiview-mode=side-by-side,"
      "multiview-flags=(GstVideoMultiviewFlagsSet)1:1:right-view-first",
      640, 8000);
  fail_unless_equals_int (pixels_that_differ (swapped.part (0, 0, 320, 240), right), 0);
}
GST_END_TEST;

GST_START_TEST (test_flags_as_text_are_one_error)
{
  GstElement *pipeline =
      gst_parse_launch ("avatartestsrc num-buffers=1 ! striprender ! video/x-raw,"
                        "multiview-mode=side-by-side,multiview-flags=half-aspect ! fakesink",
          nullptr);
  GstBus *bus = gst_element_get_bus (pipeline);
  gst_element_set_state (pipeline, GST_STATE_PLAYING);
  const std::string text = next_message_text (bus, GST_MESSAGE_ERROR);
  fail_unless (text.find ("multiview-flags") != std::string::npos, "'%s'", text.c_str ());
  gst_element_set_state (pipeline, GST_STATE_NULL);
  gst_object_unref (bus);
  gst_object_unref (pipeline);
}
GST_END_TEST;

static GstPadProbeReturn
take_memories (GstPad *, GstPadProbeInfo *info, gpointer user_data)
{
  auto pictures = static_cast<std::vector<RenderedPicture> *> (user_data);
  GstBuffer *buffer = GST_PAD_PROBE_INFO_BUFFER (info);
  for (guint i = 0; i < gst_buffer_n_memory (buffer); i++) {
    GstMapInfo map;
    RenderedPicture picture;
    fail_unless (gst_memory_map (gst_buffer_peek_memory (buffer, i), &map, GST_MAP_READ));
    picture.width = 320;
    picture.height = int (map.size / (4 * 320));
    picture.rgba.assign (map.data, map.data + map.size);
    gst_memory_unmap (gst_buffer_peek_memory (buffer, i), &map);
    pictures->push_back (std::move (picture));
  }
  return GST_PAD_PROBE_OK;
}

GST_START_TEST (test_separated_pictures_are_memories_of_one_buffer)
{
  SKIP_WITHOUT_OPENGL ();
  const Rig rig = ring_rig (1);
  GstHarness *h = gst_harness_new ("striprender");
  std::vector<RenderedPicture> pictures;
  gst_pad_add_probe (h->sinkpad, GST_PAD_PROBE_TYPE_BUFFER, take_memories, &pictures, nullptr);
  gst_harness_set_sink_caps_str (
      h, "video/x-raw(memory:GLMemory),width=320,height=240,multiview-mode=separated");
  gst_harness_set_src_caps (h, gstrange::make_range_caps (gstrange::make_info (rig, 30, 1)));
  GstBuffer *out = gst_harness_push_and_pull (h, dot (rig, 8000));
  fail_unless (out != nullptr);
  gst_buffer_unref (out);
  gst_harness_teardown (h);
  fail_unless_equals_int (pictures.size (), 2);
  fail_unless_equals_int (pictures[0].height, 240);
  const std::string single = "width=320,height=240,multiview-mode=";
  fail_unless_equals_int (
      pixels_that_differ (pictures[0], eyes ("", single + "left", 320, 8000)), 0);
  fail_unless_equals_int (
      pixels_that_differ (pictures[1], eyes ("", single + "right", 320, 8000)), 0);
}
GST_END_TEST;

/* ---- near and far plane ---- */

/* ---- overlays ---- */

GST_START_TEST (test_units_are_in_their_cameras_colours)
{
  const Rig rig = ring_rig (4);
  GstHarness *h = render_harness (rig, {"tint-views=true"});
  GstElement *r = gst_bin_get_by_name (GST_BIN (h->element), "r");
  for (guint i = 0; i < 4; i++) {
    g_object_set (r, "azimuth", 90.0 * i, nullptr);
    GstBuffer *set = make_frame_set (rig, i * GST_SECOND);
    {
      gstrange::RangeFrameMap frame (set, GST_MAP_READWRITE);
      for (const RangeImage &image : frame.views ()) /* only the one that is looked at from */
        for (int y = 0; y < 240; y++)
          for (int x = 0; x < 320; x++) {
            image.depth.at (x, y) = image.view_id == int (i) ? 7000 : 0;
            image.colour.at (x, y) = {100, 100, 100, 0};
          }
    }
    const RenderedPicture picture = render (h, set, 320);
    const ViewColour colour = view_colour (i);
    const int expected[] = {colour.red, colour.green, colour.blue};
    for (int c = 0; c < 3; c++) /* brightness 100 of 255: 355 of 510 */
      fail_unless (std::abs (picture.at (160, 120)[c] - expected[c] * 355 / 510) <= 2,
          "view %d: channel %d is %d", int (i), c, picture.at (160, 120)[c]);
  }
  gst_object_unref (r);
  gst_harness_teardown (h);
}
GST_END_TEST;

/* Over red: the figure is opaque, what is beside it is red. */
static void
expect_overlay (const char *launch)
{
  GstElement *pipeline = gst_parse_launch (launch, nullptr);
  fail_unless (pipeline != nullptr);
  GstElement *sink = gst_bin_get_by_name (GST_BIN (pipeline), "sink");
  gst_element_set_state (pipeline, GST_STATE_PLAYING);
  GstSample *sample = nullptr;
  g_signal_emit_by_name (sink, "pull-sample", &sample);
  fail_unless (sample != nullptr);
  const RenderedPicture picture =
      take_rendered (gst_buffer_ref (gst_sample_get_buffer (sample)), 320);
  gst_sample_unref (sample);
  const guint8 *beside = picture.at (10, 10), *figure = picture.at (160, 200);
  fail_unless (beside[0] > 240 && beside[1] < 15 && beside[2] < 15, "beside: %d %d %d", beside[0],
      beside[1], beside[2]);
  fail_unless (
      figure[0] < 240 || figure[1] > 40, "figure: %d %d %d", figure[0], figure[1], figure[2]);
  gst_element_set_state (pipeline, GST_STATE_NULL);
  gst_object_unref (sink);
  gst_object_unref (pipeline);
}

GST_START_TEST (test_transparent_background_lets_video_through)
{
  const std::string figure = "avatartestsrc num-buffers=2 noise=0 ! striprender background=0 ! "
                             "video/x-raw,width=320,height=240 ! ";
  const std::string red =
      " videotestsrc pattern=red num-buffers=2 ! video/x-raw,width=320,height=240 ! ";
  const std::string out = " ! video/x-raw,format=RGBA ! appsink name=sink sync=false ";
  expect_overlay (("compositor name=m sink_0::zorder=0 sink_1::zorder=1 ! videoconvert" + out +
                   red + "m.sink_0 " + figure + "m.sink_1")
                      .c_str ());
  if (!opengl_works ())
    return;
  expect_overlay (("glvideomixer name=m sink_0::zorder=0 sink_1::zorder=1 ! gldownload" + out +
                   red + "glupload ! glcolorconvert ! m.sink_0 " + figure + "glupload ! m.sink_1")
                      .c_str ());
}
GST_END_TEST;

/* ---- OpenGL that fails ---- */

static GLenum GSTGLAPI
say_lost ()
{
  return 0x0507; /* GL_CONTEXT_LOST */
}

static void
lose_context (GstGLContext *context, gpointer)
{
  context->gl_vtable->GetError = say_lost;
}

/* Which memory downstream accepts. */
static GstPadProbeReturn
answer_caps (GstPad *, GstPadProbeInfo *info, gpointer accepts_all)
{
  GstQuery *query = GST_PAD_PROBE_INFO_QUERY (info);
  if (GST_QUERY_TYPE (query) != GST_QUERY_CAPS)
    return GST_PAD_PROBE_OK;
  GstCaps *caps = gst_caps_from_string (
      *static_cast<bool *> (accepts_all)
          ? "video/x-raw(memory:GLMemory),width=64,height=48; video/x-raw,width=64,height=48"
          : "video/x-raw(memory:GLMemory),width=64,height=48");
  gst_query_set_caps_result (query, caps);
  gst_caps_unref (caps);
  return GST_PAD_PROBE_HANDLED;
}

static void
lose_the_context_of (const char *element, bool accepts_all, GstMessageType type, const char *text)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = gst_harness_new_parse (element);
  bool accepts = false;
  gst_pad_add_probe (
      h->sinkpad, GST_PAD_PROBE_TYPE_QUERY_DOWNSTREAM, answer_caps, &accepts, nullptr);
  gst_harness_set_src_caps (h, gstrange::make_range_caps (gstrange::make_info (rig, 30, 1)));
  GstElement *r = gst_harness_find_element (h, "striprender");
  GstBus *bus = gst_bus_new ();
  gst_element_set_bus (r, bus);
  GstBuffer *picture = gst_harness_push_and_pull (h, dot (rig, 8000));
  auto memory = reinterpret_cast<GstGLBaseMemory *> (gst_buffer_peek_memory (picture, 0));
  gst_gl_context_thread_add (memory->context, lose_context, nullptr);
  gst_buffer_unref (picture);
  accepts = accepts_all;
  gst_harness_push (h, dot (rig, 8000, 1));
  fail_unless_contains (next_message_text (bus, type), text);
  if (type == GST_MESSAGE_WARNING)
    for (int i = 2; i < 5; i++) {
      const RenderedPicture drawn = render (h, dot (rig, 8000, GstClockTime (i)), 64);
      fail_unless (drawn.at (32, 24, 0) > 100, "%d", drawn.at (32, 24, 0));
    }
  const auto bad = GstMessageType (GST_MESSAGE_ERROR | GST_MESSAGE_WARNING);
  fail_unless (gst_bus_pop_filtered (bus, bad) == nullptr);
  gst_element_set_bus (r, nullptr);
  gst_object_unref (r);
  gst_object_unref (bus);
  gst_harness_teardown (h);
}

GST_START_TEST (test_lost_context_is_one_warning_or_one_error)
{
  SKIP_WITHOUT_OPENGL ();
  lose_the_context_of ("striprender", true, GST_MESSAGE_WARNING, "software");
  lose_the_context_of ("striprender backend=opengl", true, GST_MESSAGE_ERROR, "context is lost");
}
GST_END_TEST;

GST_START_TEST (test_no_context_at_all_is_one_error)
{
  g_setenv ("GST_GL_API", "gles1", TRUE); /* which no element draws with */
  GstElement *pipeline = gst_parse_launch (
      "avatartestsrc num-buffers=3 ! striprender backend=opengl ! fakesink", nullptr);
  GstBus *bus = gst_element_get_bus (pipeline);
  gst_element_set_state (pipeline, GST_STATE_PLAYING);
  const std::string text = next_message_text (bus, GST_MESSAGE_ERROR);
  fail_unless_contains (text, "gles1");
  int ours = 0;
  while (
      GstMessage *message = gst_bus_timed_pop_filtered (bus, GST_SECOND / 4, GST_MESSAGE_ERROR)) {
    ours += g_str_has_prefix (GST_OBJECT_NAME (GST_MESSAGE_SRC (message)), "striprender");
    gst_message_unref (message);
  }
  fail_unless_equals_int (ours, 0);
  gst_element_set_state (pipeline, GST_STATE_NULL);
  g_unsetenv ("GST_GL_API");
  gst_object_unref (bus);
  gst_object_unref (pipeline);
}
GST_END_TEST;

/* ---- touch ---- */

struct Touched {
  double azimuth, elevation, distance, pan_x, pan_y;
};

static Touched
values_of (GstElement *r)
{
  Touched t;
  g_object_get (r, "azimuth", &t.azimuth, "elevation", &t.elevation, "distance", &t.distance,
      "pan-x", &t.pan_x, "pan-y", &t.pan_y, nullptr);
  return t;
}

GST_START_TEST (test_one_finger_turns_two_move_and_zoom)
{
  GstElement *r = gst_element_factory_make ("striprender", nullptr);
  GstPad *src = gst_element_get_static_pad (r, "src");
  gst_element_set_state (r, GST_STATE_PAUSED);
  const auto none = GST_NAVIGATION_MODIFIER_NONE;
  const auto down = [&] (guint id, double x, double y) {
    gst_pad_send_event (src, gst_navigation_event_new_touch_down (id, x, y, 1, none));
  };
  const auto move = [&] (guint id, double x, double y) {
    gst_pad_send_event (src, gst_navigation_event_new_touch_motion (id, x, y, 1, none));
  };
  move (7, 5, 5); /* is not down */
  down (7, 320, 240);
  move (7, 160, 240); /* a quarter of 640 pixels */
  Touched t = values_of (r);
  fail_unless (std::abs (t.azimuth - 45) < 1e-6 && t.elevation == 0, "azimuth %f", t.azimuth);
  down (9, 260, 240);
  down (11, 0, 0);     /* a third finger */
  move (11, 600, 400); /* does nothing */
  move (9, 360, 240);  /* twice as far apart */
  t = values_of (r);
  fail_unless (std::abs (t.azimuth - 45) < 1e-6, "two fingers turn: %f", t.azimuth);
  fail_unless (std::abs (t.distance - 0.5) < 1e-6, "distance %f", t.distance);
  gst_pad_send_event (src, gst_navigation_event_new_touch_up (7, 160, 240, none));
  move (9, 360, 120);
  t = values_of (r);
  fail_unless (std::abs (t.elevation + 22.5) < 1e-6, "elevation %f", t.elevation);
  gst_pad_send_event (src, gst_navigation_event_new_touch_cancel (none));
  move (9, 0, 0);
  fail_unless_cmp (values_of (r).azimuth, ==, t.azimuth);
  gst_element_set_state (r, GST_STATE_NULL);
  gst_object_unref (src);
  gst_object_unref (r);
}
GST_END_TEST;

static Suite *
striprendereyes_suite ()
{
  Suite *suite = suite_create ("striprendereyes");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_known_point_has_the_disparity_of_its_distance);
  tcase_add_test (tc, test_all_packings_hold_the_same_two_pictures);
  tcase_add_test (tc, test_flags_as_text_are_one_error);
  tcase_add_test (tc, test_separated_pictures_are_memories_of_one_buffer);
  tcase_add_test (tc, test_units_are_in_their_cameras_colours);
  tcase_add_test (tc, test_transparent_background_lets_video_through);
  tcase_add_test (tc, test_lost_context_is_one_warning_or_one_error);
  tcase_add_test (tc, test_no_context_at_all_is_one_error);
  tcase_add_test (tc, test_one_finger_turns_two_move_and_zoom);
  return suite;
}

GST_CHECK_MAIN (striprendereyes);
