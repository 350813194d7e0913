/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Background subtraction on the test scene, beside the truth: for tests and roi_bench. */
#pragma once

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <opencv2/imgproc.hpp>
#include <random>
#include <rangecast/roi/background.hpp>
#include <rangecast/roi/segmentation.hpp>
#include <rangecast/scene/scene.hpp>
#include <rangecast/stereo/stereo_depth.hpp>

namespace rangecast::testing {

/** Paints on an image, and on its depth unless that is empty, but not on the person. */
using RoomChange = std::function<void (
    cv::Mat &colour, cv::Mat &depth, const cv::Mat &person, double time_s, SceneCamera camera)>;

struct RoiTrial {
  SceneSettings scene;
  SegmentationSettings settings;
  int view = 0;
  bool stereo = false;      ///< depth of StereoDepth instead of the exact one with noise
  double depth_noise = 0.2; ///< of the exact depth: as a stereo camera's disparity noise, pixels
  bool grey = false;        ///< of a camera without colour
  RoomChange before;        ///< of the room when it is learnt
  double cast_shadow = 0;   ///< fraction of light that the person's shadow blocks
  double light_drift = 0;   ///< amplitude of a slow change of all light (40 s)
  double exposure = 1;      ///< of the frames with the person; the background has 1
  int background_frames = 30;
  bool person_learnt = false; ///< stands in the background
  double frame_period_s = 1 / 30.0;
  double first_s = 1.5, step_s = 1.7; ///< of the frames with the person
  int frames = 12;

  /** The room that the targets are set for. */
  static RoiTrial standard ()
  {
    RoiTrial trial;
    trial.scene.far_m = 4.5;
    trial.scene.noise_sigma = 2.5;
    trial.cast_shadow = 0.4;
    trial.light_drift = 0.1;
    return trial;
  }
};

/** Sums and worst cases over all frames. */
struct RoiScore {
  double worst_iou = 1, mean_iou = 0;      ///< of the valid pixels that are left with the true mask
  double mean_mask_iou = 0;                ///< the same of the decision, valid or not
  long shadow_pixels = 0, shadow_kept = 0; ///< in the cast shadow, not the person's
  long outside_kept = 0;                   ///< all that is kept beside the person, pixels
  long person_pixels = 0;
  long eaten_deep = 0; ///< missed pixels more than 1 pixel inside the silhouette
  double eaten = 0;    ///< how deep the deepest of the missed pixels lies, pixels
};

/** Renders, disturbs, segments and scores; keeps the pictures of the last frame. */
class RoiStage {
public:
  explicit RoiStage (const RoiTrial &trial)
      : trial_ (trial), size_ (trial.scene.width, trial.scene.height)
  {
    for (cv::Mat *m : {&colour_, &other_})
      m->create (size_, CV_8UC4);
    depth_.create (size_, CV_16U);
    truth_.create (size_, CV_8U);
    other_truth_.create (size_, CV_8U);
  }

  Status prepare ()
  {
    if (Status s = Scene::create (trial_.scene, scene_); !s.ok ())
      return s;
    background_.reset (size_.width, size_.height);
    return trial_.stereo ? stereo_.set (scene_->rig ().views[trial_.view], {}) : Status ();
  }

  /** Learns the empty room. */
  Status learn ()
  {
    for (int i = 0; i < trial_.background_frames; i++) {
      take (i * trial_.frame_period_s, !trial_.person_learnt, trial_.before);
      if (Status s = background_.learn (image ()); !s.ok ())
        return s;
    }
    background_.finish ();
    learnt_ = background_;
    return {};
  }

