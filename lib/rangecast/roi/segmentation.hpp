/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <opencv2/core.hpp>

#include "background.hpp"

namespace rangecast {

/** What speaks for a pixel. */
enum class Cue { kBoth, kColour, kDepth };

struct SegmentationSettings {
  Cue cue = Cue::kBoth;
  double noise_factor = 4;         ///< a difference counts from so many standard deviations
  double depth_threshold_m = 0.02; ///< and from so much nearness, metres
  double colour_threshold = 18;    ///< and from so much chromatic distortion, grey levels
  double shadow = 0.5;             ///< darker than this share of the background is no shadow
  double highlight = 1.35;         ///< brighter than this share of the background is no light
  int min_area = 150;              ///< smaller islands go, pixels
  int max_hole = 100;              ///< smaller holes close, pixels
};

/** Separates what has come into the scene from its background. Keeps its memory between frames. */
class Segmenter {
public:
  /** Clears the depth of every pixel of the background.
   *
   *  A pixel belongs to the background unless it is nearer than it by more than its noise, or of
   *  another colour. Colour is compared by chromatic distortion and brightness ratio (T.
   *  Horprasert, D. Harwood, L. S. Davis, "A statistical approach for real-time robust background
   *  subtraction and shadow detection", ICCV 1999), so that a pixel which is only darker (shadow)
   *  or only brighter (light) stays background. Where only depth speaks for a pixel, the region
   * must be at least 9 pixels wide, lest fringes beside silhouettes stay. Then small islands go and
   * small holes close. Closing a hole makes no depth; it decides which valid pixels stay. Last,
   *  islands in space go: patches of fewer than min_area pixels whose neighbours are invalid or
   * more than 30 mm nearer or farther.
   *  @param image         depth is written, colour read
   *  @param depth_unit_m  metres per depth unit
   *  @return kBadSize if the ROI does not lie in the background's image */
  Status clear_background (const RangeImage &image, const BackgroundModel &background,
      double depth_unit_m, const SegmentationSettings &settings);

private:
  void classify (const RangeImage &image, const BackgroundModel &background, double depth_unit_m,
      const SegmentationSettings &settings);
  void join_cues (Cue cue);
  void remove_small (cv::Mat &mask, int min_area);
  void remove_small_in_space (const RangeImage &image, double depth_unit_m, int min_area);

  cv::Mat nearer_only_, opened_,
      kernel_; /* what is nearer than the background, but not of another colour */
  cv::Mat mask_, inverse_, labels_, stats_, centroids_, halves_, speckles_;
};

} // namespace rangecast
