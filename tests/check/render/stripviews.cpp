/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What a viewer begins with and switches: striprender's fit, view-mask and background-shade. */
#include <gst/controller/controller.h>

#include <algorithm>
#include <memory>

#include "render-check.hpp"

using namespace rangecast;
using namespace rangecast::testing;

/* The pixels that are no background, which is 0xff000000. */
struct Drawn {
  int left = 1 << 20, right = -1, top = 1 << 20, bottom = -1;
  bool red = false, green = false;

  explicit Drawn (const RenderedPicture &picture)
  {
    for (int y = 0; y < picture.height; y++)
      for (int x = 0; x < picture.width; x++) {
        if (picture.at (x, y, 0) < 100 && picture.at (x, y, 1) < 100)
          continue;
        left = std::min (left, x);
        right = std::max (right, x);
        top = std::min (top, y);
        bottom = std::max (bottom, y);
        red |= picture.at (x, y, 0) >= 100;
        green |= picture.at (x, y, 1) >= 100;
      }
  }
  [[nodiscard]] bool empty () const { return right < 0; }
  [[nodiscard]] double middle_x () const { return (left + right) / 2.0; }
  [[nodiscard]] double middle_y () const { return (top + bottom) / 2.0; }
};

/* A red patch of the first view's pixels, 0.8 m away, and what is seen by nobody else. */
static GstBuffer *
patch (const Rig &rig, Roi roi, GstClockTime pts = 0)
{
  GstBuffer *buffer = make_frame_set (rig, pts);
  gstrange::RangeFrameMap frame (buffer, GST_MAP_READWRITE);
  for (const RangeImage &image : frame.views ())
    for (int y = 0; y < 240; y++)
      for (int x = 0; x < 320; x++) {
        const bool inside = image.view_id == 0 && x >= roi.x && x < roi.x + roi.width &&
                            y >= roi.y && y < roi.y + roi.height;
        image.depth.at (x, y) = inside ? 8000 : 0;
        image.colour.at (x, y) = {255, 0, 0, 0};
      }
  return buffer;
}

static void
press_key (GstHarness *h, const char *key)
{
  GstElement *element = gst_harness_find_element (h, "striprender");
  GstPad *src = gst_element_get_static_pad (element, "src");
  gst_pad_send_event (src, gst_navigation_event_new_key_press (key, GST_NAVIGATION_MODIFIER_NONE));
  gst_object_unref (src);
  gst_object_unref (element);
}

static void
fail_unless_fitted (const RenderedPicture &picture)
{
  const Drawn drawn (picture);
  fail_if (drawn.empty ());
  const double width = double (drawn.right + 1 - drawn.left) / picture.width;
  const double height = double (drawn.bottom + 1 - drawn.top) / picture.height;
  GST_INFO ("%dx%d: %d to %d, %d to %d", picture.width, picture.height, drawn.left, drawn.right,
      drawn.top, drawn.bottom);
  fail_unless (std::abs (std::max (width, height) - 0.85) < 0.05, "%f x %f", width, height);
  fail_unless (std::abs (drawn.middle_x () - (picture.width - 1) / 2.0) < 3, "%f right",
      drawn.middle_x () - picture.width / 2.0);
  fail_unless (std::abs (drawn.middle_y () - (picture.height - 1) / 2.0) < 3, "%f down",
      drawn.middle_y () - picture.height / 2.0);
}

/* ---- fit ---- */

GST_START_TEST (test_fit_centres_and_fills_at_any_aspect_and_from_any_side)
{
  const Rig rig = ring_rig (1);
  const struct {
    const char *properties, *output;
    int width;
  } cases[] = {{"", "width=320,height=240", 320}, {"", "width=200,height=400", 200},
      {"", "width=640,height=200", 640}, {"azimuth=40", "width=320,height=240", 320},
      {"azimuth=-30 elevation=25", "width=320,height=240", 320},
      {"field-of-view=90", "width=320,height=240", 320}};
  for (const auto &c : cases)
    for (Roi roi : {Roi{20, 30, 60, 120}, Roi{150, 180, 160, 40}}) {
      const std::string properties = std::string ("fit=true background=0xff000000 ") + c.properties;
      GstHarness *h = render_harness (rig, {properties.c_str (), c.output});
      fail_unless_fitted (render (h, patch (rig, roi), c.width));
      gst_harness_teardown (h);
    }
}
GST_END_TEST;

