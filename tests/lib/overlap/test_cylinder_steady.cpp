/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What cylinderfilter keeps from frame to frame, and what it does with several bodies. */
#include "cylinder-support.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>
#include <rangecast/base/cpu.hpp>
#include <rangecast/scene/scene.hpp>

using namespace rangecast;
using namespace rangecast::testing;

namespace {

/* A figure that stands still, seen with noise. */
struct StillScene {
  StillScene ()
  {
    SceneSettings settings;
    EXPECT_TRUE (Scene::create (settings, scene).ok ());
  }
  Frame shoot (double time_s)
  {
    Frame frame (scene->range_rig ());
    std::array<Roi, kMaxViews> boxes;
    const std::vector<RangeImage> images = frame.images ();
    EXPECT_TRUE (
        scene->render_range (images, time_s, false, {boxes.data (), images.size ()}, 1).ok ());
    frame.add_noise (random, 0.2); /* 3 mm at 0.7 m */
    return frame;
  }
  std::unique_ptr<Scene> scene;
  std::mt19937 random{3};
};

struct Steadiness {
  double changed = 0; ///< share of cells, mean of frames
  double shift_mm = 0, turn_deg = 0;
};

Steadiness
watch_still_scene (const CylinderSettings &settings)
{
  constexpr int kFrames = 6;
  StillScene still;
  CylinderFilter filter;
  EXPECT_TRUE (filter.set_rig (still.scene->range_rig ()).ok ());
  Steadiness all;
  CylinderResult before;
  for (int i = 0; i <= kFrames; i++) {
    Frame frame = still.shoot (1);
    const CylinderResult now = run (filter, frame, settings);
    if (i > 0) {
      all.changed += double (now.cells_changed) / double (now.cells) / kFrames;
      all.shift_mm = std::max (all.shift_mm, 1e3 * norm (now.axis.position - before.axis.position));
      const double cosine = std::min (1.0, dot (now.axis.direction, before.axis.direction));
      all.turn_deg = std::max (all.turn_deg, std::acos (cosine) * 180 / M_PI);
      EXPECT_GT (now.cells_held, now.cells * 4 / 5);
    }
    before = now;
  }
  return all;
}

/* Units whose left and right neighbours agree with each other but not with it. */
double
share_of_lone_cells (const CylinderFilter &filter, int columns)
{
  int lone = 0, all = 0;
  for (int s = 0; s < filter.cell_slices (); s++)
    for (int c = 0; c < columns; c++) {
      const int left = filter.cell_winner (s, (c + columns - 1) % columns),
                right = filter.cell_winner (s, (c + 1) % columns), own = filter.cell_winner (s, c);
      all += own >= 0;
      lone += own >= 0 && left == right && left >= 0 && left != own;
    }
  return double (lone) / std::max (1, all);
}

} // namespace

TEST (Steady, fewer_than_one_unit_in_a_hundred_changes_while_the_head_is_still)
{
  EXPECT_LT (watch_still_scene ({}).changed, 0.01);
}

TEST (Steady, without_hysteresis_cells_do_change)
{
  CylinderSettings settings;
  settings.hysteresis = 0;
  EXPECT_GT (watch_still_scene (settings).changed, 0.02);
}

TEST (Steady, the_axis_stands_still_with_the_head)
{
  const Steadiness steady = watch_still_scene ({});
  EXPECT_LT (steady.shift_mm, 0.1);
  EXPECT_LT (steady.turn_deg, 0.05);
}

TEST (Steady, a_surface_that_turns_changes_its_view_within_three_frames)
{
  Rig rig;
  rig.views = {ring_view (0, 0), ring_view (1, 50)};
  CylinderFilter filter;
  ASSERT_TRUE (filter.set_rig (rig).ok ());
  for (int i = 0; i < 5; i++) {
    Frame frame (rig, patch (0));
    run (filter, frame, vertical_through_origin ());
    EXPECT_LT (frame.points (1), frame.points (0) / 20);
  }
  for (int i = 0; i < 3; i++) {
    Frame frame (rig, patch (50));
    run (filter, frame, vertical_through_origin ());
    if (i == 2) {
      EXPECT_LT (frame.points (0), frame.points (1) / 3); /* the patch's rim */
    }
  }
}

