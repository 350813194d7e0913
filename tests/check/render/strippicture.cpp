/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* striprender's picture: what is where, in which colour, in all modes and of any frame set. */
#include "render-check.hpp"

#include <gst/gl/gstglfuncs.h>

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
    if (!h)
      RANGECAST_SKIP ("no OpenGL context");
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

/* The background begins right beside the outermost pixels. */
GST_START_TEST (test_edges_lose_no_pixel_and_gain_none)
{
  const Rig rig = ring_rig (1);
  for (const char *mode : {"mode=strips", "mode=rectangles"}) {
    GstHarness *h = render_harness (rig, mode);
    if (!h)
      RANGECAST_SKIP ("no OpenGL context");
    const RenderedPicture picture = render (h, wall (rig));
    for (auto [x, y] :
        {std::pair{160, 30}, {160, 209}, {40, 120}, {279, 120}, {40, 30}, {279, 209}})
      fail_unless (picture.at (x, y, 0) >= 50 + 40 / 2, "%s: %d, %d is missing", mode, x, y);
    for (auto [x, y] : {std::pair{160, 29}, {160, 210}, {39, 120}, {280, 120}})
      fail_unless (picture.at (x, y, 0) == 0x20, "%s: %d, %d is drawn", mode, x, y);
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

/* Strips blend from pixel to pixel, rectangles and points do not: that is all of the difference. */
GST_START_TEST (test_three_modes_draw_the_same_picture)
{
  const Rig rig = ring_rig (1);
  for (const char *camera : {"", "azimuth=20", "azimuth=30 elevation=-15 distance=0.7"}) {
    RenderedPicture pictures[3];
    const char *modes[] = {"mode=strips", "mode=rectangles", "mode=points point-size=1.6"};
    for (int i = 0; i < 3; i++) {
      GstHarness *h = render_harness (rig, (std::string (modes[i]) + " " + camera).c_str ());
      if (!h)
        RANGECAST_SKIP ("no OpenGL context");
      pictures[i] = render (h, drawn_by (rig, hill));
      gst_harness_teardown (h);
    }
    for (int i = 1; i < 3; i++) {
      const Likeness like = compare (pictures[0], pictures[i]);
      fail_unless (like.psnr_db > 36, "%s %s: %f dB", camera, modes[i], like.psnr_db);
      fail_unless (like.only_one < 0.03, "%s %s: %f", camera, modes[i], like.only_one);
    }
  }
}
GST_END_TEST;

GST_START_TEST (test_opengl_es_draws_the_same_picture)
{
  const Rig rig = ring_rig (1);
  for (const char *properties :
      {"azimuth=20", "azimuth=20 mode=rectangles", "azimuth=20 mode=points", "samples=4"}) {
    RenderedPicture pictures[2];
    for (const char *api : {"opengl3", "gles2"}) {
      g_setenv ("GST_GL_API", api, TRUE);
      GstHarness *h = render_harness (rig, properties);
      if (!h) {
        g_unsetenv ("GST_GL_API");
        RANGECAST_SKIP ("no OpenGL context of both kinds");
      }
      pictures[api[0] == 'g'] = render (h, drawn_by (rig, hill));
      GstElement *element = gst_harness_find_element (h, "striprender");
      GstGLContext *context = nullptr;
      g_object_get (element, "context", &context, nullptr);
      fail_unless_equals_int (
          gst_gl_context_get_gl_api (context) == GST_GL_API_GLES2, api[0] == 'g');
      gst_object_unref (context);
      gst_object_unref (element);
      gst_harness_teardown (h);
    }
    const Likeness like = compare (pictures[0], pictures[1]);
    fail_unless (like.psnr_db > 45, "%s: %f dB", properties, like.psnr_db);
    fail_unless (like.only_one < 0.002, "%s: %f", properties, like.only_one);
  }
  g_unsetenv ("GST_GL_API");
}
GST_END_TEST;

/* Neither gamma nor rounding: a colour that goes in comes out. */
GST_START_TEST (test_colours_come_out_as_they_go_in)
{
  const Rig rig = ring_rig (1);
  for (const char *properties : {"", "mode=rectangles", "mode=points", "samples=4"}) {
    GstHarness *h = render_harness (rig, properties);
    if (!h)
      RANGECAST_SKIP ("no OpenGL context");
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

/* Pixels on the rim of a disc that are neither its colour nor the background. */
static int
mixed_pixels (const RenderedPicture &picture)
{
  int mixed = 0;
  for (int i = 0; i < 320 * 240; i++)
    mixed += picture.rgba[4 * i] != 0x20 && picture.rgba[4 * i] != 0xff;
  return mixed;
}

/* A white disc on nothing. */
static void
disc_pixel (int x, int y, guint16 &depth, Rgbx &colour)
{
  depth = std::hypot (x - 159.5, y - 119.5) < 70 ? 8000 : 0;
  colour = {255, 255, 255, 0};
}

GST_START_TEST (test_samples_smooth_edges_and_may_change_any_time)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = render_harness (rig, "mode=strips azimuth=25");
  if (!h)
    RANGECAST_SKIP ("no OpenGL context");
  const auto disc = [&] { return drawn_by (rig, disc_pixel); };
  GstElement *element = gst_harness_find_element (h, "striprender");
  const auto set_samples = [&] (int n) { g_object_set (element, "samples", n, nullptr); };
  const RenderedPicture plain = render (h, disc ());
  fail_unless_equals_int (mixed_pixels (plain), 0);
  set_samples (4);
  const RenderedPicture smooth = render (h, disc ());
  fail_unless (mixed_pixels (smooth) > 100, "%d", mixed_pixels (smooth));
  fail_unless_equals_int (smooth.at (160, 120, 0), 0xff);
  fail_unless_equals_int (smooth.at (5, 5, 2), 0x2a);
  set_samples (64); /* more than there are anywhere: as many as there are */
  ck_assert_int_gt (mixed_pixels (render (h, disc ())), 100);
  set_samples (1);
  fail_unless_cmp (render (h, disc ()).rgba, ==, plain.rgba);
  gst_object_unref (element);
  gst_harness_teardown (h);
}
GST_END_TEST;

/* What is half there has half the alpha, not half the brightness. */
GST_START_TEST (test_samples_over_a_transparent_background_have_no_dark_rims)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = render_harness (rig, "mode=strips azimuth=25 samples=4 background=0");
  if (!h)
    RANGECAST_SKIP ("no OpenGL context");
  const RenderedPicture picture = render (h, drawn_by (rig, disc_pixel));
  int rim = 0;
  for (int y = 0; y < 240; y++)
    for (int x = 0; x < 320; x++) {
      const int alpha = picture.at (x, y, 3);
      rim += alpha > 0 && alpha < 255;
      for (int c = 0; c < 3; c++)
        fail_unless_equals_int (picture.at (x, y, c), alpha > 0 ? 255 : 0);
    }
  fail_unless (rim > 100, "%d pixels", rim);
  gst_harness_teardown (h);
}
GST_END_TEST;

/* A rim that covers a share of its pixel lies over the background as any picture of that alpha. */
GST_START_TEST (test_samples_over_a_tinted_glass_mix_by_alpha)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = render_harness (rig, "mode=strips azimuth=25 samples=4 background=0x404080c0");
  if (!h)
    RANGECAST_SKIP ("no OpenGL context");
  const RenderedPicture picture = render (h, drawn_by (rig, disc_pixel));
  const double behind[] = {0x40, 0x80, 0xc0}, glass = 0x40 / 255.0;
  int rim = 0;
  for (int y = 0; y < 240; y++)
    for (int x = 0; x < 320; x++) {
      const double alpha = picture.at (x, y, 3) / 255.0;
      const double covered = (alpha - glass) / (1 - glass); /* 1 - alpha = (1 - c) (1 - glass) */
      rim += covered > 0.01 && covered < 0.99;
      for (int c = 0; c < 3; c++) {
        const double expected =
            (covered * 255 + (1 - covered) * glass * behind[c]) / std::max (alpha, 1e-9);
        fail_unless (std::abs (picture.at (x, y, c) - expected) <= 3, "%d, %d: %d, not %f", x, y,
            picture.at (x, y, c), expected);
      }
    }
  fail_unless (rim > 100, "%d pixels", rim);
  fail_unless_equals_int (picture.at (5, 5, 0), 0x40);
  fail_unless_equals_int (picture.at (5, 5, 1), 0x80);
  fail_unless_equals_int (picture.at (5, 5, 2), 0xc0);
  fail_unless_equals_int (picture.at (5, 5, 3), 0x40);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_strips_leave_out_surfaces_seen_from_behind_unless_wanted)
{
  const Rig rig = ring_rig (2); /* the scene's middle is where both look */
  const auto drawn = [&] (const char *properties) {
    GstHarness *h = render_harness (rig, properties);
    if (!h)
      return -1;
    const RenderedPicture picture = render (h, wall (rig));
    gst_harness_teardown (h);
    return int (!is_background (picture, 160, 120));
  };
  if (drawn ("") < 0)
    RANGECAST_SKIP ("no OpenGL context");
  fail_unless_equals_int (drawn ("mode=strips"), 1);
  fail_unless_equals_int (drawn ("mode=strips azimuth=180"), 0);
  fail_unless_equals_int (drawn ("mode=strips azimuth=180 back-faces=true"), 1);
  fail_unless_equals_int (drawn ("mode=strips back-faces=true"), 1);
}
GST_END_TEST;

GST_START_TEST (test_one_camera_is_drawn_from_behind_too)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = render_harness (rig, "azimuth=180 field-of-view=60");
  if (!h)
    RANGECAST_SKIP ("no OpenGL context");
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
    if (!h)
      return -1;
    const RenderedPicture picture = render (h, wall_of_two (rig));
    int n = 0;
    for (int y = 60; y < 180; y++)
      for (int x = 100; x < 220; x++)
        n += picture.at (x, y, 1) > 100;
    gst_harness_teardown (h);
    return n;
  };
  if (green ("mode=strips") < 0)
    RANGECAST_SKIP ("no OpenGL context");
  fail_unless_equals_int (green ("mode=strips"), 0);
  fail_unless_equals_int (green ("mode=strips azimuth=40"), 120 * 120);
  const int without = green ("mode=strips view-gap=0");
  fail_unless (without > 1000 && without < 120 * 119, "%d", without);
}
GST_END_TEST;

