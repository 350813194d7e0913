/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "rigcheck.hpp"

#include <algorithm>
#include <cmath>
#include <rangecast/geometry/rectified_pose.hpp>
#include <string>

using rangecast::Rig;
using rangecast::Status;
using rangecast::StatusCode;
using rangecast::View;

namespace {

/* The same calibration read again, or rectified by another build, differs by rounding; a new
 * calibration by more. Position in metres, elements of the rotation matrix, relative focal length.
 */
constexpr double kMaxDistance_m = 1e-3, kMaxRotation = 2e-3, kMaxScale = 2e-3;
/* Rectification scales the focal length, by an amount that depends on the lenses, so that no pixel
 * stays empty. */
constexpr double kMaxRectifiedScale = 0.5;

double
max_difference (const rangecast::Mat3 &a, const rangecast::Mat3 &b)
{
  double max = 0;
  for (std::size_t i = 0; i < a.size (); i++)
    max = std::max (max, std::abs (a[i] - b[i]));
  return max;
}

Status
differs (const View &view, const std::string &what)
{
  return {StatusCode::kBadValue, "view " + std::to_string (view.id) + " is not that of the rig: " +
                                     what + "; give the camera host the same rig file"};
}

Status
check_view (const View &view, View expected)
{
  if (Status s = rangecast::scale_view (expected, view.width, view.height); !s.ok ())
    return differs (view, std::to_string (view.width) + "x" + std::to_string (view.height) +
                              " pixels; the rig has the shape of " +
                              std::to_string (expected.width) + "x" +
                              std::to_string (expected.height));
  double max_scale = kMaxScale;
  if (expected.right) {
    rangecast::Pose left_from_rectified;
    left_from_rectified.rotation =
        rangecast::transposed (rangecast::rectifying_rotation (expected.right->partner_from_left));
    expected.world_from_view = expected.world_from_view * left_from_rectified;
    if (!rangecast::is_rectified (expected))
      max_scale = kMaxRectifiedScale;
  }
  const rangecast::Pose &p = view.world_from_view, &q = expected.world_from_view;
  if (const double apart = rangecast::norm (p.translation - q.translation);
      !(apart <= kMaxDistance_m))
    return differs (view, "its position is " + std::to_string (apart) + " m off");
  if (!(max_difference (p.rotation, q.rotation) <= kMaxRotation))
    return differs (view, "its orientation differs");
  const double scale = view.intrinsics.fx / expected.intrinsics.fx;
  if (!(std::abs (scale - 1) <= max_scale))
    return differs (
        view, "its focal length is " + std::to_string (scale) + " times that of the rig");
  return {};
}

} // namespace

Status
check_rig (const Rig &stream, const Rig &expected)
{
  for (const View &view : stream.views) {
    const View *known = expected.find (view.id);
    if (!known)
      return {
          StatusCode::kBadValue, "view " + std::to_string (view.id) +
                                     " is not in the rig; give the camera host the same rig file"};
    if (Status s = check_view (view, *known); !s.ok ())
      return s;
  }
  return {};
}