TEST (Steady, the_holder_stays_until_another_view_is_better_by_the_hysteresis)
{
  Rig rig;
  rig.views = {ring_view (0, 0), ring_view (1, 50)};
  for (const bool forget : {false, true}) {
    CylinderFilter filter;
    ASSERT_TRUE (filter.set_rig (rig).ok ());
    Frame first (rig, patch (0)), second (rig, patch (30));
    run (filter, first, vertical_through_origin ());
    if (forget)
      filter.reset ();
    const CylinderResult result = run (filter, second, vertical_through_origin ());
    /* cos 30 = 0.87 against cos 20 = 0.94. */
    EXPECT_EQ (second.points (0) > second.points (1), !forget);
    EXPECT_EQ (result.cells_held > 0, !forget);
  }
}

TEST (Steady, a_new_rig_forgets_who_won)
{
  Rig rig;
  rig.views = {ring_view (0, 0), ring_view (1, 50)};
  CylinderFilter filter;
  ASSERT_TRUE (filter.set_rig (rig).ok ());
  Frame first (rig, patch (0)), second (rig, patch (30));
  run (filter, first, vertical_through_origin ());
  ASSERT_TRUE (filter.set_rig (rig).ok ());
  EXPECT_EQ (run (filter, second, vertical_through_origin ()).cells_held, 0u);
  EXPECT_LT (second.points (0), second.points (1));
}

TEST (Steady, units_of_another_size_or_about_another_axis_do_not_hold_what_was_won)
{
  Rig rig;
  rig.views = {ring_view (0, 0), ring_view (1, 50)};
  const CylinderSettings first = vertical_through_origin ();
  CylinderSettings higher = first, more = first, found = first, elsewhere = first, turned = first,
                   nearby = first;
  higher.cells.height_m = 0.005;
  more.cells.columns = 400;
  found.axis = AxisMode::kVertical;
  elsewhere.fixed_axis.position = {0, 0, -0.06};
  turned.fixed_axis.direction = {0.2, 1, 0};
  nearby.fixed_axis.position = {0, 0.001, 0.001};
  const CylinderSettings all[] = {first, nearby, higher, more, found, elsewhere, turned};
  for (std::size_t i = 0; i < std::size (all); i++) {
    CylinderFilter filter;
    ASSERT_TRUE (filter.set_rig (rig).ok ());
    Frame before (rig, patch (0)), after (rig, patch (30));
    run (filter, before, first);
    const CylinderResult result = run (filter, after, all[i]);
    const bool held = i < 2; /* the same place, and one that follows somebody */
    EXPECT_EQ (result.cells_held > 0, held) << i;
    EXPECT_EQ (after.points (0) > after.points (1), held) << i;
  }
}

/* Units that are said to have a winner. */
static std::uint64_t
cells_with_winner (const CylinderFilter &filter, int columns)
{
  std::uint64_t cells = 0;
  for (int s = 0; s < filter.cell_slices (); s++)
    for (int c = 0; c < columns; c++)
      cells += filter.cell_winner (s, c) >= 0;
  return cells;
}

TEST (Steady, a_unit_without_points_has_no_winner_but_its_holder_is_not_forgotten)
{
  Rig rig;
  rig.views = {ring_view (0, 0), ring_view (1, 50)};
  const CylinderSettings settings = vertical_through_origin ();
  CylinderFilter filter;
  ASSERT_TRUE (filter.set_rig (rig).ok ());
  std::uint64_t cells = 0;
  const Surface whole = patch (0);
  for (const double half_m : {0.03, 0.01, 0.03}) {
    Frame frame (rig, [&] (Vec3 o, Vec3 d) {
      const double s = whole (o, d);
      return std::abs (o.x + s * d.x) < half_m ? s : INFINITY;
    });
    const CylinderResult result = run (filter, frame, settings);
    EXPECT_GT (result.cells, 20u);
    EXPECT_EQ (cells_with_winner (filter, settings.cells.columns), result.cells) << half_m;
    if (cells > 0) { /* the rest comes back to who had it */
      EXPECT_EQ (result.cells_held, result.cells);
    }
    cells = result.cells;
  }
  Frame empty (rig);
  run (filter, empty, settings);
  EXPECT_EQ (cells_with_winner (filter, settings.cells.columns), 0u);
}

TEST (Steady, winners_are_remembered_by_view_and_not_by_place_in_the_frame_set)
{
  StillScene still;
  CylinderFilter filter;
  ASSERT_TRUE (filter.set_rig (still.scene->range_rig ()).ok ());
  CylinderResult result;
  for (int i = 0; i < 4; i++) {
    Frame frame = still.shoot (1);
    std::vector<RangeImage> images = frame.images ();
    if (i % 2)
      std::reverse (images.begin (), images.end ());
    ASSERT_TRUE (filter.process (images, {}, result).ok ());
    if (i > 0) {
      EXPECT_LT (result.cells_changed, result.cells / 50);
    }
  }
  Frame frame = still.shoot (1);
  std::vector<RangeImage> images = frame.images ();
  images.erase (images.begin () + 1);
  ASSERT_TRUE (filter.process (images, {}, result).ok ());
  EXPECT_LT (result.points_out, result.points_in);
}

