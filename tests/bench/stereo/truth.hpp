/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <rangecast/base/status.hpp>
#include <string>
#include <vector>

namespace bench {

/** Reads true disparities: PFM (what its header says of scale is about brightness and is ignored),
 *  a grey picture that OpenCV reads, or NumPy's NPZ, NPY (the first array). By the file's content.
 *  @param scale       file values per pixel of disparity, > 0
 *  @param[out] truth  CV_32F, pixels; 0 = unknown, which also is what the file has as not finite
 *  @return kNotFound, kBadData, kTruncated, kUnsupported; the message begins with the path */
rangecast::Status read_truth (const std::string &path, double scale, cv::Mat &truth);

/** @name Formats, without the path in the message @{ */
rangecast::Status decode_pfm (const std::vector<std::uint8_t> &bytes, cv::Mat &values);
/** A zip archive with arrays, stored or deflated: the first one. */
rangecast::Status decode_npz (const std::vector<std::uint8_t> &bytes, cv::Mat &values);
/** Numbers of two dimensions, row by row, little-endian: u1 u2 u4 i1 i2 i4 f4 f8. */
rangecast::Status decode_npy (const std::uint8_t *bytes, std::size_t size, cv::Mat &values);
/** @} */

} // namespace bench
