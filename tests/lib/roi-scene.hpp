/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Background subtraction on the test scene, beside the truth: for tests and roi_bench. */
#pragma once

#include <algorithm>
#include <cmath>
#include <cstring>
#include <opencv2/imgproc.hpp>
#include <random>
#include <rangecast/roi/background.hpp>
#include <rangecast/roi/segmentation.hpp>
#include <rangecast/scene/scene.hpp>
#include <rangecast/stereo/stereo_depth.hpp>

namespace rangecast::testing {

struct RoiTrial {
  SceneSettings scene;
  SegmentationSettings settings;
  int view = 0;
  bool stereo = false;      ///< depth of StereoDepth instead of the exact one with noise
  double depth_noise = 0.2; ///< of the exact depth: as a stereo camera's disparity noise, pixels
  bool grey = false;        ///< of a camera without colour
  double exposure = 1;      ///< of the frames with the person; the background has 1
  int background_frames = 30;
  double frame_period_s = 1 / 30.0;
  double first_s = 1.5, step_s = 1.7; ///< of the frames with the person
  int frames = 12;

  /** The room that the targets are set for. */
  static RoiTrial standard ()
  {
    RoiTrial trial;
    trial.scene.far_m = 4.5;
    trial.scene.noise_sigma = 2.5;
    trial.scene.cast_shadow = 0.4;
    trial.scene.light_drift = 0.1;
    trial.scene.chair = true;
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
    for (cv::Mat *m : {&colour_, &other_, &plain_, &lit_})
      m->create (size_, CV_8UC4);
    depth_.create (size_, CV_16U);
    truth_.create (size_, CV_8U);
  }

  Status prepare ()
  {
    SceneSettings clean = trial_.scene;
    clean.noise_sigma = 0;
    clean.light_drift = 0;
    if (Status s = Scene::create (clean, shadowed_); !s.ok ())
      return s;
    if (Status s = Scene::create (trial_.scene, scene_); !s.ok ())
      return s;
    background_.reset (size_.width, size_.height);
    return trial_.stereo ? stereo_.set (scene_->rig ().views[trial_.view], {}) : Status ();
  }

  /** Learns the empty room. */
  Status learn ()
  {
    for (int i = 0; i < trial_.background_frames; i++) {
      take (i * trial_.frame_period_s, true);
      if (Status s = background_.learn (image ()); !s.ok ())
        return s;
    }
    background_.finish ();
    learnt_ = background_;
    return {};
  }

  /** One moment's colour, depth and truth. */
  void take (double time_s, bool empty)
  {
    const auto left = rgbx (colour_);
    (void)scene_->render (
        trial_.view, SceneCamera::kLeft, time_s, empty, left, depth_view (), bytes (truth_));
    if (trial_.stereo) {
      (void)scene_->render (trial_.view, SceneCamera::kRight, time_s, empty, rgbx (other_), {}, {});
      const cv::Mat copy = colour_.clone ();
      (void)stereo_.process (rgbx (copy), rgbx (other_), image ());
    } else {
      disturb_depth ();
    }
    if (trial_.grey || (!empty && trial_.exposure != 1))
      disturb_colour (empty ? 1 : trial_.exposure);
    time_s_ = time_s;
    empty_ = empty;
  }

  Status segment ()
  {
    return segmenter_.clear_background (
        image (), background_, scene_->rig ().views[0].depth_unit_m, trial_.settings);
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
    mark_shadow ();
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

  /* What the figure's shadow darkens by 5 % or more. */
  void mark_shadow ()
  {
    (void)shadowed_->render (
        trial_.view, SceneCamera::kLeft, time_s_, empty_, rgbx (plain_), {}, {});
    (void)shadowed_->render (trial_.view, SceneCamera::kLeft, time_s_, true, rgbx (lit_), {},
        {}); /* nobody, no shadow */
    shadow_.create (size_, CV_8U);
    for (int y = 0; y < size_.height; y++)
      for (int x = 0; x < size_.width; x++) {
        const int dark = plain_.at<cv::Vec4b> (y, x)[1], lit = lit_.at<cv::Vec4b> (y, x)[1];
        shadow_.at<std::uint8_t> (y, x) =
            truth_.at<std::uint8_t> (y, x) == 0 && dark < 0.95 * lit ? 255 : 0;
      }
  }

  RoiTrial trial_;
  cv::Size size_;
  std::unique_ptr<Scene> scene_, shadowed_;
  StereoDepth stereo_;
  BackgroundModel background_, learnt_;
  Segmenter segmenter_;
  std::mt19937 random_{1};
  cv::Mat colour_, other_, plain_, lit_, depth_, truth_, shadow_, kept_;
  double time_s_ = 0;
  bool empty_ = true;
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
