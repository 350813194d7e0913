/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "../base/simd.hpp"
#include "tiles.hpp"

namespace rangecast {

/** Refines disparities that are right to about a pixel. In each of two iterations, each disparity
 * is replaced by that of a plane fitted to its neighbourhood, and shifted to minimize the
 * difference between both images: one step of B. D. Lucas, T. Kanade, "An iterative image
 * registration technique with an application to stereo vision", IJCAI 1981, in which each pixel of
 * the window is sampled at its own disparity, so that slanted and curved surfaces are as precise as
 * those that face the camera, and the images may differ in brightness. Without texture only the
 * plane fit has an effect. Reuses its memory between images. */
class DisparityRefiner {
public:
  struct Job {
    const cv::Mat &left, &right; ///< CV_8U, rectified, of the same height
    const cv::Mat &colour;       ///< CV_8UC4, the left one's
    int right_x = 0;             ///< column of `right` that corresponds to column 0 of `left`
    int nearest = 1;             ///< 1/16 pixel; farther pixels (or without disparity) are ignored
  };

  /** Shifts no disparity by more than a pixel before the last plane fit; adds and removes none.
   *  @param tiles     pixels read and written; there must be no disparities around them
   *  @param disparity  CV_16S, 1/16 pixel, of the left image's size */
  void apply (const Job &job, const Tiles &tiles, cv::Mat &disparity);

private:
  /* Scratch memory of one thread. */
  struct Memory {
    std::vector<float> sums, left, shares, valid; /* of rows */
    std::vector<std::uint8_t> counts, near;       /* of rows */
    std::vector<std::int32_t> at, greys;          /* of rows */
    std::vector<float> columns[4], threes[4];     /* of sums over patches: see find_shift() */
    /* Gradient and difference of grey levels of the last rows; 0 without disparity. */
    std::vector<float> slopes, differences;
    int stride = 0;
  };
  static constexpr int kGroup = kMaxLanes;
  /* Adjacent pixels, of which those near a step are fitted one by one. */
  struct Edges {
    int x, y;                /* in the padded planes */
    std::int32_t is[kGroup]; /* -1 = near a step and with a disparity, else 0 */
    /* Neighbours that belong to its surface, row by row, beginning with the highest bit: above and
     * in the pixel's row, and below. */
    std::uint32_t members[2][kGroup];
    float count[kGroup];                            /* of members */
    float at[kGroup], across[kGroup], down[kGroup]; /* their weights: see fit_planes() */
  };
  struct Part {
    cv::Rect at; /* columns with disparities of a tile */
    std::vector<Edges> edges;
  };
  void begin (const cv::Size &size, const Tiles &tiles);
  void load (const Job &job, const cv::Mat &disparity, cv::Rect &part);
  void mark_steps (const cv::Rect &part);
  template <typename Lanes> void find_edges (Part &part, Memory &memory);
  template <typename Lanes> void fit_planes (Edges &edges, int lane) const;
  template <typename Lanes> void smooth (const Part &part, Memory &memory);
  template <typename Lanes> void smooth_edges (const Edges &edges, int lane);
  static void begin_moves (const cv::Rect &at, Memory &memory);
  static float *row_of (std::vector<float> &rows, int y, const Memory &memory);
  template <typename Lanes>
  void compare_row (const Job &job, const cv::Rect &at, int y, Memory &memory) const;
  template <typename Lanes> static void move_window (const cv::Rect &at, int y, Memory &memory);
  template <typename Lanes> void move (const Job &job, const Part &part, Memory &memory);
  template <typename Lanes>
  void move_edges (const Edges &edges, const cv::Rect &at, int lane, Memory &memory);
  void put_back (const Job &job, const cv::Rect &part, cv::Mat &disparity) const;

  /* All are padded, so that windows stay inside. */
  cv::Mat first_, now_, next_; /* CV_32F, pixels more than the farthest; 0 = none */
  cv::Mat steps_;              /* CV_8U: 1 = no disparity, or next to a step */
  cv::Mat valid_;              /* CV_8U: 1 = there is a disparity */
  cv::Mat colour_;             /* CV_32S: R, G, B and 0 in memory order */
  std::vector<Part> parts_;
  WorkerMemory<Memory> memory_;
};

} // namespace rangecast