/* However close the near plane is: points lie behind the viewer. */
GST_START_TEST (test_view_gap_is_metres_also_where_the_viewer_is_among_the_points)
{
  Rig rig = ring_rig (9);
  rig.views.resize (2);
  const auto green = [&] (const char *gap, double green_nearer_m) {
    const std::string properties =
        std::string ("mode=strips azimuth=20 distance=0.3 field-of-view=40 view-gap=") + gap;
    GstHarness *h = render_harness (rig, properties.c_str ());
    if (!h)
      return -1;
    GstBuffer *walls = wall_of_two (rig);
    {
      gstrange::RangeFrameMap frame (walls, GST_MAP_READWRITE);
      for (const RangeImage &image : frame.views ())
        for (int y = 0; y < 240; y++)
          for (int x = 0; x < 320; x++)
            if (image.view_id == 1)
              image.depth.at (x, y) -= guint16 (std::lround (green_nearer_m * 10000));
      frame.views ()[0].depth.at (0, 0) = 3100; /* behind the viewer */
    }
    const RenderedPicture picture = render (h, walls);
    int n = 0;
    for (int y = 100; y < 140; y++)
      for (int x = 140; x < 180; x++)
        n += picture.at (x, y, 1) > 100;
    gst_harness_teardown (h);
    return n;
  };
  if (green ("0", 0.02) < 0)
    RANGECAST_SKIP ("no OpenGL context");
  /* both views look 20 degrees past the viewer: neither is behind the other by more than noise */
  fail_unless_equals_int (green ("0.2", 0.02), 40 * 40);
  fail_unless_equals_int (green ("0.2", -0.02), 0);
  fail_unless_equals_int (green ("1", -0.02), 0);
}
GST_END_TEST;

