/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "pose_alignment.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

#include "../base/cholesky.hpp"
#include "../geometry/pixel_transfer.hpp"
#include "../geometry/world_points.hpp"
#include "contradicted_points.hpp"

namespace rangecast {

namespace {

constexpr int kSamples = 1500;      ///< grid pixels of each view in a frame
constexpr int kFirstSamples = 6000; ///< of the first frame,
constexpr int kFirstRounds = 6;     ///< which is compared this many times
constexpr double kKept = 0.85;      ///< weight of older frames in the next one
constexpr float kSeenThrough =
    10; ///< footprints: distance at which a point is in front of a surface
/* Maximum distance between what two views see of one surface, in footprints of a pixel. A footprint
 * grows with z as the error of stereo does with z^2 / (focal length * baseline). */
constexpr float kSurfaceFootprints = 6;
/* Two pixels of one surface differ by less in R, G and B, grey levels: beside an edge they mix
 * colours differently, so they may differ by much. */
constexpr float kMaxPixelDifference = 60;
constexpr float kMinWeight = 0.1f;        ///< SurfacePlane::weight of points that are compared
constexpr float kMinNormals = 0.7f;       ///< cosine between the normals of one surface
constexpr float kFar = 2 * kMaxImageSide; ///< pixels: no view sees as far aside
constexpr double kEnough = 100;           ///< points; more do not add weight to a pair
/* A pose is expected to be off by this, metres; the prior of no motion follows from it. */
constexpr double kExpected = 0.003;
/* Number of independent errors of a pair: they are alike over large parts of a surface. */
constexpr double kIndependent = 8;
constexpr double kMinError = 0.0003; ///< of depth, metres
constexpr double kRadius = 0.15;     ///< metres: distance of the surface from the centre of turns
constexpr double kMinPairWeight = 1; ///< of a pair that counts, points
constexpr double kFaded = 1e-6;      ///< points: less counts as 0
constexpr double kMinAgreement = 0.3, kFullAgreement = 0.6; ///< of pairs that count

/* Metres: rotations as the distance that they move the surface. */
std::array<double, 6>
as_array (const PoseCorrection &c)
{
  return {c.translation.x, c.translation.y, c.translation.z, kRadius * c.rotation.x,
      kRadius * c.rotation.y, kRadius * c.rotation.z};
}

Vec3
limited (Vec3 v, double max)
{
  const double length = norm (v);
  return length > max ? max / length * v : v;
}

/* Rodrigues' formula. */
Mat3
rotation_of (Vec3 r)
{
  const double angle = norm (r);
  if (angle < 1e-12)
    return kIdentity3;
  const Vec3 a = 1 / angle * r;
  const double s = std::sin (angle), c = std::cos (angle), t = 1 - c;
  return {c + t * a.x * a.x, t * a.x * a.y - s * a.z, t * a.x * a.z + s * a.y,
      t * a.x * a.y + s * a.z, c + t * a.y * a.y, t * a.y * a.z - s * a.x, t * a.x * a.z - s * a.y,
      t * a.y * a.z + s * a.x, c + t * a.z * a.z};
}

/* The rotation that a matrix nearly is (Gram and Schmidt's method, by rows). */
Mat3
orthonormal (const Mat3 &m)
{
  Vec3 a{m[0], m[1], m[2]}, b{m[3], m[4], m[5]};
  a = 1 / norm (a) * a;
  b = b - dot (a, b) * a;
  b = 1 / norm (b) * b;
  const Vec3 c = cross (a, b);
  return {a.x, a.y, a.z, b.x, b.y, b.z, c.x, c.y, c.z};
}

/* A camera with its corrected pose, to map points both ways. */
struct CameraLookup {
  PixelRays rays;
  PixelLookup lookup;
  float footprint; /* metres, of a pixel at depth 1 */

  explicit CameraLookup (const View &view)
      : rays (view), lookup (view),
        footprint (static_cast<float> (view.depth_unit_m / view.intrinsics.fx))
  {
  }

