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
  fail_unless (std::abs (std::max (width, height) - 0.85) < 0.04, "%f x %f", width, height);
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
      if (!h)
        RANGECAST_SKIP ("no OpenGL context");
      fail_unless_fitted (render (h, patch (rig, roi), c.width));
      gst_harness_teardown (h);
    }
}
GST_END_TEST;

GST_START_TEST (test_fit_follows_the_shape_of_the_output)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = render_harness (rig, "fit=true background=0xff000000");
  if (!h)
    RANGECAST_SKIP ("no OpenGL context");
  const Roi roi = {200, 20, 100, 60};
  fail_unless_fitted (render (h, patch (rig, roi, 0)));
  set_output_caps (h->element, "width=160,height=320");
  fail_unless_fitted (render (h, patch (rig, roi, GST_SECOND / 30), 160));
  set_output_caps (h->element, "width=320,height=240");
  fail_unless_fitted (render (h, patch (rig, roi, GST_SECOND / 15)));
  gst_harness_teardown (h);
}
GST_END_TEST;

/* It fills less than the fit does: the fit is one of another patch. */
static void
fail_if_fitted (const RenderedPicture &picture)
{
  const Drawn drawn (picture);
  fail_if (drawn.empty ());
  fail_unless_cmp (drawn.right - drawn.left, <, 0.7 * picture.width);
  fail_unless_cmp (drawn.bottom - drawn.top, <, 0.7 * picture.height);
}

GST_START_TEST (test_fit_outlasts_other_sizes_and_corrected_rigs)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = render_harness (rig, "fit=true background=0xff000000");
  if (!h)
    RANGECAST_SKIP ("no OpenGL context");
  const Roi first = {100, 80, 100, 80}, other = {130, 100, 60, 40};
  const RenderedPicture at_first = render (h, patch (rig, first, 0));
  render (h, patch (rig, first, 600 * GST_MSECOND)); /* about the same: settled */
  set_output_caps (h->element, "width=160,height=320");
  fail_if_fitted (render (h, patch (rig, other, GST_SECOND), 160));
  fail_unless_fitted (render (h, patch (rig, first, 1100 * GST_MSECOND), 160));
  set_output_caps (h->element, "width=320,height=240");
  fail_if_fitted (render (h, patch (rig, other, 1200 * GST_MSECOND)));

  Rig corrected = rig;
  corrected.views[0].world_from_view.translation.x += 0.004;
  corrected.views[0].intrinsics.fx *= 1.001;
  gst_harness_set_src_caps (h, gstrange::make_range_caps (gstrange::make_info (corrected, 30, 1)));
  fail_if_fitted (render (h, patch (corrected, other, 1300 * GST_MSECOND)));
  gst_harness_set_src_caps (h, gstrange::make_range_caps (gstrange::make_info (rig, 30, 1)));
  fail_unless_cmp (render (h, patch (rig, first, 1400 * GST_MSECOND)).rgba, ==, at_first.rgba);

  const Rig more = ring_rig (2); /* other cameras, another fit */
  gst_harness_set_src_caps (h, gstrange::make_range_caps (gstrange::make_info (more, 30, 1)));
  fail_unless_fitted (render (h, patch (more, other, 1500 * GST_MSECOND)));
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_fit_holds_until_a_key_asks_for_another)
{
  const Rig rig = ring_rig (1);
  for (const char *key : {"r", "Home"}) {
    GstHarness *h = render_harness (rig, "fit=true background=0xff000000");
    if (!h)
      RANGECAST_SKIP ("no OpenGL context");
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
  if (!h)
    RANGECAST_SKIP ("no OpenGL context");
  fail_unless (Drawn (render (h, patch (rig, {}, 0))).empty ());
  fail_unless_fitted (render (h, patch (rig, {0, 40, 20, 160}, GST_SECOND)));
  render (h, patch (rig, {0, 40, 100, 160}, 1200 * GST_MSECOND)); /* too early */
  fail_unless_fitted (render (h, patch (rig, {80, 40, 120, 160}, 1600 * GST_MSECOND)));
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_fit_waits_for_all_views_that_come)
{
  const Rig rig = ring_rig (2);
  GstHarness *h = render_harness (rig, "fit=true background=0xff000000");
  if (!h)
    RANGECAST_SKIP ("no OpenGL context");
  const Drawn alone (render (h, patch (rig, {40, 40, 60, 60}, 0)));
  fail_if (alone.empty ());
  render (h, make_frame_set (rig, GST_SECOND));
  const Drawn both (render (h, make_frame_set (rig, 2 * GST_SECOND)));
  fail_unless (both.bottom - both.top > 170 && both.bottom < 239 && both.top > 0, "%d to %d",
      both.top, both.bottom);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_fit_gives_up_on_a_view_that_is_lost)
{
  const Rig rig = ring_rig (2);
  GstHarness *h = render_harness (rig, "fit=true background=0xff000000");
  if (!h)
    RANGECAST_SKIP ("no OpenGL context");
  const Roi roi = {100, 80, 100, 80}, other = {130, 100, 60, 40};
  const RenderedPicture both = render (h, make_frame_set (rig, 0));
  fail_if (Drawn (both).empty ());
  const Drawn waits (render (h, patch (rig, roi, 4 * GST_SECOND)));
  fail_unless_cmp (waits.right - waits.left, <, 0.75 * 320);
  fail_unless_cmp (waits.bottom - waits.top, <, 0.75 * 240);
  fail_unless_fitted (render (h, patch (rig, roi, 6 * GST_SECOND)));
  fail_unless_fitted (render (h, patch (rig, roi, 7 * GST_SECOND))); /* settled */
  fail_if_fitted (render (h, patch (rig, other, 20 * GST_SECOND)));
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_fit_takes_no_notice_of_single_points_far_away)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = render_harness (rig, "fit=true background=0xff000000");
  if (!h)
    RANGECAST_SKIP ("no OpenGL context");
  GstBuffer *buffer = patch (rig, {60, 60, 100, 100});
  {
    gstrange::RangeFrameMap frame (buffer, GST_MAP_READWRITE);
    const RangeImage &image = frame.views ()[0];
    for (int i = 0; i < 12; i++) { /* black: not in what is looked for */
      image.depth.at (4 + 25 * i, 3 + 19 * i) = i % 2 ? 3000 : 15000;
      image.colour.at (4 + 25 * i, 3 + 19 * i) = {0, 0, 0, 0};
    }
  }
  const Drawn drawn (render (h, buffer));
  fail_unless (std::abs (drawn.middle_x () - 159.5) < 5 && std::abs (drawn.middle_y () - 119.5) < 5,
      "%f, %f", drawn.middle_x (), drawn.middle_y ());
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_hand_and_properties_go_before_the_fit)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = render_harness (rig, "fit=true background=0xff000000");
  if (!h)
    RANGECAST_SKIP ("no OpenGL context");
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

