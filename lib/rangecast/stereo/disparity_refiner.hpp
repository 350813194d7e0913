/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "tiles.hpp"

namespace rangecast {

/** Takes the noise off disparities that are right to a pixel or so. In turns, each disparity
 *  becomes that of the plane which fits its neighbourhood best, and moves by what makes the two
 *  pictures agree there: one step of B. D. Lucas, T. Kanade, "An iterative image registration
 *  technique with an application to stereo vision", IJCAI 1981, in which every pixel of the window
 *  is looked up at its own disparity, so that slanted and curved surfaces are no worse off than
 *  those that face the camera, and the pictures may differ in brightness. Where there is no texture
 * only the planes count. Keeps its memory between pictures. */
class DisparityRefiner {
public:
  struct Job {
    const cv::Mat &left, &right; ///< CV_8U, rectified, of the same height
    const cv::Mat &colour;       ///< CV_8UC4, the left one's
    int right_x = 0;             ///< column of `right` that is the left picture's column 0
    int nearest = 1;             ///< 1/16 pixel; what is farther (or has none) is left alone
    int turns = 2;               ///< 0 = nothing happens
  };

  /** No disparity moves by more than a pixel, and none comes or goes.
   *  @param pieces     what is looked at and written; around them there must be no disparities
   *  @param disparity  CV_16S, 1/16 pixel, of the left picture's size */
  void apply (const Job &job, const Pieces &pieces, cv::Mat &disparity);

private:
  /* What one thread needs: rows. */
  struct Memory {
    std::vector<float> columns[4], sums[4], shifts;
    std::vector<std::uint8_t> steps[2];
    std::vector<std::int32_t> at;
    std::vector<std::uint32_t> greys;
  };
  void make_room (const cv::Size &size, const Pieces &pieces);
  void take (const Job &job, const cv::Mat &disparity, cv::Rect &part);
  void mark_steps (const cv::Rect &part);
  void smooth (const cv::Rect &part, Memory &memory);
  void compare (const Job &job, const cv::Rect &part, Memory &memory);
  void move (const cv::Rect &part, Memory &memory);
  void put_back (const Job &job, const cv::Rect &part, cv::Mat &disparity) const;
  void take_colours (const cv::Mat &colour);
  void choose_members (const cv::Rect &part, Memory &memory);
  [[nodiscard]] std::uint64_t members_of (int x, int y) const;
  [[nodiscard]] float on_plane (int x, int y, std::uint64_t members) const;
  [[nodiscard]] float shift_of_members (int x, int y, std::uint64_t members) const;

  /* All have a border, so that no window leaves them. */
  cv::Mat first_, now_, next_;         /* CV_32F, pixels beyond what is just too far; 0 = none */
  cv::Mat steps_;                      /* CV_8U: 1 = none there, or a step beside it */
  cv::Mat slopes_, differences_;       /* CV_32F, of greys; 0 where there is no disparity */
  cv::Mat products_, squares_;         /* CV_32F: slope times difference, and slope times itself */
  cv::Mat colours_[3];                 /* CV_8U: R, G, B */
  std::vector<std::uint64_t> members_; /* 0 = all around a pixel, see members_of() */
  cv::Mat valid_;                      /* CV_8U: 1 = there is a disparity */
  std::vector<cv::Rect> parts_;        /* of pieces: the columns that have disparities */
  WorkerMemory<Memory> memory_;
};

} // namespace rangecast
