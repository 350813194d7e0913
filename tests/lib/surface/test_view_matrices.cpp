/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* From pixels of a view to the picture: matrices, what a frame set covers, reduced views, vertices
 * of mode blend. */
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <rangecast/surface/orbit.hpp>
#include <rangecast/surface/painting.hpp>
#include <rangecast/surface/reduced_view.hpp>
#include <rangecast/surface/scene_hull.hpp>
#include <rangecast/surface/strips.hpp>
#include <set>
#include <vector>

using namespace rangecast;

namespace {

/* One camera beside the origin that looks along z, turned by 30 degrees about y. */
View
camera ()
{
  View view;
  view.width = 64;
  view.height = 48;
  view.intrinsics = {80, 82, 31, 24};
  const double c = std::cos (M_PI / 6), s = std::sin (M_PI / 6);
  view.world_from_view = {{c, 0, s, 0, 1, 0, -s, 0, c}, {0.2, 0.1, -0.3}};
  view.near_m = 0.5;
  view.far_m = 1.5;
  return view;
}

/* A viewer elsewhere. */
OrbitMatrices
picture_of (const View &view, std::span<const Vec3> hull = {})
{
  Orbit orbit;
  orbit.azimuth_deg = 25;
  orbit.elevation_deg = 10;
  return orbit_matrices (scene_frame ({{view}}), orbit, 4.0 / 3, true, {}, hull);
}

struct Clip {
  double x, y, z, w;
};

Clip
clip (const Mat4 &m, double x, double y, double z, double w)
{
  const auto row = [&] (std::size_t i) {
    return m[i] * x + m[4 + i] * y + m[8 + i] * z + m[12 + i] * w;
  };
  return {row (0), row (1), row (2), row (3)};
}

/* A slanted plane with a hole, 20x10 pixels of the camera's image. */
class Patch {
public:
  Patch () : depth_ (200), colour_ (200)
  {
    for (std::size_t i = 0; i < depth_.size (); i++) {
      depth_[i] = i % 20 == 7 ? 0 : static_cast<std::uint16_t> (9000 + 20 * (i % 20));
      colour_[i] = {static_cast<std::uint8_t> (i), 2, 3, 0};
    }
  }
  [[nodiscard]] ConstRangeImage image () const
  {
    return {0, {30, 20, 20, 10}, {depth_.data (), 20, 10, 40}, {colour_.data (), 20, 10, 80}, 0};
  }

private:
  std::vector<std::uint16_t> depth_;
  std::vector<Rgbx> colour_;
};

} // namespace

TEST (ViewMatrices, pixel_goes_where_its_point_goes)
{
  const View view = camera ();
  const Mat4 world = picture_of (view).clip_from_world;
  const Roi roi{10, 20, 30, 20};
  const Vec3 p = view.world_from_view * view.intrinsics.unproject (10 + 5, 20 + 7, 9000 * 1e-4);
  const Clip expected = clip (world, p.x, p.y, p.z, 1);
  const Clip found = clip (clip_from_pixel (world, view, roi), 5 * 9000., 7 * 9000., 9000, 1);
  EXPECT_NEAR (found.x, expected.x, 1e-4);
  EXPECT_NEAR (found.y, expected.y, 1e-4);
  EXPECT_NEAR (found.z, expected.z, 1e-4);
  EXPECT_NEAR (found.w, expected.w, 1e-4);
}

TEST (ViewMatrices, shifted_depth_is_that_of_a_point_so_much_farther)
{
  const View view = camera ();
  const Mat4 m = picture_of (view).clip_from_world;
  const Vec3 eye = viewer_position (m), forward{m[3], m[7], m[11]};
  const Vec3 near = eye + (0.8 / norm (forward)) * forward,
             far = near + (0.05 / norm (forward)) * forward;
  const auto shift = depth_shift (m, m, 0.05);
  const double w = clip (m, near.x, near.y, near.z, 1).w;
  const Clip expected = clip (m, far.x, far.y, far.z, 1);
  EXPECT_NEAR (shift.a + shift.b / (w + shift.g), expected.z / expected.w, 1e-5);
}

TEST (ViewMatrices, cotangent_is_that_of_the_angle_at_which_both_rays_meet)
{
  const View viewer = camera ();
  Mat4 m = picture_of (viewer).clip_from_world;
  const Vec3 eye = viewer_position (m), forward{m[3], m[7], m[11]}, up{m[1], m[5], m[9]};
  const Vec3 side = cross (forward, up), aside = (1 / norm (side)) * side,
             along = (1 / norm (forward)) * forward;
  View view = viewer;
  view.world_from_view.translation = eye + 0.2 * aside + 0.1 * along;
  for (float &value : m) /* as an application's matrix may be */
    value *= 2;
  const auto cotangent = view_cotangent (m, view, 0, 1, 1);
  for (const double distance : {0.1, 0.5, 1.0}) {
    const Vec3 p = eye + distance * along;
    const double w = clip (m, p.x, p.y, p.z, 1).w;
    EXPECT_NEAR (cotangent.per_w * w - cotangent.offset, (distance - 0.1) / 0.2, 1e-4);
  }
}

