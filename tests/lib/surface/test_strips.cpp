/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Strips and the orbit camera. */
#include "../test-support.hpp"

#include <cmath>
#include <random>
#include <rangecast/surface/camera_lines.hpp>
#include <rangecast/surface/orbit.hpp>
#include <rangecast/surface/strips.hpp>
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
  settings.merge = 0;
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
  settings.merge = 0;
  EXPECT_EQ (vertices_of (Drawing ({"55", "5."}), settings),
      (std::vector<Vertex>{{0, 0, kFarBefore, kBefore}, {0, 1, kFarBefore, kCentre},
          {0, 0, kCentre, kBefore}, {0, 1, kCentre, kCentre}, {1, 0, kCentre, kBefore},
          {1, 0, kCentre, kFarAfter}, {1, 0, kFarAfter, kBefore}, {1, 0, kFarAfter, kFarAfter},
          /* joined by degenerate triangles: the isolated pixel below */
          {1, 0, kFarAfter, kFarAfter}, {0, 1, kBefore, kBefore}, {0, 1, kBefore, kBefore},
          {0, 1, kBefore, kAfter}, {0, 1, kAfter, kBefore}, {0, 1, kAfter, kAfter}}));
}

TEST (Strips, equal_successive_pixels_become_one_longer_piece)
{
  StripSettings settings;
  settings.merge = 0;
  const auto all = vertices_of (Drawing ({"555555555555"}), settings);
  settings.merge = 1;
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

TEST (Strips, band_starts_where_the_one_above_ends)
{
  StripSettings settings;
  settings.merge = 0;
  const auto v = vertices_of (Drawing ({"555", "559"}), settings);
  int met = 0, open = 0;
  for (const Vertex &p : v)
    if (p.y == 1 && p.vertical != kFarAfter && p.x < 2)
      p.vertical == kCentre ? met++ : open++;
  EXPECT_GT (met, 0);
  EXPECT_EQ (open, 0);
}

TEST (Strips, farther_surface_goes_on_behind_a_nearer_one_below)
{
  StripSettings settings;
  settings.merge = 0;
  int behind = 0;
  for (const Vertex &p : vertices_of (Drawing ({"777", "555", "777"}), settings)) {
    behind += p.y == 0 && p.vertical == kFullAfter;
    EXPECT_TRUE (p.y != 1 || p.vertical == kCentre || p.vertical == kFarAfter);
    EXPECT_TRUE (p.y != 2 || p.vertical == kBefore || p.vertical == kFarAfter);
  }
  EXPECT_EQ (behind, 6); /* the joining piece repeats the last one */
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
      for (bool merge : {false, true})
        for (StripMode mode : {StripMode::kStrips, StripMode::kRectangles}) {
          StripSettings settings;
          settings.mode = mode;
          settings.merge = merge;
          settings.depth_step = 0.21; /* 5 and 6 are near, 6 and 7 are, 5 and 7 are not */
          const auto v = vertices_of (Drawing (rows), settings);
          ASSERT_NO_FATAL_FAILURE (expect_triangles_within (settings.depth_step, rows, v));
          ASSERT_NO_FATAL_FAILURE (expect_no_cracks (rows, v));
          if (!merge) {
            ASSERT_NO_FATAL_FAILURE (expect_valid_pixels_drawn (rows, v));
          }
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

TEST (Strips, gap_of_rows_is_bridged_only_if_short_and_its_ends_are_near)
{
  StripSettings settings;
  settings.max_gap = 1;
  settings.merge = 0;
  const auto lower_rows_of_the_first_band = [&] (const std::vector<std::string> &rows) {
    const auto v = vertices_of (Drawing (rows), settings);
    std::set<int> lower;
    for (std::size_t i = 0; i + 1 < v.size (); i += 2)
      if (v[i].y == 0 && v[i].vertical == kBefore)
        lower.insert (v[i + 1].y);
    return lower;
  };
  EXPECT_EQ (lower_rows_of_the_first_band ({"555", "...", "555"}), std::set<int>{2});
  EXPECT_EQ (lower_rows_of_the_first_band ({"555", "...", "...", "555"}), std::set<int>{0});
  EXPECT_EQ (lower_rows_of_the_first_band ({"555", "...", "777"}), std::set<int>{0});
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

/* What the neighbour code leaves of a slow ramp: runs of equal pixels. An edge is none. */
TEST (Strips, runs_of_copies_become_a_slope_and_edges_stay_sharp)
{
  std::vector<int> depth (60, 7000), grey;
  for (int x = 0; x < 60; x++)
    grey.push_back (x < 40 ? 50 + x / 5 * 5 : 200);
  const auto columns = columns_of (vertices_of (shaded ({depth}, {grey}), {}), 0, true);
  EXPECT_LE (columns.size (), 12u); /* the 8 runs of the ramp are not 16 columns */
  EXPECT_TRUE (columns.contains (39) && columns.contains (40));
}

TEST (Strips, empty_view_has_no_vertices)
{
  std::vector<StripVertex> packed = {1, 2, 3};
  StripResult result;
  build_strips ({}, {}, packed, result);
  EXPECT_TRUE (packed.empty ());
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

TEST (Orbit, default_picture_keeps_a_principal_point_off_centre)
{
  Rig rig = ring_rig (4);
  rig.views[0].intrinsics.cx += 21;
  rig.views[0].intrinsics.cy -= 13;
  expect_default_picture_is_the_first_views_own (rig);
}

TEST (Orbit, default_picture_looks_where_the_first_view_does)
{
  Rig rig = ring_rig (4); /* two axes miss the others */
  rig.views[0].world_from_view.translation.x += 0.05;
  rig.views[2].world_from_view.translation.y += 0.08;
  expect_default_picture_is_the_first_views_own (rig);
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

/* The first view of a ring stands at z = 0.8 and looks along -z. */
TEST (CameraLines, pyramid_and_frustum_reach_from_the_camera_to_near_and_far)
{
  View view = ring_rig (4).views[0];
  view.near_m = 0.5;
  view.far_m = 2;
  std::vector<LineVertex> lines;
  append_camera_lines (view, camera_colour (0), lines);
  ASSERT_EQ (lines.size () % 2, 0u);
  const Vec3 eye = view.world_from_view.translation;
  int at_eye = 0, at_near = 0, at_far = 0;
  for (const LineVertex &p : lines) {
    const Vec3 seen = view.world_from_view.inverse () * Vec3{p.x, p.y, p.z};
    at_eye += norm (Vec3{p.x, p.y, p.z} - eye) < 1e-6;
    at_near += std::abs (seen.z - 0.5) < 1e-6;
    at_far += std::abs (seen.z - 2) < 1e-6;
    if (std::abs (seen.z - 2) < 1e-6) { /* the outer edges of the corner pixels */
      EXPECT_NEAR (std::abs (seen.x / seen.z * view.intrinsics.fx), view.width / 2.0, 1e-3);
      EXPECT_NEAR (std::abs (seen.y / seen.z * view.intrinsics.fy), view.height / 2.0, 1e-3);
    }
  }
  EXPECT_EQ (at_eye, 4);
  EXPECT_EQ (at_far, 8 + 4);
  EXPECT_EQ (at_near, int (lines.size ()) - at_eye - at_far);
}

TEST (CameraLines, roof_is_on_the_pictures_upper_side)
{
  std::vector<LineVertex> lines;
  append_camera_lines (ring_rig (1).views[0], camera_colour (0), lines);
  const View view = ring_rig (1).views[0];
  double highest = -1e9, picture_top = -1e9;
  for (const LineVertex &p : lines) {
    const Vec3 seen = view.world_from_view.inverse () * Vec3{p.x, p.y, p.z};
    if (std::abs (seen.z - view.near_m) < 1e-6)
      (std::abs (seen.x) < 1e-3 ? highest : picture_top) =
          std::max (std::abs (seen.x) < 1e-3 ? highest : picture_top, double (p.y));
  }
  EXPECT_GT (highest, picture_top + 0.1 * (2 * picture_top));
}

TEST (CameraLines, neighbours_have_colours_that_differ)
{
  for (std::size_t i = 0; i < 16; i++)
    EXPECT_NE (camera_colour (i).name, camera_colour (i + 1).name);
}
