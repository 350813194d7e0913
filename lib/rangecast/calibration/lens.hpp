/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <vector>

#include "observations.hpp"

namespace rangecast {

/** Number of distortion coefficients, in OpenCV's order. */
enum class DistortionModel {
  kNone = 0,
  kFour = 4,  ///< k1 k2 p1 p2
  kFive = 5,  ///< k1 k2 p1 p2 k3
  kEight = 8, ///< k1 k2 p1 p2 k3 k4 k5 k6: rational model, for wide-angle lenses
};

/** fx fy cx cy, then k1 k2 p1 p2 k3 k4 k5 k6 (0 for those that the model lacks). */
using LensParameters = std::array<double, 12>;

/** Projection of OpenCV's pinhole camera with distortion, for double and Ceres' Jet.
 *  @param p  camera frame; in front of the camera
 *  @param[out] pixel  x, y */
template <typename T>
void
project (const T *lens, const T *p, T *pixel)
{
  const T x = p[0] / p[2], y = p[1] / p[2];
  const T r2 = x * x + y * y;
  const T *d = lens + 4;
  const T radial = (T (1) + r2 * (d[0] + r2 * (d[1] + r2 * d[4]))) /
                   (T (1) + r2 * (d[5] + r2 * (d[6] + r2 * d[7])));
  const T xd = x * radial + T (2) * d[2] * x * y + d[3] * (r2 + T (2) * x * x);
  const T yd = y * radial + d[2] * (r2 + T (2) * y * y) + T (2) * d[3] * x * y;
  pixel[0] = lens[0] * xd + lens[2];
  pixel[1] = lens[1] * yd + lens[3];
}

/** Minimum depth of a point in front of a camera, metres. */
inline constexpr double kNearestM = 1e-6;

/** RMS reprojection error of the corners, pixels; infinite if one of them is behind the camera. */
[[nodiscard]] double reprojection_rms (const LensParameters &lens, const Pose &camera_from_board,
    const BoardSpec &board, const std::vector<BoardCorner> &corners);

[[nodiscard]] Intrinsics intrinsics_of (const LensParameters &lens);
[[nodiscard]] Distortion distortion_of (const LensParameters &lens, DistortionModel model);

/** The calibration of one camera alone. */
struct LensCalibration {
  LensParameters lens{};
  double rms_px = 0;
  std::vector<int> frames; ///< frames used: indices into the list of frames
  std::vector<Pose> poses; ///< camera_from_board of each of them
};

/** cv::calibrateCamera on all sightings of the camera.
 *  @return kBadValue if OpenCV finds no solution */
Status calibrate_lens (const CalibrationCamera &camera, int index,
    const std::vector<CalibrationFrame> &frames, const BoardSpec &board, DistortionModel model,
    LensCalibration &result);

/** Checks the parameters for plausibility.
 *  @param reach_px  farthest corner seen from the principal point, pixels
 *  @param[out] warning  what is unusual but possible, or empty
 *  @return kBadValue that names the camera and the parameter */
Status check_lens (const CalibrationCamera &camera, const LensParameters &lens, double reach_px,
    std::string &warning);

} // namespace rangecast
