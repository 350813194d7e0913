/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "orbit.hpp"

#include <algorithm>
#include <cmath>

namespace rangecast {
namespace {

constexpr double kDegree = M_PI / 180;

Vec3
normalised (Vec3 v)
{
  const double length = norm (v);
  return length > 0 ? 1 / length * v : Vec3{0, 0, 1};
}

Vec3
column (const Mat3 &m, int i)
{
  return {m[i], m[3 + i], m[6 + i]};
}

/* Solves a 3x3 system by Cramer's rule. */
bool
solve (const Mat3 &a, Vec3 b, Vec3 &x)
{
  const Vec3 c0 = column (a, 0), c1 = column (a, 1), c2 = column (a, 2);
  const double determinant = dot (c0, cross (c1, c2));
  if (std::abs (determinant) < 1e-6)
    return false;
  x = {dot (b, cross (c1, c2)) / determinant, dot (c0, cross (b, c2)) / determinant,
      dot (c0, cross (c1, b)) / determinant};
  return true;
}

/* The point with the least sum of squared distances to all optical axes; if there are many, because
 * cameras face each other, the one nearest to the middle of all cameras. */
bool
meeting_point (const Rig &rig, Vec3 &point)
{
  constexpr double kPull = 1e-4; /* towards that middle, beside the axes' pull */
  Mat3 a{};
  Vec3 b, middle;
  for (const View &view : rig.views)
    middle = middle + 1.0 / double (rig.views.size ()) * view.world_from_view.translation;
  for (const View &view : rig.views) {
    const Vec3 d = column (view.world_from_view.rotation, 2);
    const double axis[] = {d.x, d.y, d.z};
    Mat3 off = kIdentity3; /* takes the part of a vector that is off the axis */
    for (int i = 0; i < 3; i++)
      for (int j = 0; j < 3; j++)
        off[3 * i + j] -= axis[i] * axis[j];
    for (int i = 0; i < 9; i++)
      a[i] += off[i] / double (rig.views.size ());
    b = b + 1.0 / double (rig.views.size ()) * (off * view.world_from_view.translation);
  }
  if (rig.views.size () < 2 || solve (a, b, point))
    return rig.views.size () > 1;
  const auto forward = [] (const View &v) { return column (v.world_from_view.rotation, 2); };
  const bool face_each_other = std::ranges::any_of (rig.views,
      [&] (const View &view) { return dot (forward (view), forward (rig.views[0])) < 0; });
  if (!face_each_other)
    return false;
  for (std::size_t i = 0; i < 3; i++)
    a[4 * i] += kPull;
  return solve (a, b + kPull * middle, point);
}

/* Column-major product. */
Mat4
product (const std::array<double, 16> &a, const std::array<double, 16> &b)
{
  Mat4 c{};
  for (int i = 0; i < 4; i++)
    for (int j = 0; j < 4; j++) {
      double sum = 0;
      for (int k = 0; k < 4; k++)
        sum += a[4 * k + i] * b[4 * j + k];
      c[4 * j + i] = static_cast<float> (sum);
    }
  return c;
}

/* Position and axes of the camera, world. */
struct CameraPose {
  Vec3 position, right, up, back;

