/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Strips and the orbit camera. */
#include "../test-support.hpp"

#include <algorithm>
#include <cmath>
#include <random>
#include <rangecast/surface/orbit.hpp>
#include <rangecast/surface/strips.hpp>
#include <rangecast/surface/surface_scene.hpp>
#include <set>

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

/* The offset in pixels. */
constexpr float
strip_offset (StripPlace place)
{
  return 0.25f * (static_cast<float> (place) - 3);
}

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

TEST (Strips, equal_successive_pixels_become_one_longer_piece)
{
  StripSettings settings;
  StripResult result;
  const auto merged = vertices_of (Drawing ({"555555555555"}), settings, &result);
  EXPECT_EQ (merged.size (), 8u);
  EXPECT_EQ (result.points, 12u);
  EXPECT_EQ (merged[4].x, 11);
}

TEST (Strips, gap_is_bridged_only_if_short_and_its_ends_are_near)
{
  StripSettings settings;
  StripResult bridged, long_gap, step;
  vertices_of (Drawing ({"55..55"}), settings, &bridged);
  EXPECT_EQ (bridged.strips, 1u);
  vertices_of (Drawing ({"55...55"}), settings, &long_gap);
  EXPECT_EQ (long_gap.strips, 2u);
  vertices_of (Drawing ({"55..66"}), settings, &step);
  EXPECT_EQ (step.strips, 2u);
}

namespace {

/* Rows of random depths, some of them near one another in chains whose ends are not. */
std::vector<std::string>
random_rows (std::mt19937 &random, const char *depths)
{
  std::vector<std::string> rows (20, std::string (30, '.'));
  for (auto &row : rows)
    for (char &c : row)
      c = random () % 4 == 0 ? '.' : depths[random () % 8];
  return rows;
}

void
expect_valid_pixels_drawn (const std::vector<std::string> &rows, const std::vector<Vertex> &v)
{
  std::vector<bool> drawn (600);
  for (const Vertex &p : v) {
    ASSERT_LT (p.x, 30);
    ASSERT_LT (p.y, 20);
    drawn[30 * p.y + p.x] = true;
  }
  for (int i = 0; i < 600; i++)
    ASSERT_EQ (drawn[i], rows[i / 30][i % 30] != '.') << "pixel " << i % 30 << ", " << i / 30;
}

void
expect_triangles_within (
    double depth_step, const std::vector<std::string> &rows, const std::vector<Vertex> &v)
{
  for (std::size_t i = 2; i < v.size (); i++) {
    if (v[i - 2] == v[i - 1] || v[i - 1] == v[i] || v[i - 2] == v[i])
      continue;
    int least = 9, most = 0;
    for (std::size_t k = i - 2; k <= i; k++) {
      least = std::min (least, rows[v[k].y][v[k].x] - '0');
      most = std::max (most, rows[v[k].y][v[k].x] - '0');
    }
    ASSERT_LE (most - least, depth_step * least) << "at " << v[i].x << ", " << v[i].y;
  }
}

/* Whether a triangle has the point in its inside or on its edge, whichever way round it is. */
bool
covers (const Vertex (&t)[3], double x, double y)
{
  bool left = false, right = false;
  for (int i = 0; i < 3; i++) {
    const Vertex &a = t[i], &b = t[(i + 1) % 3];
    const double ax = a.x + strip_offset (a.horizontal), ay = a.y + strip_offset (a.vertical);
    const double bx = b.x + strip_offset (b.horizontal), by = b.y + strip_offset (b.vertical);
    const double side = (bx - ax) * (y - ay) - (by - ay) * (x - ax);
    left = left || side > 1e-9;
    right = right || side < -1e-9;
  }
  return !(left && right);
}

/* In the view's own picture, near the corners of every valid pixel, there is a triangle. */
void
expect_no_cracks (const std::vector<std::string> &rows, const std::vector<Vertex> &v)
{
  constexpr double kCorners[][2] = {{-0.35, -0.35}, {0.35, -0.35}, {-0.35, 0.35}, {0.35, 0.35}};
  std::vector<bool> covered (600 * 4);
  for (std::size_t i = 2; i < v.size (); i++) {
    const Vertex t[3] = {v[i - 2], v[i - 1], v[i]};
    if (t[0] == t[1] || t[1] == t[2] || t[0] == t[2])
      continue;
    const auto [x0, x1] = std::minmax ({t[0].x, t[1].x, t[2].x});
    const auto [y0, y1] = std::minmax ({t[0].y, t[1].y, t[2].y});
    for (int y = std::max (0, y0 - 1); y <= std::min (19, y1 + 1); y++)
      for (int x = std::max (0, x0 - 1); x <= std::min (29, x1 + 1); x++)
        for (int k = 0; k < 4; k++)
          if (covers (t, x + kCorners[k][0], y + kCorners[k][1]))
            covered[4 * (30 * y + x) + k] = true;
  }
  for (int i = 0; i < 2400; i++)
    ASSERT_TRUE (covered[i] || rows[i / 120][i / 4 % 30] == '.')
        << "corner " << i % 4 << " of pixel " << i / 4 % 30 << ", " << i / 120;
}

} // namespace