GST_START_TEST (test_fit_may_be_set_any_time)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = render_harness (rig, "background=0xff000000");
  if (!h)
    RANGECAST_SKIP ("no OpenGL context");
  const Roi roi = {10, 10, 60, 60};
  const RenderedPicture before = render (h, patch (rig, roi, 0));
  const Drawn first (before);
  ck_assert_int_le (first.left, 11);
  ck_assert_int_lt (first.right, 75);
  GstElement *r = gst_harness_find_element (h, "striprender");
  g_object_set (r, "fit", TRUE, nullptr);
  fail_unless_fitted (render (h, patch (rig, roi, GST_SECOND)));
  g_object_set (r, "fit", FALSE, nullptr);
  fail_unless_cmp (render (h, patch (rig, roi, 2 * GST_SECOND)).rgba, ==, before.rgba);
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

static void
let_wander (GstBuffer *buffer)
{
  auto allocator = static_cast<GstAllocator *> (
      gst_object_ref_sink (g_object_new (wandering_allocator_get_type (), nullptr)));
  auto wandering = new WanderingMemory;
  wandering->bytes.resize (gst_buffer_get_size (buffer));
  gst_buffer_extract (buffer, 0, wandering->bytes.data (), wandering->bytes.size ());
  gst_memory_init (&wandering->memory, GST_MEMORY_FLAG_READONLY, allocator, nullptr,
      wandering->bytes.size (), 0, 0, wandering->bytes.size ());
  gst_buffer_replace_all_memory (buffer, &wandering->memory);
  gst_object_unref (allocator); /* its memory has it */
}

/* A frame set that is drawn again is mapped again. From the side, a patch is less wide. */
GST_START_TEST (test_fit_of_a_held_frame_set)
{
  Live live ("fit=true background=0xff000000 mode=strips");
  if (!live.h)
    RANGECAST_SKIP ("no OpenGL context");
  GstBuffer *set = patch (live.rig, {40, 90, 200, 60});
  GST_BUFFER_DURATION (set) = 200 * GST_MSECOND;
  let_wander (set);
  fail_unless_equals_int (gst_harness_push (live.h, set), GST_FLOW_OK);
  fail_unless_fitted (live.next ());
  press_key (live.h, "r"); /* azimuth 0 */
  g_object_set (live.r, "azimuth", 50.0, nullptr);
  const Drawn aside (live.next ()); /* 0.62 with the fit from before */
  fail_unless (aside.right - aside.left > 0.75 * 320, "%d to %d", aside.left, aside.right);
  fail_unless_equals_uint64 (stats_field (live.r, "repeated"), 1);
}
GST_END_TEST;

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
    if (!h)
      RANGECAST_SKIP ("no OpenGL context");
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

