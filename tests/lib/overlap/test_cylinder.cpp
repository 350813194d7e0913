/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include <algorithm>
#include <atomic>
#include <climits>
#include <cstdlib>
#include <new>
#include <rangecast/scene/scene.hpp>

#include "cylinder-support.hpp"

/* Counts what is allocated; after so many allocations there is no memory left. Not inlined, or
 * compilers see a free that has no malloc and warn. */
static std::atomic<int> allocations, allocations_left{INT_MAX};

[[gnu::noinline]] void *
operator new (std::size_t size)
{
  allocations++;
  void *memory = allocations_left-- > 0 ? std::malloc (size ? size : 1) : nullptr;
  if (!memory)
    throw std::bad_alloc ();
  return memory;
}
[[gnu::noinline]] void
operator delete (void *memory) noexcept
{
  std::free (memory);
}
[[gnu::noinline]] void
operator delete (void *memory, std::size_t) noexcept
{
  std::free (memory);
}

using namespace rangecast;
using namespace rangecast::testing;

namespace {

CylinderResult
filter_once (Frame &frame, const Rig &rig, const CylinderSettings &settings = {})
{
  CylinderFilter filter;
  EXPECT_TRUE (filter.set_rig (rig).ok ());
  return run (filter, frame, settings);
}

Rig
rig_of (std::initializer_list<View> views)
{
  Rig rig;
  rig.views = views;
  return rig;
}

const Surface kBust = both (
    ellipsoid ({0, 0, 0}, {0.09, 0.2, 0.11}), ellipsoid ({0, 0.02, 0.11}, {0.02, 0.03, 0.02}));
const Surface kTwo = both (
    ellipsoid ({-0.15, 0, 0}, {0.07, 0.2, 0.08}), ellipsoid ({0.15, 0, 0.05}, {0.07, 0.19, 0.08}));

/* A still figure of the built-in scene, with another noise in each frame. */
struct StillScene {
  StillScene ()
  {
    EXPECT_TRUE (Scene::create ({}, scene).ok ());
    rig = scene->range_rig ();
  }
  Frame next ()
  {
    Frame frame (rig);
    std::array<Roi, kMaxViews> boxes;
    const std::vector<RangeImage> images = frame.images ();
    EXPECT_TRUE (scene->render_range (images, 1, false, {boxes.data (), images.size ()}, 1).ok ());
    frame.add_noise (random, 0.2); /* 3 mm at 0.7 m */
    return frame;
  }
  std::unique_ptr<Scene> scene;
  Rig rig;
  std::mt19937 random{3};
};

} // namespace

TEST (Axis, follows_a_tilted_body_and_points_up)
{
  const double tilt = 20 * M_PI / 180, c = std::cos (tilt), t = std::sin (tilt);
  const Mat3 upright_from_world{c, t, 0, -t, c, 0, 0, 0, 1};
  const Surface body = ellipsoid ({0, 0, 0}, {0.08, 0.2, 0.08});
  const Rig rig = ring_rig (4);
  Frame frame (rig, [&] (Vec3 o, Vec3 d) {
    return body (upright_from_world * (o - Vec3{0.02, 0, 0}), upright_from_world * d);
  });
  const Axis axis = filter_once (frame, rig).axis;
  /* Points are denser where the body is nearer, so not quite the body's own axis. */
  EXPECT_GT (dot (axis.direction, {-t, c, 0}), std::cos (6 * M_PI / 180));
  EXPECT_NEAR (axis.position.x, 0.02, 0.01);
}

TEST (Decision, the_camera_that_looks_squarely_at_a_patch_keeps_it)
{
  const Rig rig = rig_of ({ring_view (3, 50), ring_view (8, 0), ring_view (9, -50)});
  Frame frame (rig, patch (0));
  const std::size_t squarely = frame.points (1);
  ASSERT_GT (frame.points (0), 100u);
  filter_once (frame, rig, about_world_axis ());
  EXPECT_EQ (frame.points (1), squarely);
  /* At the patch's very edge another view's points may lie in a cell that it has to itself. */
  EXPECT_LT (frame.points (0) + frame.points (2), squarely / 10);
}

