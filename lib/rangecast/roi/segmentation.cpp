/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "segmentation.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <opencv2/imgproc.hpp>

#include "../base/simd.hpp"
#include "classification.hpp"

namespace rangecast {
namespace {

constexpr std::uint8_t kYes = 255;
/* Search range around a pixel for foreground or background, relative to the width. */
constexpr double kSight = 0.125;
/* Distance from the foreground at which pixels without depth may update the background, pixels.
 */
constexpr int kGuard = 7;

cv::Mat
square (int side)
{
  return cv::getStructuringElement (cv::MORPH_RECT, cv::Size (side, side));
}

/* Equals cv::medianBlur for masks of 0 and 255, but is faster. */
void
find_majority (const cv::Mat &mask, cv::Mat &to, int side)
{
  cv::blur (mask, to, {side, side}, {-1, -1}, cv::BORDER_REPLICATE);
  cv::compare (to, 127, to, cv::CMP_GT);
}

const Status kFailed = {StatusCode::kNoSpace, "background subtraction: OpenCV failed"};

} // namespace

void
Segmenter::classify (const ConstRangeImage &image, const BackgroundModel &background,
    double depth_unit_m, const SegmentationSettings &settings)
{
  ClassLimits limits = {settings.cue != Cue::kDepth, settings.cue != Cue::kColour,
      settings.cue == Cue::kBoth && settings.fringe > 1, float (settings.colour_threshold),
      float (settings.shadow), float (settings.highlight),
      float (settings.depth_threshold_m / depth_unit_m), float (background.depth_noise ()),
      {1, 1, 1}};
  if (settings.follow_light && limits.use_colour)
    estimate_light (image, background, limits, light_);
  else
    light_ = {1, 1, 1};
  limits.light = light_;
  for (cv::Mat *m : {&other_, &nearer_, &same_, &calm_, &lit_, &blank_, &placed_, &seen_})
    m->create (image.roi.height, image.roi.width, CV_8U);
  for (cv::Mat *m : {&ratio_, &tolerance_})
    m->create (image.roi.height, image.roi.width, CV_32F);
  for (int y = 0; y < image.roi.height; y++)
    classify_row ({background.row (image.roi.y + y) + image.roi.x,
                      background.inferred_depth (image.roi.y + y) + image.roi.x,
                      image.depth.row (y), image.colour.row (y)},
        image.roi.width, limits,
        {other_.ptr (y), nearer_.ptr (y), same_.ptr (y), calm_.ptr (y), lit_.ptr (y),
            blank_.ptr (y), placed_.ptr (y), seen_.ptr (y), ratio_.ptr<float> (y),
            tolerance_.ptr<float> (y)});
}

/* Classifies pixels by depth, or by colour where depth is unknown; then those that are surrounded.
 * Small patches of depth are ignored. */
void
Segmenter::find_sides (const SegmentationSettings &settings)
{
  sides_.create (nearer_.size (), CV_8U);
  sides_.setTo (int (Side::kUnknown));
  cv::compare (placed_, 1, inverse_, cv::CMP_GT);
  sides_.setTo (int (Side::kBackground), inverse_);
  /* Where the background had no depth, colour decides if it is conclusive. */
  cv::bitwise_or (seen_, blank_, inside_);
  cv::bitwise_or (inside_, other_, inside_);
  cv::bitwise_not (inside_, inside_);
  find_majority (inside_, inverse_, 5);
  sides_.setTo (int (Side::kBackground), inverse_);
  sides_.setTo (int (Side::kForeground), near_);
  const int reach = std::clamp (int (kSight * sides_.cols), 16, 255);
  surroundings_.find_inside (sides_, reach, surrounded_);
  /* A region that matches the background conclusively is a hole through which it is seen. Stereo
   * finds the depth of wide ones. */
  const int wide = 2 * settings.fringe + 1;
  cv::morphologyEx (surrounded_, opened_, cv::MORPH_OPEN, square (wide));
  cv::bitwise_and (opened_, seen_, opened_);
  cv::bitwise_or (opened_, blank_, opened_);
  cv::bitwise_not (opened_, inverse_);
  cv::bitwise_and (inverse_, calm_, inverse_);
  cv::compare (inverse_, 0, inverse_, cv::CMP_GT);
  find_majority (inverse_, opened_, 5);
  cv::bitwise_or (inverse_, opened_, inverse_);
  surrounded_.copyTo (inside_);
  inside_.setTo (0, inverse_);
}

/* The brightness of pixels relative to that of pixels of a mask within reach.
 * @param min_count  least number of those
 * @param[out] like  255 = within tolerance */
void
Segmenter::compare_with_mean (const cv::Mat &mask, int reach, int min_count, cv::Mat &like)
{
  const cv::Size window = {2 * reach + 1, 2 * reach + 1};
  cv::bitwise_and (mask, 1, like);
  cv::boxFilter (like, counts_, CV_16U, window, {-1, -1}, false, cv::BORDER_CONSTANT);
  chosen_.create (mask.size (), CV_32F);
  chosen_.setTo (0);
  ratio_.copyTo (chosen_, mask);
  cv::boxFilter (chosen_, sums_, CV_32F, window, {-1, -1}, false, cv::BORDER_CONSTANT);
  for_this_cpu ([&] {
    for (int y = 0; y < mask.rows; y++) {
      const float *ratio = ratio_.ptr<float> (y), *tolerance = tolerance_.ptr<float> (y),
                  *sum = sums_.ptr<float> (y);
      const auto count = counts_.ptr<std::uint16_t> (y);
      std::uint8_t *__restrict to = like.ptr (y);
      for (int x = 0; x < mask.cols; x++) {
        const auto n = float (count[x]);
        const bool within = std::abs (ratio[x] * n - sum[x]) <= tolerance[x] * n;
        to[x] = within & (count[x] >= min_count) ? kYes : 0;
      }
    }
  });
}

/* Ignores colour where depth matches the background all around: shadows, a lamp, a screen. inverse_
 * is where. */
void
Segmenter::ignore_colour (int reach)
{
  const int side = 2 * reach + 1;
  cv::dilate (near_, opened_, square (side));
  cv::bitwise_and (placed_, 1, inverse_);
  cv::boxFilter (inverse_, counts_, CV_16U, {side, side}, {-1, -1}, false);
  cv::compare (counts_, side * side / 2, inverse_, cv::CMP_GT);
  cv::bitwise_and (inverse_, other_, inverse_);
  inverse_.setTo (0, opened_);
  other_.setTo (0, inverse_);
}

/* A shadow that reaches the person's feet: pixels without depth have the brightness of the shadow
 * next to them. */
void
Segmenter::ignore_shadows (int reach)
{
  cv::bitwise_and (inverse_, lit_, inverse_);
  if (cv::countNonZero (inverse_) == 0)
    return;
  constexpr int kEnough = 5; /* pixels */
  compare_with_mean (inverse_, reach, kEnough, opened_);
  cv::bitwise_and (opened_, lit_, opened_);
  opened_.setTo (0, surrounded_);
  opened_.setTo (0, near_);
  other_.setTo (0, opened_);
}

/* Of the pixels with the background's hue, only those with the brightness of background within
 * reach stay `same`, in shadow or not. Pixels without background within reach are marked in
 * inverse_. */
void
Segmenter::find_same (int reach)
{
  cv::bitwise_or (other_, nearer_, opened_);
  cv::bitwise_or (opened_, surrounded_, opened_);
  cv::compare (opened_, 0, opened_, cv::CMP_EQ);
  compare_with_mean (opened_, reach, 1, inverse_);
  cv::bitwise_and (same_, inverse_, same_);
  cv::compare (counts_, 0, inverse_, cv::CMP_EQ);
  find_majority (same_, opened_, 3); /* single pixels may match by chance */
  cv::bitwise_and (opened_, nearer_, same_);
}

void
Segmenter::join_cues (const SegmentationSettings &settings)
{
  const bool stereo = settings.cue == Cue::kBoth && settings.fringe > 1;
  if (settings.cue == Cue::kBoth) {
    nearer_.copyTo (near_);
    remove_small (near_, settings.min_area, 0);
    if (stereo)
      find_sides (settings);
    ignore_colour (stereo ? settings.fringe : kGuard);
  }
  if (!stereo) {
    cv::bitwise_or (other_, nearer_, mask_);
    return;
  }
  ignore_shadows (settings.fringe);
  find_same (settings.fringe);
  cv::bitwise_and (inverse_, nearer_, inverse_);
  cv::bitwise_or (inverse_, same_, inverse_); /* wide where it extends into the object */
  cv::morphologyEx (inverse_, opened_, cv::MORPH_OPEN,
      square (settings.fringe | 1)); /* an even one would shift by half a pixel */
  cv::bitwise_not (same_, inverse_);
  cv::bitwise_and (nearer_, inverse_, mask_); /* nearer, and unlike the background */
  cv::bitwise_or (mask_, other_, mask_);
  cv::bitwise_or (mask_, opened_, mask_);
  cv::bitwise_or (mask_, inside_, mask_);
}

/* Removes components of fewer than min_area pixels, and all but the `keep` largest. */
void
Segmenter::remove_small (cv::Mat &mask, int min_area, int keep)
{
  if (min_area <= 1 && keep <= 0)
    return;
  components_.clear ();
  for (int y = 0; y < mask.rows; y++)
    components_.add_mask_row (mask.ptr (y), mask.cols);
  areas_.clear ();
  for (const ConnectedComponents::Run &run : components_.runs ())
    if (components_.is_root (run))
      areas_.push_back (run.size);
  int min_kept = min_area;
  if (keep > 0 && keep < static_cast<int> (areas_.size ())) {
    std::nth_element (areas_.begin (), areas_.begin () + keep - 1, areas_.end (), std::greater ());
    min_kept = std::max (min_kept, areas_[static_cast<std::size_t> (keep - 1)]);
  }
  if (std::ranges::none_of (areas_, [min_kept] (int area) { return area < min_kept; }))
    return;
  for (int y = 0; y < mask.rows; y++)
    for (const ConnectedComponents::Run &run : components_.row (y))
      if (components_.size_of (run) < min_kept)
        std::fill (mask.ptr (y) + run.x0, mask.ptr (y) + run.x1, std::uint8_t{0});
}

void
Segmenter::find_quiet ()
{
  cv::dilate (mask_, opened_, square (2 * kGuard + 1));
  cv::bitwise_not (opened_, opened_);
  cv::bitwise_and (calm_, opened_, quiet_);
  cv::bitwise_and (placed_, opened_, opened_);
  cv::min (opened_, BackgroundModel::kDifferent, opened_);
  cv::max (quiet_, opened_, quiet_);
  cv::compare (calm_, kYes, opened_, cv::CMP_EQ);
  cv::bitwise_and (opened_, inverse_, opened_);
  cv::bitwise_or (quiet_, opened_, quiet_);
}

/* Maps depth to a scale on which 128 is the maximum difference of neighbours on one surface: 30 mm,
 * or the noise between two pixels, which grows with the square of depth. */
void
Segmenter::make_steps (double depth_unit_m, double noise)
{
  if (step_unit_m_ == depth_unit_m && step_noise_ == noise)
    return;
  constexpr double kIslandStepM = 0.03, kNoiseFactor = 6, kStep = 128;
  step_unit_m_ = depth_unit_m;
  step_noise_ = noise;
  step_of_depth_.resize (65536);
  double sum = 0;
  for (int d = 1; d < 65536; d++) {
    const double z = d * depth_unit_m;
    sum += kStep * depth_unit_m / std::max (kIslandStepM, kNoiseFactor * noise * z * z);
    step_of_depth_[static_cast<std::size_t> (d)] =
        static_cast<std::int16_t> (std::clamp (sum, 1.0, 32767.0));
  }
}

/* Removes components in space: patches next to the person in the image, but well in front or
 * behind. Stereo often produces them at silhouettes. */
void
Segmenter::remove_small_in_space (
    const RangeImage &image, double depth_unit_m, double noise, int min_area)
{
  if (min_area <= 1)
    return;
  constexpr int kStep = 128; /* as in make_steps() */
  make_steps (depth_unit_m, noise);
  steps_.create (image.roi.height, image.roi.width, CV_16S);
  for (int y = 0; y < image.roi.height; y++) {
    const std::uint16_t *depth = image.depth.row (y);
    auto step = steps_.ptr<std::int16_t> (y);
    for (int x = 0; x < image.roi.width; x++)
      step[x] = step_of_depth_[depth[x]];
  }
  components_.clear ();
  for (int y = 0; y < image.roi.height; y++)
    components_.add_level_row (steps_.ptr<std::int16_t> (y),
        steps_.ptr<std::int16_t> (std::max (0, y - 1)), 0, image.roi.width, 1, kStep);
  for (int y = 0; y < image.roi.height; y++)
    for (const ConnectedComponents::Run &run : components_.row (y))
      if (components_.size_of (run) < min_area)
        std::fill (image.depth.row (y) + run.x0, image.depth.row (y) + run.x1, kInvalidDepth);
}

/* Not into single pixels that stick out of the silhouette, nor, with colour, where the image
 * matches the background: a closed hole may be a real one. Farther where the hue differs, because a
 * shadow's does not. */
void
Segmenter::extend_depth (const RangeImage &image, const SegmentationSettings &settings)
{
  if (settings.fill <= 0)
    return;
  find_majority (mask_, opened_, 3);
  cv::bitwise_and (opened_, mask_, opened_);
  if (settings.cue != Cue::kDepth)
    opened_.setTo (0, calm_);
  fill_.fill (image, opened_, settings.fill);
  if (settings.cue != Cue::kDepth) {
    constexpr int kFarther = 4;
    opened_.setTo (0, lit_);
    cv::bitwise_and (opened_, other_, opened_);
    fill_.fill (image, opened_, kFarther * settings.fill);
  }
  if (settings.cue == Cue::kBoth && settings.fringe > 1) {
    cv::bitwise_and (mask_, inside_, opened_);
    fill_.fill (image, opened_, opened_.cols);
    fill_.fill (image, opened_, opened_.cols, true);
  }
}

Status
Segmenter::decide (const ConstRangeImage &image, const BackgroundModel &background,
    double depth_unit_m, const SegmentationSettings &settings)
{
  const Roi &roi = image.roi;
  if (!background.covers (roi))
    return {StatusCode::kBadSize, "view " + std::to_string (image.view_id) +
                                      ": the ROI does not lie in the image of the background"};
  if (roi.empty ())
    return {};
  try {
    classify (image, background, depth_unit_m, settings);
    join_cues (settings);
    remove_small (mask_, settings.min_area, settings.max_people);
    cv::bitwise_not (mask_, inverse_);
    remove_small (inverse_, settings.max_hole, 0);
    cv::bitwise_not (inverse_, mask_);
    find_quiet ();
  } catch (const cv::Exception &) {
    return kFailed;
  }
  return {};
}

Status
Segmenter::clear (const RangeImage &image, const BackgroundModel &background, double depth_unit_m,
    const SegmentationSettings &settings)
{
  if (image.roi.empty ())
    return {};
  try {
    for (int y = 0; y < image.roi.height; y++) {
      const auto clear = inverse_.ptr<std::uint8_t> (y);
      std::uint16_t *depth = image.depth.row (y);
      for (int x = 0; x < image.roi.width; x++)
        depth[x] = clear[x] ? kInvalidDepth : depth[x];
    }
    remove_small_in_space (
        image, depth_unit_m, background.depth_noise () / depth_unit_m, settings.min_area);
    extend_depth (image, settings);
  } catch (const cv::Exception &) {
    return kFailed;
  }
  return {};
}

} // namespace rangecast
