/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Boards before cameras that are known exactly: as pictures, or as the corners that would be seen.
 */
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/calib3d.hpp>
#include <random>
#include <rangecast/calibration/lens.hpp>

namespace rangecast::testing {

inline constexpr double kDegree = std::numbers::pi / 180;

/** A camera of which everything is known. */
struct TrueCamera {
  CalibrationCamera camera;
  LensParameters lens{};
  Pose world_from_camera;
};

inline Pose
rotation_about (Vec3 axis, double angle_rad)
{
  const double s = std::sin (angle_rad / 2) / norm (axis), w = std::cos (angle_rad / 2);
  const double x = axis.x * s, y = axis.y * s, z = axis.z * s;
  return {{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), 2 * (x * y + w * z),
              1 - 2 * (x * x + z * z), 2 * (y * z - w * x), 2 * (x * z - w * y),
              2 * (y * z + w * x), 1 - 2 * (x * x + y * y)},
      {}};
}

/** Degrees between two poses. */
inline double
angle_between (const Pose &a, const Pose &b)
{
  const Mat3 r = transposed (a.rotation) * b.rotation;
  const Vec3 axis{r[7] - r[5], r[2] - r[6], r[3] - r[1]};
  return std::atan2 (norm (axis), r[0] + r[4] + r[8] - 1) / kDegree;
}

/** Stands `distance_m` from the world's origin, `angle_deg` about y from +z, and looks at it. */
inline Pose
ring_pose (double angle_deg, double distance_m)
{
  const double a = angle_deg * kDegree, s = std::sin (a), c = std::cos (a);
  return {{c, 0, -s, 0, -1, 0, -s, 0, -c}, {s * distance_m, 0, c * distance_m}};
}

/** A board somewhere in the picture of a camera: its middle `distance_m` away, on a pixel of the
 *  inner `spread` of the picture, turned by up to `tilt_deg`. @return camera_from_board, origin in
 *  corner 0 */
inline Pose
random_board (const TrueCamera &t, const BoardSpec &board, double distance_m, double spread,
    double tilt_deg, std::mt19937 &random)
{
  std::uniform_real_distribution<double> unit (-1, 1);
  const double u = t.lens[2] + spread * unit (random) * t.camera.width / 2;
  const double v = t.lens[3] + spread * unit (random) * t.camera.height / 2;
  Pose middle = rotation_about (
      {unit (random), unit (random), 0.3 * unit (random)}, tilt_deg * kDegree * unit (random));
  middle.translation = intrinsics_of (t.lens).unproject (u, v, distance_m);
  const Vec3 far_corner = board.corner (board.corner_count () - 1);
  return middle * Pose{kIdentity3, -0.5 * far_corner};
}

/** The corners that a camera sees, with noise; none unless all are in the picture and the board's
 *  face is turned towards it. */
inline std::vector<BoardCorner>
project_board (const TrueCamera &t, const Pose &camera_from_board, const BoardSpec &board,
    double noise_px, std::mt19937 &random)
{
  std::normal_distribution<double> noise; /* times noise_px, which may be 0 */
  std::vector<BoardCorner> corners;
  const Vec3 normal = camera_from_board.rotation * Vec3{0, 0, 1};
  const Vec3 middle = camera_from_board * (0.5 * board.corner (board.corner_count () - 1));
  if (middle.z <= 0 || dot (normal, middle) < 0.4 * norm (middle))
    return {};
  for (int id = 0; id < board.corner_count (); id++) {
    const Vec3 p = camera_from_board * board.corner (id);
    const double point[3] = {p.x, p.y, p.z};
    double pixel[2];
    project (t.lens.data (), point, pixel);
    if (p.z <= 0 || pixel[0] < 10 || pixel[1] < 10 || pixel[0] > t.camera.width - 11 ||
        pixel[1] > t.camera.height - 11)
      return {};
    corners.push_back (
        {id, pixel[0] + noise_px * noise (random), pixel[1] + noise_px * noise (random)});
  }
  return corners;
}

/** Draws boards as a camera with a distorting lens sees them: every pixel is the mean of rays
 *  through it, traced back to the board. */
class BoardRenderer {
public:
  static constexpr int kRays = 4; ///< a side of a pixel
  static constexpr int kSquarePx = 64;