/* The far plane has room for what is moved behind its place. */
GST_START_TEST (test_largest_view_gap_throws_nothing_out)
{
  const Rig rig = ring_rig (3);
  const auto drawn = [&] (const char *properties) {
    GstHarness *h = render_harness (rig, properties);
    if (!h)
      return -1;
    const RenderedPicture picture = render (h, wall_of_two (rig));
    int n = 0;
    for (int y = 0; y < 240; y++)
      for (int x = 0; x < 320; x++)
        n += !is_background (picture, x, y);
    gst_harness_teardown (h);
    return n;
  };
  if (drawn ("") < 0)
    RANGECAST_SKIP ("no OpenGL context");
  for (const std::string camera : {"azimuth=60", "azimuth=40 distance=0.2", "azimuth=180"})
    fail_unless_equals_int (drawn ((camera + " back-faces=true view-gap=1").c_str ()),
        drawn ((camera + " back-faces=true view-gap=0").c_str ()));
}
GST_END_TEST;

/* A step in depth is no surface: from the side one sees between the two. */
GST_START_TEST (test_strips_stop_at_depth_steps)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = render_harness (rig, "azimuth=-30");
  if (!h)
    RANGECAST_SKIP ("no OpenGL context");
  const auto step = [&] (int nearer) {
    return drawn_by (rig, [nearer] (int x, int, guint16 &depth, Rgbx &colour) {
      depth = guint16 (x < 160 ? 8000 : nearer);
      colour = {255, 255, 255, 0};
    });
  };
  const auto empty = [&] (const RenderedPicture &picture) {
    int n = 0;
    for (int x = 100; x < 220; x++)
      n += is_background (picture, x, 120);
    return n;
  };
  fail_unless_equals_int (empty (render (h, step (7900))), 0);
  const RenderedPicture torn = render (h, step (7000));
  fail_unless (empty (torn) > 10, "%d", empty (torn));
  gst_harness_teardown (h);
}
GST_END_TEST;