TEST (CoveredPart, holds_every_point_and_little_more)
{
  const View view = camera ();
  const Patch patch;
  std::vector<Vec3> hull;
  append_hull (patch.image (), view, hull);
  const Mat4 m = picture_of (view, hull).clip_from_world;
  const Roi whole{0, 0, 400, 300}, covered = covered_part (m, hull, 400, 300, whole);
  double left = 400, right = 0, first = 300, last = 0;
  for (int y = 0; y < 10; y++)
    for (int x = 0; x < 20; x++) {
      const std::uint16_t depth = patch.image ().depth.at (x, y);
      if (depth == kInvalidDepth)
        continue;
      const Clip c =
          clip (clip_from_pixel (m, view, patch.image ().roi), x * depth, y * depth, depth, 1);
      left = std::min (left, (c.x / c.w + 1) * 200),
      right = std::max (right, (c.x / c.w + 1) * 200);
      first = std::min (first, (c.y / c.w + 1) * 150),
      last = std::max (last, (c.y / c.w + 1) * 150);
    }
  EXPECT_LE (covered.x, left - 2);
  EXPECT_GE (covered.x + covered.width, right + 2);
  EXPECT_LE (covered.y, first - 2);
  EXPECT_GE (covered.y + covered.height, last + 2);
  EXPECT_LT (covered.width, (right - left) * 1.3 + 20);
  EXPECT_LT (covered.height, (last - first) * 1.3 + 20);
  const Roi part{covered.x + 5, 0, 100, 300};
  EXPECT_EQ (covered_part (m, hull, 400, 300, part).x, part.x);
  EXPECT_TRUE (covered_part (m, {}, 400, 300, whole).empty ());
  hull.push_back (viewer_position (m) + Vec3{-m[3], -m[7], -m[11]});
  EXPECT_EQ (covered_part (m, hull, 400, 300, part), part) << "some of it is behind the camera";
}

TEST (BlendAtlas, cells_lie_beside_each_other_and_views_of_the_viewers_direction_have_their_own)
{
  const Roi covered{30, 20, 100, 80};
  for (const int max_side : {100, 250, 2048})
    for (const std::size_t views : {std::size_t{1}, std::size_t{3}, std::size_t{12}}) {
      std::vector<double> alignments;
      for (std::size_t i = 0; i < views; i++)
        alignments.push_back (0.1 * double (i)); /* the last one looks most as the viewer does */
      BlendAtlas atlas;
      make_blend_atlas (alignments, kMaxBlendCells, covered, max_side, atlas);
      ASSERT_GE (atlas.cells, 1u);
      ASSERT_LE (atlas.cells, std::min (views, kMaxBlendCells));
      EXPECT_LE (std::max (atlas.width, atlas.height), std::max (max_side, covered.width));
      std::set<std::pair<int, int>> places;
      for (std::size_t i = 0; i < atlas.cells; i++) {
        const auto [right, down] = atlas.from_picture[i];
        const int x = covered.x + right, y = covered.y + down;
        EXPECT_TRUE (x >= 0 && y >= 0 && x % covered.width == 0 && y % covered.height == 0);
        EXPECT_TRUE (x + covered.width <= atlas.width && y + covered.height <= atlas.height);
        places.insert ({x, y});
      }
      EXPECT_EQ (places.size (), atlas.cells);
      ASSERT_EQ (atlas.cell_of.size (), views);
      for (std::size_t i = 0; i < views; i++)
        EXPECT_EQ (atlas.cell_of[i], std::min (views - 1 - i, atlas.cells - 1));
    }
}

TEST (ReducedView, every_second_pixel_stays_where_it_was)
{
  const View view = camera ();
  const Patch patch;
  ReducedView memory;
  const SurfaceView reduced = memory.reduce ({patch.image (), &view});
  ASSERT_EQ (reduced.image.roi, (Roi{0, 0, 10, 5}));
  EXPECT_EQ (memory.points (), 190u);
  for (int y = 0; y < 5; y++)
    for (int x = 0; x < 10; x++) {
      const std::uint16_t depth = reduced.image.depth.at (x, y);
      ASSERT_EQ (depth, patch.image ().depth.at (2 * x, 2 * y));
      ASSERT_EQ (reduced.image.colour.at (x, y).r, patch.image ().colour.at (2 * x, 2 * y).r);
      const Vec3 a = reduced.view->intrinsics.unproject (x, y, depth),
                 b = view.intrinsics.unproject (30 + 2 * x, 20 + 2 * y, depth);
      ASSERT_NEAR (norm (a - b), 0, 1e-9);
    }
}

TEST (SurfaceVertices, carry_their_pixel_and_reach_no_farther_than_asked)
{
  const View view = camera ();
  const Patch patch;
  const ConstRangeImage image = patch.image ();
  BlendPlanes planes;
  const SurfaceView surface{image, &view};
  make_blend_planes ({&surface, 1}, 0, 0.03, planes);
  std::vector<StripVertex> strips;
  StripResult result;
  build_strips (image, {}, strips, result, &planes);
  for (const int reach : {0, 1, 2}) {
    std::vector<SurfaceVertex> vertices;
    make_vertices (image, &planes, strips, reach, vertices);
    ASSERT_EQ (vertices.size (), strips.size ());
    int farthest = 0;
    for (std::size_t i = 0; i < strips.size (); i++) {
      const int x = static_cast<int> (strips[i] & 8191),
                y = static_cast<int> (strips[i] >> 13 & 8191);
      farthest =
          std::max ({farthest, std::abs (vertices[i].x - 4 * x), std::abs (vertices[i].y - 4 * y)});
      ASSERT_EQ (vertices[i].depth, image.depth.at (x, y));
      ASSERT_EQ (vertices[i].colour.r, image.colour.at (x, y).r);
    }
    EXPECT_EQ (farthest, reach);
  }
}
