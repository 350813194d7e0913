/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* striprender's picture: what is where, in which colour, in all modes and of any frame set. */
#include "render-check.hpp"

#include <cstdlib>
#include <functional>

using namespace rangecast;
using namespace rangecast::testing;

GST_START_TEST (test_default_picture_is_the_first_views_own_in_every_mode)
{
  const Rig rig = ring_rig (4);
  for (const char *mode :
      {"mode=blend", "mode=strips", "mode=rectangles", "mode=points point-size=1.5"}) {
    GstHarness *h = render_harness (rig, mode);
    const RenderedPicture picture = render (h, wall (rig));
    double error = 0;
    for (int y = 35; y < 205; y++)
      for (int x = 45; x < 275; x++) {
        const int expected[] = {x / 2 + 50, y, 200 - x / 2};
        for (int c = 0; c < 3; c++)
          error += std::pow (picture.at (x, y, c) - expected[c], 2);
      }
    const double mse = error / (170 * 230 * 3);
    fail_unless (mse < 4, "%s: mean square error %f", mode, mse);
    fail_unless_equals_int (picture.at (10, 120, 0), 0x20); /* the background */
    fail_unless_equals_int (picture.at (160, 225, 2), 0x2a);
    gst_harness_teardown (h);
  }
}
GST_END_TEST;

/* A frame set of the rig's first view, whole: depth and colour of each pixel as a function says. */
using Pixel = std::function<void (int x, int y, guint16 &depth, Rgbx &colour)>;

static GstBuffer *
drawn_by (const Rig &rig, const Pixel &pixel)
{
  GstBuffer *buffer = make_frame_set (rig);
  gstrange::RangeFrameMap frame (buffer, GST_MAP_READWRITE);
  for (const RangeImage &image : frame.views ())
    for (int y = 0; y < 240; y++)
      for (int x = 0; x < 320; x++) {
        image.depth.at (x, y) = 0;
        if (image.view_id == 0)
          pixel (x, y, image.depth.at (x, y), image.colour.at (x, y));
      }
  return buffer;
}

/* A smooth hill in soft colours, round, on nothing. */
static void
hill (int x, int y, guint16 &depth, Rgbx &colour)
{
  const double u = (x - 159.5) / 110, v = (y - 119.5) / 100, d = u * u + v * v;
  depth = guint16 (d < 1 ? 7000 + 1000 * d : 0);
  colour = {guint8 (128 + 80 * std::sin (x / 20.0)), guint8 (128 + 80 * std::sin (y / 15.0)),
      guint8 (100 + x / 4), 0};
}

static bool
is_background (const RenderedPicture &picture, int x, int y)
{
  return picture.at (x, y, 0) == 0x20 && picture.at (x, y, 1) == 0x24 &&
         picture.at (x, y, 2) == 0x2a;
}

struct Likeness {
  double psnr_db;  /* where both have something */
  double only_one; /* share of what either draws that only one does */
};

static Likeness
compare (const RenderedPicture &a, const RenderedPicture &b)
{
  double squares = 0, both = 0, one = 0;
  for (int y = 0; y < 240; y++)
    for (int x = 0; x < 320; x++) {
      const bool in_a = !is_background (a, x, y), in_b = !is_background (b, x, y);
      both += in_a && in_b;
      one += in_a != in_b;
      for (int c = 0; in_a && in_b && c < 3; c++)
        squares += std::pow (a.at (x, y, c) - b.at (x, y, c), 2);
    }
  fail_unless (both > 1000, "the pictures have nothing in common");
  return {10 * std::log10 (255 * 255 / std::max (squares / (3 * both), 1e-9)), one / (both + one)};
}

/* The built-in figure, from all sides. */
static GstBuffer *
figure (Rig &rig)
{
  GstHarness *h = gst_harness_new_parse ("avatartestsrc views=4 range-person-only=true "
                                         "num-buffers=1 "
                                         "! capsfilter caps=video/x-range,width=320,height=240");
  gst_harness_play (h);
  GstBuffer *frame_set = gst_harness_pull (h);
  GstCaps *caps = gst_pad_get_current_caps (h->sinkpad);
  gstrange::RangeInfo info;
  fail_unless (frame_set && gstrange::parse_caps (caps, info).ok ());
  rig = info.rig;
  gst_caps_unref (caps);
  gst_harness_teardown (h);
  return frame_set;
}

