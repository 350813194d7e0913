/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <opencv2/core/mat.hpp>

#include "../geometry/image_view.hpp"

namespace rangecast {

/** The pixels of a colour image as a CV_8UC4 matrix that shares them: to be written only if
 *  they may be. */
inline cv::Mat
opencv_image (ImageView<const Rgbx> image)
{
  return {image.height, image.width, CV_8UC4, const_cast<Rgbx *> (image.data),
      static_cast<std::size_t> (image.stride)};
}

} // namespace rangecast