/* ---- frame sets that are hardly any ---- */

GST_START_TEST (test_uploads_the_planes_of_the_roi_and_vertices_alone)
{
  const Rig rig = ring_rig (2);
  for (const char *mode : {"mode=strips", "mode=rectangles", "mode=points"}) {
    GstHarness *h = render_harness (rig, mode);
    if (!h)
      RANGECAST_SKIP ("no OpenGL context");
    render (h, make_frame_set (rig, 0, {10, 20, 64, 48}));
    fail_unless_equals_uint64 (
        stats_field (h, "uploaded-bytes"), 2 * 64 * 48 * (2 + 4) + 4 * stats_field (h, "vertices"));
    gst_harness_teardown (h);
  }
}
GST_END_TEST;

GST_START_TEST (test_view_of_one_pixel_is_one_dot)
{
  const Rig rig = ring_rig (1);
  for (const char *mode : {"mode=strips", "mode=rectangles", "mode=points"}) {
    GstHarness *h = render_harness (rig, mode);
    if (!h)
      RANGECAST_SKIP ("no OpenGL context");
    GstBuffer *buffer = make_frame_set (rig, 0, {200, 100, 1, 1});
    {
      gstrange::RangeFrameMap frame (buffer, GST_MAP_READWRITE);
      frame.views ()[0].depth.at (0, 0) = 8000;
      frame.views ()[0].colour.at (0, 0) = {255, 255, 255, 0};
    }
    const RenderedPicture picture = render (h, buffer);
    int drawn = 0;
    for (int y = 0; y < 240; y++)
      for (int x = 0; x < 320; x++)
        drawn += !is_background (picture, x, y);
    fail_unless_equals_int (drawn, 1);
    fail_unless_equals_int (picture.at (200, 100, 0), 255);
    fail_unless_equals_uint64 (stats_field (h, "points"), 1);
    gst_harness_teardown (h);
  }
}
GST_END_TEST;

