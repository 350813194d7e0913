/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <opencv2/core.hpp>
#include <rangecast/base/status.hpp>
#include <string>

namespace bench {

/** Reads true disparities: NumPy's NPZ with an array of floats, or an image that OpenCV reads.
 *  @param scale       file values per pixel of disparity, > 0
 *  @param[out] truth  CV_32F, pixels; 0 = unknown, which the file may also mark as not finite
 *  @return kNotFound, kBadData; the message begins with the path */
rangecast::Status read_truth (const std::string &path, double scale, cv::Mat &truth);

} // namespace bench
