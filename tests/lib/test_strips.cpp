/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Strips and the orbit camera. */
#include "test-support.hpp"

#include <random>
#include <rangecast/strips/orbit.hpp>
#include <rangecast/strips/strips.hpp>

using namespace rangecast;
using rangecast::testing::Image;
using rangecast::testing::ring_rig;

namespace {

/* A picture drawn by hand: digits are depths (times 1000), a dot is invalid. One colour. */
struct Drawing {
  Image<std::uint16_t> depth;
  Image<Rgbx> colour;
  int width, height;

  explicit Drawing (const std::vector<std::string> &rows)
      : depth (int (rows[0].size ()), int (rows.size ())),
        colour (int (rows[0].size ()), int (rows.size ())), width (int (rows[0].size ())),
        height (int (rows.size ()))
  {
    for (int y = 0; y < height; y++)
      for (int x = 0; x < width; x++)
        depth.view ().at (x, y) =
            rows[y][x] == '.' ? 0 : static_cast<std::uint16_t> (1000 * (rows[y][x] - '0'));
  }
  ConstRangeImage image () { return {0, {0, 0, width, height}, depth.view (), colour.view (), 0}; }
};

struct Vertex {
  int x, y;
  StripPlace horizontal, vertical;
  friend bool operator== (const Vertex &, const Vertex &) = default;
};

std::vector<Vertex>
vertices_of (Drawing drawing, const StripSettings &settings, StripResult *result = nullptr)
{
  std::vector<StripVertex> packed;
  StripResult own;
  build_strips (drawing.image (), settings, packed, result ? *result : own);
  std::vector<Vertex> vertices;
  for (StripVertex v : packed)
    vertices.push_back (
        {int (v & 8191), int (v >> 13 & 8191), StripPlace (v >> 26 & 7), StripPlace (v >> 29)});
  return vertices;
}

} // namespace

TEST (Strips, drawing_of_6_by_5_pixels_gives_these_strips)
{
  StripSettings settings;
  settings.max_gap = 1;
  settings.merge = false;
  StripResult result;
  /* A band with a gap that is bridged; a depth step; an isolated pixel; rows that join and do not.
   */
  vertices_of (Drawing ({"55.555", "555...", "333999", "......", "..7..."}), settings, &result);
  EXPECT_EQ (result.points, 15u);
  EXPECT_EQ (result.strips, 4u); /* row 0, row 1, and both halves of row 2 */
  EXPECT_EQ (result.isolated, 1u);
  /* bands of n pixels: n - 1 steps and two ends, two triangles each */
  EXPECT_EQ (result.triangles, 2u * (4 + 2) + 2 * (2 + 2) + 2 * (2 + 2) + 2 * (2 + 2) + 2);
}

TEST (Strips, band_has_its_pixels_in_order_and_reaches_beyond_its_ends)
{
  StripSettings settings;
  settings.merge = false;
  EXPECT_EQ (vertices_of (Drawing ({"55", "5."}), settings),
      (std::vector<Vertex>{{0, 0, kFarBefore, kCentre}, {0, 1, kFarBefore, kCentre},
          {0, 0, kCentre, kCentre}, {0, 1, kCentre, kCentre}, {1, 0, kCentre, kCentre},
          {1, 0, kCentre, kFarAfter}, {1, 0, kFarAfter, kCentre}, {1, 0, kFarAfter, kFarAfter},
          /* joined by degenerate triangles: the isolated pixel below */
          {1, 0, kFarAfter, kFarAfter}, {0, 1, kBefore, kBefore}, {0, 1, kBefore, kBefore},
          {0, 1, kBefore, kAfter}, {0, 1, kAfter, kBefore}, {0, 1, kAfter, kAfter}}));
}

TEST (Strips, equal_successive_pixels_become_one_longer_piece)
{
  StripSettings settings;
  settings.merge = false;
  const auto all = vertices_of (Drawing ({"555555555555"}), settings);
  settings.merge = true;
  StripResult result;
  const auto merged = vertices_of (Drawing ({"555555555555"}), settings, &result);
  EXPECT_EQ (all.size (), 28u);
  EXPECT_EQ (merged.size (), 8u);
  EXPECT_EQ (result.points, 12u);
  EXPECT_EQ (merged[4].x, 11);
}

