/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <opencv2/core.hpp>

#include "../base/status.hpp"
#include "../geometry/camera.hpp"
#include "../geometry/image_view.hpp"
#include "../geometry/rig.hpp"

namespace rangecast {

/** The surface that a depth camera sees, rendered from the view of another camera. Neighbouring
 * pixels are connected if their depths differ by at most 3 %, so that the surface has no holes at
 * any resolution; an isolated pixel covers its own area. Hidden surfaces are removed by z-buffer.
 * Reuses its memory between images. */
class DepthMesh {
public:
  /** @param camera  the depth camera; may have lens distortion */
  Status set (const View &camera);

  /** Computes the points of a depth image.
   *  @param depth     of the camera's size; 0 = invalid
   *  @param metres    per unit of `depth`
   *  @param near_m, far_m  other depths are invalid */
  void unproject (ImageView<const std::uint16_t> depth, double metres, double near_m, double far_m);

  /** @name The points by row; z = 0 for invalid ones @{ */
  [[nodiscard]] const cv::Vec3f *row (int y) const { return points_.ptr<cv::Vec3f> (y); }
  [[nodiscard]] int width () const { return points_.cols; }
  [[nodiscard]] int height () const { return points_.rows; }
  /** @} */

  /** @param lens        of the other camera, without distortion
   *  @param to_camera   other_from_depth
   *  @param[out] inverse_depth  CV_32F of the size to draw: 1/z in 1/m, 0 = nothing */
  void draw (const Intrinsics &lens, const Pose &to_camera, cv::Mat &inverse_depth);

private:
  void project (const Intrinsics &lens, const Pose &to_camera);

  double focal_ = 1;
  cv::Mat rays_, points_; /* CV_32FC2 at z = 1; CV_32FC3 */
  cv::Mat corners_;       /* CV_32FC3: x, y in pixels, 1/z */
};

} // namespace rangecast