TEST (Decision, a_camera_from_above_does_not_win_a_wall)
{
  Rig rig = rig_of ({ring_view (0, 25), ring_view (1, 0)});
  const double down = 75 * M_PI / 180, c = std::cos (down), s = std::sin (down);
  rig.views[1].world_from_view = {{1, 0, 0, 0, -c, -s, 0, s, -c}, {0, 0.8 * s, 0.1 + 0.8 * c}};
  Frame frame (rig, patch (0));
  const std::size_t from_the_side = frame.points (0);
  ASSERT_GT (frame.points (1), 100u);
  filter_once (frame, rig, about_world_axis ());
  EXPECT_EQ (frame.points (0), from_the_side);
  EXPECT_LT (frame.points (1), from_the_side / 20);
}

/* Two walls one behind the other, which the second camera sees more squarely: both are its own,
 * though each cell has points of both. */
TEST (Decision, surfaces_at_different_radii_of_a_cell_do_not_compete)
{
  const Rig rig = rig_of ({ring_view (0, 40), ring_view (1, 0)});
  Frame frame (rig, patch (0)), behind (rig, patch (0, {0, 0, 0.02}));
  for (std::size_t i = 0; i < 2; i++)
    for (int v = 0; v < kHeight; v += 2) /* every other row sees the wall behind */
      std::copy_n (behind.depth[i].view ().row (v), kWidth, frame.depth[i].view ().row (v));
  CylinderFilter filter;
  ASSERT_TRUE (filter.set_rig (rig).ok ());
  const std::size_t squarely = frame.points (1);
  run (filter, frame, about_world_axis ());
  EXPECT_EQ (frame.points (1), squarely);
  int winners[2] = {};
  for (int s = 0; s < filter.cell_slices (); s++)
    for (int c = 0; c < 360; c++)
      if (const int winner = filter.cell_winner (s, c); winner >= 0)
        winners[winner]++;
  EXPECT_GT (winners[1], 100);
  EXPECT_LT (winners[0], winners[1] / 20);
}

TEST (Coverage, the_hole_of_the_winner_stays_filled)
{
  const Rig rig = rig_of ({ring_view (0, 40), ring_view (1, 0)});
  Frame frame (rig, patch (0)), whole = frame;
  filter_once (whole, rig, about_world_axis ());
  auto depth = frame.depth[1].view ();
  for (int v = depth.height / 2 - 1; v <= depth.height / 2 + 1; v++)
    for (int u = depth.width / 2 - 1; u <= depth.width / 2 + 1; u++)
      depth.at (u, v) = 0;
  filter_once (frame, rig, about_world_axis ());
  /* The hole and the rim, no more. */
  EXPECT_GT (frame.points (0), whole.points (0) + 9);
  EXPECT_LT (frame.points (0), whole.points (0) + 50);
}

/* Hair before a cheek: for the one camera it hides the cheek, which is open to the other. */
TEST (Coverage, what_lies_a_little_behind_the_winners_surface_is_another_surface)
{
  const Rig rig = rig_of ({ring_view (0, 0), ring_view (1, 30)});
  for (const double behind : {0.001, 0.006, 0.022}) {
    Frame near (rig, patch (0)), frame (rig, patch (0, {0, 0, 0.1 - behind}));
    frame.depth[0] = near.depth[0];
    const std::size_t points = frame.points (1);
    filter_once (frame, rig, about_world_axis ());
    if (behind > 0.002)
      EXPECT_EQ (frame.points (1), points) << behind;
    else
      EXPECT_LT (frame.points (1), points / 2);
  }
}

