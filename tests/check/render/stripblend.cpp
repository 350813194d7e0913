/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* striprender mode=blend: what several views of one surface give together. */
#include <clocale>
#include <cstdlib>

#include "render-check.hpp"

using namespace rangecast;
using namespace rangecast::testing;

/* Two cameras 40 degrees apart. */
static Rig
two_of_nine ()
{
  Rig rig = ring_rig (9);
  rig.views.resize (2);
  return rig;
}

/* The mean colour of the middle of the picture. */
static std::array<double, 3>
middle (const RenderedPicture &picture)
{
  std::array<double, 3> mean{};
  for (int y = 100; y < 140; y++)
    for (int x = 140; x < 180; x++)
      for (int c = 0; c < 3; c++)
        mean[std::size_t (c)] += picture.at (x, y, c) / 1600.0;
  return mean;
}

/* The first view sees the wall squarely, the second one at 40 degrees: the square of its cosine. */
GST_START_TEST (test_midway_between_two_views_weights_follow_the_slant)
{
  const Rig rig = two_of_nine ();
  GstHarness *h = render_harness (rig, "azimuth=20");
  const auto colour = middle (render (h, wall_of_two (rig)));
  const double slant = std::pow (std::cos (40 * M_PI / 180), 2), red = 255 / (1 + slant);
  fail_unless (std::abs (colour[0] - red) < 8 && std::abs (colour[1] - (255 - red)) < 8, "%f %f",
      colour[0], colour[1]);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_view_of_the_viewers_own_direction_counts_most)
{
  const Rig rig = two_of_nine ();
  GstHarness *h = render_harness (rig, "azimuth=0");
  const auto own = middle (render (h, wall_of_two (rig)));
  gst_harness_set (h, "striprender", "azimuth", 40.0, nullptr);
  const auto other = middle (render (h, wall_of_two (rig)));
  /* the other one looks 40 degrees off: the sixth power of its cosine, a fifth; the second view
   * sees the wall at a slant, too, so that it has 0.59 of its weight beside that fifth */
  fail_unless (own[0] > 5 * own[1], "%f %f", own[0], own[1]);
  fail_unless (other[1] > 2.7 * other[0], "%f %f", other[0], other[1]);
  gst_harness_teardown (h);
}
GST_END_TEST;

/* Moves the first view's wall back by that much. */
static GstBuffer *
walls_apart (const Rig &rig, double metres)
{
  GstBuffer *walls = wall_of_two (rig);
  gstrange::RangeFrameMap frame (walls, GST_MAP_READWRITE);
  const RangeImage &image = frame.views ()[0];
  for (int y = 0; y < 240; y++)
    for (int x = 0; x < 320; x++)
      image.depth.at (x, y) += guint16 (std::lround (metres * 10000));
  return walls;
}

GST_START_TEST (test_surface_beyond_the_blend_range_is_hidden)
{
  const Rig rig = two_of_nine ();
  GstHarness *h = render_harness (rig, "azimuth=20");
  fail_unless_cmp (middle (render (h, walls_apart (rig, 0.01)))[0], >, 60);
  fail_unless_cmp (middle (render (h, walls_apart (rig, 0.1)))[0], <, 1);
  gst_harness_set (h, "striprender", "blend-range", 0.2, nullptr);
  fail_unless_cmp (middle (render (h, walls_apart (rig, 0.1)))[0], >, 60);
  gst_harness_teardown (h);
}
GST_END_TEST;

/* It shows things in place however wrong their depth is. */
GST_START_TEST (test_view_of_the_viewers_own_position_is_blended_at_any_depth)
{
  const Rig rig = two_of_nine ();
  GstHarness *h = render_harness (rig, "azimuth=0");
  fail_unless_cmp (middle (render (h, walls_apart (rig, 0.1)))[0], >, 200);
  gst_harness_set (h, "striprender", "azimuth", 40.0, nullptr); /* now the other one is */
  fail_unless_cmp (middle (render (h, walls_apart (rig, 0.1)))[0], <, 1);
  gst_harness_teardown (h);
}
GST_END_TEST;

/* A white disc on nothing. */
static GstBuffer *
disc (const Rig &rig)
{
  GstBuffer *buffer = make_frame_set (rig);
  gstrange::RangeFrameMap frame (buffer, GST_MAP_READWRITE);
  const RangeImage &image = frame.views ()[0];
  for (int y = 0; y < 240; y++)
    for (int x = 0; x < 320; x++) {
      image.depth.at (x, y) = std::hypot (x - 159.5, y - 119.5) < 70 ? 8000 : 0;
      image.colour.at (x, y) = {255, 255, 255, 0};
    }
  return buffer;
}