TEST (Steady, neighbouring_cells_agree)
{
  StillScene still;
  for (const double smoothing_m : {0.0, 0.01}) {
    CylinderFilter filter;
    ASSERT_TRUE (filter.set_rig (still.scene->range_rig ()).ok ());
    Frame frame = still.shoot (1);
    CylinderSettings settings;
    settings.cells.smoothing_m = smoothing_m;
    settings.agreement = smoothing_m > 0 ? settings.agreement : 0;
    run (filter, frame, settings);
    const double lone = share_of_lone_cells (filter, settings.cells.columns);
    if (smoothing_m > 0)
      EXPECT_LT (lone, 0.002);
    else
      EXPECT_GT (lone, 0.01);
  }
}

TEST (Rungs, every_processor_gives_the_same)
{
  for (const int views : {4, 40}) {
    const Rig rig = ring_rig (views);
    const Surface body = both (
        ellipsoid ({0, 0, 0}, {0.09, 0.2, 0.11}), ellipsoid ({0.2, 0, 0.1}, {0.1, 0.03, 0.03}));
    Frame fast (rig, body);
    std::mt19937 random (5);
    fast.add_noise (random, 0.2);
    Frame plain = fast;
    CylinderFilter one, two;
    ASSERT_TRUE (one.set_rig (rig).ok () && two.set_rig (rig).ok ());
    const CylinderResult a = run (one, fast);
    limit_cpu (CpuLevel::kScalar);
    const CylinderResult b = run (two, plain);
    limit_cpu (kCpuLevels[std::size (kCpuLevels) - 1]);
    EXPECT_TRUE (fast == plain);
    EXPECT_EQ (a.points_out, b.points_out);
    EXPECT_EQ (a.axis.position.x, b.axis.position.x);
    EXPECT_LT (a.points_out, a.points_in);
  }
}

TEST (Clusters, those_that_stand_apart_get_a_cylinder_each)
{
  const Rig rig = ring_rig (4);
  const Surface left = ellipsoid ({-0.15, 0, 0}, {0.07, 0.2, 0.08}),
                right = ellipsoid ({0.15, 0, 0.05}, {0.07, 0.19, 0.08});
  CylinderSettings settings;
  for (const int bodies : {1, 4}) {
    settings.max_clusters = bodies;
    CylinderFilter filter;
    ASSERT_TRUE (filter.set_rig (rig).ok ());
    Frame frame (rig, both (left, right));
    const CylinderResult result = run (filter, frame, settings);
    EXPECT_EQ (result.clusters, bodies == 1 ? 1 : 2);
    EXPECT_EQ (std::abs (result.axis.position.x) > 0.1, bodies > 1);
  }
  CylinderFilter filter;
  ASSERT_TRUE (filter.set_rig (rig).ok ());
  Frame frame (rig, left);
  EXPECT_EQ (run (filter, frame, settings).clusters, 1);
}

TEST (Clusters, winners_do_not_change_when_another_body_comes_and_goes)
{
  const Rig rig = ring_rig (4);
  const Surface left = ellipsoid ({-0.15, 0, 0}, {0.07, 0.2, 0.08}),
                right = ellipsoid ({0.15, 0, 0.05}, {0.07, 0.19, 0.08});
  CylinderFilter filter;
  ASSERT_TRUE (filter.set_rig (rig).ok ());
  for (int i = 0; i < 6; i++) {
    Frame frame (rig, i == 2 || i == 3 ? both (left, right) : left);
    const CylinderResult result = run (filter, frame);
    EXPECT_EQ (result.clusters, i == 2 || i == 3 ? 2 : 1);
    if (i > 0) { /* not more than what one hides of the other */
      EXPECT_GT (result.cells_held, i == 2 ? 9000u : 17000u) << i;
      EXPECT_LT (result.cells_changed, result.cells / 8) << i;
    }
  }
}