GST_START_TEST (test_fit_holds_until_a_key_asks_for_another)
{
  const Rig rig = ring_rig (1);
  for (const char *key : {"r", "Home"}) {
    GstHarness *h = render_harness (rig, "fit=true background=0xff000000");
    const Roi first = {100, 80, 100, 80}, other = {130, 100, 60, 40};
    const RenderedPicture at_first = render (h, patch (rig, first, 0));
    fail_unless_fitted (at_first);
    render (h, patch (rig, first, 600 * GST_MSECOND)); /* about the same: settled */
    const Drawn moved (render (h, patch (rig, other, 2 * GST_SECOND)));
    ck_assert_int_lt (moved.right - moved.left, 180);
    fail_unless_cmp (moved.middle_x (), >, 165);
    fail_unless_cmp (render (h, patch (rig, first, 3 * GST_SECOND)).rgba, ==, at_first.rgba);
    press_key (h, key);
    fail_unless_fitted (render (h, patch (rig, other, 4 * GST_SECOND)));
    gst_harness_teardown (h);
  }
}
GST_END_TEST;

/* Somebody who comes in from the side is first seen in part. */
GST_START_TEST (test_fit_goes_on_until_the_view_settles)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = render_harness (rig, "fit=true background=0xff000000");
  fail_unless (Drawn (render (h, patch (rig, {}, 0))).empty ());
  fail_unless_fitted (render (h, patch (rig, {0, 40, 20, 160}, GST_SECOND)));
  render (h, patch (rig, {0, 40, 100, 160}, 1200 * GST_MSECOND)); /* too early */
  fail_unless_fitted (render (h, patch (rig, {80, 40, 120, 160}, 1600 * GST_MSECOND)));
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_hand_and_properties_go_before_the_fit)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = render_harness (rig, "fit=true background=0xff000000");
  const Roi roi = {40, 80, 100, 80};
  fail_unless_fitted (render (h, patch (rig, roi, 0)));
  press_key (h, "minus");
  const RenderedPicture zoomed = render (h, patch (rig, roi, GST_SECOND / 10));
  const Drawn smaller (zoomed);
  fail_unless (std::abs (smaller.bottom - smaller.top - 0.85 * 240 / 1.1) < 6, "%d",
      smaller.bottom - smaller.top);
  /* the person goes, before the fit has settled, and comes back: nothing moves */
  render (h, patch (rig, {200, 100, 40, 40}, GST_SECOND));
  fail_unless_cmp (render (h, patch (rig, roi, 2 * GST_SECOND)).rgba, ==, zoomed.rgba);
  GstElement *r = gst_harness_find_element (h, "striprender");
  g_object_set (r, "distance", 8.0, nullptr);
  const Drawn far_away (render (h, patch (rig, roi, 3 * GST_SECOND)));
  ck_assert_int_lt (far_away.bottom - far_away.top, 30);
  fail_unless_cmp (std::abs (far_away.middle_x () - 159.5), <, 3);
  gst_object_unref (r);
  gst_harness_teardown (h);
}
GST_END_TEST;

/* Memory that is somewhere else each time it is mapped, and zeros where it was. For reading. */
struct WanderingMemory {
  GstMemory memory;
  std::vector<guint8> bytes;
  std::vector<std::unique_ptr<guint8[]>> maps;
};

static gpointer
map_elsewhere (GstMemory *memory, gsize, GstMapFlags)
{
  auto self = reinterpret_cast<WanderingMemory *> (memory);
  auto &map = self->maps.emplace_back (std::make_unique<guint8[]> (self->bytes.size ()));
  std::ranges::copy (self->bytes, map.get ());
  return map.get ();
}

static void
unmap_to_zeros (GstMemory *memory)
{
  auto self = reinterpret_cast<WanderingMemory *> (memory);
  for (auto &map : self->maps) /* planes are unmapped together */
    std::fill_n (map.get (), self->bytes.size (), guint8 (0));
}

struct WanderingAllocator {
  GstAllocator parent;
};
struct WanderingAllocatorClass {
  GstAllocatorClass parent;
};
G_DEFINE_TYPE (WanderingAllocator, wandering_allocator, GST_TYPE_ALLOCATOR)

static void
wandering_allocator_init (WanderingAllocator *self)
{
  self->parent.mem_map = map_elsewhere;
  self->parent.mem_unmap = unmap_to_zeros;
}

static void
wandering_allocator_class_init (WanderingAllocatorClass *klass)
{
  klass->parent.free = [] (GstAllocator *, GstMemory *memory) {
    delete reinterpret_cast<WanderingMemory *> (memory);
  };
}

/* ---- view-mask ---- */

/* Two views that stand 40 degrees apart. */
static Rig
two_views ()
{
  Rig rig = ring_rig (9);
  rig.views.resize (2);
  return rig;
}