  BoardRenderer (const TrueCamera &t, const BoardSpec &board) : true_ (t), board_ (board)
  {
    if (!draw_board (board, kSquarePx, texture_).ok ())
      std::abort ();
    std::vector<cv::Point2d> pixels, rays;
    for (int y = 0; y <= t.camera.height; y++)
      for (int x = 0; x <= t.camera.width; x++)
        pixels.emplace_back (x - 0.5, y - 0.5);
    const auto &l = t.lens;
    const cv::Matx33d k (l[0], 0, l[2], 0, l[1], l[3], 0, 0, 1);
    cv::undistortPoints (pixels, rays, k, std::vector<double> (l.begin () + 4, l.end ()),
        cv::noArray (), cv::noArray (), {cv::TermCriteria::COUNT, 20, 0});
    for (const cv::Point2d &r : rays)
      rays_.emplace_back (float (r.x), float (r.y));
  }

  /** @param noise  standard deviation of the sensor's noise, grey levels */
  std::vector<std::uint8_t> render (
      const Pose &camera_from_board, double noise, std::mt19937 &random)
  {
    const int width = true_.camera.width, height = true_.camera.height;
    std::vector<std::uint8_t> picture (std::size_t (width) * height);
    std::normal_distribution<float> sensor; /* times noise, which may be 0 */
    const Ray rays (camera_from_board.inverse (), board_.square_m);
    for (int y = 0; y < height; y++)
      for (int x = 0; x < width; x++) {
        const cv::Point2f *upper = &rays_[std::size_t (y) * (width + 1) + x];
        const cv::Point2f *lower = upper + width + 1;
        const float wall = 90 + 40.F * float (y) / float (height);
        float grey = look (rays, 0.25F * (upper[0] + upper[1] + lower[0] + lower[1]), wall, 1);
        if (grey != wall) {
          grey = 0;
          for (int j = 0; j < kRays; j++)
            for (int i = 0; i < kRays; i++) {
              const float a = (i + 0.5F) / kRays, b = (j + 0.5F) / kRays;
              const cv::Point2f ray = (1 - b) * ((1 - a) * upper[0] + a * upper[1]) +
                                      b * ((1 - a) * lower[0] + a * lower[1]);
              grey += look (rays, ray, wall, 0) / (kRays * kRays);
            }
        }
        grey += float (noise) * sensor (random);
        picture[std::size_t (y) * width + x] = std::uint8_t (std::clamp (grey + 0.5F, 0.F, 255.F));
      }
    return picture;
  }

private:
  /* Where rays meet the board: a homography from rays to the texture's pixels. */
  struct Ray {
    Ray (const Pose &board_from_camera, double square_m)
    {
      const Mat3 &r = board_from_camera.rotation;
      const Vec3 &t = board_from_camera.translation;
      /* p = t + s d with s = -t.z / d.z; texture = (p / square + 2) * kSquarePx */
      for (int i = 0; i < 3; i++) {
        w[i] = float (r[6 + i]);
        u[i] = float (((t.x * r[6 + i] - t.z * r[i]) / square_m + 2 * r[6 + i]) * kSquarePx);
        v[i] = float (((t.y * r[6 + i] - t.z * r[3 + i]) / square_m + 2 * r[6 + i]) * kSquarePx);
      }
      sign = t.z < 0 ? 1.F : -1.F;
    }
    float u[3], v[3], w[3], sign;
  };

  /* Grey level where a ray ends: on the board 30 .. 220, beside it the wall. */
  [[nodiscard]] float look (const Ray &r, cv::Point2f d, float wall, int margin_squares) const
  {
    const float w = r.w[0] * d.x + r.w[1] * d.y + r.w[2];
    if (!(w * r.sign > 1e-6F))
      return wall;
    const float u = (r.u[0] * d.x + r.u[1] * d.y + r.u[2]) / w;
    const float v = (r.v[0] * d.x + r.v[1] * d.y + r.v[2]) / w;
    const int width = (board_.columns + 3) * kSquarePx, height = (board_.rows + 3) * kSquarePx;
    const auto margin = float (margin_squares * kSquarePx / 2);
    if (!(u >= -margin && v >= -margin && u < float (width) + margin &&
            v < float (height) + margin))
      return wall;
    if (margin_squares > 0)
      return -1; /* near enough to look more closely */
    return 30 + 190.F / 255 * float (texture_[std::size_t (v) * width + std::size_t (u)]);
  }

  TrueCamera true_;
  BoardSpec board_;
  std::vector<std::uint8_t> texture_;
  std::vector<cv::Point2f> rays_; // through the corners of pixels
};

} // namespace rangecast::testing