/* Of both kinds of OpenGL as in software, three scenes from five places. Rectangles, which face
 * their camera, have cracks between them, which differ. */
GST_START_TEST (test_opengl_draws_the_same_picture)
{
  struct {
    Rig rig;
    GstBuffer *frame_set;
  } scenes[3] = {{ring_rig (1), nullptr}, {ring_rig (9), nullptr}, {}};
  scenes[0].frame_set = drawn_by (scenes[0].rig, hill);
  scenes[1].rig.views.resize (2);
  scenes[1].frame_set = wall_of_two (scenes[1].rig);
  scenes[2].frame_set = figure (scenes[2].rig);
  const char *places[] = {"azimuth=0", "azimuth=12", "azimuth=-35 elevation=20",
      "azimuth=60 distance=0.6", "azimuth=10 pan-x=0.2 field-of-view=70"};
  for (const char *api : {"opengl3", "gles2"}) {
    g_setenv ("GST_GL_API", api, TRUE);
    if (!opengl_works ()) {
      g_unsetenv ("GST_GL_API");
      RANGECAST_SKIP ("no OpenGL context of both kinds");
    }
    for (const char *mode : {"", " mode=strips", " mode=points"})
      for (const char *place : places)
        for (const auto &[rig, frame_set] : scenes) {
          if (frame_set != scenes[0].frame_set && *mode) /* noise decides what is in front */
            continue;
          const std::string properties = std::string (place) + mode;
          RenderedPicture pictures[2];
          for (const bool opengl : {false, true}) {
            GstHarness *h =
                render_harness (rig, {.properties = properties.c_str (), .opengl = opengl});
            pictures[opengl] = render (h, gst_buffer_ref (frame_set));
            GstElement *r = gst_harness_find_element (h, "striprender");
            GstStructure *stats = nullptr;
            g_object_get (r, "stats", &stats, nullptr);
            fail_unless_equals_string (
                gst_structure_get_string (stats, "backend"), opengl ? "opengl" : "software");
            gst_structure_free (stats);
            gst_object_unref (r);
            gst_harness_teardown (h);
          }
          const Likeness like = compare (pictures[0], pictures[1]);
          fail_unless (like.psnr_db > (properties.ends_with ("points") ? 30 : 40), "%s: %f dB",
              properties.c_str (), like.psnr_db);
          fail_unless (like.only_one < (properties.ends_with ("points") ? 0.05 : 0.005), "%s: %f",
              properties.c_str (), like.only_one);
        }
  }
  for (const auto &scene : scenes)
    gst_buffer_unref (scene.frame_set);
  g_unsetenv ("GST_GL_API");
}
GST_END_TEST;

/* Neither gamma nor rounding: a colour that goes in comes out. */
GST_START_TEST (test_colours_come_out_as_they_go_in)
{
  const Rig rig = ring_rig (1);
  for (const char *properties : {"", "mode=rectangles", "mode=points"}) {
    GstHarness *h = render_harness (rig, properties);
    const RenderedPicture picture =
        render (h, drawn_by (rig, [] (int x, int, guint16 &depth, Rgbx &colour) {
          depth = 8000;
          colour = x < 160 ? Rgbx{10, 100, 200, 0} : Rgbx{255, 0, 1, 0};
        }));
    for (auto [x, red, green, blue] : {std::tuple{100, 10, 100, 200}, {220, 255, 0, 1}}) {
      fail_unless_equals_int (picture.at (x, 120, 0), red);
      fail_unless_equals_int (picture.at (x, 120, 1), green);
      fail_unless_equals_int (picture.at (x, 120, 2), blue);
    }
    gst_harness_teardown (h);
  }
}
GST_END_TEST;