GST_START_TEST (test_view_mask_reaches_the_last_view_id)
{
  Rig rig = ring_rig (64);
  GstHarness *h = render_harness (rig, "mode=strips distance=2 view-mask=0x8000000000000000");
  if (!h)
    RANGECAST_SKIP ("no OpenGL context");
  const auto set = [&] { return make_frame_set (rig, 0, {120, 90, 80, 60}); };
  render (h, set ());
  const guint64 one = stats_field (h, "points");
  ck_assert_uint_gt (one, 0);
  GstElement *r = gst_harness_find_element (h, "striprender");
  g_object_set (r, "view-mask", G_MAXUINT64, nullptr);
  render (h, set ());
  fail_unless_equals_uint64 (stats_field (h, "points"), 64 * one);
  gst_object_unref (r);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_view_mask_changes_a_held_picture_and_can_be_controlled)
{
  Live live;
  if (!live.h)
    RANGECAST_SKIP ("no OpenGL context");
  live.push (0);
  const RenderedPicture all = live.next ();
  g_object_set (live.r, "view-mask", guint64 (0), nullptr);
  const RenderedPicture none = live.next ();
  for (std::size_t i = 0; i < none.rgba.size (); i += 4)
    fail_unless_equals_int (none.rgba[i], 0x20);
  g_object_set (live.r, "view-mask", G_MAXUINT64, nullptr);
  fail_unless_cmp (live.next ().rgba, ==, all.rgba);
  GstControlSource *source = gst_interpolation_control_source_new ();
  g_object_set (source, "mode", GST_INTERPOLATION_MODE_NONE, nullptr);
  gst_object_add_control_binding (GST_OBJECT (live.r),
      gst_direct_control_binding_new_absolute (GST_OBJECT (live.r), "view-mask", source));
  gst_timed_value_control_source_set (GST_TIMED_VALUE_CONTROL_SOURCE (source), 0, 2);
  gst_object_unref (source);
  fail_unless_cmp (live.next ().rgba, ==, none.rgba);
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
  if (!opengl_works ())
    RANGECAST_SKIP ("no OpenGL context");
  const char *size = "width=320,height=240";
  for (const char *mode : {"mode=blend", "mode=strips", "mode=rectangles", "mode=points",
           "mode=strips samples=4", "mode=strips back-faces=true"}) {
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
  if (!opengl_works ())
    RANGECAST_SKIP ("no OpenGL context");
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

GST_START_TEST (test_background_shade_leaves_transparent_backgrounds_alone)
{
  if (!opengl_works ())
    RANGECAST_SKIP ("no OpenGL context");
  for (const char *look : {"mode=blend background=0x00808080", "mode=blend background=0x80404040",
           "mode=strips background=0", "mode=strips samples=4 background=0x80404040"}) {
    const std::string shaded = std::string (look) + " background-shade=1";
    const char *size = "width=320,height=240";
    const RenderedPicture with = ground (shaded.c_str (), size, 320);
    fail_unless (with.rgba == ground (look, size, 320).rgba, "%s", look);
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
  tcase_add_test (tc, test_fit_follows_the_shape_of_the_output);
  tcase_add_test (tc, test_fit_outlasts_other_sizes_and_corrected_rigs);
  tcase_add_test (tc, test_fit_holds_until_a_key_asks_for_another);
  tcase_add_test (tc, test_fit_goes_on_until_the_view_settles);
  tcase_add_test (tc, test_fit_waits_for_all_views_that_come);
  tcase_add_test (tc, test_fit_gives_up_on_a_view_that_is_lost);
  tcase_add_test (tc, test_fit_takes_no_notice_of_single_points_far_away);
  tcase_add_test (tc, test_hand_and_properties_go_before_the_fit);
  tcase_add_test (tc, test_fit_may_be_set_any_time);
  tcase_add_test (tc, test_fit_of_a_held_frame_set);
  tcase_add_test (tc, test_view_mask_draws_those_views_alone);
  tcase_add_test (tc, test_view_mask_reaches_the_last_view_id);
  tcase_add_test (tc, test_view_mask_changes_a_held_picture_and_can_be_controlled);
  tcase_add_test (tc, test_background_shade_is_a_gradient_in_every_mode);
  tcase_add_test (tc, test_background_shade_is_of_each_eyes_picture);
  tcase_add_test (tc, test_background_shade_leaves_transparent_backgrounds_alone);
  return suite;
}

GST_CHECK_MAIN (stripviews);
