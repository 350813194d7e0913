/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <opencv2/core.hpp>

#include "../geometry/range_image.hpp"
#include "background_disparity.hpp"
#include "disparity_filter.hpp"
#include "disparity_refiner.hpp"
#include "matching.hpp"
#include "silhouette_filter.hpp"
#include "tiles.hpp"

namespace rangecast {

struct StereoSettings {
  MatchSettings match;
  double patch_tolerance = 1;      ///< share of its contrast that a patch may differ by; 0 = off
  double flying_pixel_step = 0.03; ///< share of the depth that neighbours may differ; 0 = off
  int silhouette_radius = 8;       ///< pixels around that say what is beside a silhouette; 0 = off
  int gap_width = 12;              ///< pixels; narrower holes in a surface are filled; 0 = off
  int refine = 2;                  ///< turns that take the noise off disparities; 0 = off
  /** How far to match, metres; 0 = to infinity. What lies beyond far is cleared, but must be
   *  matched so as not to be taken for something nearer. */
  double search_far_m = 0;
  /** Where nothing moves, pictures are matched that are the mean of so many; 1 = off. */
  int average = 10;
  double steady = 0; ///< 0 (off) to 1: how much depth is held still where nothing moves
  int n_threads = 0; ///< that match one pair; 0 = as many as there are cores

  friend bool operator== (const StereoSettings &, const StereoSettings &) = default;
};

/** What a rectified pair's disparities mean. */
struct PairGeometry {
  int width = 0, height = 0; ///< pixels, of both pictures
  double focal_baseline = 0; ///< pixels times metres
  double offset = 0;         ///< pixels, right minus left principal point
};

/** Matches rectified pairs and clears what cannot be right: the whole picture at all depths, or a
 *  part of it at some. Keeps its memory between pictures. */
class DisparityFinder {
public:
  /** @return kBadValue if near needs more disparity than there is picture, or what Matcher says */
  Status set (
      const PairGeometry &pair, const StereoSettings &settings, double near_m, double far_m);

  /** @param left, right  CV_8UC4, R G B x, of the pair's size
   *  @param roi          in the picture, not empty
   *  @param parts        of the picture, one below the other: where to look in the ROI; null =
   *  everywhere in it
   *  @param near_m, far_m  where to look, 0 = everywhere; with limits, what was seen beyond them
   *  while there were none is not taken for something else as long as it stays
   *  @return kNoSpace if OpenCV failed */
  Status find (const cv::Mat &left, const cv::Mat &right, const Roi &roi, double near_m,
      double far_m, const std::vector<cv::Rect> *parts = nullptr);

  /** CV_16U of the ROI, 1/16 pixel with equal principal points, 0 = none. */
  [[nodiscard]] const cv::Mat &disparity () const { return disparity_; }
  [[nodiscard]] cv::Mat &disparity () { return disparity_; }
  /** Disparity 1/16 pixel with equal principal points at that depth. */
  [[nodiscard]] double disparity_at (double depth_m) const
  {
    return 16 * pair_.focal_baseline / depth_m;
  }

  /** Disparities to look for, pixels: of the pictures as they are. */
  [[nodiscard]] int least () const { return least_; }
  [[nodiscard]] int most () const { return most_; }

private:
  Status choose_range (double near_m, double far_m);
  void place_window (const Roi &roi);
  void cut_window (int camera, const cv::Mat &picture);
  void choose_parts (const std::vector<cv::Rect> *parts);
  Status match ();
  void filter (const cv::Mat &left);
  void know_background (const cv::Mat &grey, int right_x);
  void take (const Roi &roi);

  PairGeometry pair_;
  StereoSettings settings_;
  Matcher all_, some_, *matcher_ = &all_;
  int least_ = 0, most_ = 0; /* disparities, pixels, of all there is to see */
  int far_ = 0;              /* disparity, 1/16 pixel, of the farthest depth of interest */
  DisparityFilter filter_;
  SilhouetteFilter silhouettes_;
  DisparityRefiner refiner_;
  BackgroundDisparity background_;
  cv::Rect window_at_, core_at_; /* of the picture: what is needed; the ROI and its margin */
  Pieces pieces_;                /* of the core: where to look */
  int missing_[2] = {0, 0};      /* columns that the window has beyond it, left and right */
  std::vector<cv::Rect> parts_;
  cv::Mat grey_, window_[2], raw_, disparity_;
  cv::Mat whole_[2];    /* as large as the picture: memory of what follows */
  cv::Mat core_, next_; /* CV_16S of the core: disparities, and what the next filter writes */
};

} // namespace rangecast