TEST (Strips, every_valid_pixel_is_drawn_and_no_triangle_spans_a_step)
{
  std::mt19937 random (1);
  for (const char *depths : {"55555577", "55566677", "56565677", "55667788"})
    for (int round = 0; round < 50; round++) {
      const auto rows = random_rows (random, depths);
      for (StripMode mode : {StripMode::kStrips, StripMode::kRectangles}) {
        StripSettings settings;
        settings.mode = mode;
        settings.depth_step = 0.21; /* 5 and 6 are near, 6 and 7 are, 5 and 7 are not */
        const auto v = vertices_of (Drawing (rows), settings);
        ASSERT_NO_FATAL_FAILURE (expect_triangles_within (settings.depth_step, rows, v));
        ASSERT_NO_FATAL_FAILURE (expect_no_cracks (rows, v));
      }
      StripSettings points;
      points.mode = StripMode::kPoints;
      ASSERT_NO_FATAL_FAILURE (
          expect_valid_pixels_drawn (rows, vertices_of (Drawing (rows), points)));
    }
}

/* Triangles are counter-clockwise, y pointing down: renderers leave out what they see from behind.
 */
TEST (Strips, all_triangles_face_the_camera)
{
  std::mt19937 random (2);
  for (int round = 0; round < 50; round++) {
    const auto rows = random_rows (random, round % 2 ? "55556677" : "55555559");
    for (StripMode mode : {StripMode::kStrips, StripMode::kRectangles}) {
      StripSettings settings;
      settings.mode = mode;
      settings.depth_step = 0.21;
      const auto v = vertices_of (Drawing (rows), settings);
      for (std::size_t i = 2; i < v.size (); i++) {
        const Vertex &a = v[i - 2], &b = v[i - 1 + i % 2], &c = v[i - i % 2];
        const auto x = [] (const Vertex &p) { return p.x + strip_offset (p.horizontal); };
        const auto y = [] (const Vertex &p) { return p.y + strip_offset (p.vertical); };
        const double area = (x (b) - x (a)) * (y (c) - y (a)) - (x (c) - x (a)) * (y (b) - y (a));
        ASSERT_LE (area, 1e-6) << "triangle " << i - 2 << " at " << a.x << ", " << a.y;
      }
    }
  }
}

namespace {

/* Rows of depths and greys as given. */
Drawing
shaded (const std::vector<std::vector<int>> &depth, const std::vector<std::vector<int>> &grey)
{
  Drawing drawing (std::vector<std::string> (depth.size (), std::string (depth[0].size (), '5')));
  for (int y = 0; y < drawing.height; y++)
    for (int x = 0; x < drawing.width; x++) {
      drawing.depth.view ().at (x, y) = static_cast<std::uint16_t> (depth[y][x]);
      const auto g = static_cast<std::uint8_t> (grey[y][x]);
      drawing.colour.view ().at (x, y) = {g, static_cast<std::uint8_t> (255 - g), 7, 0};
    }
  return drawing;
}

/* Columns of a row that vertices name: as the upper ones of its own band, or as the lower ones of
 * the band above. */
std::set<int>
columns_of (const std::vector<Vertex> &v, int row, bool upper)
{
  std::set<int> columns;
  for (std::size_t i = upper ? 0 : 1; i < v.size (); i += 2)
    if (v[i].y == row && v[i].horizontal == kCentre)
      columns.insert (v[i].x);
  return columns;
}

} // namespace

