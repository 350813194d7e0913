/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "../base/parallel.hpp"

namespace rangecast {

/** Semi-global matching along rows and columns, both ways (H. Hirschmueller, "Stereo processing by
 *  semiglobal matching and mutual information", PAMI 30, 2008). The matching cost compares the
 * differences of each pixel to 16 of its neighbours, clipped to kMaxDifference grey levels: a
 * census transform (R. Zabih, J. Woodfill, "Non-parametric local transforms for computing visual
 * correspondence", ECCV 1994) with 15 levels instead of two, so that noise costs less than texture,
 * and strong texture no more than that of hair or skin. The grey level itself has a small weight
 * (S. Birchfield, C. Tomasi, "A pixel dissimilarity measure that is insensitive to image sampling",
 * PAMI 20, 1998). Results depend neither on the number of threads nor on the processor. Reuses its
 * memory between images. */
class SemiGlobalMatcher {
public:
  struct Settings {
    int uniqueness_ratio = 0;          ///< per cent by which the best match must beat the second
    int left_right_max_difference = 1; ///< pixels; -1 = no left-right check
  };
  void set (const Settings &settings) { settings_ = settings; }

  /** @param left, right    CV_8U, the same size, rows agree
   *  @param min_disparity  pixels; left x minus right x
   *  @param disparities    number of disparities, a multiple of 16
   *  @param n_threads      0 = one per core
   *  @param[out] disparity CV_16S, 1/16 pixel; 16 * min_disparity - 16 = no match, as in columns
   * whose disparities are not all inside the right image */
  void match (const cv::Mat &left, const cv::Mat &right, int min_disparity, int disparities,
      int n_threads, cv::Mat &disparity);

private:
  /* Scratch memory of one thread. */
  struct Memory {
    std::vector<std::uint8_t> transformed[2]; /* of a row: by neighbour and column */
    std::vector<std::uint8_t> low, high;      /* of grey around a right pixel */
    std::vector<std::uint8_t> paths, lowest;
    std::vector<std::uint16_t> sums;
    std::vector<std::int16_t> right;
    std::vector<std::uint16_t> right_sums;
  };
  /* The part to match: columns x0 to x0 + columns, rows y0 to y0 + rows. */
  struct Stripe {
    const cv::Mat &left;
    int min_disparity, x0, columns, y0, rows;
  };
  /* The best disparity of a pixel. */
  struct Match {
    std::int16_t disparity; /* 1/16 pixel, or kAmbiguous */
    std::int16_t whole;     /* pixels */
    std::uint16_t sum;      /* its cost */
  };
  template <int kCount> void compare_row (const Stripe &stripe, int y, Memory &memory);
  template <int kCount> void walk_row (const Stripe &stripe, int y, Memory &memory);
  template <int kCount> void walk_columns (const Stripe &stripe, int x, int end, Memory &memory);
  template <int kCount>
  [[nodiscard]] bool is_unique (const std::uint16_t *sums, int best, int disparities) const;
  template <int kCount>
  [[nodiscard]] Match choose (
      const Stripe &stripe, std::size_t cell, const std::uint8_t *up, Memory &memory) const;
  void check_row (const Stripe &stripe, int y, Memory &memory, cv::Mat &disparity) const;
  template <int kCount>
  void match_stripe (const Stripe &stripe, int y, int end, int n_threads, cv::Mat &disparity);
  [[nodiscard]] std::size_t at (const Stripe &stripe, int x, int y) const;

  Settings settings_;
  int disparities_ = 0;
  cv::Mat padded_[2]; /* CV_8U: left, and right mirrored, padded */
  /* By row, column and disparity of a stripe: cost; sum along the paths of a row; cost along the
   * path down. */
  std::vector<std::uint8_t> costs_, across_, down_;
  std::vector<Match> matches_; /* by row and column of a stripe */
  WorkerMemory<Memory> memory_;
};

} // namespace rangecast