TEST (Clusters, one_thread_and_many_give_the_same_over_several_frames)
{
  const Rig rig = ring_rig (6);
  const Surface people = both (ellipsoid ({-0.15, 0, 0}, {0.07, 0.2, 0.08}),
      ellipsoid ({0.15, 0, 0.05}, {0.07, 0.19, 0.08}));
  CylinderFilter one, many;
  ASSERT_TRUE (one.set_rig (rig).ok () && many.set_rig (rig).ok ());
  std::mt19937 random (11);
  for (int i = 0; i < 3; i++) {
    Frame first (rig, people);
    first.add_noise (random, 0.2);
    Frame second = first;
    CylinderSettings settings;
    const CylinderResult a = run (one, first, settings);
    settings.threads = 5;
    const CylinderResult b = run (many, second, settings);
    EXPECT_TRUE (first == second);
    EXPECT_EQ (a.clusters, 2);
    EXPECT_EQ (a.cells_changed, b.cells_changed);
    EXPECT_EQ (a.cells_held, b.cells_held);
  }
}

TEST (Clusters, stray_points_are_no_body)
{
  const Rig rig = ring_rig (4);
  Frame frame (rig, ellipsoid ({0, 0, 0}, {0.09, 0.2, 0.11}));
  std::mt19937 random (1);
  for (auto &image : frame.depth)
    for (int i = 0; i < 100; i++)
      image.view ().at (int (random () % kWidth), int (random () % kHeight)) =
          static_cast<std::uint16_t> (3000 + random () % 12000);
  CylinderFilter filter;
  ASSERT_TRUE (filter.set_rig (rig).ok ());
  EXPECT_EQ (run (filter, frame).clusters, 1);
}

/* ---- degenerate input: nothing is NaN, nothing is out of bounds, points only disappear ---- */

/* A view whose pixel (column, row) of a small picture looks straight at the origin. */
static View
small_view (int id, double angle_deg, int width, int height)
{
  View view = ring_view (id, angle_deg, 0.8, width, height);
  view.intrinsics = {300, 300, width / 2 + 0.0, height / 2 + 0.0};
  return view;
}

static void
expect_sane (const Rig &rig, const std::function<std::uint16_t (int view, int u, int v)> &depth_at,
    const CylinderSettings &settings)
{
  CylinderFilter filter;
  ASSERT_TRUE (filter.set_rig (rig).ok ());
  for (int round = 0; round < 3; round++) {
    Frame frame (rig);
    std::size_t points = 0;
    for (std::size_t i = 0; i < rig.views.size (); i++)
      for (int v = 0; v < rig.views[i].height; v++)
        for (int u = 0; u < rig.views[i].width; u++)
          points += (frame.depth[i].view ().at (u, v) = depth_at (int (i), u, v)) != 0;
    const CylinderResult result = run (filter, frame, settings);
    EXPECT_EQ (result.points_in, points);
    std::size_t left = 0;
    for (std::size_t i = 0; i < rig.views.size (); i++) {
      left += frame.points (i);
      for (int v = 0; v < rig.views[i].height; v++)
        for (int u = 0; u < rig.views[i].width; u++) {
          const int now = frame.depth[i].view ().at (u, v);
          if (now != 0) {
            ASSERT_EQ (now, depth_at (int (i), u, v));
          }
        }
    }
    EXPECT_EQ (result.points_out, left);
    if (points > 0) {
      EXPECT_GT (left, 0u);
    }
    for (double number : {result.axis.position.x, result.axis.position.y, result.axis.position.z})
      EXPECT_TRUE (std::isfinite (number));
    EXPECT_NEAR (norm (result.axis.direction), 1, 1e-9);
  }
}

TEST (Degenerate, views_of_one_pixel)
{
  for (const int views : {1, 2, 3, 64}) {
    Rig rig;
    for (int i = 0; i < views; i++)
      rig.views.push_back (small_view (i, 360.0 * i / views, 1, 1));
    for (const std::uint16_t depth : {1, 7000, 8000, 65535})
      expect_sane (rig, [=] (int, int, int) { return depth; }, {});
  }
}

TEST (Degenerate, focal_lengths_at_their_limits)
{
  for (const double focal : {1e-3, 1e6}) {
    Rig rig;
    for (int i = 0; i < 3; i++) {
      rig.views.push_back (small_view (i, 120.0 * i, 9, 33));
      rig.views.back ().intrinsics.fx = rig.views.back ().intrinsics.fy = focal;
    }
    ASSERT_TRUE (validate (rig).ok ());
    for (const std::uint16_t depth : {1, 8000, 65535})
      expect_sane (rig, [=] (int, int, int) { return depth; }, {});
  }
}

