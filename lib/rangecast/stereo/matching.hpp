/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <opencv2/calib3d.hpp>
#include <vector>

#include "../base/status.hpp"
#include "semi_global_matcher.hpp"

namespace rangecast {

enum class MatchAlgorithm { kBm, kSgbm, kSgbm3Way, kSgm };

struct MatchSettings {
  MatchAlgorithm algorithm = MatchAlgorithm::kSgm;
  int block_size = 0;            ///< pixels, odd; 0: 15 for kBm, 3 for kSgbm...; not for kSgm
  int uniqueness_ratio = 0;      ///< per cent by which the best match must beat the second
  int speckle_window_size = 100; ///< maximum area of components that are cleared, pixels; 0 = off
  int speckle_range = 2;         ///< maximum disparity difference within a component, pixels
  int left_right_max_difference = 1; ///< pixels; -1 = no left-right check

  friend bool operator== (const MatchSettings &, const MatchSettings &) = default;
};

/** Matches rectified pairs with OpenCV's block matching (K. Konolige, "Small vision systems", 1998)
 *  or semi-global matching (H. Hirschmueller, "Stereo processing by semiglobal matching and mutual
 *  information", PAMI 30, 2008), in all five or three directions, or with SemiGlobalMatcher. */
class Matcher {
public:
  /** @param min_disparity, max_disparity  pixels, inclusive; left x minus right x; may be negative
   */
  Status set (const MatchSettings &settings, int min_disparity, int max_disparity);

  /** Changes the disparity range only. @return kBadValue as set() */
  Status set_range (int min_disparity, int max_disparity);

  [[nodiscard]] int min_disparity () const { return min_disparity_; }
  /** Number of columns left of a pixel that its match may need. */
  [[nodiscard]] int reach () const
  {
    return min_disparity_ + disparities_ > 0 ? min_disparity_ + disparities_ : 0;
  }

  /** Number of columns right of a pixel that its match may need, for negative disparities. */
  [[nodiscard]] int reach_right () const { return min_disparity_ < 0 ? -min_disparity_ : 0; }

  /** Whether matches depend on rows below a pixel as well as above. */
  [[nodiscard]] bool looks_down () const { return settings_.algorithm == MatchAlgorithm::kSgm; }

  /** @param left, right  8 bit grey, the same size, rows agree
   *  @param n_threads  0 = one per core. Otherwise OpenCV's algorithms split the rows into
   * overlapping stripes
   *  @param[out] disparity  CV_16S, 1/16 pixel; below 16 * min_disparity() = no match
   *  @return kNoSpace if OpenCV failed */
  Status match (const cv::Mat &left, const cv::Mat &right, int n_threads, cv::Mat &disparity);

private:
  Status match_whole (const cv::Mat &left, const cv::Mat &right, cv::Mat &disparity);
  Status match_stripes (
      const cv::Mat &left, const cv::Mat &right, int n_threads, cv::Mat &disparity);

  MatchSettings settings_;
  SemiGlobalMatcher sgm_;
  cv::Ptr<cv::StereoMatcher> matcher_;
  std::vector<cv::Ptr<cv::StereoMatcher>> more_; /* one per stripe */
  std::vector<cv::Mat> stripes_;
  int min_disparity_ = 0, disparities_ = 0;
};

} // namespace rangecast