TEST (Strips, pixels_left_out_are_near_the_line_between_those_that_stay)
{
  std::mt19937 random (3);
  std::vector<int> depth, grey;
  for (int x = 0; x < 400; x++) {
    depth.push_back (7000 + int (300 * std::sin (x / 40.0)) + int (random () % 5));
    grey.push_back (128 + int (100 * std::sin (x / 25.0)) + int (random () % 3));
  }
  const auto columns = columns_of (vertices_of (shaded ({depth}, {grey}), {}), 0, true);
  EXPECT_LT (columns.size (), 300u);
  for (auto it = columns.begin (); std::next (it) != columns.end (); ++it) {
    const int a = *it, b = *std::next (it);
    EXPECT_LE (b - a, kMaxPieceLength);
    for (int x = a + 1; x < b; x++) {
      const double t = double (x - a) / (b - a);
      EXPECT_NEAR (depth[a] + t * (depth[b] - depth[a]), depth[x], kMergeDepth * depth[x] + 0.1);
      EXPECT_NEAR (grey[a] + t * (grey[b] - grey[a]), grey[x], kMergeColour + 0.1);
    }
  }
}

TEST (Strips, bands_above_and_below_a_row_leave_out_the_same_pixels)
{
  std::mt19937 random (4);
  std::vector<std::vector<int>> depth (5, std::vector<int> (100)), grey = depth;
  for (int y = 0; y < 5; y++)
    for (int x = 0; x < 100; x++) {
      depth[y][x] = 7000 + int (random () % 12);
      grey[y][x] = 100 + int (random () % 7);
    }
  const auto v = vertices_of (shaded (depth, grey), {});
  for (int row = 1; row < 4; row++) {
    EXPECT_EQ (columns_of (v, row, true), columns_of (v, row, false)) << "row " << row;
    EXPECT_LT (columns_of (v, row, true).size (), 100u);
  }
}

TEST (Orbit, turns_about_the_middle_between_two_cameras_that_face_each_other)
{
  Rig rig = ring_rig (2);
  SceneFrame scene = scene_frame (rig);
  EXPECT_NEAR (norm (scene.target), 0, 1e-9);
  EXPECT_NEAR (scene.distance_m, 0.8, 1e-9);
  rig.views[1].world_from_view.translation.x += 0.02; /* not quite on one axis */
  EXPECT_NEAR (norm (scene_frame (rig).target), 0, 0.02);
}

TEST (Orbit, view_that_leaves_does_not_turn_the_picture_and_another_rig_does)
{
  const Rig all = ring_rig (4);
  Rig rest = all, other = ring_rig (1);
  rest.views.erase (rest.views.begin ());
  other.views[0].world_from_view = {};
  SurfaceScene scene;
  scene.set_rig (all);
  const SceneFrame before = scene.frame ();
  for (const Rig *rig : {&std::as_const (rest), &all, &std::as_const (rest)}) {
    scene.set_rig (*rig);
    EXPECT_NEAR (norm (scene.frame ().to_first - before.to_first), 0, 1e-9);
    EXPECT_NEAR (norm (scene.frame ().target - before.target), 0, 1e-9);
    EXPECT_NEAR (scene.frame ().distance_m, before.distance_m, 1e-9);
  }
  scene.set_rig (other);
  EXPECT_EQ (norm (scene.frame ().target - scene_frame (other).target), 0);
  scene.set_rig (all);
  scene.reset ();
  scene.set_rig (rest);
  EXPECT_GT (norm (scene.frame ().to_first - before.to_first), 1);
}