  /** One moment's colour, depth and truth. */
  void take (double time_s, bool empty, const RoomChange &change = {})
  {
    (void)scene_->render (trial_.view, SceneCamera::kLeft, time_s, empty, rgbx (colour_),
        depth_view (), bytes (truth_));
    if (change)
      change (colour_, depth_, truth_, time_s, SceneCamera::kLeft);
    const double light = 1 + trial_.light_drift * std::sin (2 * CV_PI * time_s / 40);
    shadow_ = shade (colour_, truth_, light, 0);
    if (trial_.stereo) {
      (void)scene_->render (
          trial_.view, SceneCamera::kRight, time_s, empty, rgbx (other_), {}, bytes (other_truth_));
      cv::Mat none;
      if (change)
        change (other_, none, other_truth_, time_s, SceneCamera::kRight);
      shade (other_, other_truth_, light, 11); /* the wall's disparity */
      const cv::Mat copy = colour_.clone ();
      (void)stereo_.process (rgbx (copy), rgbx (other_), image ());
    } else {
      disturb_depth ();
    }
    if (trial_.grey || (!empty && trial_.exposure != 1))
      disturb_colour (empty ? 1 : trial_.exposure);
    time_s_ = time_s;
  }

  Status segment ()
  {
    const Status status = decide ();
    return status.ok () ? clear () : status;
  }

  /** @name segment() in its parts @{ */
  Status decide ()
  {
    return segmenter_.decide (
        image (), background_, scene_->rig ().views[0].depth_unit_m, trial_.settings);
  }
  void adapt (double adapt_time_s)
  {
    RangeImage now = image ();
    now.capture_time_ns = std::uint64_t (time_s_ * 1e9);
    background_.adapt (now, bytes (segmenter_.quiet ()), segmenter_.light (), adapt_time_s);
  }
  Status clear ()
  {
    return segmenter_.clear (
        image (), background_, scene_->rig ().views[0].depth_unit_m, trial_.settings);
  }
  /** @} */

  /** Light of the present picture, as a share of what it was. */
  void dim (double share) { colour_.convertTo (colour_, -1, share); }
  /** Of the background as it was learnt. */
  [[nodiscard]] const float *first_mean (int x, int y) const { return learnt_.row (y)[x].mean; }

  void score (RoiScore &score)
  {
    cv::Mat kept, both, either, inside;
    cv::compare (depth_, 0, kept, cv::CMP_GT);
    cv::Mat truth = truth_ != 0;
    cv::distanceTransform (truth, inside, cv::DIST_C, 3, CV_32F);
    const double iou = overlap (kept, truth);
    score.worst_iou = std::min (score.worst_iou, iou);
    score.mean_iou += iou / trial_.frames;
    score.mean_mask_iou += overlap (segmenter_.mask (), truth) / trial_.frames;
    score.person_pixels += cv::countNonZero (truth);
    score.outside_kept += cv::countNonZero (kept & ~truth);
    score.shadow_pixels += cv::countNonZero (shadow_);
    score.shadow_kept += cv::countNonZero (shadow_ & kept);
    cv::Mat missed = truth & ~kept;
    inside.setTo (0, ~missed);
    double deepest;
    cv::minMaxLoc (inside, nullptr, &deepest);
    score.eaten = std::max (score.eaten, deepest);
    score.eaten_deep += cv::countNonZero (inside > 1);
    kept_ = kept;
  }

  RangeImage image ()
  {
    return {trial_.view, {0, 0, size_.width, size_.height}, depth_view (), rgbx (colour_), 0};
  }
  [[nodiscard]] const cv::Mat &colour () const { return colour_; }
  [[nodiscard]] const cv::Mat &depth () const { return depth_; }
  [[nodiscard]] const cv::Mat &truth () const { return truth_; }
  [[nodiscard]] const cv::Mat &kept () const { return kept_; }
  [[nodiscard]] const cv::Mat &shadow () const { return shadow_; }
  BackgroundModel &background () { return background_; }
  Segmenter &segmenter () { return segmenter_; }

private:
  static ImageView<Rgbx> rgbx (const cv::Mat &m)
  {
    return {reinterpret_cast<Rgbx *> (m.data), m.cols, m.rows, std::ptrdiff_t (m.step)};
  }
  static ImageView<std::uint8_t> bytes (const cv::Mat &m)
  {
    return {m.data, m.cols, m.rows, std::ptrdiff_t (m.step)};
  }
  ImageView<std::uint16_t> depth_view ()
  {
    return {depth_.ptr<std::uint16_t> (), depth_.cols, depth_.rows, std::ptrdiff_t (depth_.step)};
  }
  static double overlap (const cv::Mat &a, const cv::Mat &b)
  {
    const int either = cv::countNonZero (a | b);
    return either ? double (cv::countNonZero (a & b)) / either : 1;
  }