TEST (Filter, what_is_left_of_each_view_is_its_own_quarter)
{
  const Rig rig = ring_rig (4);
  Frame frame (rig, ellipsoid ({0, 0, 0}, {0.1, 0.2, 0.1}));
  filter_once (frame, rig);
  int wrong = 0, all = 0;
  for (std::size_t i = 0; i < 4; i++)
    for (int v = 0; v < kHeight; v++)
      for (int u = 0; u < kWidth; u++) {
        const View &view = rig.views[i];
        const int d = frame.depth[i].view ().at (u, v);
        const Vec3 p = view.world_from_view * view.intrinsics.unproject (u, v, d * 1e-4);
        if (!d || std::abs (p.y) > 0.17)
          continue;
        double off = std::abs (std::atan2 (p.x, p.z) - double (i) * M_PI / 2);
        off = std::min (off, std::abs (2 * M_PI - off)) * 180 / M_PI;
        wrong += off > 45 + 8; /* where regions meet they overlap */
        all++;
      }
  EXPECT_LT (wrong, all / 200);
}

TEST (Filter, cropped_images_give_the_same_as_whole_ones)
{
  const Rig rig = ring_rig (4);
  Frame whole (rig, kBust), cropped = whole;
  filter_once (whole, rig);
  CylinderFilter filter;
  CylinderResult result;
  ASSERT_TRUE (filter.set_rig (rig).ok ());
  std::vector<RangeImage> images = cropped.images ();
  for (RangeImage &image : images) {
    image.roi = {40, 10, 240, 220};
    image.depth = image.depth.crop (40, 10, 240, 220);
    image.colour = image.colour.crop (40, 10, 240, 220);
  }
  ASSERT_TRUE (filter.process (images, {}, result).ok ());
  EXPECT_TRUE (whole == cropped);
}

TEST (Filter, one_thread_and_many_give_the_same_over_several_frames)
{
  const Rig rig = ring_rig (6);
  CylinderFilter one, many;
  ASSERT_TRUE (one.set_rig (rig).ok () && many.set_rig (rig).ok ());
  std::mt19937 random (11);
  for (int i = 0; i < 3; i++) {
    Frame first (rig, kTwo);
    first.add_noise (random, 0.2);
    Frame second = first;
    CylinderSettings settings;
    const CylinderResult a = run (one, first, settings);
    settings.threads = 5;
    const CylinderResult b = run (many, second, settings);
    EXPECT_TRUE (first == second);
    EXPECT_EQ (a.cells.changed, b.cells.changed);
  }
}

TEST (Filter, allocates_nothing_once_it_has_seen_the_largest_frame)
{
  const Rig rig = ring_rig (4);
  for (const Surface &surface : {kBust, kTwo}) {
    const Frame fresh (rig, surface);
    CylinderFilter filter;
    CylinderResult result;
    ASSERT_TRUE (filter.set_rig (rig).ok ());
    for (int i = 0; i < 3; i++) {
      Frame frame = fresh;
      const std::vector<RangeImage> images = frame.images ();
      const int before = allocations;
      ASSERT_TRUE (filter.process (images, {}, result).ok ());
      if (i > 0) {
        EXPECT_EQ (allocations, before);
      }
      EXPECT_LT (result.points_out, result.points_in);
    }
  }
}

TEST (Filter, refuses_views_that_the_rig_lacks_and_settings_out_of_range)
{
  const Rig rig = ring_rig (2);
  Frame frame (rig, kBust);
  CylinderFilter filter;
  CylinderResult result;
  EXPECT_TRUE (filter.process ({}, {}, result).ok ()); /* before any rig */
  ASSERT_TRUE (filter.set_rig (rig).ok ());
  std::vector<RangeImage> images = frame.images ();
  images[1].view_id = 7;
  const Status status = filter.process (images, {}, result);
  EXPECT_EQ (status.code (), StatusCode::kNotFound);
  EXPECT_NE (status.message ().find ("view 7"), std::string::npos);
}

/* ---- what is kept from frame to frame ---- */