TEST (Orbit, cameras_side_by_side_or_behind_each_other_have_no_middle)
{
  Rig rig = ring_rig (1);
  const double expected = scene_frame (rig).distance_m;
  for (const Vec3 shift : {Vec3{0.3, 0, 0}, {0, 0, 1.5}}) {
    rig = ring_rig (1);
    rig.views.push_back (rig.views[0]);
    rig.views[1].id = 1;
    rig.views[1].world_from_view.translation = rig.views[0].world_from_view.translation + shift;
    EXPECT_NEAR (scene_frame (rig).distance_m, expected, 1e-9);
  }
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

namespace {

/* Where a world point is in a picture of 320x240, pixels. */
Vec3
project (const OrbitMatrices &matrices, Vec3 p)
{
  const Mat4 &m = matrices.clip_from_world;
  const double w = m[3] * p.x + m[7] * p.y + m[11] * p.z + m[15];
  const double x = (m[0] * p.x + m[4] * p.y + m[8] * p.z + m[12]) / w;
  const double y = (m[1] * p.x + m[5] * p.y + m[9] * p.z + m[13]) / w;
  return {(x + 1) / 2 * 320 - 0.5, (y + 1) / 2 * 240 - 0.5, 0};
}

void
expect_default_picture_is_the_first_views_own (const Rig &rig)
{
  const View &view = rig.views[0];
  const OrbitMatrices m = orbit_matrices (scene_frame (rig), {}, 320.0 / 240, true);
  for (auto [u, v] : {std::pair{0.0, 0.0}, {319.0, 239.0}, {100.0, 50.0}}) {
    const Vec3 p = project (m, view.world_from_view * view.intrinsics.unproject (u, v, 0.7));
    EXPECT_NEAR (p.x, u, 2e-3);
    EXPECT_NEAR (p.y, v, 2e-3);
  }
}

} // namespace

TEST (Orbit, default_picture_is_the_first_views_own)
{
  expect_default_picture_is_the_first_views_own (ring_rig (4));
  expect_default_picture_is_the_first_views_own (ring_rig (1));
}

TEST (Orbit, one_rolled_camera_gives_its_own_picture)
{
  Rig rig = ring_rig (1);
  rig.views[0].world_from_view =
      rig.views[0].world_from_view * Pose{{0.8, -0.6, 0, 0.6, 0.8, 0, 0, 0, 1}, {}};
  expect_default_picture_is_the_first_views_own (rig);
}

TEST (Orbit, several_rolled_cameras_give_a_picture_with_the_world_upright)
{
  Rig rig = ring_rig (4);
  rig.views[0].world_from_view = /* mounted on its side */
      rig.views[0].world_from_view * Pose{{0, -1, 0, 1, 0, 0, 0, 0, 1}, {}};
  const OrbitMatrices m = orbit_matrices (scene_frame (rig), {}, 320.0 / 240, true);
  EXPECT_NEAR (project (m, {0, 0.1, 0}).x, project (m, {0, -0.1, 0}).x, 1e-3);
  EXPECT_LT (project (m, {0, 0.1, 0}).y, project (m, {0, -0.1, 0}).y);
}

TEST (Orbit, panning_by_a_pictures_size_moves_the_target_so_far)
{
  const SceneFrame scene = scene_frame (ring_rig (4));
  for (double azimuth : {0.0, 40.0, -110.0})
    for (double elevation : {0.0, 30.0})
      for (double fov : {0.0, 70.0}) {
        Orbit orbit;
        orbit.azimuth_deg = azimuth;
        orbit.elevation_deg = elevation;
        orbit.fov_deg = fov;
        const OrbitMatrices before = orbit_matrices (scene, orbit, 320.0 / 240, true);
        orbit.pan = -0.25 * before.pan_right + 0.125 * before.pan_down;
        const OrbitMatrices after = orbit_matrices (scene, orbit, 320.0 / 240, true);
        const Vec3 from = project (before, scene.target), to = project (after, scene.target);
        EXPECT_NEAR (to.x - from.x, 80, 1e-2);
        EXPECT_NEAR (to.y - from.y, -30, 1e-2);
      }
}