GST_START_TEST (test_view_mask_draws_those_views_alone)
{
  const Rig rig = two_views ();
  for (const char *mode : {"mode=blend", "mode=strips", "mode=rectangles", "mode=points"}) {
    const std::string properties = std::string (mode) + " background=0xff000000";
    GstHarness *h = render_harness (rig, properties.c_str ());
    GstElement *r = gst_harness_find_element (h, "striprender");
    GstClockTime pts = 0;
    const auto with = [&] (guint64 mask) {
      g_object_set (r, "view-mask", mask, nullptr);
      GstBuffer *set = wall_of_two (rig);
      GST_BUFFER_PTS (set) = pts += GST_SECOND;
      return render (h, set);
    };
    const RenderedPicture both = render (h, wall_of_two (rig));
    const guint64 points = stats_field (r, "points");
    const Drawn first (with (1));
    fail_unless (first.red && !first.green);
    fail_unless_equals_uint64 (stats_field (r, "points"), points / 2);
    const Drawn second (with (2 | guint64 (1) << 63)); /* there is no such view */
    fail_unless (second.green && !second.red);
    fail_unless (Drawn (with (0)).empty ());
    fail_unless_equals_uint64 (stats_field (r, "points"), 0);
    fail_unless_cmp (with (G_MAXUINT64).rgba, ==, both.rgba);
    gst_object_unref (r);
    gst_harness_teardown (h);
  }
}
GST_END_TEST;

/* ---- background-shade ---- */

static RenderedPicture
ground (const char *properties, const char *output, int width)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = render_harness (rig, {properties, output});
  RenderedPicture picture = render (h, patch (rig, {140, 100, 40, 40}), width);
  gst_harness_teardown (h);
  return picture;
}

/* Of column 5 from a row on: lighter at the top by `shade`, darker at the bottom, no steps. */
static void
fail_unless_shaded (const RenderedPicture &picture, int first, int rows, double shade)
{
  for (int y = 0; y < rows; y++) {
    const double expected = 0x60 * (1 + shade * (1 - 2 * (y + 0.5) / rows));
    for (int c = 0; c < 3; c++)
      fail_unless (std::abs (picture.at (5, first + y, c) - expected) < 1.6, "row %d: %d, not %f",
          y, picture.at (5, first + y, c), expected);
    fail_unless (
        picture.at (5, first + y, 3) == 255, "row %d: alpha %d", y, picture.at (5, first + y, 3));
  }
}

GST_START_TEST (test_background_shade_is_a_gradient_in_every_mode)
{
  const char *size = "width=320,height=240";
  for (const char *mode : {"mode=blend", "mode=strips", "mode=rectangles", "mode=points"}) {
    const std::string flat = std::string (mode) + " background=0xff606060";
    const std::string shaded = flat + " background-shade=0.4";
    const RenderedPicture with = ground (shaded.c_str (), size, 320);
    const RenderedPicture without = ground (flat.c_str (), size, 320);
    fail_unless_shaded (with, 0, 240, 0.4);
    fail_unless_shaded (without, 0, 240, 0);
    fail_unless_equals_int (with.at (160, 120, 0), 255);
    for (int y = 0; y < 240; y++) /* the patch stays as it is, to its edge */
      for (int x = 0; x < 320; x++)
        if (without.at (x, y, 0) == 255)
          for (int c = 0; c < 4; c++)
            fail_unless_equals_int (with.at (x, y, c), without.at (x, y, c));
  }
}
GST_END_TEST;

GST_START_TEST (test_background_shade_is_of_each_eyes_picture)
{
  for (const char *mode : {"mode=blend", "mode=strips"}) {
    const std::string properties =
        std::string (mode) + " background=0xff606060 background-shade=0.4";
    const RenderedPicture both =
        ground (properties.c_str (), "width=320,height=480,multiview-mode=top-bottom", 320);
    fail_unless_shaded (both, 0, 240, 0.4);
    fail_unless_shaded (both, 240, 240, 0.4);
  }
}
GST_END_TEST;

static Suite *
stripviews_suite ()
{
  Suite *suite = suite_create ("stripviews");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_fit_centres_and_fills_at_any_aspect_and_from_any_side);
  tcase_add_test (tc, test_fit_holds_until_a_key_asks_for_another);
  tcase_add_test (tc, test_fit_goes_on_until_the_view_settles);
  tcase_add_test (tc, test_hand_and_properties_go_before_the_fit);
  tcase_add_test (tc, test_view_mask_draws_those_views_alone);
  tcase_add_test (tc, test_background_shade_is_a_gradient_in_every_mode);
  tcase_add_test (tc, test_background_shade_is_of_each_eyes_picture);
  return suite;
}

GST_CHECK_MAIN (stripviews);