TEST (Steady, fewer_than_one_cell_in_a_hundred_changes_and_the_axis_stands_while_the_head_is_still)
{
  constexpr int kFrames = 6;
  StillScene still;
  CylinderFilter filter;
  ASSERT_TRUE (filter.set_rig (still.rig).ok ());
  double changed = 0;
  Axis before;
  for (int i = 0; i <= kFrames; i++) {
    Frame frame = still.next ();
    std::vector<RangeImage> images = frame.images ();
    if (i % 2) /* winners are remembered by view, not by place in the frame set */
      std::ranges::reverse (images);
    CylinderResult now;
    ASSERT_TRUE (filter.process (images, {}, now).ok ());
    if (i > 0) {
      changed += double (now.cells.changed) / double (now.cells.cells) / kFrames;
      EXPECT_GT (now.cells.held, now.cells.cells * 3 / 4);
      EXPECT_LT (norm (now.axis.position - before.position), 0.0001);
      EXPECT_GT (dot (now.axis.direction, before.direction), std::cos (0.05 * M_PI / 180));
    }
    before = now.axis;
  }
  EXPECT_LT (changed, 0.01);
}

/* ---- degenerate and hostile input: nothing is NaN or out of bounds, points only disappear ---- */

/* A view whose pixel (column, row) of a small picture looks straight at the origin. */
static View
small_view (int id, double angle_deg, int width, int height, double focal = 300)
{
  View view = ring_view (id, angle_deg, 0.8, width, height);
  view.intrinsics = {focal, focal, width / 2 + 0.0, height / 2 + 0.0};
  return view;
}

static Rig
small_rig (int views, int width, int height, double focal = 300)
{
  Rig rig;
  for (int i = 0; i < views; i++)
    rig.views.push_back (small_view (i, 360.0 * i / views, width, height, focal));
  return rig;
}

static void
expect_sane (const Rig &rig, const std::function<int (int view, int u, int v)> &depth_at,
    const CylinderSettings &settings = {})
{
  CylinderFilter filter;
  ASSERT_TRUE (filter.set_rig (rig).ok ());
  for (int round = 0; round < 3; round++) {
    Frame frame (rig);
    std::size_t points = 0, left = 0;
    const auto for_pixels = [&] (auto work) {
      for (std::size_t i = 0; i < rig.views.size (); i++)
        for (int v = 0; v < rig.views[i].height; v++)
          for (int u = 0; u < rig.views[i].width; u++)
            work (frame.depth[i].view ().at (u, v), depth_at (int (i), u, v));
    };
    for_pixels ([&] (std::uint16_t &depth, int should) {
      depth = std::uint16_t (should);
      points += depth != 0;
    });
    const CylinderResult result = run (filter, frame, settings);
    for_pixels ([&] (std::uint16_t &depth, int should) {
      left += depth != 0;
      ASSERT_TRUE (depth == 0 || depth == std::uint16_t (should));
    });
    EXPECT_EQ (result.points_in, points);
    EXPECT_EQ (result.points_out, left);
    EXPECT_EQ (left > 0, points > 0);
    EXPECT_TRUE (std::isfinite (norm (result.axis.position)));
    EXPECT_NEAR (norm (result.axis.direction), 1, 1e-9);
  }
}

TEST (Degenerate, views_of_one_pixel_and_focal_lengths_at_their_limits)
{
  for (const int depth : {1, 7000, 65535}) {
    for (const int views : {1, 2, 3, 64})
      expect_sane (small_rig (views, 1, 1), [=] (int, int, int) { return depth; });
    for (const double focal : {1e-3, 1e6})
      expect_sane (small_rig (3, 9, 33, focal), [=] (int, int, int) { return depth; });
  }
}

TEST (Degenerate, all_points_on_the_axis_in_one_place_on_a_line_or_none)
{
  const Rig rig = small_rig (4, 9, 33);
  for (const AxisMode mode : {AxisMode::kPrincipal, AxisMode::kVertical, AxisMode::kWorld}) {
    CylinderSettings settings;
    settings.axis = mode;
    expect_sane (
        rig, [] (int, int u, int) { return u == 4 ? 8000 : 0; }, settings);
    expect_sane (
        rig, [] (int, int u, int v) { return u == 4 && v == 16 ? 8000 : 0; }, settings);
    expect_sane (
        rig, [] (int, int, int v) { return v == 16 ? 8000 : 0; }, settings);
    expect_sane (
        rig, [] (int, int, int) { return 0; }, settings);
    expect_sane (
        rig, [] (int i, int, int) { return i == 2 ? 8000 : 0; }, settings);
  }
}