  void disturb_colour (double exposure)
  {
    for (int y = 0; y < colour_.rows; y++)
      for (int x = 0; x < colour_.cols; x++) {
        auto &p = colour_.at<cv::Vec4b> (y, x);
        const double grey = 0.299 * p[0] + 0.587 * p[1] + 0.114 * p[2];
        for (int c = 0; c < 3; c++)
          p[c] = cv::saturate_cast<std::uint8_t> (exposure * (trial_.grey ? grey : p[c]));
      }
  }

  /* As a stereo camera sees it: error of depth = z^2 * error of disparity / (f * baseline). */
  void disturb_depth ()
  {
    const View &view = scene_->rig ().views[0];
    const double share =
        trial_.depth_noise * view.depth_unit_m / (view.intrinsics.fx * trial_.scene.baseline_m);
    std::normal_distribution<double> normal;
    for (int y = 0; y < depth_.rows; y++)
      for (int x = 0; x < depth_.cols; x++)
        if (auto &d = depth_.at<std::uint16_t> (y, x); d)
          d = std::uint16_t (
              std::clamp (std::lround (d + share * d * d * normal (random_)), 1L, 65535L));
  }

  /* Changes all light, and lets the person's silhouette fall onto the wall as a shadow with a soft
   * rim, to the right and down: a little bluer, as the light of the sky is.
   * @return what the shadow darkens by 5 % or more */
  cv::Mat shade (cv::Mat &colour, const cv::Mat &person, double light, int disparity) const
  {
    const cv::Matx23d by (1, 0, 70 - disparity, 0, 1, 25);
    cv::Mat dark;
    cv::warpAffine (truth_ != 0, dark, by, size_);
    cv::GaussianBlur (dark, dark, {}, 2);
    dark.setTo (0, person != 0);
    dark.convertTo (dark, CV_32F, trial_.cast_shadow / 255);
    for (int y = 0; y < size_.height; y++)
      for (int x = 0; x < size_.width; x++)
        for (int c = 0; c < 3; c++) {
          auto &level = colour.at<cv::Vec4b> (y, x)[c];
          const double tint[] = {1, 0.98, 0.94};
          level = cv::saturate_cast<std::uint8_t> (
              level * light * (1 - dark.at<float> (y, x) * tint[c]));
        }
    return dark > 0.05;
  }

  RoiTrial trial_;
  cv::Size size_;
  std::unique_ptr<Scene> scene_;
  StereoDepth stereo_;
  BackgroundModel background_, learnt_;
  Segmenter segmenter_;
  std::mt19937 random_{1};
  cv::Mat colour_, other_, depth_, truth_, other_truth_, shadow_, kept_;
  double time_s_ = 0;
};

/** Learns the empty room and scores the frames with people. */
inline Status
run_roi_trial (RoiStage &stage, const RoiTrial &trial, RoiScore &score)
{
  Status s = stage.prepare ();
  if (s.ok ())
    s = stage.learn ();
  for (int i = 0; s.ok () && i < trial.frames; i++) {
    stage.take (trial.first_s + i * trial.step_s, false);
    s = stage.segment ();
    stage.score (score);
  }
  return s;
}

} // namespace rangecast::testing
