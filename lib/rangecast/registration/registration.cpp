/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "registration.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "../geometry/point_cloud.hpp"
#include "../opencv/image.hpp"

namespace rangecast {
namespace {

/* A point is hidden if it is farther than the surface that the colour camera sees by more than this
 * fraction. */
constexpr float kHidden = 0.03f;

/* Applies lens distortion to normalized image coordinates; the model of cv::projectPoints without
 * tilt. */
cv::Vec2d
distort (double x, double y, const std::array<double, 14> &d)
{
  const double r2 = x * x + y * y, r4 = r2 * r2, r6 = r4 * r2;
  const double radial =
      (1 + d[0] * r2 + d[1] * r4 + d[4] * r6) / (1 + d[5] * r2 + d[6] * r4 + d[7] * r6);
  return {x * radial + 2 * d[2] * x * y + d[3] * (r2 + 2 * x * x) + d[8] * r2 + d[9] * r4,
      y * radial + d[2] * (r2 + 2 * y * y) + 2 * d[3] * x * y + d[10] * r2 + d[11] * r4};
}

View
pinhole_of (const View &camera)
{
  View view = camera;
  view.distortion.clear ();
  view.right.reset ();
  view.third.reset ();
  return view;
}

} // namespace

Status
Registration::set (const View &depth, const View &colour, RegisterInto into)
{
  for (const View *camera : {&depth, &colour})
    if (camera->distortion.size () == 14 &&
        (camera->distortion[12] != 0 || camera->distortion[13] != 0))
      return {StatusCode::kUnsupported, "view " + std::to_string (camera->id) +
                                            ": tilted sensors (coefficients 13 and 14) are not "
                                            "supported here"};
  depth_ = depth;
  colour_ = colour;
  into_ = into;
  bend_ = {};
  std::copy (colour.distortion.begin (), colour.distortion.end (), bend_.begin ());
  range_view_ = pinhole_of (into == RegisterInto::kDepth ? depth : colour);
  range_view_.depth_unit_m = depth.depth_unit_m;
  range_view_.near_m = depth.near_m;
  range_view_.far_m = depth.far_m;
  colour_from_depth_ = colour.world_from_view.inverse () * depth.world_from_view;
  if (Status s = mesh_.set (depth); !s.ok ())
    return s;
  if (Status s = range_mesh_.set (range_view_); !s.ok ())
    return s;
  const double share = std::min (1.0, depth.intrinsics.fx / colour.intrinsics.fx);
  const Intrinsics &k = colour.intrinsics;
  shadow_lens_ = k.scaled (share, share);
  try {
    hidden_.create (std::max (1, int (std::lround (colour.height * share))),
        std::max (1, int (std::lround (colour.width * share))), CV_32F);
    drawn_.create (range_view_.height, range_view_.width, CV_32F);
    const cv::Matx33d matrix (k.fx, 0, k.cx, 0, k.fy, k.cy, 0, 0, 1);
    outside_.release ();
    if (!colour.distortion.empty () && into == RegisterInto::kColour) {
      const cv::Size size (colour.width, colour.height);
      cv::initUndistortRectifyMap (
          matrix, colour.distortion, {}, matrix, size, CV_16SC2, maps_[0], maps_[1]);
      cv::inRange (
          maps_[0], cv::Scalar (0, 0), cv::Scalar (size.width - 1, size.height - 1), outside_);
      cv::bitwise_not (outside_, outside_);
    }
  } catch (const cv::Exception &) {
    return {StatusCode::kNoSpace, "registration: OpenCV failed"};
  }
  return {};
}

/* Converts the rendered depth to depth units. */
void
Registration::write_depth (const RangeImage &image) const
{
  const View &view = range_view_;
  const auto units = static_cast<float> (1 / view.depth_unit_m);
  for (int y = 0; y < drawn_.rows; y++) {
    const auto inverse = drawn_.ptr<float> (y);
    std::uint16_t *out = image.depth.row (y);
    for (int x = 0; x < drawn_.cols; x++) {
      const float z = inverse[x] > 0 ? 1 / inverse[x] : 0;
      const bool valid = z >= float (view.near_m) && z <= float (view.far_m);
      out[x] =
          valid ? static_cast<std::uint16_t> (std::min (z * units + 0.5f, 65535.f)) : kInvalidDepth;
    }
  }
}

bool
Registration::sample (ImageView<const Rgbx> colour, const cv::Vec3f &point, Rgbx &out) const
{
  const Vec3 p = colour_from_depth_ * Vec3{point[0], point[1], point[2]};
  if (!(p.z > 0))
    return false;
  const double nx = p.x / p.z, ny = p.y / p.z;
  const double hx = shadow_lens_.fx * nx + shadow_lens_.cx,
               hy = shadow_lens_.fy * ny + shadow_lens_.cy;
  if (!(hx > -0.5 && hy > -0.5 && hx < hidden_.cols - 0.5 && hy < hidden_.rows - 0.5))
    return false;
  const float seen = hidden_.at<float> (int (std::lround (hy)), int (std::lround (hx)));
  if (1 / p.z < double (seen) * (1 - kHidden))
    return false;
  cv::Vec2d at (nx, ny);
  if (!colour_.distortion.empty ())
    at = distort (nx, ny, bend_);
  const double u = colour_.intrinsics.fx * at[0] + colour_.intrinsics.cx;
  const double v = colour_.intrinsics.fy * at[1] + colour_.intrinsics.cy;
  if (!(u > -0.5 && v > -0.5 && u < colour.width - 0.5 && v < colour.height - 0.5))
    return false;
  const double x = std::clamp (u, 0.0, colour.width - 1.0),
               y = std::clamp (v, 0.0, colour.height - 1.0);
  const int x0 = int (x), y0 = int (y), x1 = std::min (x0 + 1, colour.width - 1),
            y1 = std::min (y0 + 1, colour.height - 1);
  const double fx = x - x0, fy = y - y0;
  const auto blend = [&] (auto channel) {
    const double top = channel (colour.at (x0, y0)) * (1 - fx) + channel (colour.at (x1, y0)) * fx;
    const double low = channel (colour.at (x0, y1)) * (1 - fx) + channel (colour.at (x1, y1)) * fx;
    return static_cast<std::uint8_t> (top * (1 - fy) + low * fy + 0.5);
  };
  out = {blend ([] (Rgbx c) { return c.r; }), blend ([] (Rgbx c) { return c.g; }),
      blend ([] (Rgbx c) { return c.b; }), 0};
  return true;
}

/* Undistorts colour; pixels outside of the distorted image become invalid. */
void
Registration::undistort_colour (ImageView<const Rgbx> colour, const RangeImage &image) const
{
  cv::Mat out = opencv_image (image.colour);
  if (outside_.empty ()) {
    opencv_image (colour).copyTo (out);
    return;
  }
  cv::remap (opencv_image (colour), out, maps_[0], maps_[1], cv::INTER_LINEAR);
  cv::Mat (image.depth.height, image.depth.width, CV_16U, image.depth.data,
      static_cast<std::size_t> (image.depth.stride))
      .setTo (kInvalidDepth, outside_);
}

void
Registration::look_up (ImageView<const Rgbx> colour, const RangeImage &image)
{
  const DepthMesh &mesh = depth_.distortion.empty () ? mesh_ : range_mesh_;
  for (int y = 0; y < image.depth.height; y++) {
    std::uint16_t *depth = image.depth.row (y);
    Rgbx *out = image.colour.row (y);
    for (int x = 0; x < image.depth.width; x++) {
      out[x] = {};
      if (depth[x] != kInvalidDepth && !sample (colour, mesh.row (y)[x], out[x]))
        depth[x] = kInvalidDepth;
    }
  }
}

Status
Registration::process (ImageView<const std::uint16_t> depth, double metres,
    ImageView<const Rgbx> colour, const RangeImage &image)
{
  const View &view = range_view_;
  if (depth.width != depth_.width || depth.height != depth_.height ||
      colour.width != colour_.width || colour.height != colour_.height ||
      image.depth.width != view.width || image.depth.height != view.height ||
      !image.depth.same_size (image.colour))
    return {StatusCode::kBadSize, "registration: an image does not have the size of its camera"};
  try {
    mesh_.unproject (depth, metres, depth_.near_m, depth_.far_m);
    if (into_ == RegisterInto::kColour) {
      mesh_.draw (view.intrinsics, colour_from_depth_, drawn_);
      write_depth (image);
      undistort_colour (colour, image);
      return {};
    }
    mesh_.draw (shadow_lens_, colour_from_depth_, hidden_);
    if (depth_.distortion.empty ()) {
      const Status status = rescale_depth (depth, metres / view.depth_unit_m,
          depth_units (view.near_m, view.depth_unit_m), depth_units (view.far_m, view.depth_unit_m),
          image.depth);
      if (!status.ok ())
        return status;
    } else {
      mesh_.draw (view.intrinsics, {}, drawn_);
      write_depth (image);
      range_mesh_.unproject (image.depth, view.depth_unit_m, 0, 1e9);
    }
    look_up (colour, image);
  } catch (const cv::Exception &) {
    return {StatusCode::kNoSpace, "registration: OpenCV failed"};
  }
  return {};
}

} // namespace rangecast
