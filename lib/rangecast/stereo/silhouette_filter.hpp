/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "box_sum.hpp"
#include "tiles.hpp"

namespace rangecast {

/** Clears the rim that block matching hangs around what stands before something farther: pixels
 *  near a step down, or near pixels without disparity, that are more like these in colour than like
 *  the pixels of their own depth, as far as `radius` around. Gives a disparity to what has none
 *  where the pixels around that look like it agree on one. Keeps its memory between pictures. */
class SilhouetteFilter {
public:
  struct Settings {
    int radius = 8;   ///< pixels, > 0
    double step = 0;  ///< share of the depth that pixels of one surface may differ
    int offset = 0;   ///< 1/16 pixel, to be added to disparities
    int least = 0;    ///< 1/16 pixel; less = none, least - 16 is what is written
    int nearest = -1; ///< what is farther is of no interest, but that it is there
    /** Only those that look like what is known to be farther than `nearest` go. */
    bool only_beyond = false;
    /** With only_beyond: 1/16 pixel; pixels without anything that far near them stay. */
    int look_near = 0;
  };

  /** @param colour     CV_8UC4, of the disparities' size
   *  @param disparity  CV_16S, 1/16 pixel; outside of `pieces` there must be none
   *  @param[out] to    the same, not the same memory; written in `pieces` */
  void apply (const Settings &settings, const cv::Mat &colour, const Pieces &pieces,
      const cv::Mat &disparity, cv::Mat &to);

private:
  struct Memory {
    Plane around, lowest, highest, line;
  };
  /* How much the samples around a pixel are like it in colour, by their depth. */
  struct Votes {
    int same = 0, near = 0; /* of disparity d, nearer */
    int far = 0, none = 0;  /* farther, without depth; not kCountNone: both are far */
  };
  void sample (int radius, const cv::Mat &colour, const cv::Mat &disparity, int n_threads);
  template <typename Count>
  void for_window (const cv::Vec4b &own, int x, int y, int radius, const Count &count) const;
  template <bool kCountNone>
  [[nodiscard]] Votes vote (
      const Settings &settings, const cv::Vec4b &own, int x, int y, int d, int most) const;
  [[nodiscard]] int likely (const Settings &settings, const cv::Vec4b &own, int x, int y) const;
  void apply_to (const Settings &settings, const cv::Mat &colour, const cv::Rect &piece,
      const cv::Mat &disparity, Memory &memory, cv::Mat &to) const;

  /* Every second pixel of every second row, and pad_ more around that are of no colour. */
  std::vector<std::uint8_t> colours_[4]; /* R, G, B, 255 = of no colour */
  Plane samples_;                        /* disparities */
  int pad_ = 0;
  WorkerMemory<Memory> memory_;
};

} // namespace rangecast
