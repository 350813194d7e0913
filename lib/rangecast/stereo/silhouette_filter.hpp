/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "box_sum.hpp"
#include "disparity_filter.hpp"
#include "tiles.hpp"

namespace rangecast {

/** Removes the rim that block matching adds around foreground: pixels near a step to farther
 * pixels, or near pixels without disparity, that are more similar in colour to those than to pixels
 * of their own depth, or of their slanted surface, within 8 pixels. Sets missing disparities where
 * similar pixels around agree on one. Reuses its memory between images. */
class SilhouetteFilter {
public:
  struct Settings {
    int offset = 0;   ///< 1/16 pixel, to be added to disparities
    int min = 0;      ///< lowest valid disparity, 1/16 pixel; cleared ones become min - 16
    int nearest = -1; ///< farther pixels are not processed, but count as farther
    /** Clear only pixels that are similar to pixels farther than `nearest`, and have pixels
     * without disparity around them. `colour` is that of the last call, whose samples are used
     * again. */
    bool only_beyond = false;
  };

  /** @param colour     CV_8UC4, of the disparities' size
   *  @param disparity  CV_16S, 1/16 pixel; none outside of `tiles`
   *  @param[out] to    as `disparity`, other memory; written in `tiles` */
  void apply (const Settings &settings, const cv::Mat &colour, const Tiles &tiles,
      const cv::Mat &disparity, cv::Mat &to);

private:
  struct Memory {
    Plane around, lowest, highest, line;
    std::vector<std::uint8_t> marks; /* of a row: see mark_row() */
  };
  /* Similarity in colour of the samples around a pixel, by their depth. */
  struct Votes {
    int same = 0, near = 0; /* of disparity d, nearer */
    int far = 0, none = 0;  /* farther, without depth; unless kCountNone, both are in `far` */
  };
  void sample (
      const Settings &settings, const cv::Mat &colour, const cv::Mat &disparity, int n_threads);
  template <typename Count>
  void for_window (const cv::Vec4b &own, int x, int y, const Count &count) const;
  template <bool kCountNone>
  [[nodiscard]] Votes vote (
      const Settings &settings, const cv::Vec4b &own, int x, int y, int d, int max) const;
  [[nodiscard]] int likely (const Settings &settings, const cv::Vec4b &own, int x, int y) const;
  static void mark_row (const Settings &settings, const std::int16_t *disparity,
      const std::int16_t *lowest, const std::int16_t *highest, int n, std::uint8_t *marks);
  void apply_to (const Settings &settings, const cv::Mat &colour, const cv::Rect &tile,
      const cv::Mat &disparity, Memory &memory, cv::Mat &to) const;

  /* Every second pixel of every second row, padded by samples without colour. */
  std::vector<std::uint8_t> colours_[4]; /* R, G, B, 255 = without colour */
  Plane samples_;                        /* disparities */
  WorkerMemory<Memory> memory_;
};

} // namespace rangecast
