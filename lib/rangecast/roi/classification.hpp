/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <cstdint>

#include "background.hpp"

namespace rangecast {

/** Thresholds of the segmentation, in units of the pixels. */
struct ClassLimits {
  bool use_colour, use_depth;
  bool doubt_depth;           ///< depth comes from stereo: unreliable without texture
  float colour;               ///< minimum chromatic distortion, grey levels
  float shadow, highlight;    ///< range of brightness relative to the background
  float nearness;             ///< minimum distance in front of the background, depth units
  float depth_noise;          ///< BackgroundModel::depth_noise()
  std::array<float, 3> light; ///< brightness of the image by channel, relative to the background
};

/** One row of an image and of its background. */
struct ClassInput {
  const BackgroundPixel *background;
  const float *inferred; ///< BackgroundModel::inferred_depth()
  const std::uint16_t *depth;
  const Rgbx *colour;
};

/** Classes of the pixels of a row: 255 = yes, 0 = no. */
struct ClassRow {
  std::uint8_t *other;  ///< different in colour
  std::uint8_t *nearer; ///< nearer than the background
  std::uint8_t *same;   ///< of the background's hue
  std::uint8_t *calm;   ///< 255: colour and depth match the background, 128: only colour
  std::uint8_t *lit;    ///< different in brightness only
  std::uint8_t *blank;  ///< background with inconclusive colour
  std::uint8_t *placed; ///< 255: depth is the background's, 128: so, but before its mean, 1: behind
  std::uint8_t *seen;   ///< the background's depth is known
  float *ratio;         ///< brightness relative to the background
  float *tolerance;     ///< noise of `ratio`
};

/** Compares a row of `n` pixels with the background. */
void classify_row (
    const ClassInput &input, int n, const ClassLimits &limits, const ClassRow &classes);

/** Finds the brightness of each channel relative to the background: the most frequent ratio of
 *  every sixteenth pixel that is not nearer than the background, without very dark and saturated
 * ones.
 *  @param[in,out] light  keeps its value where no ratio is frequent */
void estimate_light (const ConstRangeImage &image, const BackgroundModel &background,
    const ClassLimits &limits, std::array<float, 3> &light);

} // namespace rangecast