GST_START_TEST (test_frame_set_without_views_is_the_background)
{
  const Rig rig = ring_rig (4);
  GstHarness *h = render_harness (rig);
  if (!h)
    RANGECAST_SKIP ("no OpenGL context");
  const RenderedPicture full = render (h, wall (rig));
  GstBuffer *none = gst_range_buffer_new (0, 320, 240);
  GST_BUFFER_PTS (none) = 0;
  const RenderedPicture picture = render (h, none);
  for (int i = 0; i < 320 * 240; i++)
    fail_unless_equals_int (picture.rgba[4 * i + 1], 0x24);
  fail_unless_equals_uint64 (stats_field (h, "points"), 0);
  fail_unless_cmp (render (h, wall (rig)).rgba, ==, full.rgba);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_64_views_are_all_drawn)
{
  const Rig rig = ring_rig (64);
  GstHarness *h = render_harness (rig, "distance=2");
  if (!h)
    RANGECAST_SKIP ("no OpenGL context");
  const RenderedPicture picture = render (h, make_frame_set (rig, 0, {120, 90, 80, 60}));
  GstBuffer *one = make_frame_set (ring_rig (1), 0, {120, 90, 80, 60});
  const RenderedPicture alone = render (h, one);
  const guint64 points = stats_field (h, "points");
  render (h, make_frame_set (rig, 0, {120, 90, 80, 60}));
  fail_unless_equals_uint64 (stats_field (h, "points"), 64 * points);
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
  if (!h)
    RANGECAST_SKIP ("no OpenGL context");
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
  tcase_add_test (tc, test_edges_lose_no_pixel_and_gain_none);
  tcase_add_test (tc, test_three_modes_draw_the_same_picture);
  tcase_add_test (tc, test_opengl_es_draws_the_same_picture);
  tcase_add_test (tc, test_colours_come_out_as_they_go_in);
  tcase_add_test (tc, test_samples_smooth_edges_and_may_change_any_time);
  tcase_add_test (tc, test_samples_over_a_transparent_background_have_no_dark_rims);
  tcase_add_test (tc, test_samples_over_a_tinted_glass_mix_by_alpha);
  tcase_add_test (tc, test_strips_leave_out_surfaces_seen_from_behind_unless_wanted);
  tcase_add_test (tc, test_one_camera_is_drawn_from_behind_too);
  tcase_add_test (tc, test_views_of_one_surface_do_not_shine_through_each_other);
  tcase_add_test (tc, test_view_gap_is_metres_also_where_the_viewer_is_among_the_points);
  tcase_add_test (tc, test_largest_view_gap_throws_nothing_out);
  tcase_add_test (tc, test_strips_stop_at_depth_steps);
  tcase_add_test (tc, test_uploads_the_planes_of_the_roi_and_vertices_alone);
  tcase_add_test (tc, test_view_of_one_pixel_is_one_dot);
  tcase_add_test (tc, test_frame_set_without_views_is_the_background);
  tcase_add_test (tc, test_64_views_are_all_drawn);
  tcase_add_test (tc, test_new_rig_in_mid_stream_is_drawn_by_its_own_cameras);
  return suite;
}

GST_CHECK_MAIN (strippicture);
