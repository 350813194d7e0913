/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "../base/status.hpp"
#include "../geometry/camera.hpp"
#include "../geometry/image_view.hpp"
#include "../geometry/rig.hpp"

namespace rangecast {

/** The surface that a depth camera sees, drawn as another camera sees it. Neighbouring pixels
 *  are joined where their depths differ by at most 3 %, so that the surface has no holes whatever
 *  the other camera's resolution; what stands alone covers as much as its pixel did. Nearer hides
 *  farther, by z-buffer. Memory is kept between frames. */
class DepthMesh {
public:
  /** @param camera  that took the depth; may have lens distortion */
  Status set (const View &camera);

  /** Takes a depth picture: the points that the camera saw.
   *  @param depth     of the camera's size; 0 = invalid
   *  @param metres    per unit of it
   *  @param near_m, far_m  other depths are invalid */
  void take (ImageView<const std::uint16_t> depth, double metres, double near_m, double far_m);

  /** @name The points, row by row; z = 0 where there is none @{ */
  [[nodiscard]] const cv::Vec3f *row (int y) const { return points_.ptr<cv::Vec3f> (y); }
  [[nodiscard]] int width () const { return points_.cols; }
  [[nodiscard]] int height () const { return points_.rows; }
  /** @} */

  /** @param lens        of the other camera, without distortion
   *  @param to_camera   other_from_depth
   *  @param[out] inverse_depth  CV_32F of the size that is wanted: 1/z, 1/m, 0 = nothing seen */
  void draw (const Intrinsics &lens, const Pose &to_camera, cv::Mat &inverse_depth);

private:
  void project (const Intrinsics &lens, const Pose &to_camera);

  double focal_ = 1;
  cv::Mat rays_, points_; /* CV_32FC2 at z = 1; CV_32FC3 */
  cv::Mat corners_;       /* CV_32FC3: x, y in pixels, 1/z */
};

} // namespace rangecast
