/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <opencv2/core.hpp>

#include "../geometry/connected_components.hpp"
#include "background.hpp"
#include "depth_fill.hpp"
#include "surroundings.hpp"

namespace rangecast {

/** What distinguishes foreground from background. */
enum class Cue { kBoth, kColour, kDepth };

struct SegmentationSettings {
  Cue cue = Cue::kBoth;
  double depth_threshold_m = 0.02; ///< minimum distance in front of the background, metres
  double colour_threshold = 18;    ///< minimum chromatic distortion, grey levels
  double shadow = 0.5;             ///< minimum brightness of a shadow, relative to the background
  double highlight = 1.35;         ///< maximum brightness of a highlight, relative to it
  bool follow_light = true;        ///< compensate global changes of light and exposure
  int fringe = 9;     ///< minimum width of foreground that looks like background, pixels
  int min_area = 150; ///< minimum area of a component, pixels
  int max_hole = 100; ///< maximum area of holes that are closed, pixels
  int max_people = 0; ///< number of largest components to keep; 0 = all
  /** Distance of depth extrapolation in pixels where colour marks foreground, five times as far
   * where hue does; 0 = off. */
  int fill = 4;
};

/** Separates foreground from the background. Reuses its memory between images.
 *
 *  A pixel is background unless it is nearer by more than the noise, or differs in colour. Colour
 * is compared by chromatic distortion and brightness ratio (T. Horprasert, D. Harwood, L. S. Davis,
 * "A statistical approach for real-time robust background subtraction and shadow detection", ICCV
 * 1999), so that a pixel which is only darker (shadow) or brighter (highlight) stays background;
 *  more so where depth matches the background. Before, the background is adjusted to the light of
 * the image: by the most frequent ratio of each channel.
 *
 *  Where the background has no depth (too far, no texture), any valid depth is nearer. Regions that
 *  are nearer but look like the background next to them must have the width `fringe`: next to a
 *  silhouette, stereo gives background that one camera does not see the depth of the foreground.
 *  Finally small components are removed and small holes are closed. */
class Segmenter {
public:
  /** Classifies the pixels, see mask().
   *  @param depth_unit_m  metres per depth unit
   *  @return kBadSize if the ROI is not inside the background's image */
  Status decide (const ConstRangeImage &image, const BackgroundModel &background,
      double depth_unit_m, const SegmentationSettings &settings);

  /** Clears the depth of background pixels. Then removes components in space: fewer than min_area
   *  pixels whose neighbours are invalid, or differ by more than 30 mm and the depth noise. Then
   *  extrapolates depth over `fill` pixels into foreground without depth (DepthFill), but not where
   *  it looks like the background. */
  Status clear (const RangeImage &image, const BackgroundModel &background, double depth_unit_m,
      const SegmentationSettings &settings);

  /** Result of decide() for its ROI: 255 = foreground, with or without depth. */
  [[nodiscard]] const cv::Mat &mask () const { return mask_; }
  /** Where an image may update the background: 128 or more = matches its colour and brightness, and
   * either its depth or far from the foreground; BackgroundModel::kDifferent = does not, but lies
   * at its depth or behind. */
  [[nodiscard]] const cv::Mat &quiet () const { return quiet_; }
  /** Brightness of the last image by channel, relative to the background. */
  [[nodiscard]] const std::array<float, 3> &light () const { return light_; }

private:
  void classify (const ConstRangeImage &image, const BackgroundModel &background,
      double depth_unit_m, const SegmentationSettings &settings);
  void find_sides (const SegmentationSettings &settings);
  void compare_with_mean (const cv::Mat &mask, int reach, int min_count, cv::Mat &like);
  void ignore_colour (int reach);
  void ignore_shadows (int reach);
  void find_same (int reach);
  void join_cues (const SegmentationSettings &settings);
  void remove_small (cv::Mat &mask, int min_area, int keep);
  void find_quiet ();
  void remove_small_in_space (
      const RangeImage &image, double depth_unit_m, double noise, int min_area);
  void make_steps (double depth_unit_m, double noise);
  void extend_depth (const RangeImage &image, const SegmentationSettings &settings);

  std::array<float, 3> light_ = {1, 1, 1};
  cv::Mat other_, nearer_, same_, calm_, quiet_; /* classes of pixels, 255 = yes */
  cv::Mat lit_;                                  /* different in brightness only, 255 = yes */
  cv::Mat blank_;  /* background with inconclusive colour, 255 = yes */
  cv::Mat seen_;   /* the background's depth is known, 255 = yes */
  cv::Mat placed_; /* 255: depth is the background's, 128: so, but before its mean, 1: behind */
  cv::Mat near_;   /* nearer_ without small components */
  cv::Mat sides_, surrounded_, inside_; /* inside_: surrounded_ without holes */
  cv::Mat ratio_, tolerance_;           /* brightness relative to the background, and its noise */
  cv::Mat counts_, chosen_, sums_;      /* see compare_with_mean() */
  cv::Mat mask_, steps_;
  cv::Mat opened_, inverse_; /* scratch; after decide(), inverse_ is the background */
  ConnectedComponents components_;
  DepthFill fill_;
  Surroundings surroundings_;
  std::vector<int> areas_;
  std::vector<std::int16_t> step_of_depth_; /* for every depth, see make_steps() */
  double step_unit_m_ = 0, step_noise_ = -1;
};

} // namespace rangecast