GST_START_TEST (test_outlines_are_antialiased_and_have_no_dark_rims)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = render_harness (rig, "azimuth=25 background=0");
  const RenderedPicture picture = render (h, disc (rig));
  int rim = 0;
  for (int y = 0; y < 240; y++)
    for (int x = 0; x < 320; x++) {
      const int alpha = picture.at (x, y, 3);
      rim += alpha > 0 && alpha < 255;
      for (int c = 0; c < 3; c++)
        ck_assert_int_le (std::abs (picture.at (x, y, c) - (alpha > 0 ? 255 : 0)), 1);
    }
  fail_unless (rim > 100, "%d pixels", rim);
  fail_unless_equals_int (picture.at (160, 120, 3), 255);
  gst_harness_teardown (h);
}
GST_END_TEST;

/* A red wall with a round hole, and behind it a green one, which all cameras but the first see from
 * the other side. */
static GstBuffer *
wall_with_hole (const Rig &rig, double radius)
{
  GstBuffer *buffer = make_frame_set (rig);
  gstrange::RangeFrameMap frame (buffer, GST_MAP_READWRITE);
  for (const RangeImage &image : frame.views ()) {
    const bool front = image.view_id == 0;
    for (int y = 0; y < 240; y++)
      for (int x = 0; x < 320; x++) {
        const bool hole = front && std::hypot (x - 159.5, y - 119.5) < radius;
        image.depth.at (x, y) = hole ? 0 : 7000;
        image.colour.at (x, y) = front ? Rgbx{255, 0, 0, 0} : Rgbx{0, 255, 0, 0};
      }
  }
  return buffer;
}

/* Pixels of the middle that are green, and that are red. */
static std::pair<int, int>
greens_and_reds (const RenderedPicture &picture)
{
  int greens = 0, reds = 0;
  for (int y = 112; y < 128; y++)
    for (int x = 152; x < 168; x++) {
      greens += picture.at (x, y, 1) > 20;
      reds += picture.at (x, y, 0) > 20;
    }
  return {greens, reds};
}

/* With 16 views, too: insides do not add up to an outside. */
GST_START_TEST (test_inside_shows_through_large_gaps_only)
{
  for (const int views : {2, 6, 16}) {
    Rig rig = ring_rig (2);
    while (int (rig.views.size ()) < views) {
      rig.views.push_back (rig.views[1]);
      rig.views.back ().id = int (rig.views.size ()) - 1;
    }
    GstHarness *h = render_harness (rig, "azimuth=0");
    const auto small = greens_and_reds (render (h, wall_with_hole (rig, 3))),
               large = greens_and_reds (render (h, wall_with_hole (rig, 60)));
    fail_unless (small == std::pair (0, 256), "%d: %d %d", views, small.first, small.second);
    fail_unless (large == std::pair (256, 0), "%d: %d %d", views, large.first, large.second);
    gst_harness_teardown (h);
  }
}
GST_END_TEST;

/* Shaders are text; a locale may write 0,5. */
GST_START_TEST (test_draws_in_a_locale_with_a_decimal_comma)
{
  if (!setlocale (LC_NUMERIC, "de_DE.UTF-8") && !setlocale (LC_NUMERIC, "fr_FR.UTF-8"))
    RANGECAST_SKIP ("no locale with a decimal comma");
  const Rig rig = two_of_nine ();
  GstHarness *h = render_harness (rig, "azimuth=0");
  if (h) {
    fail_unless_cmp (middle (render (h, wall_of_two (rig)))[0], >, 100);
    gst_harness_teardown (h);
  }
  setlocale (LC_NUMERIC, "C");
}
GST_END_TEST;

static Suite *
stripblend_suite (void)
{
  Suite *s = suite_create ("stripblend");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (s, tc);
  tcase_add_test (tc, test_midway_between_two_views_weights_follow_the_slant);
  tcase_add_test (tc, test_view_of_the_viewers_own_direction_counts_most);
  tcase_add_test (tc, test_surface_beyond_the_blend_range_is_hidden);
  tcase_add_test (tc, test_view_of_the_viewers_own_position_is_blended_at_any_depth);
  tcase_add_test (tc, test_outlines_are_antialiased_and_have_no_dark_rims);
  tcase_add_test (tc, test_inside_shows_through_large_gaps_only);
  tcase_add_test (tc, test_draws_in_a_locale_with_a_decimal_comma);
  return s;
}

GST_CHECK_MAIN (stripblend);
