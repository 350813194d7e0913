/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "lens.hpp"

#include "opencv_types.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <opencv2/calib3d.hpp>

namespace rangecast {
namespace {

int
opencv_flags (DistortionModel model)
{
  switch (model) {
    case DistortionModel::kNone:
      return cv::CALIB_ZERO_TANGENT_DIST | cv::CALIB_FIX_K1 | cv::CALIB_FIX_K2 | cv::CALIB_FIX_K3;
    case DistortionModel::kFour:
      return cv::CALIB_FIX_K3;
    case DistortionModel::kFive:
      return 0;
    case DistortionModel::kEight:
      return cv::CALIB_RATIONAL_MODEL;
  }
  return 0;
}

/* Distance from the principal point at which radial distortion stops being monotonic, pixels; at
 * most `limit`. */
double
fold_px (const LensParameters &lens, double limit)
{
  const double f = std::min (lens[0], lens[1]);
  double before = 0;
  for (double r = 0.01; r < 20; r += 0.01) {
    const double point[3] = {r, 0, 1};
    LensParameters radial = lens;
    radial[6] = radial[7] = 0; /* p1, p2: small, and not radial */
    double pixel[2];
    project (radial.data (), point, pixel);
    const double out = (pixel[0] - lens[2]) / lens[0] * f;
    if (out <= before)
      return before;
    before = out;
    if (out > limit)
      break;
  }
  return limit;
}

std::string
number (double value)
{
  char text[32];
  std::snprintf (text, sizeof text, "%.4g", value);
  return text;
}

} // namespace

double
reprojection_rms (const LensParameters &lens, const Pose &camera_from_board, const BoardSpec &board,
    const std::vector<BoardCorner> &corners)
{
  double sum = 0;
  for (const BoardCorner &corner : corners) {
    const Vec3 p = camera_from_board * board.corner (corner.id);
    if (!(p.z > kNearestM))
      return std::numeric_limits<double>::infinity ();
    const double point[3] = {p.x, p.y, p.z};
    double pixel[2];
    project (lens.data (), point, pixel);
    sum += std::pow (pixel[0] - corner.x, 2) + std::pow (pixel[1] - corner.y, 2);
  }
  return corners.empty () ? 0 : std::sqrt (sum / double (corners.size ()));
}

Intrinsics
intrinsics_of (const LensParameters &lens)
{
  return {lens[0], lens[1], lens[2], lens[3]};
}

Distortion
distortion_of (const LensParameters &lens, DistortionModel model)
{
  return {lens.begin () + 4, lens.begin () + 4 + int (model)};
}

Status
calibrate_lens (const CalibrationCamera &camera, int index,
    const std::vector<CalibrationFrame> &frames, const BoardSpec &board, DistortionModel model,
    LensCalibration &result)
{
  std::vector<std::vector<cv::Point3f>> object;
  std::vector<std::vector<cv::Point2f>> image;
  result = {};
  for (std::size_t f = 0; f < frames.size (); f++) {
    const Sighting *sighting = frames[f].find (index);
    if (!sighting)
      continue;
    object.emplace_back ();
    image.emplace_back ();
    for (const BoardCorner &c : sighting->corners) {
      object.back ().push_back (opencv_point (board.corner (c.id)));
      image.back ().emplace_back (float (c.x), float (c.y));
    }
    result.frames.push_back (int (f));
  }
  cv::Mat k, d;
  std::vector<cv::Mat> rvecs, tvecs;
  try {
    result.rms_px = cv::calibrateCamera (object, image, {camera.width, camera.height}, k, d, rvecs,
        tvecs, opencv_flags (model), {cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 100, 1e-9});
  } catch (const std::exception &e) {
    return {StatusCode::kBadValue, text_of (camera) + ": cannot be calibrated from " +
                                       std::to_string (image.size ()) + " frames: " + e.what ()};
  }
  result.lens = {
      k.at<double> (0, 0), k.at<double> (1, 1), k.at<double> (0, 2), k.at<double> (1, 2)};
  for (int i = 0; i < int (model); i++)
    result.lens[4 + i] = d.at<double> (i);
  for (std::size_t i = 0; i < rvecs.size (); i++)
    result.poses.push_back (pose_from_opencv (rvecs[i], tvecs[i]));
  return {};
}

Status
check_lens (const CalibrationCamera &camera, const LensParameters &lens, double reach_px,
    std::string &warning)
{
  warning.clear ();
  const auto [fx, fy, cx, cy] = intrinsics_of (lens);
  if (!std::ranges::all_of (lens, [] (double v) { return std::isfinite (v); }) || fx <= 0 ||
      fy <= 0 || fx > 1e5 || fy > 1e5)
    return {StatusCode::kBadValue,
        text_of (camera) + ": no lens model fits these boards (focal length " + number (fx) +
            " pixels); show tilted boards all over the image"};
  if (cx < 0 || cy < 0 || cx >= camera.width || cy >= camera.height)
    return {StatusCode::kBadValue, text_of (camera) + ": principal point " + number (cx) + ", " +
                                       number (cy) +
                                       " is outside the image; show tilted boards all over it"};
  const double corner =
      std::hypot (std::max (cx, camera.width - 1 - cx), std::max (cy, camera.height - 1 - cy));
  const double fold = fold_px (lens, corner);
  if (fold < reach_px)
    return {StatusCode::kBadValue,
        text_of (camera) + ": lens distortion turns back " + number (fold) +
            " pixels from the image centre; show the board nearer to the image corners, or use "
            "fewer coefficients of distortion"};
  if (fold < corner)
    warning = text_of (camera) + ": lens distortion is undetermined beyond " + number (fold) +
              " pixels from the image centre; show the board nearer to the image corners";
  else if (std::abs (std::log (fx / fy)) > 0.05)
    warning = text_of (camera) + ": focal lengths " + number (fx) + " and " + number (fy) +
              " pixels differ; are the pixels square?";
  return {};
}

} // namespace rangecast