GST_START_TEST (test_strips_leave_out_surfaces_seen_from_behind)
{
  const Rig rig = ring_rig (2); /* the scene's middle is where both look */
  const auto drawn = [&] (const char *properties) {
    GstHarness *h = render_harness (rig, properties);
    const RenderedPicture picture = render (h, wall (rig));
    gst_harness_teardown (h);
    return int (!is_background (picture, 160, 120));
  };
  fail_unless_equals_int (drawn ("mode=strips"), 1);
  fail_unless_equals_int (drawn ("mode=strips azimuth=180"), 0);
}
GST_END_TEST;

GST_START_TEST (test_one_camera_is_drawn_from_behind_too)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = render_harness (rig, "azimuth=180 field-of-view=60");
  const RenderedPicture picture = render (h, wall (rig));
  int drawn = 0;
  for (int y = 0; y < 240; y++)
    for (int x = 0; x < 320; x++)
      drawn += !is_background (picture, x, y);
  fail_unless (drawn > 5000, "%d pixels", drawn);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_views_of_one_surface_do_not_shine_through_each_other)
{
  Rig rig = ring_rig (9);
  rig.views.resize (2);
  const auto green = [&] (const char *properties) {
    GstHarness *h = render_harness (rig, properties);
    const RenderedPicture picture = render (h, wall_of_two (rig));
    int n = 0;
    for (int y = 60; y < 180; y++)
      for (int x = 100; x < 220; x++)
        n += picture.at (x, y, 1) > 100;
    gst_harness_teardown (h);
    return n;
  };
  fail_unless_equals_int (green ("mode=strips"), 0);
  fail_unless_equals_int (green ("mode=strips azimuth=40"), 120 * 120);
}
GST_END_TEST;

/* ---- frame sets that are hardly any ---- */

GST_START_TEST (test_64_views_are_all_drawn)
{
  const Rig rig = ring_rig (64);
  GstHarness *h = render_harness (rig, "distance=2");
  const RenderedPicture picture = render (h, make_frame_set (rig, 0, {120, 90, 80, 60}));
  GstBuffer *one = make_frame_set (ring_rig (1), 0, {120, 90, 80, 60});
  const RenderedPicture alone = render (h, one);
  const guint64 points = stats_field (h, "striprender", "points");
  render (h, make_frame_set (rig, 0, {120, 90, 80, 60}));
  fail_unless_equals_uint64 (stats_field (h, "striprender", "points"), 64 * points);
  int more = 0;
  for (int y = 0; y < 240; y++)
    for (int x = 0; x < 320; x++)
      more += !is_background (picture, x, y) && is_background (alone, x, y);
  fail_unless (more > 200, "%d pixels", more);
  gst_harness_teardown (h);
}
GST_END_TEST;

/* Other cameras, of another size, in mid-stream: no picture is of both rigs. */
GST_START_TEST (test_new_rig_in_mid_stream_is_drawn_by_its_own_cameras)
{
  const Rig small = ring_rig (3, 64, 48), large = ring_rig (2);
  GstHarness *h = render_harness (large);
  const RenderedPicture before = render (h, wall (large));
  const auto use = [&] (const Rig &rig) {
    gst_harness_set_src_caps (h, gstrange::make_range_caps (gstrange::make_info (rig, 30, 1)));
  };
  use (small);
  const RenderedPicture other = render (h, make_frame_set (small));
  fail_unless_cmp (other.rgba, !=, before.rgba);
  fail_if (is_background (other, 160, 120));
  use (large);
  fail_unless_cmp (render (h, wall (large)).rgba, ==, before.rgba);
  gst_harness_teardown (h);
}
GST_END_TEST;

static Suite *
strippicture_suite ()
{
  Suite *suite = suite_create ("strippicture");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_default_picture_is_the_first_views_own_in_every_mode);
  tcase_add_test (tc, test_opengl_draws_the_same_picture);
  tcase_add_test (tc, test_colours_come_out_as_they_go_in);
  tcase_add_test (tc, test_strips_leave_out_surfaces_seen_from_behind);
  tcase_add_test (tc, test_one_camera_is_drawn_from_behind_too);
  tcase_add_test (tc, test_views_of_one_surface_do_not_shine_through_each_other);
  tcase_add_test (tc, test_64_views_are_all_drawn);
  tcase_add_test (tc, test_new_rig_in_mid_stream_is_drawn_by_its_own_cameras);
  return suite;
}

GST_CHECK_MAIN (strippicture);
