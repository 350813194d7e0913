/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "../test-support.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <map>
#include <new>
#include <random>
#include <rangecast/overlap/cylinder_filter.hpp>

/* Counts what is allocated, for the test that nothing is. Not inlined, or compilers see a free that
 * has no malloc and warn. */
static std::atomic<int> allocations;

[[gnu::noinline]] void *
operator new (std::size_t size)
{
  allocations++;
  if (void *memory = std::malloc (size ? size : 1))
    return memory;
  throw std::bad_alloc ();
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
using rangecast::testing::Image;
using rangecast::testing::ring_rig;
using rangecast::testing::ring_view;

namespace {

/** Where a ray (origin + s * direction, s > 0) first meets a surface; s, or infinity. */
using Surface = std::function<double (Vec3 origin, Vec3 direction)>;
constexpr double kMiss = INFINITY;

Surface
ellipsoid (Vec3 centre, Vec3 radii)
{
  return [=] (Vec3 o, Vec3 d) {
    o = o - centre;
    o = {o.x / radii.x, o.y / radii.y, o.z / radii.z};
    d = {d.x / radii.x, d.y / radii.y, d.z / radii.z};
    const double a = dot (d, d), b = dot (o, d), c = dot (o, o) - 1, root = b * b - a * c;
    return root < 0 ? kMiss : (-b - std::sqrt (root)) / a;
  };
}

/** A square patch with its middle at `centre`, `half` metres to each side, seen from both sides. */
Surface
patch (Vec3 centre, Vec3 normal, double half)
{
  return [=] (Vec3 o, Vec3 d) {
    const double s = dot (centre - o, normal) / dot (d, normal);
    const Vec3 p = o + s * d - centre;
    const bool hit = s > 0 && std::abs (p.y) < half && norm (p - Vec3{0, p.y, 0}) < half;
    return hit ? s : kMiss;
  };
}

Surface
both (const Surface &a, const Surface &b)
{
  return [=] (Vec3 o, Vec3 d) { return std::min (a (o, d), b (o, d)); };
}

/** An upright body about 0.4 m high with a nose; its principal axis is vertical. */
Surface
bust ()
{
  return both (
      ellipsoid ({0, 0, 0}, {0.09, 0.2, 0.11}), ellipsoid ({0, 0.02, 0.11}, {0.02, 0.03, 0.02}));
}

/** What cameras see of a surface, exactly but for depth's own steps. */
class Shots {
public:
  Shots (const Rig &rig, const Surface &surface, double noise_m = 0) : rig (rig)
  {
    std::mt19937 random (7);
    std::normal_distribution<double> noise (0, 1);
    for (const View &view : rig.views) {
      depth.emplace_back (view.width, view.height);
      colour.emplace_back (view.width, view.height);
      auto out = depth.back ().view ();
      for (int v = 0; v < view.height; v++)
        for (int u = 0; u < view.width; u++) {
          const Vec3 ray = view.world_from_view.rotation * view.intrinsics.unproject (u, v, 1);
          const double z = surface (view.world_from_view.translation, ray);
          const double units = (z + noise_m * noise (random)) / view.depth_unit_m;
          out.at (u, v) = z < 6 ? static_cast<std::uint16_t> (units + 0.5) : 0;
          colour.back ().view ().at (u, v) = {std::uint8_t (u), std::uint8_t (v), 3, 4};
        }
    }
  }

  std::vector<RangeImage> images ()
  {
    std::vector<RangeImage> all;
    for (std::size_t i = 0; i < rig.views.size (); i++) {
      const View &view = rig.views[i];
      all.push_back (
          {view.id, {0, 0, view.width, view.height}, depth[i].view (), colour[i].view (), 0});
    }
    return all;
  }

  std::vector<Vec3> points ()
  {
    std::vector<Vec3> all;
    for (std::size_t i = 0; i < rig.views.size (); i++)
      for (Vec3 p : points_of (i))
        all.push_back (p);
    return all;
  }

  std::vector<Vec3> points_of (std::size_t i)
  {
    const View &view = rig.views[i];
    std::vector<Vec3> all;
    for (int v = 0; v < view.height; v++)
      for (int u = 0; u < view.width; u++)
        if (const int d = depth[i].view ().at (u, v))
          all.push_back (
              view.world_from_view * view.intrinsics.unproject (u, v, d * view.depth_unit_m));
    return all;
  }

  CylinderResult filter (const CylinderSettings &settings)
  {
    CylinderFilter filter;
    CylinderResult result;
    EXPECT_TRUE (filter.set_rig (rig).ok ());
    const Status status = filter.process (images (), settings, result);
    EXPECT_TRUE (status.ok ()) << status.message ();
    return result;
  }

  Rig rig;
  std::vector<Image<std::uint16_t>> depth;
  std::vector<Image<Rgbx>> colour;
};

CylinderSettings
vertical_through_origin ()
{
  CylinderSettings settings;
  settings.axis = AxisMode::kFixed;
  return settings;
}

/** Points in cubes, to find those near a place. */
class Cubes {
public:
  explicit Cubes (const std::vector<Vec3> &points)
  {
    for (Vec3 p : points)
      cubes_[cube (p, 0)].push_back (p);
  }

  /** Metres to the nearest point; kSide if there is none nearer. */
  double nearest (Vec3 p) const
  {
    double least = kSide;
    for (int k = 0; k < 27; k++)
      if (auto found = cubes_.find (cube (p, k - 13)); found != cubes_.end ())
        for (Vec3 q : found->second)
          least = std::min (least, norm (p - q));
    return least;
  }

private:
  static constexpr double kSide = 0.012;
  static std::array<int, 3> cube (Vec3 p, int k)
  {
    auto floored = [] (double v) { return static_cast<int> (std::floor (v / kSide)); };
    k += 13;
    return {floored (p.x) + k % 3 - 1, floored (p.y) + k / 3 % 3 - 1, floored (p.z) + k / 9 - 1};
  }
  std::map<std::array<int, 3>, std::vector<Vec3>> cubes_;
};

/** The farthest that any of `from` is from the nearest of `to`, metres. */
double
farthest_gap (const std::vector<Vec3> &from, const std::vector<Vec3> &to)
{
  const Cubes cubes (to);
  double worst = 0;
  for (Vec3 p : from)
    worst = std::max (worst, cubes.nearest (p));
  return worst;
}

/** Points that have a point of an earlier view within 3 mm: the pitch of the cameras there. */
std::size_t
doubles (Shots &shots)
{
  std::size_t n = 0;
  std::vector<Vec3> earlier = shots.points_of (0);
  for (std::size_t i = 1; i < shots.rig.views.size (); i++) {
    const Cubes cubes (earlier);
    for (Vec3 p : shots.points_of (i)) {
      n += cubes.nearest (p) < 0.003;
      earlier.push_back (p);
    }
  }
  return n;
}

View
view_at (int id, Vec3 position, double turn_deg)
{
  View view = ring_view (id, turn_deg, 1);
  view.world_from_view.translation = position;
  return view;
}

} // namespace

TEST (FastAtan2, stays_within_its_stated_error_all_round)
{
  double worst = 0;
  for (int i = 0; i < 200000; i++) {
    const double phi = 2 * M_PI * i / 200000, r = 0.001 + i % 1000;
    const float x = static_cast<float> (r * std::cos (phi)),
                y = static_cast<float> (r * std::sin (phi));
    double expected = std::atan2 (double{y}, double{x});
    expected += expected < 0 ? 2 * M_PI : 0;
    const double error = std::abs (fast_atan2 (y, x) - expected);
    worst = std::max (worst, std::min (error, std::abs (error - 2 * M_PI)));
  }
  EXPECT_LT (worst, 1.5e-5);
  EXPECT_EQ (fast_atan2 (0, 0), 0);
}

TEST (Wall, vector_and_plain_code_agree_and_columns_stay_in_range)
{
  std::mt19937 random (3);
  std::uniform_real_distribution<float> any (-0.5f, 0.5f);
  Image<std::uint16_t> depth (37, 1, 1000);
  const RangeImage image{0, {0, 0, 37, 1}, depth.view (), {}, 0};
  WorldPoints four, one;
  ASSERT_TRUE (four.reset ({&image, 1}).ok ());
  four.fill (0, image, PixelRays (ring_view (0, 0)));
  for (int i = 0; i < 37; i++)
    four.x[i] = any (random), four.y[i] = any (random), four.z[i] = any (random);
  four.x[5] = four.z[5] = 0;
  four.x[6] = 0.3f, four.z[6] = -1e-30f; /* an angle that rounds to 2 pi */
  one = four;
  std::vector<float> r4 (37), r1 (37);
  std::vector<std::int32_t> c4 (37), c1 (37);
  const CylinderFrame frame{Axis{}};
  (void)project_to_cylinder (four, {0, 37}, frame, 360, r4.data (), c4.data ());
  for (std::size_t i = 0; i < 37; i++)
    (void)project_to_cylinder (one, {i, i + 1}, frame, 360, r1.data (), c1.data ());
  for (int i = 0; i < 37; i++) {
    EXPECT_FLOAT_EQ (r4[i], r1[i]);
    EXPECT_EQ (c4[i], c1[i]) << i;
    EXPECT_GE (c4[i], 0);
    EXPECT_LT (c4[i], 360);
  }
}

TEST (Axis, eigenvectors_of_a_known_matrix)
{
  double values[3];
  Vec3 vectors[3];
  eigen_symmetric ({2, 1, 0, 2, 0, 5}, values, vectors);
  EXPECT_NEAR (values[0], 5, 1e-12);
  EXPECT_NEAR (values[1], 3, 1e-12);
  EXPECT_NEAR (values[2], 1, 1e-12);
  EXPECT_NEAR (std::abs (vectors[0].z), 1, 1e-12);
  EXPECT_NEAR (std::abs (dot (vectors[1], {std::sqrt (0.5), std::sqrt (0.5), 0})), 1, 1e-12);
}

TEST (Axis, follows_a_tilted_body_and_points_up)
{
  const double tilt = 20 * M_PI / 180, c = std::cos (tilt), t = std::sin (tilt);
  const Mat3 upright_from_world{c, t, 0, -t, c, 0, 0, 0, 1};
  const Surface body = ellipsoid ({0, 0, 0}, {0.08, 0.2, 0.08});
  Shots shots (ring_rig (4), [=] (Vec3 o, Vec3 d) {
    return body (upright_from_world * (o - Vec3{0.02, 0, 0}), upright_from_world * d);
  });
  const Axis axis = shots.filter ({}).axis;
  /* Points are denser where the body is nearer, so not quite the body's own axis. */
  EXPECT_GT (dot (axis.direction, {-t, c, 0}), std::cos (6 * M_PI / 180));
  EXPECT_NEAR (axis.position.x, 0.02, 0.01);
}

TEST (Axis, round_bodies_have_a_vertical_one)
{
  Shots shots (ring_rig (4), ellipsoid ({0, 0, 0}, {0.1, 0.1, 0.1}));
  EXPECT_EQ (shots.filter ({}).axis.direction.y, 1);
}

TEST (Axis, does_not_lie_along_a_camera_that_sees_it_end_on)
{
  Shots shots (ring_rig (4), ellipsoid ({0, 0, 0}, {0.2, 0.09, 0.08}));
  EXPECT_EQ (shots.filter ({}).axis.direction.y, 1);
}

TEST (Axis, does_not_follow_noise)
{
  AxisTracker tracker;
  tracker.follow ({{0, 0, 0}, {0, 1, 0}});
  const double turn = 0.1 * M_PI / 180;
  const Axis &axis = tracker.follow ({{0.0002, 0, 0}, {std::sin (turn), std::cos (turn), 0}});
  EXPECT_GT (axis.position.x, 0);
  EXPECT_LT (axis.position.x, 0.00006);
  EXPECT_LT (axis.direction.x, turn / 10);
  EXPECT_NEAR (norm (axis.direction), 1, 1e-12);
  tracker.reset ();
  EXPECT_EQ (tracker.follow ({{1, 0, 0}, {1, 0, 0}}).position.x, 1);
}

TEST (Axis, follows_motion_within_three_frames)
{
  AxisTracker tracker;
  tracker.follow ({{0, 0, 0}, {0, 1, 0}});
  const double turn = 20 * M_PI / 180;
  const Axis there{{0.1, 0, 0}, {std::sin (turn), std::cos (turn), 0}};
  for (int frame = 0; frame < 3; frame++)
    tracker.follow (there);
  EXPECT_LT (norm (tracker.axis ().position - there.position), 0.01);
  EXPECT_GT (dot (tracker.axis ().direction, there.direction), std::cos (2.5 * M_PI / 180));
}

TEST (Decision, the_camera_that_looks_squarely_at_a_patch_keeps_it)
{
  Rig rig;
  rig.views = {ring_view (3, 50), ring_view (8, 0), ring_view (9, -50)};
  Shots shots (rig, patch ({0, 0, 0.1}, {0, 0, 1}, 0.03));
  const std::size_t squarely = shots.points_of (1).size ();
  ASSERT_GT (shots.points_of (0).size (), 100u);
  shots.filter (vertical_through_origin ());
  EXPECT_EQ (shots.points_of (1).size (), squarely);
  /* At the patch's very edge another view's points may lie in a cell that it has to itself. */
  EXPECT_LT (shots.points_of (0).size () + shots.points_of (2).size (), squarely / 10);
}

TEST (Decision, the_plain_rule_decides_unit_by_unit)
{
  Rig rig;
  rig.views = {ring_view (0, 50), ring_view (1, 0)};
  Shots shots (rig, patch ({0, 0, 0.1}, {0, 0, 1}, 0.03));
  const std::size_t squarely = shots.points_of (1).size ();
  CylinderSettings settings = vertical_through_origin ();
  settings.cells.smoothing_m = 0;
  settings.cells.columns = 90; /* wide enough for a point of each view */
  settings.cells.height_m = 0.006;
  shots.filter (settings);
  EXPECT_EQ (shots.points_of (1).size (), squarely);
  EXPECT_LT (shots.points_of (0).size (), squarely / 5);
}

TEST (Decision, of_two_that_see_it_equally_the_first_keeps_all_and_the_second_its_outline)
{
  Rig rig;
  rig.views = {ring_view (5, 0), ring_view (2, 0)};
  Shots shots (rig, bust ());
  const std::size_t first = shots.points_of (0).size ();
  const CylinderResult result = shots.filter ({});
  EXPECT_EQ (shots.points_of (0).size (), first);
  EXPECT_LT (shots.points_of (1).size (), first / 10);
  EXPECT_EQ (result.points_in, 2 * first);
  EXPECT_EQ (result.cells, result.cells_shared);
}

TEST (Decision, surfaces_further_apart_than_the_layer_gap_do_not_compete)
{
  /* Front sees the chest, the side camera an arm before it: same cells, other radii. */
  Rig rig;
  rig.views = {ring_view (0, 0), ring_view (1, 0)};
  Shots chest (rig, patch ({0, 0, 0.1}, {0, 0, 1}, 0.03)),
      arm (rig, patch ({0, 0, 0.2}, {0, 0, 1}, 0.03));
  chest.depth[1] = arm.depth[1];
  const std::size_t points = chest.points ().size ();
  const CylinderResult apart = chest.filter (vertical_through_origin ());
  EXPECT_EQ (apart.points_out, points);
  EXPECT_GT (apart.cells_shared, 0u);
  /* Even where they do, neither covers the other. */
  CylinderSettings settings = vertical_through_origin ();
  settings.cells.layer_gap_m = 0.2;
  EXPECT_EQ (chest.filter (settings).points_out, points);
}

TEST (Decision, a_view_with_one_point_in_a_unit_competes)
{
  Rig rig;
  rig.views = {ring_view (0, 0), ring_view (1, 60)};
  Shots shots (rig, patch ({0, 0, 0.1}, {0, 0, 1}, 0.03));
  Shots before = shots;
  /* One pixel of the oblique view is left. */
  auto depth = shots.depth[1].view ();
  int left = 0;
  for (int v = 0; v < depth.height; v++)
    for (int u = 0; u < depth.width; u++)
      if (depth.at (u, v) && !(v == 120 && left++ == 5))
        depth.at (u, v) = 0;
  ASSERT_EQ (shots.points_of (1).size (), 1u);
  shots.filter (vertical_through_origin ());
  EXPECT_EQ (shots.points_of (1).size (), 0u);
  EXPECT_EQ (shots.points_of (0).size (), before.points_of (0).size ());
}

TEST (Decision, holds_across_the_seam_at_phi_0)
{
  /* phi = 0 lies on +x: camera at 90 degrees looks at it squarely. */
  Rig rig;
  rig.views = {ring_view (0, 40), ring_view (1, 90)};
  Shots shots (rig, patch ({0.1, 0, 0}, {1, 0, 0}, 0.03));
  const std::size_t squarely = shots.points_of (1).size ();
  shots.filter (vertical_through_origin ());
  EXPECT_EQ (shots.points_of (1).size (), squarely);
  EXPECT_LT (shots.points_of (0).size (), squarely / 20);
}

TEST (Decision, a_camera_from_above_does_not_win_a_wall)
{
  Rig rig;
  rig.views = {ring_view (0, 25), ring_view (1, 0)};
  const double down = 75 * M_PI / 180, c = std::cos (down), s = std::sin (down);
  rig.views[1].world_from_view = {{1, 0, 0, 0, -c, -s, 0, s, -c}, {0, 0.8 * s, 0.1 + 0.8 * c}};
  Shots shots (rig, patch ({0, 0, 0.1}, {0, 0, 1}, 0.03));
  const std::size_t from_the_side = shots.points_of (0).size ();
  ASSERT_GT (shots.points_of (1).size (), 100u);
  shots.filter (vertical_through_origin ());
  EXPECT_EQ (shots.points_of (0).size (), from_the_side);
  EXPECT_LT (shots.points_of (1).size (), from_the_side / 20);
}

TEST (Decision, both_sides_of_a_thin_thing_stay)
{
  Rig rig;
  rig.views = {ring_view (0, 0), view_at (1, {0, 0, -0.8}, 180)};
  Shots shots (rig, patch ({0, 0, 0.1}, {0, 0, 1}, 0.03));
  const std::size_t points = shots.points ().size ();
  EXPECT_EQ (shots.filter (vertical_through_origin ()).points_out, points);
}

TEST (Coverage, the_hole_of_the_winner_stays_filled)
{
  Rig rig;
  rig.views = {ring_view (0, 40), ring_view (1, 0)};
  Shots shots (rig, patch ({0, 0, 0.1}, {0, 0, 1}, 0.03));
  Shots whole = shots;
  whole.filter (vertical_through_origin ());
  const std::vector<Vec3> before = shots.points ();
  auto depth = shots.depth[1].view ();
  for (int v = depth.height / 2 - 1; v <= depth.height / 2 + 1; v++)
    for (int u = depth.width / 2 - 1; u <= depth.width / 2 + 1; u++)
      depth.at (u, v) = 0;
  shots.filter (vertical_through_origin ());
  EXPECT_LT (farthest_gap (before, shots.points ()), 0.0025);
  /* The hole and the rim, no more. */
  EXPECT_GT (shots.points_of (0).size (), whole.points_of (0).size () + 9);
  EXPECT_LT (shots.points_of (0).size (), whole.points_of (0).size () + 50);
}

TEST (Coverage, what_lies_a_little_behind_the_winners_surface_is_another_surface)
{
  /* Hair before a cheek: for the one camera it hides the cheek, which is open to the other. */
  Rig rig;
  rig.views = {ring_view (0, 0), ring_view (1, 30)};
  for (const double behind : {0.001, 0.006, 0.022}) {
    Shots near (rig, patch ({0, 0, 0.1}, {0, 0, 1}, 0.03)),
        far (rig, patch ({0, 0, 0.1 - behind}, {0, 0, 1}, 0.03));
    far.depth[0] = near.depth[0];
    const std::size_t points = far.points_of (1).size ();
    far.filter (vertical_through_origin ());
    if (behind > 0.002)
      EXPECT_EQ (far.points_of (1).size (), points) << behind;
    else
      EXPECT_LT (far.points_of (1).size (), points / 2);
  }
}

TEST (Coverage, the_other_side_of_a_thin_thing_is_another_surface)
{
  /* A ribbon that one camera sees from the front at a slant and the other from behind. */
  Rig rig;
  rig.views = {ring_view (0, 0), ring_view (1, 60)};
  const double turn = 110 * M_PI / 180;
  Shots shots (rig, patch ({0, 0, 0.05}, {std::sin (turn), 0, std::cos (turn)}, 0.03));
  ASSERT_GT (shots.points_of (0).size (), 100u);
  const std::size_t points = shots.points ().size ();
  EXPECT_EQ (shots.filter (vertical_through_origin ()).points_out, points);
}

TEST (Coverage, a_wider_overlap_keeps_more_and_no_less)
{
  std::size_t before = 0;
  for (const double overlap : {0.0, 1.0, 3.0, 6.0}) {
    Shots shots (ring_rig (4), bust ());
    CylinderSettings settings;
    settings.overlap = overlap;
    const CylinderResult result = shots.filter (settings);
    EXPECT_GT (result.points_out, before) << overlap;
    EXPECT_LT (result.points_out, result.points_in) << overlap;
    before = result.points_out;
  }
}

TEST (PixelLookup, finds_the_pixel_that_a_ray_came_from)
{
  const View view = view_at (0, {0.3, -0.2, 0.7}, 35);
  const PixelRays rays (view);
  const PixelLookup lookup (view);
  for (const float depth : {3000.f, 20000.f}) {
    float point[3], u, v, z;
    rays.point (17, 201, depth, point);
    lookup.find (point, u, v, z);
    EXPECT_NEAR (u, 17, 0.01);
    EXPECT_NEAR (v, 201, 0.01);
    EXPECT_NEAR (z, depth, 0.5);
  }
}

TEST (Filter, doubles_go_and_no_holes_come)
{
  for (const double noise_m : {0.0, 0.001}) {
    Shots shots (ring_rig (4), bust (), noise_m);
    const std::vector<Vec3> before = shots.points ();
    const std::size_t before_doubles = doubles (shots);
    const CylinderResult result = shots.filter ({});
    const std::vector<Vec3> after = shots.points ();
    EXPECT_EQ (result.points_in, before.size ());
    EXPECT_EQ (result.points_out, after.size ());
    EXPECT_LT (farthest_gap (before, after), 0.006) << noise_m;
    EXPECT_GT (before_doubles, before.size () / 4) << noise_m;
    EXPECT_LT (doubles (shots), before_doubles / 5) << noise_m;
  }
}

TEST (Filter, what_is_left_of_each_view_is_its_own_quarter)
{
  Shots shots (ring_rig (4), ellipsoid ({0, 0, 0}, {0.1, 0.2, 0.1}), 0.001);
  shots.filter ({});
  int wrong = 0, all = 0;
  for (int i = 0; i < 4; i++)
    for (Vec3 p : shots.points_of (i)) {
      if (std::abs (p.y) > 0.17)
        continue;
      double off = std::abs (std::atan2 (p.x, p.z) - i * M_PI / 2);
      off = std::min (off, 2 * M_PI - off) * 180 / M_PI;
      wrong += off > 45 + 8; /* where regions meet they overlap */
      all++;
    }
  EXPECT_LT (wrong, all / 200);
}

TEST (Filter, points_only_disappear_and_colour_is_untouched)
{
  Shots shots (ring_rig (3), bust (), 0.002);
  Shots before = shots;
  shots.filter ({});
  for (int i = 0; i < 3; i++) {
    auto now = shots.depth[i].view (), then = before.depth[i].view ();
    auto c = shots.colour[i].view (), c0 = before.colour[i].view ();
    for (int v = 0; v < now.height; v++) {
      for (int u = 0; u < now.width; u++)
        if (now.at (u, v) != 0) {
          ASSERT_EQ (now.at (u, v), then.at (u, v));
        }
      ASSERT_EQ (std::memcmp (c.row (v), c0.row (v), 4 * std::size_t (c.width)), 0);
    }
  }
}

TEST (Filter, a_cropped_image_gives_the_same_as_a_whole_one)
{
  Shots whole (ring_rig (4), bust ()), cropped = whole;
  whole.filter ({});
  CylinderFilter filter;
  CylinderResult result;
  ASSERT_TRUE (filter.set_rig (cropped.rig).ok ());
  std::vector<RangeImage> images = cropped.images ();
  for (RangeImage &image : images) {
    image.roi = {40, 10, 240, 220};
    image.depth = image.depth.crop (40, 10, 240, 220);
    image.colour = image.colour.crop (40, 10, 240, 220);
  }
  ASSERT_TRUE (filter.process (images, {}, result).ok ());
  EXPECT_EQ (whole.points ().size (), cropped.points ().size ());
}

TEST (Filter, is_the_same_with_one_thread_and_many)
{
  Shots one (ring_rig (8), bust (), 0.001), many = one;
  CylinderSettings settings;
  one.filter (settings);
  settings.threads = 3;
  many.filter (settings);
  for (int i = 0; i < 8; i++)
    for (int v = 0; v < 240; v++)
      ASSERT_EQ (
          std::memcmp (one.depth[i].view ().row (v), many.depth[i].view ().row (v), 320 * 2), 0);
}

TEST (Filter, one_view_or_none_is_left_alone)
{
  Shots shots (ring_rig (2), bust ());
  CylinderFilter filter;
  CylinderResult result;
  ASSERT_TRUE (filter.set_rig (shots.rig).ok ());
  EXPECT_TRUE (filter.process ({}, {}, result).ok ());
  EXPECT_EQ (result.points_in, 0u);
  std::vector<RangeImage> images = shots.images ();
  images[0].roi = {};
  images[0].depth = {};
  images[0].colour = {};
  const std::size_t points = shots.points_of (1).size ();
  EXPECT_TRUE (filter.process (images, {}, result).ok ());
  EXPECT_EQ (result.points_in, points);
  EXPECT_EQ (result.points_out, points);
}

TEST (Filter, allocates_nothing_once_it_has_seen_the_largest_frame)
{
  const Surface two = both (ellipsoid ({-0.15, 0, 0}, {0.07, 0.2, 0.08}),
      ellipsoid ({0.15, 0, 0.05}, {0.07, 0.19, 0.08}));
  for (const Surface &surface : {bust (), two}) {
    Shots shots (ring_rig (4), surface, 0.001);
    Shots fresh = shots;
    CylinderFilter filter;
    CylinderResult result;
    ASSERT_TRUE (filter.set_rig (shots.rig).ok ());
    const std::vector<RangeImage> images = shots.images ();
    ASSERT_TRUE (filter.process (images, {}, result).ok ());
    for (int frame = 0; frame < 3; frame++) {
      for (std::size_t i = 0; i < images.size (); i++)
        for (int v = 0; v < images[i].depth.height; v++)
          std::memcpy (images[i].depth.row (v), fresh.depth[i].view ().row (v),
              2 * std::size_t (images[i].depth.width));
      const int before = allocations;
      const Status status = filter.process (images, {}, result);
      EXPECT_EQ (allocations, before);
      EXPECT_TRUE (status.ok ());
      EXPECT_LT (result.points_out, result.points_in);
    }
  }
}

TEST (Filter, takes_64_views_single_pixels_and_extreme_depths)
{
  Rig rig = ring_rig (64);
  CylinderFilter filter;
  CylinderResult result;
  ASSERT_TRUE (filter.set_rig (rig).ok ());
  std::mt19937 random (1);
  std::vector<Image<std::uint16_t>> depth;
  std::vector<RangeImage> images;
  for (int i = 0; i < 64; i++)
    depth.emplace_back (i % 5 == 0 ? 1 : 20, i % 5 == 0 ? 1 : 15);
  for (int i = 0; i < 64; i++) {
    auto view = depth[i].view ();
    for (int v = 0; v < view.height; v++)
      for (int u = 0; u < view.width; u++)
        view.at (u, v) = static_cast<std::uint16_t> (i % 3 == 0 ? 65535 : random ());
    images.push_back ({i, {300 - i, 7, view.width, view.height}, view, {}, 0});
  }
  CylinderSettings settings;
  settings.cells.columns = 3600;
  settings.cells.height_m = 0.0002;
  for (int frame = 0; frame < 3; frame++) {
    const Status status = filter.process (images, settings, result);
    ASSERT_TRUE (status.ok ()) << status.message ();
    EXPECT_TRUE (std::isfinite (norm (result.axis.position)));
    EXPECT_NEAR (norm (result.axis.direction), 1, 1e-9);
  }
  EXPECT_LE (result.points_out, result.points_in);
}

TEST (Filter, refuses_views_that_the_rig_has_not_and_settings_out_of_range)
{
  Shots shots (ring_rig (2), bust ());
  CylinderFilter filter;
  CylinderResult result;
  ASSERT_TRUE (filter.set_rig (shots.rig).ok ());
  std::vector<RangeImage> images = shots.images ();
  images[1].view_id = 7;
  const Status status = filter.process (images, {}, result);
  EXPECT_EQ (status.code (), StatusCode::kNotFound);
  EXPECT_NE (status.message ().find ("view 7"), std::string::npos);
  CylinderSettings settings;
  settings.cells.columns = 0;
  EXPECT_EQ (filter.process (shots.images (), settings, result).code (), StatusCode::kBadValue);
  settings = {};
  settings.axis = AxisMode::kFixed;
  settings.fixed_axis.direction = {0, 0, 0};
  EXPECT_EQ (filter.process (shots.images (), settings, result).code (), StatusCode::kBadValue);
}