TEST (Strips, gap_is_bridged_only_if_short_and_its_ends_are_near)
{
  StripSettings settings;
  settings.max_gap = 2;
  StripResult bridged, long_gap, step;
  vertices_of (Drawing ({"55..55"}), settings, &bridged);
  EXPECT_EQ (bridged.strips, 1u);
  vertices_of (Drawing ({"55...55"}), settings, &long_gap);
  EXPECT_EQ (long_gap.strips, 2u);
  vertices_of (Drawing ({"55..66"}), settings, &step);
  EXPECT_EQ (step.strips, 2u);
}

TEST (Strips, every_valid_pixel_is_drawn_and_no_triangle_spans_a_step)
{
  std::mt19937 random (1);
  for (int round = 0; round < 50; round++) {
    std::vector<std::string> rows (20, std::string (30, '.'));
    for (auto &row : rows)
      for (char &c : row)
        c = random () % 4 == 0 ? '.' : random () % 3 == 0 ? '7' : '5';
    Drawing drawing (rows);
    for (StripMode mode : {StripMode::kStrips, StripMode::kRectangles, StripMode::kPoints}) {
      StripSettings settings;
      settings.mode = mode;
      settings.merge = false;
      const auto v = vertices_of (drawing, settings);
      std::vector<bool> drawn (600);
      for (const Vertex &p : v) {
        ASSERT_TRUE (p.x < 30 && p.y < 20);
        ASSERT_NE (drawing.depth.view ().at (p.x, p.y), 0);
        drawn[30 * p.y + p.x] = true;
      }
      for (int i = 0; i < 600; i++)
        ASSERT_EQ (drawn[i], rows[i / 30][i % 30] != '.');
      for (std::size_t i = 2; mode != StripMode::kPoints && i < v.size (); i++) {
        const Vertex &a = v[i - 2], &b = v[i - 1], &c = v[i];
        if (a == b || b == c || a == c)
          continue;
        ASSERT_EQ (rows[a.y][a.x], rows[b.y][b.x]);
        ASSERT_EQ (rows[b.y][b.x], rows[c.y][c.x]);
      }
    }
  }
}

TEST (Strips, empty_view_has_no_vertices)
{
  std::vector<StripVertex> packed = {1, 2, 3};
  StripResult result;
  build_strips ({}, {}, packed, result);
  EXPECT_TRUE (packed.empty ());
}

TEST (Orbit, ring_looks_at_its_middle_from_the_first_view)
{
  const SceneFrame scene = scene_frame (ring_rig (4));
  EXPECT_NEAR (norm (scene.target), 0, 1e-9);
  EXPECT_NEAR (scene.distance_m, 0.8, 1e-9);
  EXPECT_NEAR (scene.to_first.z, 1, 1e-9);
  EXPECT_NEAR (scene.fov_deg, 2 * std::atan (120.0 / 320) * 180 / M_PI, 1e-9);
}

TEST (Orbit, one_camera_with_identity_pose_has_its_own_up)
{
  Rig rig = ring_rig (1);
  rig.views[0].world_from_view = {};
  const SceneFrame scene = scene_frame (rig);
  EXPECT_NEAR (scene.up.y, -1, 1e-9);
  EXPECT_NEAR (scene.to_first.z, -1, 1e-9);
  EXPECT_GT (scene.target.z, rig.views[0].near_m);
}

TEST (Orbit, default_picture_is_the_first_views_own)
{
  const Rig rig = ring_rig (4);
  const View &view = rig.views[0];
  const Mat4 m = orbit_matrices (scene_frame (rig), {}, 320.0 / 240, true).clip_from_world;
  for (auto [u, v] : {std::pair{0.0, 0.0}, {319.0, 239.0}, {100.0, 50.0}}) {
    const Vec3 p = view.world_from_view * view.intrinsics.unproject (u, v, 0.7);
    const double w = m[3] * p.x + m[7] * p.y + m[11] * p.z + m[15];
    const double x = (m[0] * p.x + m[4] * p.y + m[8] * p.z + m[12]) / w;
    const double y = (m[1] * p.x + m[5] * p.y + m[9] * p.z + m[13]) / w;
    EXPECT_NEAR ((x + 1) / 2 * 320 - 0.5, u, 1e-3);
    EXPECT_NEAR ((y + 1) / 2 * 240 - 0.5, v, 1e-3);
  }
}
