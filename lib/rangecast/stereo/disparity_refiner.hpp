/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "tiles.hpp"

namespace rangecast {

/** Refines disparities that are right to about a pixel. In each iteration, each disparity is
 * replaced by that of a plane fitted to its neighbourhood, and shifted to minimize the difference
 * between both images: one step of B. D. Lucas, T. Kanade, "An iterative image registration
 * technique with an application to stereo vision", IJCAI 1981, in which each pixel of the window is
 * sampled at its own disparity, so that slanted and curved surfaces are as precise as those that
 * face the camera, and the images may differ in brightness. Without texture only the plane fit has
 * an effect. Reuses its memory between images. */
class DisparityRefiner {
public:
  struct Job {
    const cv::Mat &left, &right; ///< CV_8U, rectified, of the same height
    const cv::Mat &colour;       ///< CV_8UC4, the left one's
    int right_x = 0;             ///< column of `right` that corresponds to column 0 of `left`
    int nearest = 1;             ///< 1/16 pixel; farther pixels (or without disparity) are ignored
    int iterations = 2;          ///< 0 = off
  };

  /** Changes no disparity by more than a pixel; adds and removes none.
   *  @param tiles     pixels read and written; there must be no disparities around them
   *  @param disparity  CV_16S, 1/16 pixel, of the left image's size */
  void apply (const Job &job, const Tiles &tiles, cv::Mat &disparity);

private:
  /* Scratch memory of one thread: rows. */
  struct Memory {
    std::vector<float> columns[4], sums[4], shifts;
    std::vector<std::uint8_t> steps[2];
    std::vector<std::int32_t> at;
    std::vector<std::uint32_t> greys;
  };
  void begin (const Job &job, const cv::Size &size, const Tiles &tiles);
  void load (const Job &job, const cv::Mat &disparity, cv::Rect &part);
  void mark_steps (const cv::Rect &part);
  void smooth (const cv::Rect &part, Memory &memory);
  void compare (const Job &job, const cv::Rect &part, Memory &memory);
  void move (const cv::Rect &part, Memory &memory);
  void put_back (const Job &job, const cv::Rect &part, cv::Mat &disparity) const;
  void choose_members (const cv::Rect &part, Memory &memory);
  [[nodiscard]] std::uint64_t members_of (int x, int y) const;
  [[nodiscard]] float on_plane (int x, int y, std::uint64_t members) const;
  [[nodiscard]] float shift_of_members (int x, int y, std::uint64_t members) const;

  /* All are padded, so that windows stay inside. */
  cv::Mat first_, now_, next_;         /* CV_32F, pixels more than the farthest; 0 = none */
  cv::Mat steps_;                      /* CV_8U: 1 = no disparity, or next to a step */
  cv::Mat slopes_, differences_;       /* CV_32F, of grey levels; 0 without disparity */
  cv::Mat products_, squares_;         /* CV_32F: gradient times difference, gradient squared */
  cv::Mat colours_[3];                 /* CV_8U: R, G, B */
  std::vector<std::uint64_t> members_; /* 0 = all neighbours, see members_of() */
  cv::Mat valid_;                      /* CV_8U: 1 = there is a disparity */
  std::vector<cv::Rect> parts_;        /* of tiles: the columns with disparities */
  WorkerMemory<Memory> memory_;
};

} // namespace rangecast