  [[nodiscard]] std::array<double, 16> eye_from_world () const
  {
    return {right.x, up.x, back.x, 0, right.y, up.y, back.y, 0, right.z, up.z, back.z, 0,
        -dot (right, position), -dot (up, position), -dot (back, position), 1};
  }
};

struct ClipDistances {
  double near_m, far_m;
};

/* Factor of the range for what is drawn beside its points, such as ends of bands. It costs one bit
 * of the depth buffer's 24. */
constexpr double kRoom = 2;
constexpr double kMaxFarToNear = 2000;

ClipDistances
clip_distances (
    std::span<const Vec3> hull, const CameraPose &camera, double distance_m, double room_m)
{
  double nearest = 1e30, farthest = 0;
  for (const Vec3 &p : hull) {
    const double depth = dot (camera.position - p, camera.back);
    nearest = std::min (nearest, depth);
    farthest = std::max (farthest, depth);
  }
  if (farthest <= 0) /* nothing is in front of the camera */
    return {distance_m / 50, distance_m * 20};
  const double far_m = kRoom * farthest + room_m;
  return {std::max (nearest / kRoom, far_m / kMaxFarToNear), far_m};
}

/* Orbit::pan's axes in the world. */
Vec3
world_from_pan (const SceneFrame &scene, Vec3 p)
{
  const Vec3 right = normalised (cross (scene.up, scene.to_first));
  return p.x * right + p.y * scene.up + p.z * scene.to_first;
}

/* The camera's axes in those of Orbit::pan. */
OrbitAxes
axes_in_pan (const SceneFrame &scene, const Orbit &orbit)
{
  const double azimuth = orbit.azimuth_deg * kDegree;
  const double elevation =
      std::clamp (scene.elevation_deg + orbit.elevation_deg, -89.0, 89.0) * kDegree;
  const double sa = std::sin (azimuth), ca = std::cos (azimuth);
  const double se = std::sin (elevation), ce = std::cos (elevation);
  return {{ca, 0, -sa}, {-se * sa, ce, -se * ca}, {ce * sa, se, ce * ca}};
}

} // namespace

SceneFrame
scene_frame (const Rig &rig)
{
  SceneFrame scene;
  if (rig.views.empty ())
    return scene;
  const View &first = *std::ranges::min_element (rig.views, {}, &View::id);
  const Mat3 &r = first.world_from_view.rotation;
  const Vec3 position = first.world_from_view.translation, forward = column (r, 2);
  scene.fov_deg = 2 * std::atan (first.height / (2 * first.intrinsics.fy)) / kDegree;
  scene.off_centre_x = (2 * first.intrinsics.cx + 1 - first.width) / first.height;
  scene.off_centre_y = (2 * first.intrinsics.cy + 1 - first.height) / first.height;
  const bool met = meeting_point (rig, scene.target) &&
                   dot (scene.target - position, forward) > first.near_m / 2;
  scene.up = met ? Vec3{0, 1, 0} : -1.0 * column (r, 1);
  scene.distance_m =
      met ? dot (scene.target - position, forward) : 2 / (1 / first.near_m + 1 / first.far_m);
  scene.target = position + scene.distance_m * forward;
  const Vec3 to_first = position - scene.target;
  const double height = dot (to_first, scene.up);
  scene.elevation_deg = std::asin (std::clamp (height / scene.distance_m, -1.0, 1.0)) / kDegree;
  const Vec3 level = to_first - height * scene.up;
  scene.to_first =
      norm (level) > 1e-3 * scene.distance_m ? normalised (level) : -1.0 * column (r, 1);
  return scene;
}

OrbitAxes
orbit_axes (const SceneFrame &scene, const Orbit &orbit)
{
  const OrbitAxes pan = axes_in_pan (scene, orbit);
  return {world_from_pan (scene, pan.right), world_from_pan (scene, pan.up),
      world_from_pan (scene, pan.back)};
}

OrbitMatrices
orbit_matrices (const SceneFrame &scene, const Orbit &orbit, double aspect, bool flip_y,
    const Eye &eye, std::span<const Vec3> hull, double room_m)
{
  const double distance = orbit.distance_m > 0 ? orbit.distance_m : scene.distance_m;
  const OrbitAxes axes = orbit_axes (scene, orbit), pan = axes_in_pan (scene, orbit);
  CameraPose camera{{}, axes.right, axes.up, axes.back};
  camera.position = scene.target + world_from_pan (scene, orbit.pan) + distance * camera.back +
                    eye.right_m * camera.right;

  const double fov = (orbit.fov_deg > 0 ? orbit.fov_deg : scene.fov_deg) * kDegree;
  const double half = std::tan (fov / 2); /* of the picture's height, at a distance of 1 */
  const auto [near, far] = clip_distances (hull, camera, distance, room_m);
  const double down = flip_y ? -1 : 1;
  /* eyes look in parallel; their pictures are shifted, not turned, so that no eye's is higher */
  const double converged = eye.convergence_m > 0 ? eye.convergence_m : distance;
  const double shift = scene.off_centre_x / aspect + eye.right_m / (half * aspect * converged);
  const std::array<double, 16> clip_from_eye = {1 / (half * aspect), 0, 0, 0, 0, down / half, 0, 0,
      -shift, down * scene.off_centre_y, (far + near) / (near - far), -1, 0, 0,
      2 * far * near / (near - far), 0};
  const double height = 2 * half * distance;
  return {product (clip_from_eye, camera.eye_from_world ()), distance, height * aspect * pan.right,
      -height * pan.up};
}

Mat4
in_part (const Mat4 &clip_from_world, const PicturePart &part)
{
  Mat4 m = clip_from_world;
  for (int column = 0; column < 4; column++) {
    const double w = m[4 * column + 3];
    m[4 * column] = static_cast<float> (part.width * m[4 * column] + part.x * w);
    m[4 * column + 1] = static_cast<float> (part.height * m[4 * column + 1] + part.y * w);
  }
  return m;
}

Roi
covered_part (
    const Mat4 &clip_from_world, std::span<const Vec3> hull, int width, int height, const Roi &part)
{
  constexpr int kMargin = 2;
  const Mat4 &m = clip_from_world;
  double left = 1, right = -1, first = 1, last = -1;
  for (const Vec3 &p : hull) {
    const auto clip = [&] (std::size_t i) {
      return m[i] * p.x + m[4 + i] * p.y + m[8 + i] * p.z + m[12 + i];
    };
    const double w = clip (3);
    if (!(w > 0))
      return part;
    const double x = std::clamp (clip (0) / w, -1.0, 1.0), y = std::clamp (clip (1) / w, -1.0, 1.0);
    left = std::min (left, x), right = std::max (right, x);
    first = std::min (first, y), last = std::max (last, y);
  }
  const auto pixels = [] (double from, double to, int size, int begin, int length) {
    const double from_pixel = std::floor ((from + 1) / 2 * size) - kMargin,
                 to_pixel = std::ceil ((to + 1) / 2 * size) + kMargin;
    const int at = std::max (static_cast<int> (from_pixel), begin);
    return std::pair (
        at, std::max (0, std::min (static_cast<int> (to_pixel), begin + length) - at));
  };
  const auto [x, columns] = pixels (left, right, width, part.x, part.width);
  const auto [y, rows] = pixels (first, last, height, part.y, part.height);
  return {x, y, columns, rows};
}

namespace {

constexpr double kZoomStep = 1.1;
constexpr double kTurnStep_deg = 5;
constexpr double kMaxElevation_deg = 89;
constexpr double kMaxDistance_m = 1000;

} // namespace

void
OrbitMotion::set_shown (
    const OrbitMatrices &matrices, const SceneFrame &scene, int width, int height)
{
  home_distance_m_ = scene.distance_m;
  home_elevation_deg_ = scene.elevation_deg;
  pan_right_ = matrices.pan_right;
  pan_down_ = matrices.pan_down;
  width_ = width;
  height_ = height;
}

/* Stays below the vertical, which is nearer where the first view itself looks down or up. */
void
OrbitMotion::turn (double azimuth_deg, double elevation_deg)
{
  orbit.azimuth_deg = std::fmod (orbit.azimuth_deg + azimuth_deg, 360.0);
  orbit.elevation_deg = std::clamp (orbit.elevation_deg + elevation_deg,
      std::max (-kMaxElevation_deg, -kMaxElevation_deg - home_elevation_deg_),
      std::min (kMaxElevation_deg, kMaxElevation_deg - home_elevation_deg_));
}

void
OrbitMotion::zoom (double factor)
{
  const double distance_m = orbit.distance_m > 0 ? orbit.distance_m : home_distance_m_;
  orbit.distance_m = std::clamp (distance_m * factor, 0.01, kMaxDistance_m);
}

void
OrbitMotion::orbit_by (double dx, double dy)
{
  turn (-180 * dx / width_, 90 * dy / height_);
}

void
OrbitMotion::pan_by (double dx, double dy)
{
  const Vec3 pan = orbit.pan - dx / width_ * pan_right_ - dy / height_ * pan_down_;
  const auto limited = [] (double metres) {
    return std::clamp (metres, -kMaxDistance_m, kMaxDistance_m);
  };
  orbit.pan = {limited (pan.x), limited (pan.y), limited (pan.z)};
}

void
OrbitMotion::pinch (double dx, double dy, double before, double after)
{
  pan_by (dx, dy);
  if (before > 1 && after > 1)
    zoom (before / after);
}

void
OrbitMotion::step (int right, int up)
{
  turn (kTurnStep_deg * right, kTurnStep_deg * up);
}

void
OrbitMotion::step_nearer (bool nearer)
{
  zoom (nearer ? 1 / kZoomStep : kZoomStep);
}

void
OrbitMotion::go_home ()
{
  orbit = {.fov_deg = orbit.fov_deg, .pan = {}};
  home_requests++;
}

namespace {

/* Row of the matrix that makes one clip coordinate. */
Vec3
row_of (const Mat4 &m, std::size_t i)
{
  return {m[i], m[4 + i], m[8 + i]};
}

} // namespace

Mat4
clip_from_pixel (const Mat4 &clip_from_world, const View &view, const Roi &roi)
{
  const Mat3 &r = view.world_from_view.rotation;
  const Vec3 &t = view.world_from_view.translation;
  const Intrinsics &lens = view.intrinsics;
  const double unit = view.depth_unit_m, x = unit / lens.fx, y = unit / lens.fy;
  const double cx = lens.cx - roi.x, cy = lens.cy - roi.y;
  Mat4 product;
  for (std::size_t i = 0; i < 4; i++) {
    const Vec3 row = row_of (clip_from_world, i);
    const double right = x * dot (row, {r[0], r[3], r[6]}),
                 down = y * dot (row, {r[1], r[4], r[7]});
    product[i] = static_cast<float> (right);
    product[4 + i] = static_cast<float> (down);
    product[8 + i] =
        static_cast<float> (unit * dot (row, {r[2], r[5], r[8]}) - cx * right - cy * down);
    product[12 + i] = static_cast<float> (dot (row, t) + clip_from_world[12 + i]);
  }
  return product;
}

/* The point that the matrix maps to x = y = w = 0. */
Vec3
viewer_position (const Mat4 &clip_from_world)
{
  const Mat4 &m = clip_from_world;
  const Vec3 x = row_of (m, 0), y = row_of (m, 1), w = row_of (m, 3);
  const double volume = dot (x, cross (y, w));
  const Vec3 sum = static_cast<double> (m[12]) * cross (y, w) +
                   static_cast<double> (m[13]) * cross (w, x) +
                   static_cast<double> (m[15]) * cross (x, y);
  return (-1 / volume) * sum;
}

double
view_alignment (const Mat4 &clip_from_world, const View &view)
{
  const Vec3 forward = row_of (clip_from_world, 3);
  const Mat3 &r = view.world_from_view.rotation;
  return dot (forward, {r[2], r[5], r[8]}) / norm (forward);
}

ViewCotangent
view_cotangent (const Mat4 &clip_from_world, const View &view, std::size_t cell, std::size_t cells,
    std::size_t layers)
{
  if (cell + 1 == cells && layers > cells)
    return {};
  /* Off the viewer's axis rays meet at an angle also if the camera is on it, nearer or farther. */
  constexpr double kMinAside_m = 1e-3, kOffAxis = 0.2;
  const Vec3 row = row_of (clip_from_world, 3);
  const double scale = norm (row);
  const Vec3 way = view.world_from_view.translation - viewer_position (clip_from_world);
  const double along = dot (way, row) / scale,
               aside = std::max (
                   {norm (way - (along / scale) * row), kMinAside_m, kOffAxis * std::abs (along)});
  return {static_cast<float> (1 / (scale * aside)), static_cast<float> (along / aside)};
}

bool
mirrors (const Mat4 &clip_from_world)
{
  const Mat4 &m = clip_from_world;
  return dot (cross (row_of (m, 0), row_of (m, 1)), row_of (m, 3)) > 0;
}

DepthShift
depth_shift (const Mat4 &clip_matrix, const Mat4 &clip_from_world, double gap_m)
{
  const Vec3 z = row_of (clip_matrix, 2), w = row_of (clip_matrix, 3);
  const double a = dot (z, w) / dot (w, w);
  const double g = std::max (gap_m * norm (row_of (clip_from_world, 3)), 1e-6);
  return {static_cast<float> (a), static_cast<float> (clip_matrix[14] - a * clip_matrix[15]),
      static_cast<float> (g)};
}

} // namespace rangecast
