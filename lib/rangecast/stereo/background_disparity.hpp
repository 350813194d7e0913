/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "box_sum.hpp"
#include "tiles.hpp"

namespace rangecast {

/** Remembers the background beyond far from images that were matched at all depths. A matcher that
 *  searches only some depths would mistake it for something nearer; here it is recognized by its
 *  disparity.
 *  Disparities are CV_16S in 1/16 pixel, greys CV_8U. */
class BackgroundDisparity {
public:
  void reset () { known_.release (); }
  [[nodiscard]] bool empty () const { return known_.empty (); }

  /** @param grey       the whole left image
   *  @param disparity  its disparities; background from `min` to below `far`
   *  Keeps what was known where something else is now; where nothing is known, guesses from the
   * rest of the row. */
  void remember (const cv::Mat &grey, const cv::Mat &disparity, int min, int far);

  /** Replaces disparities by the background's where that matches the images better, or matches
   * them and the left image has not changed. Removes them next to the background where there was
   * none and the image has not changed: the right camera does not see these pixels.
   *  @param left, right  the same rows; column `right_x` of `right` is column 0 of `left`
   *  @param at           position of `left` in the whole image
   *  @param none         written where `disparity` stays below `min`
   *  @param[out] to      as `disparity`, not the same memory; written in `tiles` */
  void restore (const cv::Mat &left, const cv::Mat &right, int right_x, const cv::Point &at,
      int min, int none, const Tiles &tiles, const cv::Mat &disparity, cv::Mat &to);

  /** Finds pixels that look as the background did, or as what the right camera did not see beside
   * it.
   *  @param left, at  as for restore(); @param[out] still  CV_8U of its size: 255 or 0 */
  void find_still (const cv::Mat &left, const cv::Point &at, cv::Mat &still) const;

  /** Sets the farthest disparity, `min`, for pixels without disparity next to the background in
   * their row: one camera does not see them. */
  void extend (const cv::Point &at, int min, int far, const Tiles &tiles, cv::Mat &disparity) const;

private:
  /* Scratch memory of one thread for one tile: pixels, and sums over patches. */
  struct Memory {
    Plane grey, before, pixels, own, other, contrast, change, sums;
    std::vector<std::int16_t> columns;
    std::vector<std::uint8_t> restored; /* of a row: 1 = its disparity became the background's */
    std::vector<std::int16_t> there, claimed; /* of a row: column of the right image, its claim */
    std::vector<std::int16_t> claims; /* by column of the right image: cost of the best match */
  };
  /* Positions of the images of one call. */
  struct Job {
    const cv::Mat &left, &right;
    int right_x;
    cv::Point at;
    int min, none;
  };
  void compare (const Job &job, const cv::Rect &tile, const cv::Mat &disparity, int min,
      Memory &memory, Plane &unlike) const;
  void restore_tile (const Job &job, const cv::Rect &tile, const cv::Mat &disparity, Memory &memory,
      cv::Mat &to) const;
  void restore_row (const Job &job, int x0, int y, int i, int width, Memory &memory,
      std::int16_t *disparity) const;
  void mark_hidden (
      const std::int16_t *disparity, const std::uint8_t *grey, int y, int min, int far);

  cv::Mat known_;   /* CV_16S; kUnknown; kHidden: had no disparity */
  cv::Mat likely_;  /* the same with guesses from the row */
  cv::Mat picture_; /* CV_8U: left image where something is known */
  WorkerMemory<Memory> memory_;
};

} // namespace rangecast
