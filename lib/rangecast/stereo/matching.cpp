/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "matching.hpp"

#include <string>

namespace rangecast {

/* OpenCV's 16-bit disparities in 1/16 pixel hold no more. */
constexpr int kMaxDisparity = 2000;

static cv::Ptr<cv::StereoMatcher>
make_bm (const MatchSettings &s, int block_size, int disparities)
{
  auto bm = cv::StereoBM::create (disparities, block_size);
  bm->setPreFilterCap (31);
  bm->setTextureThreshold (10);
  bm->setUniquenessRatio (s.uniqueness_ratio);
  return bm;
}

static cv::Ptr<cv::StereoMatcher>
make_sgbm (const MatchSettings &s, int block_size, int disparities)
{
  const int area = block_size * block_size;
  const int mode = s.algorithm == MatchAlgorithm::kSgbm ? cv::StereoSGBM::MODE_SGBM
                                                        : cv::StereoSGBM::MODE_SGBM_3WAY;
  return cv::StereoSGBM::create (
      0, disparities, block_size, 8 * area, 32 * area, 0, 31, s.uniqueness_ratio, 0, 0, mode);
}

Status
Matcher::set (const MatchSettings &s, int min_disparity, int max_disparity)
{
  const bool bm = s.algorithm == MatchAlgorithm::kBm;
  const int block = s.block_size > 0 ? s.block_size : bm ? 15 : 3;
  if (block % 2 == 0 || (bm && block < 5) || block > 51)
    return {StatusCode::kBadValue, "stereo: block size " + std::to_string (block) +
                                       ", expected an odd number" +
                                       (bm ? " from 5 to 51" : " up to 51")};
  if (max_disparity <= min_disparity || max_disparity > kMaxDisparity ||
      min_disparity < -kMaxDisparity)
    return {StatusCode::kBadValue, "stereo: disparities " + std::to_string (min_disparity) +
                                       " to " + std::to_string (max_disparity) +
                                       " pixels, expected less than 2000; is near too near?"};
  min_disparity_ = min_disparity;
  disparities_ = (max_disparity - min_disparity + 1 + 15) / 16 * 16;
  try {
    matcher_ = bm ? make_bm (s, block, disparities_) : make_sgbm (s, block, disparities_);
    matcher_->setMinDisparity (min_disparity);
    matcher_->setSpeckleWindowSize (0); /* after other filters, see StereoDepth */
    matcher_->setDisp12MaxDiff (s.left_right_max_difference);
  } catch (const cv::Exception &) {
    return {StatusCode::kBadValue, "stereo: OpenCV refuses these settings"};
  }
  return {};
}

Status
Matcher::match (const cv::Mat &left, const cv::Mat &right, cv::Mat &disparity)
{
  try {
    matcher_->compute (left, right, disparity);
  } catch (const cv::Exception &) {
    return {StatusCode::kNoSpace,
        "stereo: OpenCV's matcher failed; is the block larger than the picture?"};
  }
  return {};
}

} // namespace rangecast
