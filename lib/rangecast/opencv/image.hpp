/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <opencv2/core/mat.hpp>

#include "../geometry/image_view.hpp"

namespace rangecast {

/** Wraps a colour image as CV_8UC4 without copying; write only if the image is writable. */
inline cv::Mat
opencv_image (ImageView<const Rgbx> image)
{
  return {image.height, image.width, CV_8UC4, const_cast<Rgbx *> (image.data),
      static_cast<std::size_t> (image.stride)};
}

} // namespace rangecast