  /* The normal of a plane in the world, away from the camera, not of unit length. */
  void normal (const SurfacePlane &plane, float x, float y, float out[3]) const
  {
    const float h[] = {plane.across, plane.down, plane.constant (x, y)};
    for (int k = 0; k < 3; k++)
      out[k] = h[0] * lookup.rows[0][k] + h[1] * lookup.rows[1][k] + h[2] * lookup.rows[2][k];
  }
};

float
length_of (const float v[3])
{
  return std::sqrt (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

/* Whether a view sees background at a place and around it: no pixel has depth, but others of the
 * row have (a row of a lost slice has none). Then the point of the other view is wrong.
 * @param u, v  of the image's plane, which may be smaller than the image */
bool
is_background (const AlignedView &view, const View &camera, float u, float v, float z)
{
  /* Pixels: an angle that most holes of stereo are smaller than. */
  const int around = std::max (4, static_cast<int> (camera.intrinsics.fx / 50));
  const RangeImage &image = view.image;
  const float metres = z * static_cast<float> (camera.depth_unit_m);
  const int x = static_cast<int> (u + 0.5f) + image.roi.x,
            y = static_cast<int> (v + 0.5f) + image.roi.y;
  if (image.depth.empty () || x < around || y < around || x + around >= camera.width ||
      y + around >= camera.height || metres < static_cast<float> (camera.near_m) ||
      metres > static_cast<float> (camera.far_m))
    return false;
  const int own_row = y - image.roi.y;
  if (own_row < 0 || own_row >= view.planes->height () || !view.planes->is_used (own_row))
    return false;
  for (int b = -around; b <= around; b += around / 4)
    for (int a = -around; a <= around; a += around / 4) {
      const int column = x + a - image.roi.x, row = y + b - image.roi.y;
      if (column >= 0 && row >= 0 && column < image.depth.width && row < image.depth.height &&
          image.depth.at (column, row) != kInvalidDepth)
        return false;
    }
  return true;
}

bool
is_same_colour (const AlignedView &a, int ax, int ay, const AlignedView &b, int bx, int by)
{
  if (!a.gains || !b.gains || !a.image.colour.same_size (a.image.depth) ||
      !b.image.colour.same_size (b.image.depth))
    return true;
  const Rgbx p = a.image.colour.at (ax, ay), q = b.image.colour.at (bx, by);
  const std::array<float, 3> &f = *a.gains, &g = *b.gains;
  const float d[] = {f[0] * p.r - g[0] * q.r, f[1] * p.g - g[1] * q.g, f[2] * p.b - g[2] * q.b};
  return std::max ({std::abs (d[0]), std::abs (d[1]), std::abs (d[2])}) < kMaxPixelDifference;
}

} // namespace

double
PoseCorrection::size () const
{
  return norm (translation) + kRadius * norm (rotation);
}

void
PoseAlignment::set_rig (const Rig &rig)
{
  rig_ = now_ = rig;
  index_.fill (-1);
  for (std::size_t i = 0; i < rig.views.size (); i++)
    index_[static_cast<std::size_t> (rig.views[i].id)] = static_cast<int> (i);
  reset ();
}

void
PoseAlignment::reset ()
{
  corrections_.fill ({});
  for (std::size_t i = 0; i < rig_.views.size (); i++)
    now_.views[i].world_from_view = rig_.views[i].world_from_view;
  depth_error_ = 0;
  pairs_.clear ();
  started_ = false;
  frame_ = 0;
}

Pose
PoseAlignment::corrected (const Pose &world_from_view, const PoseCorrection &by) const
{
  const Mat3 turn = rotation_of (by.rotation);
  Pose pose = Pose{turn, centre_ + by.translation - turn * centre_} * world_from_view;
  pose.rotation = orthonormal (pose.rotation);
  return pose;
}

/* The middle of what the first frame's views see. */
void
PoseAlignment::find_centre (std::span<const AlignedView> views)
{
  Vec3 sum;
  double count = 0;
  for (const AlignedView &view : views) {
    const PixelRays rays (camera_of (view.image.view_id));
    for (int y = 0; y < view.planes->height (); y += 8)
      for (int x = 0; x < view.planes->width (); x += 8)
        if (const SurfacePlane &plane = view.planes->at (x, y); plane.weight > 0) {
          float p[3];
          rays.point (static_cast<float> (view.image.roi.x + x),
              static_cast<float> (view.image.roi.y + y), plane.depth, p);
          sum = sum + Vec3{p[0], p[1], p[2]};
          count++;
        }
  }
  if (count > 0)
    centre_ = 1 / count * sum;
  started_ = count > 0;
}

/* Points of one view in another one. */
struct PoseAlignment::Comparison {
  const AlignedView &from, &to;
  const View &camera; /* of `to` */
  const CameraLookup own, other;
  const PixelTransfer transfer;
  const Vec3 centre;
  Pair &pair;
  double sign;               /* of `from` in the difference of the pair's corrections, */
  std::array<double, 6> now; /* which is this */

  Comparison (PoseAlignment &owner, const AlignedView &a, const AlignedView &b)
      : from (a), to (b), camera (owner.camera_of (b.image.view_id)),
        own (owner.camera_of (a.image.view_id)), other (camera),
        transfer (own.rays, from.image.roi, other.lookup, to.image.roi), centre (owner.centre_),
        pair (owner.pairs_.get (a.image.view_id, b.image.view_id)),
        sign (a.image.view_id == pair.first ? 1 : -1),
        now (as_array (owner.correction (pair.first)))
  {
    const std::array<double, 6> second = as_array (owner.correction (pair.second));
    for (std::size_t k = 0; k < 6; k++)
      now[k] -= second[k];
  }

  /* Looks a pixel up in the other view and compares it with what is seen there. */
  void look_up (int x, int y)
  {
    const SurfacePlane &mine = from.planes->at (x, y);
    if (mine.weight < kMinWeight)
      return;
    float h[3];
    for (int k = 0; k < 3; k++)
      h[k] = transfer.origin[k] +
             mine.depth * (transfer.corner[k] + static_cast<float> (x) * transfer.right[k] +
                              static_cast<float> (y) * transfer.down[k]);
    pair.points++;
    if (!(h[2] > 0) || !(std::abs (h[0]) < kFar * h[2]) || !(std::abs (h[1]) < kFar * h[2]))
      return;
    const float column = h[0] / h[2], row = h[1] / h[2];
    if (is_background (to, camera, column, row, h[2]))
      pair.through++;
    else if (column >= 0 && row >= 0 && column <= static_cast<float> (to.planes->width () - 1) &&
             row <= static_cast<float> (to.planes->height () - 1))
      compare (x, y, h, static_cast<int> (column + 0.5f), static_cast<int> (row + 0.5f));
  }

  /* Compares a pixel with pixel u, v of the other view, where it is seen at h. */
  void compare (int x, int y, const float (&h)[3], int u, int v)
  {
    const SurfacePlane &mine = from.planes->at (x, y), &theirs = to.planes->at (u, v);
    if (theirs.weight < kMinWeight)
      return;
    const auto column = static_cast<float> (u), row = static_cast<float> (v);
    float n[3], m[3];
    other.normal (theirs, column + static_cast<float> (to.image.roi.x),
        row + static_cast<float> (to.image.roi.y), n);
    const float behind = theirs.across * h[0] + theirs.down * h[1] +
                         theirs.constant (column, row) * h[2] - theirs.depth * theirs.depth,
                size = length_of (n), distance = behind / size,
                footprint = std::max (mine.depth * own.footprint, theirs.depth * other.footprint),
                off = distance / (kSurfaceFootprints * footprint);
    if (distance < -kSeenThrough * footprint)
      pair.through++;
    if (std::abs (off) >= 1) /* behind: hidden, not a contradiction */
      return;
    const float full_x = static_cast<float> (from.image.roi.x + x),
                full_y = static_cast<float> (from.image.roi.y + y);
    own.normal (mine, full_x, full_y, m);
    if (n[0] * m[0] + n[1] * m[1] + n[2] * m[2] < kMinNormals * size * length_of (m))
      return;
    const bool same = is_same_colour (from, x, y, to, u, v);
    (same ? pair.same : pair.other_colour)++;
    float p[3];
    own.rays.point (full_x, full_y, mine.depth, p);
    const float biweight = 1 - off * off;
    add (double{sign / size} * Vec3{n[0], n[1], n[2]}, Vec3{p[0], p[1], p[2]}, distance,
        double{biweight} * biweight * std::sqrt (mine.weight * theirs.weight));
  }

  /* Adds an observation to the pair's normal equations. */
  void add (Vec3 normal, Vec3 point, double distance, double weight)
  {
    const Vec3 arm = 1 / kRadius * cross (point - centre, normal);
    const double j[] = {normal.x, normal.y, normal.z, arm.x, arm.y, arm.z};
    double error = distance; /* with no correction at all */
    for (std::size_t k = 0; k < 6; k++)
      error -= j[k] * now[k];
    pair.weight += weight;
    pair.square += weight * error * error;
    for (std::size_t k = 0, at = 0; k < 6; k++) {
      pair.right[k] -= weight * j[k] * error;
      for (std::size_t l = 0; l <= k; l++)
        pair.matrix[at++] += weight * j[k] * j[l];
    }
  }
};

void
PoseAlignment::compare_pair (const AlignedView &from, const AlignedView &to, int samples)
{
  Comparison comparison (*this, from, to);
  if (!may_share_surfaces (comparison.own.rays, comparison.other.rays))
    return;
  const int width = from.planes->width (), height = from.planes->height ();
  const double share = double (width) * height / samples;
  const int step = std::max (1, static_cast<int> (std::ceil (std::sqrt (share))));
  const auto steps = static_cast<std::uint32_t> (step);
  const int left = static_cast<int> (frame_ % steps),
            top = static_cast<int> (frame_ / steps % steps);
  for (int y = top; y < height; y += step)
    for (int x = left; x < width; x += step)
      comparison.look_up (x, y);
}

PairAgreement
PoseAlignment::agreement (int first, int second) const
{
  const Pair *pair = pairs_.find (first, second);
  if (!pair)
    return {};
  return {pair->points, pair->same + pair->through + pair->other_colour, pair->same};
}

/* Mean square of a pair's errors after correction, square metres. */
double
PoseAlignment::variance (const Pair &pair) const
{
  const std::array<double, 6> a = as_array (correction (pair.first)),
                              b = as_array (correction (pair.second));
  double sum = pair.square;
  for (std::size_t k = 0, at = 0; k < 6; k++) {
    const double by = a[k] - b[k];
    sum -= 2 * by * pair.right[k];
    for (std::size_t l = 0; l <= k; l++, at++)
      sum += (l < k ? 2 : 1) * by * (a[l] - b[l]) * pair.matrix[at];
  }
  return std::max (sum / pair.weight, kMinError * kMinError);
}

void
PoseAlignment::solve ()
{
  const std::uint64_t views = pairs_.views ();
  const std::size_t n = 6 * static_cast<std::size_t> (std::popcount (views));
  if (n == 0)
    return;
  matrix_.assign (n * n, 0);
  right_.assign (n, 0);
  for (std::size_t i = 0; i < n; i++)
    matrix_[i * n + i] = 1 / (kExpected * kExpected);
  double squares = 0, weights = 0;
  std::uint64_t linked = 0;
  for (const Pair &pair : pairs_) {
    const double agreed = agreement (pair.first, pair.second).share ();
    const double trust =
        std::clamp ((agreed - kMinAgreement) / (kFullAgreement - kMinAgreement), 0.0, 1.0);
    if (pair.weight < kMinPairWeight || trust <= 0)
      continue;
    linked |= std::uint64_t{1} << pair.first | std::uint64_t{1} << pair.second;
    const double square = variance (pair);
    squares += trust * pair.weight * square;
    weights += trust * pair.weight;
    const double scale =
        kIndependent * trust * std::min (1.0, pair.weight / kEnough) / (pair.weight * square);
    const std::size_t i = 6 * number_among (views, pair.first),
                      j = 6 * number_among (views, pair.second);
    for (std::size_t k = 0, at = 0; k < 6; k++) {
      right_[i + k] += scale * pair.right[k];
      right_[j + k] -= scale * pair.right[k];
      for (std::size_t l = 0; l <= k; l++, at++) {
        const double value = scale * pair.matrix[at];
        matrix_[(i + k) * n + i + l] += value;
        matrix_[(j + k) * n + j + l] += value;
        /* The lower triangle only. */
        const std::size_t low = std::min (i, j), high = std::max (i, j);
        matrix_[(high + k) * n + low + l] -= value;
        if (l < k)
          matrix_[(high + l) * n + low + k] -= value;
      }
    }
  }
  depth_error_ = weights > 0 ? std::sqrt (squares / weights) : 0;
  if (!solve_cholesky (matrix_, right_))
    return; /* never: the prior makes it definite */
  set_gauge (views, linked);
}

/* Moves all views that share a surface with another one together, so that the median of each
 * component is 0. The others have no correction. */
void
PoseAlignment::set_gauge (std::uint64_t views, std::uint64_t linked)
{
  for (std::size_t k = 0; k < 6; k++) {
    sorted_.clear ();
    for (std::uint64_t rest = linked; rest; rest &= rest - 1)
      sorted_.push_back (right_[6 * number_among (views, std::countr_zero (rest)) + k]);
    std::ranges::sort (sorted_);
    const std::size_t count = sorted_.size ();
    const double median = count > 0 ? (sorted_[(count - 1) / 2] + sorted_[count / 2]) / 2 : 0;
    for (std::uint64_t rest = linked; rest; rest &= rest - 1)
      right_[6 * number_among (views, std::countr_zero (rest)) + k] -= median;
  }
  for (std::uint64_t rest = views & ~linked; rest; rest &= rest - 1)
    corrections_[static_cast<std::size_t> (std::countr_zero (rest))] = {};
  for (std::uint64_t rest = linked; rest; rest &= rest - 1) {
    const int id = std::countr_zero (rest);
    const double *v = &right_[6 * number_among (views, id)];
    PoseCorrection &to = corrections_[static_cast<std::size_t> (id)];
    to.translation = limited ({v[0], v[1], v[2]}, kMaxTranslation);
    to.rotation = limited (1 / kRadius * Vec3{v[3], v[4], v[5]}, kMaxRotation);
  }
}

/* Reduces the weight of older frames. Sums never reach 0 by themselves, but lose their meaning. */
void
PoseAlignment::fade (Pair &pair, double kept)
{
  const double counts = pair.points * kept < kFaded ? 0 : kept,
               sums = pair.weight * kept < kFaded ? 0 : kept;
  for (double *value : {&pair.points, &pair.same, &pair.through, &pair.other_colour})
    *value *= counts;
  for (double *value : {&pair.weight, &pair.square})
    *value *= sums;
  for (double &value : pair.matrix)
    value *= sums;
  for (double &value : pair.right)
    value *= sums;
}

void
PoseAlignment::learn (std::span<const AlignedView> views)
{
  const bool first = !started_;
  if (first)
    find_centre (views);
  if (!started_)
    return;
  for (int round = 0; round < (first ? kFirstRounds : 1); round++) {
    frame_++;
    const double kept = first ? 0 : kKept;
    for (const AlignedView &a : views)
      for (const AlignedView &b : views)
        if (a.image.view_id < b.image.view_id)
          fade (pairs_.get (a.image.view_id, b.image.view_id), kept);
    for (std::size_t i = 0; i < rig_.views.size (); i++)
      now_.views[i].world_from_view =
          corrected (rig_.views[i].world_from_view, correction (rig_.views[i].id));
    for (const AlignedView &from : views)
      for (const AlignedView &to : views)
        if (from.image.view_id != to.image.view_id)
          compare_pair (from, to, first ? kFirstSamples : kSamples);
    solve ();
  }
}

} // namespace rangecast
