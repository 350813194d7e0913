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
  /* Scratch memory of one thread. */
  struct Memory {
    std::vector<float> columns[4], sums[4], shifts; /* of rows */
    std::vector<std::uint8_t> counts[2];
    std::vector<std::int32_t> at;
    std::vector<std::uint32_t> greys;
    /* Of a part and kPatch pixels around: gradient times difference of grey levels, gradient
     * squared, gradient, difference; 0 without disparity. */
    std::vector<float> planes[4];
    int stride = 0;
  };
  /* A pixel near a step: the neighbours that belong to its surface (see members_of()), and their
   * weights (see fit_plane()). */
  struct Edge {
    int x, y; /* in the padded planes */
    std::uint64_t members;
    float at, across, down;
  };
  struct Part {
    cv::Rect at; /* columns with disparities of a tile */
    std::vector<Edge> edges;
  };
  void begin (const cv::Size &size, const Tiles &tiles);
  void load (const Job &job, const cv::Mat &disparity, cv::Rect &part);
  void mark_steps (const cv::Rect &part);
  void find_edges (Part &part, Memory &memory);
  void smooth (const Part &part, Memory &memory);
  void compare (const Job &job, const cv::Rect &at, Memory &memory) const;
  void move (const Job &job, const Part &part, Memory &memory);
  void put_back (const Job &job, const cv::Rect &part, cv::Mat &disparity) const;
  [[nodiscard]] std::uint64_t members_of (int x, int y) const;
  static void fit_plane (Edge &edge);
  [[nodiscard]] float on_plane (const Edge &edge) const;
  static float shift_of (const Edge &edge, const cv::Rect &at, const Memory &memory);

  /* All are padded, so that windows stay inside. */
  cv::Mat first_, now_, next_; /* CV_32F, pixels more than the farthest; 0 = none */
  cv::Mat steps_;              /* CV_8U: 1 = no disparity, or next to a step */
  cv::Mat valid_;              /* CV_8U: 1 = there is a disparity */
  cv::Mat colours_[3];         /* CV_8U: R, G, B */
  std::vector<Part> parts_;
  WorkerMemory<Memory> memory_;
};

} // namespace rangecast