TEST (Degenerate, all_points_on_the_axis)
{
  /* The middle column of each view, 0.8 m away: x = z = 0 but for rounding. */
  Rig rig;
  for (int i = 0; i < 4; i++)
    rig.views.push_back (small_view (i, 90.0 * i, 9, 33));
  const auto column = [] (int, int u, int) { return std::uint16_t (u == 4 ? 8000 : 0); };
  for (const AxisMode mode : {AxisMode::kPrincipal, AxisMode::kVertical, AxisMode::kFixed}) {
    CylinderSettings settings;
    settings.axis = mode;
    expect_sane (rig, column, settings);
  }
}

TEST (Degenerate, all_points_in_one_place_or_on_a_line)
{
  Rig rig;
  for (int i = 0; i < 3; i++)
    rig.views.push_back (small_view (i, 120.0 * i, 17, 5));
  expect_sane (rig, [] (int, int u, int v) { return u == 8 && v == 2 ? 8000 : 0; }, {});
  expect_sane (rig, [] (int, int, int v) { return v == 2 ? 8000 : 0; }, {});
  CylinderSettings settings; /* the line is the axis */
  settings.axis = AxisMode::kFixed;
  settings.fixed_axis.direction = {1, 0, 0};
  expect_sane (
      rig, [] (int i, int, int v) { return v == 2 && i == 0 ? 8000 : 0; }, settings);
}

TEST (Degenerate, settings_at_their_ends)
{
  Rig rig;
  for (int i = 0; i < 4; i++)
    rig.views.push_back (small_view (i, 90.0 * i, 40, 30));
  const auto bumpy = [] (int i, int u, int v) {
    return std::uint16_t (6000 + 500 * ((u * 7 + v * 13 + i) % 5));
  };
  for (const int columns : {8, 9, 3600})
    for (const double gap_m : {0.0, 0.03, 100.0})
      for (const double smoothing_m : {0.0, 1.0}) {
        CylinderSettings settings;
        settings.cells = {0.0002, columns, gap_m, smoothing_m};
        settings.hysteresis = settings.agreement = 2;
        expect_sane (rig, bumpy, settings);
      }
}

TEST (Degenerate, more_slices_than_the_cylinder_has_cells_for)
{
  /* 65 m of depth along the axis, slices of 0.2 mm, as narrow as they get and as wide. */
  Rig rig;
  for (int i = 0; i < 2; i++) {
    rig.views.push_back (small_view (i, 0, 200, 150));
    rig.views.back ().depth_unit_m = 0.001;
    rig.views.back ().far_m = 65;
  }
  for (const int columns : {8, 3600}) {
    CylinderSettings settings;
    settings.axis = AxisMode::kFixed;
    settings.fixed_axis.direction = {0, 0, 1};
    settings.cells.columns = columns;
    settings.cells.height_m = 0.0002;
    const auto scattered = [] (int i, int u, int v) {
      return std::uint16_t (u * 40503 + v * 30011 + i);
    };
    expect_sane (rig, scattered, settings);
  }
}

TEST (Degenerate, frame_sets_without_images_or_points)
{
  CylinderFilter filter;
  CylinderResult result;
  EXPECT_TRUE (filter.process ({}, {}, result).ok ()); /* before any rig */
  const Rig rig = ring_rig (3);
  ASSERT_TRUE (filter.set_rig (rig).ok ());
  Frame body (rig, ellipsoid ({0, 0, 0}, {0.09, 0.2, 0.11})), empty (rig);
  Frame again = body;
  run (filter, body);
  EXPECT_EQ (run (filter, empty).points_in, 0u);
  EXPECT_TRUE (filter.process ({}, {}, result).ok ());
  result = run (filter, again);
  EXPECT_LT (result.points_out, result.points_in);
}

TEST (Degenerate, the_rig_and_all_settings_may_change_between_frames)
{
  CylinderFilter filter;
  for (const int views : {4, 1, 33, 2, 64, 3}) {
    Rig rig;
    for (int i = 0; i < views; i++)
      rig.views.push_back (ring_view (i, 360.0 * i / views, 0.8, 40 + views, 30));
    ASSERT_TRUE (filter.set_rig (rig).ok ());
    for (const int columns : {360, 90, 721}) {
      Frame frame (rig, ellipsoid ({0, 0, 0}, {0.09, 0.2, 0.11}));
      CylinderSettings settings;
      settings.cells.columns = columns;
      settings.cells.height_m = 1.0 / columns;
      settings.max_clusters = 1 + views % 8;
      const CylinderResult result = run (filter, frame, settings);
      const bool some_went = result.points_out < result.points_in;
      EXPECT_TRUE (some_went || views < 30); /* few that coarse see no place twice */
    }
  }
}
