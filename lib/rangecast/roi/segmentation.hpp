/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <opencv2/core.hpp>

#include "background.hpp"
#include "depth_fill.hpp"
#include "surroundings.hpp"

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
  bool follow_light = true;        ///< first undo what exposure and lamps do to the whole picture
  int fringe = 9;                  ///< what looks like background must be so wide, pixels; 0 = any
  int min_area = 150;              ///< smaller islands go, pixels
  int max_hole = 100;              ///< smaller holes close, pixels
  int max_people = 0;              ///< only so many of the largest islands stay; 0 = all
  /** Pixels that depth is extended where colour speaks for a pixel, and four times as many more
   * where its hue does; 0 = off. */
  int fill = 4;
};

/** Separates what has come into the scene from its background. Keeps its memory between frames.
 *
 *  A pixel belongs to the background unless it is nearer than it by more than its noise, or of
 *  another colour. Colour is compared by chromatic distortion and brightness ratio (T. Horprasert,
 *  D. Harwood, L. S. Davis, "A statistical approach for real-time robust background subtraction and
 *  shadow detection", ICCV 1999), so that a pixel which is only darker (shadow) or only brighter
 *  (light) stays background; where depth says that the background is there, it may be much darker
 *  or brighter. Before that the background gets the light of the picture: for each channel the
 * ratio that most pixels have.
 *
 *  Where the background's depth was never valid (too far, no texture) any valid depth is nearer.
 *  Where a nearer pixel has the colour and the light of the background beside it, the region must
 * be as wide as a thing is: beside a silhouette stereo gives the background that one camera does
 * not see the depth of what hides it, and such fringes must not stay. Then small islands go and
 * small holes close. */
class Segmenter {
public:
  /** Decides which pixels stay, see mask().
   *  @param depth_unit_m  metres per depth unit
   *  @return kBadSize if the ROI does not lie in the background's image */
  Status decide (const ConstRangeImage &image, const BackgroundModel &background,
      double depth_unit_m, const SegmentationSettings &settings);

  /** Clears the depth of every pixel that decide() found to be background. Closing a hole made no
   *  depth; it decided which valid pixels stay. After that islands in space go: patches of fewer
   * than min_area pixels whose neighbours are invalid or nearer or farther by more than 30 mm and
   * more than the noise of depth there. Then what stays but has no depth gets some, `fill` pixels
   * far (DepthFill); not where it looks just like the background, be it a small hole or not. */
  Status clear (const RangeImage &image, const BackgroundModel &background, double depth_unit_m,
      const SegmentationSettings &settings);

  /** decide() and clear(). */
  Status clear_background (const RangeImage &image, const BackgroundModel &background,
      double depth_unit_m, const SegmentationSettings &settings);

  /** What the last decide() found, of its ROI: 255 = kept, whether valid or not. */
  [[nodiscard]] const cv::Mat &mask () const { return mask_; }
  /** Where the last decide() found nothing that speaks against the background: other than 0 = its
   *  colour, in its light, and either its depth or well away from what is kept. What may teach the
   *  background. */
  [[nodiscard]] const cv::Mat &quiet () const { return quiet_; }
  /** Brightness of the last picture by channel, as a share of the background's. */
  [[nodiscard]] const std::array<float, 3> &light () const { return light_; }

private:
  void classify (const ConstRangeImage &image, const BackgroundModel &background,
      double depth_unit_m, const SegmentationSettings &settings);
  void find_sides (const SegmentationSettings &settings);
  void forgive_light (int reach);
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
  cv::Mat lit_;                                  /* of another brightness only, 255 = yes */
  cv::Mat blank_;  /* background of which colour says nothing, 255 = yes */
  cv::Mat seen_;   /* the background's depth is known there, 255 = yes */
  cv::Mat placed_; /* where depth has been compared with the background's, 255 = the same */
  cv::Mat sides_, surrounded_, inside_; /* inside_: surrounded_ without what is seen through */
  cv::Mat dark_beside_, dark_, by_colour_;
  cv::Mat ratio_, tolerance_; /* of brightness to the background's, and how far noise moves it */
  cv::Mat behind_, light_beside_, opened_, kernel_, guard_;
  cv::Mat mask_, inverse_, labels_, stats_, centroids_, steps_, speckles_;
  DepthFill fill_;
  Surroundings surroundings_;
  std::vector<int> areas_;
  std::vector<std::int16_t> step_of_depth_; /* for every depth, see make_steps() */
  double step_unit_m_ = 0, step_noise_ = -1;
};

} // namespace rangecast
