/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "matching.hpp"

#include <algorithm>
#include <atomic>
#include <opencv2/core/utility.hpp>
#include <string>

namespace rangecast {
namespace {

/* Limit of OpenCV's 16-bit disparities in 1/16 pixel. */
constexpr int kMaxDisparity = 2000;

int
block_size_of (const MatchSettings &s)
{
  return s.block_size > 0 ? s.block_size : s.algorithm == MatchAlgorithm::kBm ? 15 : 3;
}

cv::Ptr<cv::StereoMatcher>
make_matcher (const MatchSettings &s, int min_disparity, int disparities)
{
  const int block_size = block_size_of (s), area = block_size * block_size;
  cv::Ptr<cv::StereoMatcher> matcher;
  if (s.algorithm == MatchAlgorithm::kBm) {
    const auto bm = cv::StereoBM::create (disparities, block_size);
    bm->setPreFilterCap (31);
    bm->setTextureThreshold (10);
    bm->setUniquenessRatio (s.uniqueness_ratio);
    matcher = bm;
  } else {
    /* Penalties are a quarter less than in OpenCV's examples: steps are located better, and hair is
     * less often merged with the background. */
    matcher = cv::StereoSGBM::create (0, disparities, block_size, 6 * area, 24 * area, 0, 31,
        s.uniqueness_ratio, 0, 0,
        s.algorithm == MatchAlgorithm::kSgbm ? cv::StereoSGBM::MODE_SGBM
                                             : cv::StereoSGBM::MODE_SGBM_3WAY);
  }
  matcher->setMinDisparity (min_disparity);
  matcher->setSpeckleWindowSize (0); /* DisparityFinder does it after other filters */
  matcher->setDisp12MaxDiff (s.left_right_max_difference);
  return matcher;
}

} // namespace

Status
Matcher::set (const MatchSettings &s, int min_disparity, int max_disparity)
{
  const bool bm = s.algorithm == MatchAlgorithm::kBm;
  const int block = block_size_of (s);
  if (block % 2 == 0 || (bm && block < 5) || block > 51)
    return {StatusCode::kBadValue, "stereo: block size " + std::to_string (block) +
                                       ", expected an odd number" +
                                       (bm ? " from 5 to 51" : " up to 51")};
  settings_ = s;
  sgm_.set ({s.uniqueness_ratio, s.left_right_max_difference});
  matcher_.release ();
  more_.clear ();
  return set_range (min_disparity, max_disparity);
}

Status
Matcher::set_range (int min_disparity, int max_disparity)
{
  if (max_disparity <= min_disparity || max_disparity > kMaxDisparity ||
      min_disparity < -kMaxDisparity)
    return {StatusCode::kBadValue, "stereo: disparities " + std::to_string (min_disparity) +
                                       " to " + std::to_string (max_disparity) +
                                       " pixels, expected less than 2000; is near too near?"};
  min_disparity_ = min_disparity;
  /* OpenCV needs multiples of 16. Semi-global matching gains by them, too: what is not in the range
   * matches the excess as often as the rest, and is cleared as inconsistent. */
  disparities_ = (max_disparity - min_disparity + 16) / 16 * 16;
  if (settings_.algorithm == MatchAlgorithm::kSgm)
    return {};
  try {
    if (!matcher_)
      matcher_ = make_matcher (settings_, min_disparity_, disparities_);
    const auto limit = [this] (cv::StereoMatcher &matcher) {
      matcher.setMinDisparity (min_disparity_);
      matcher.setNumDisparities (disparities_);
    };
    limit (*matcher_);
    for (const auto &matcher : more_)
      limit (*matcher);
  } catch (const cv::Exception &) {
    return {StatusCode::kBadValue, "stereo: OpenCV rejects these settings"};
  }
  return {};
}

/* OpenCV splits an image among all cores, but not inside a parallel loop: so one thread is a loop
 * of one. Several threads get stripes, which overlap to avoid seams. */
Status
Matcher::match (const cv::Mat &left, const cv::Mat &right, int n_threads, cv::Mat &disparity)
{
  if (settings_.algorithm == MatchAlgorithm::kSgm) {
    sgm_.match (left, right, min_disparity_, disparities_, n_threads, disparity);
    return {};
  }
  if (n_threads == 0 || n_threads >= std::max (cv::getNumThreads (), 2))
    return match_whole (left, right, disparity);
  if (n_threads > 1)
    return match_stripes (left, right, n_threads, disparity);
  Status status;
  cv::parallel_for_ (
      cv::Range (0, 1), [&] (const cv::Range &) { status = match_whole (left, right, disparity); });
  return status;
}

Status
Matcher::match_whole (const cv::Mat &left, const cv::Mat &right, cv::Mat &disparity)
{
  try {
    matcher_->compute (left, right, disparity);
  } catch (const cv::Exception &) {
    return {StatusCode::kNoSpace,
        "stereo: OpenCV's matcher failed; is the block larger than the image?"};
  }
  return {};
}

Status
Matcher::match_stripes (
    const cv::Mat &left, const cv::Mat &right, int n_threads, cv::Mat &disparity)
{
  constexpr int kOverlap = 16; /* minimum number of rows; the paths of SGM converge within them */
  const int n = std::clamp (left.rows / (4 * kOverlap), 1, n_threads);
  const int overlap = std::max (kOverlap, block_size_of (settings_));
  while (static_cast<int> (more_.size ()) < n)
    more_.push_back (make_matcher (settings_, min_disparity_, disparities_));
  stripes_.resize (more_.size ());
  disparity.create (left.size (), CV_16S);
  std::atomic<bool> failed = false;
  const auto work = [&] (const cv::Range &range) {
    for (int i = range.start; i < range.end; i++) {
      const cv::Range rows (left.rows * i / n, left.rows * (i + 1) / n);
      const cv::Range wide (
          std::max (0, rows.start - overlap), std::min (left.rows, rows.end + overlap));
      const auto k = static_cast<std::size_t> (i);
      try {
        more_[k]->compute (left.rowRange (wide), right.rowRange (wide), stripes_[k]);
        stripes_[k]
            .rowRange (rows.start - wide.start, rows.end - wide.start)
            .copyTo (disparity.rowRange (rows));
      } catch (const cv::Exception &) {
        failed = true;
      }
    }
  };
  cv::parallel_for_ (cv::Range (0, n), work, n);
  if (failed)
    return {StatusCode::kNoSpace,
        "stereo: OpenCV's matcher failed; is the block larger than a stripe of the image?"};
  return {};
}

} // namespace rangecast