TEST (Degenerate, settings_at_their_ends_and_random_depths_of_64_views)
{
  for (const int columns : {8, 9, 3600})
    for (const double height_m : {0.0002, 10.0}) {
      CylinderSettings settings;
      settings.columns = columns;
      settings.slice_height_m = height_m;
      settings.overlap = kMaxOverlap;
      expect_sane (
          small_rig (64, 20, 15), [] (int i, int u, int v) { return u * 40503 + v * 30011 + i; },
          settings);
      expect_sane (
          small_rig (4, 40, 30),
          [] (int i, int u, int v) { return 6000 + 500 * ((u * 7 + v * 13 + i) % 5); }, settings);
    }
}

/* 65 m of depth along the axis, slices of 0.2 mm. */
TEST (Degenerate, more_slices_than_the_cylinder_has_cells_for)
{
  Rig rig = rig_of ({small_view (0, 0, 200, 150), small_view (1, 0, 200, 150)});
  for (View &view : rig.views) {
    view.depth_unit_m = 0.001;
    view.far_m = 65;
    view.world_from_view.rotation = {1, 0, 0, 0, 0, 1, 0, -1, 0}; /* looks up */
  }
  ASSERT_TRUE (validate (rig).ok ());
  CylinderSettings settings = about_world_axis ();
  settings.slice_height_m = 0.0002;
  for (const int columns : {8, 3600}) {
    settings.columns = columns;
    expect_sane (
        rig, [] (int i, int u, int v) { return u * 40503 + v * 30011 + i; }, settings);
  }
}

/* Eight columns, one slice, and no two points of a view on the same surface. What takes a second
 * here takes hours where work grows with the square of a cell's points. */
TEST (Degenerate, as_many_layers_as_points_in_cells_that_all_views_share)
{
  Rig rig;
  for (int i = 0; i < 16; i++)
    rig.views.push_back (ring_view (i, 0, 0.8, 640, 480));
  Frame frame (rig);
  std::mt19937 random (1);
  for (auto &image : frame.depth)
    for (int v = 0; v < 480; v++)
      for (int u = 0; u < 640; u++)
        image.view ().at (u, v) = static_cast<std::uint16_t> (1 + random () % 65535);
  CylinderSettings settings = about_world_axis ();
  settings.slice_height_m = 10;
  settings.columns = 8;
  const CylinderResult result = filter_once (frame, rig, settings);
  EXPECT_EQ (result.points_in, 16u * 640 * 480);
  EXPECT_LE (result.points_out, result.points_in);
}

/* Wherever memory ends, that is a status; and the next frame finds nothing half done. */
TEST (Degenerate, memory_that_ends_anywhere_is_a_status_and_the_next_frame_is_as_ever)
{
  const Rig rig = ring_rig (3);
  const Frame fresh (rig, kTwo);
  Frame expected = fresh;
  filter_once (expected, rig);
  int failures = 0;
  for (bool done = false; !done; failures++) {
    Frame frame = fresh;
    const std::vector<RangeImage> images = frame.images ();
    CylinderFilter filter;
    CylinderResult result;
    allocations_left = failures;
    const Status rig_status = filter.set_rig (rig);
    const Status status = rig_status.ok () ? filter.process (images, {}, result) : rig_status;
    allocations_left = INT_MAX;
    done = status.ok ();
    if (!done) {
      EXPECT_EQ (status.code (), StatusCode::kNoSpace);
      Frame untouched = fresh;
      ASSERT_TRUE (frame == untouched);
      ASSERT_TRUE (filter.set_rig (rig).ok ());
      run (filter, frame);
    }
    ASSERT_TRUE (frame == expected) << failures;
  }
  EXPECT_GT (failures, 20);
}
