/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "depth_mesh.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>

namespace rangecast {
namespace {

/* Maximum relative depth difference of neighbours on one surface. */
constexpr float kStep = 0.03f;
/* Maximum size of a triangle in the other image, pixels: a rig that magnifies more is wrong, and
 * each triangle would cost the time of a whole image. */
constexpr float kMaxTriangleSide = 64;
constexpr float kNearest = 0.01f; /* metres from the other camera */

using Corner = cv::Vec3f;

/* The pixels with centres between two positions, within an image. */
struct Span {
  int first, last;

  Span (float low, float high, int size)
      : first (std::max (0, static_cast<int> (std::ceil (low)))),
        last (std::min (size - 1, static_cast<int> (std::floor (high))))
  {
  }
};

bool
fits (float low, float high)
{
  return high - low <= kMaxTriangleSide && low > -1e6f && high < 1e6f;
}

/* Fills a front-facing triangle; 1/z is linear in the image. */
void
fill (const Corner &a, const Corner &b, const Corner &c, cv::Mat &picture)
{
  const float area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
  if (!(area > 1e-6f))
    return;
  const auto [x0, x1] = std::minmax ({a[0], b[0], c[0]});
  const auto [y0, y1] = std::minmax ({a[1], b[1], c[1]});
  if (!fits (x0, x1) || !fits (y0, y1))
    return;
  const Span columns (x0, x1, picture.cols), rows (y0, y1, picture.rows);
  constexpr float kEdge = -1e-4f; /* pixels on an edge belong to both triangles */
  for (int y = rows.first; y <= rows.last; y++) {
    auto out = picture.ptr<float> (y);
    for (int x = columns.first; x <= columns.last; x++) {
      const float px = float (x), py = float (y);
      const float u = ((c[0] - b[0]) * (py - b[1]) - (c[1] - b[1]) * (px - b[0])) / area;
      const float v = ((a[0] - c[0]) * (py - c[1]) - (a[1] - c[1]) * (px - c[0])) / area;
      const float w = 1 - u - v;
      if (u >= kEdge && v >= kEdge && w >= kEdge)
        out[x] = std::max (out[x], u * a[2] + v * b[2] + w * c[2]);
    }
  }
}

bool
joined (const Corner &a, const Corner &b)
{
  return a[2] > 0 && b[2] > 0 && std::abs (a[2] - b[2]) <= kStep * std::max (a[2], b[2]);
}

/* Draws the area of one pixel where nothing was drawn, or something well behind it. */
void
dot (const Corner &at, float radius, cv::Mat &picture)
{
  if (!(at[2] > 0) || !fits (at[0] - radius, at[0] + radius) ||
      !fits (at[1] - radius, at[1] + radius))
    return;
  const Span columns (at[0] - radius, at[0] + radius, picture.cols);
  const Span rows (at[1] - radius, at[1] + radius, picture.rows);
  for (int y = rows.first; y <= rows.last; y++)
    for (int x = columns.first; x <= columns.last; x++)
      if (float &out = picture.at<float> (y, x); out < at[2] * (1 - kStep))
        out = at[2];
}

} // namespace

Status
DepthMesh::set (const View &camera)
{
  focal_ = camera.intrinsics.fx;
  const Intrinsics &k = camera.intrinsics;
  const cv::Matx33d matrix (k.fx, 0, k.cx, 0, k.fy, k.cy, 0, 0, 1);
  try {
    cv::Mat pixels (camera.height, camera.width, CV_32FC2);
    for (int y = 0; y < camera.height; y++)
      for (int x = 0; x < camera.width; x++)
        pixels.at<cv::Vec2f> (y, x) = {float (x), float (y)};
    const cv::Mat list = pixels.reshape (2, camera.width * camera.height);
    cv::undistortPoints (list, rays_, matrix, camera.distortion);
    rays_ = rays_.reshape (2, camera.height);
    points_.create (camera.height, camera.width, CV_32FC3);
  } catch (const cv::Exception &) {
    return {StatusCode::kNoSpace, "view " + std::to_string (camera.id) + ": OpenCV failed"};
  }
  return {};
}

void
DepthMesh::unproject (
    ImageView<const std::uint16_t> depth, double metres, double near_m, double far_m)
{
  for (int y = 0; y < points_.rows; y++) {
    const std::uint16_t *in = depth.row (y);
    const auto ray = rays_.ptr<cv::Vec2f> (y);
    auto point = points_.ptr<cv::Vec3f> (y);
    for (int x = 0; x < points_.cols; x++) {
      const double z = in[x] * metres;
      const auto used = static_cast<float> (in[x] && z >= near_m && z <= far_m ? z : 0);
      point[x] = {ray[x][0] * used, ray[x][1] * used, used};
    }
  }
}

void
DepthMesh::project (const Intrinsics &lens, const Pose &to_camera)
{
  corners_.create (points_.size (), CV_32FC3);
  cv::Matx33f r;
  for (int i = 0; i < 9; i++)
    r.val[i] = static_cast<float> (to_camera.rotation[static_cast<std::size_t> (i)]);
  const Vec3 t = to_camera.translation;
  const Corner shift (float (t.x), float (t.y), float (t.z));
  for (int y = 0; y < points_.rows; y++) {
    const auto point = points_.ptr<cv::Vec3f> (y);
    auto corner = corners_.ptr<Corner> (y);
    for (int x = 0; x < points_.cols; x++) {
      const Corner p = point[x][2] > 0 ? Corner (r * point[x]) + shift : Corner ();
      const float inverse = p[2] > kNearest ? 1 / p[2] : 0;
      corner[x] = {float (lens.fx) * p[0] * inverse + float (lens.cx),
          float (lens.fy) * p[1] * inverse + float (lens.cy), inverse};
    }
  }
}

void
DepthMesh::draw (const Intrinsics &lens, const Pose &to_camera, cv::Mat &inverse_depth)
{
  project (lens, to_camera);
  inverse_depth.setTo (0);
  for (int y = 0; y + 1 < corners_.rows; y++) {
    const auto top = corners_.ptr<Corner> (y), low = corners_.ptr<Corner> (y + 1);
    for (int x = 0; x + 1 < corners_.cols; x++) {
      const Corner &a = top[x], &b = top[x + 1], &c = low[x + 1], &d = low[x];
      if (joined (a, c)) {
        if (joined (a, b) && joined (b, c))
          fill (a, b, c, inverse_depth);
        if (joined (a, d) && joined (d, c))
          fill (a, c, d, inverse_depth);
      } else if (joined (b, d)) {
        if (joined (a, b) && joined (a, d))
          fill (a, b, d, inverse_depth);
        if (joined (b, c) && joined (d, c))
          fill (b, c, d, inverse_depth);
      }
    }
  }
  for (int y = 0; y < corners_.rows; y++) {
    const auto corner = corners_.ptr<Corner> (y);
    const auto point = points_.ptr<cv::Vec3f> (y);
    for (int x = 0; x < corners_.cols; x++) /* half a pixel of the depth camera */
      dot (corner[x], float (0.5 * lens.fx / focal_) * point[x][2] * corner[x][2], inverse_depth);
  }
}

} // namespace rangecast
