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

const Status kFailed = {StatusCode::kNoSpace, "background subtraction: OpenCV failed"};

} // namespace

void
Segmenter::classify (const ConstRangeImage &image, const BackgroundModel &background,
    double depth_unit_m, const SegmentationSettings &settings)
{
  ClassLimits limits = {settings.cue != Cue::kDepth, settings.cue != Cue::kColour,
      settings.cue == Cue::kBoth && settings.fringe > 1, float (settings.noise_factor),
      float (settings.colour_threshold), float (settings.shadow), float (settings.highlight),
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
  nearer_.copyTo (opened_);
  remove_small (opened_, settings.min_area, 0);
  sides_.create (nearer_.size (), CV_8U);
  sides_.setTo (int (Side::kUnknown));
  sides_.setTo (int (Side::kBackground), placed_);
  /* Where the background had no depth, colour decides if it is conclusive. */
  cv::bitwise_or (seen_, blank_, inside_);
  cv::bitwise_or (inside_, other_, inside_);
  cv::bitwise_not (inside_, inside_);
  majority_.find (inside_, 2, inverse_);
  sides_.setTo (int (Side::kBackground), inverse_);
  sides_.setTo (int (Side::kForeground), opened_);
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
  majority_.find (inverse_, 2, opened_);
  cv::bitwise_or (inverse_, opened_, inverse_);
  surrounded_.copyTo (inside_);
  inside_.setTo (0, inverse_);
}

/* Values are not loaded by condition in these loops, so that vectors are. */
namespace {

/* Pixels of a row that are set in a mask of 0 and 255: 1, else 0. */
void
count_pixels (const std::uint8_t *__restrict mask, int n, std::uint16_t *__restrict counts)
{
  for (int x = 0; x < n; x++)
    counts[x] = mask[x] & 1;
}

/* Values of a row where a mask is set, else 0. */
void
choose_values (const float *__restrict values, const std::uint8_t *__restrict mask, int n,
    float *__restrict chosen)
{
  for (int x = 0; x < n; x++) {
    const float value = values[x];
    chosen[x] = mask[x] ? value : 0;
  }
}

/* Marks pixels of a mask where more than `half` of the pixels around are set. */
void
mark_majority (const std::uint16_t *__restrict counts, const std::uint8_t *__restrict mask,
    int half, int n, std::uint8_t *__restrict marks)
{
  for (int x = 0; x < n; x++) {
    const std::uint8_t pixel = mask[x];
    marks[x] = counts[x] > half ? pixel : std::uint8_t{0};
  }
}

/* Brightness of a row relative to the background, and that of some pixels around: sum and number.
 */
struct Brightness {
  const float *ratio, *tolerance, *sum;
  const std::uint16_t *count;
};

/* Whether brightness is that of the pixels around, of which there must be some. */
void
compare_brightness (const Brightness &b, int min_count, int n, std::uint8_t *__restrict like)
{
  const float *__restrict ratio = b.ratio, *__restrict tolerance = b.tolerance,
                          *__restrict sum = b.sum;
  const std::uint16_t *__restrict count = b.count;
  for (int x = 0; x < n; x++) {
    const auto pixels = float (count[x]);
    const float off = std::abs (ratio[x] * pixels - sum[x]), max = tolerance[x] * pixels;
    like[x] = (off <= max) & (count[x] >= min_count) ? kYes : 0;
  }
}

} // namespace

/* The brightness of pixels relative to that of pixels of a mask within reach.
 * @param min_count  least number of those
 * @param[out] like  255 = within tolerance */
void
Segmenter::compare_with_mean (const cv::Mat &mask, int reach, int min_count, cv::Mat &like)
{
  const int n = mask.cols;
  counts_.create (mask.size (), CV_16U);
  like.create (mask.size (), CV_8U);
  for_this_cpu ([&] {
    box_counts_.find (
        mask.size (), reach, cv::BORDER_CONSTANT,
        [&] (int y, std::uint16_t *counts) { count_pixels (mask.ptr (y), n, counts); },
        [&] (int y, const std::uint16_t *sums) {
          std::copy_n (sums, n, counts_.ptr<std::uint16_t> (y));
        });
    box_values_.find (
        mask.size (), reach, cv::BORDER_CONSTANT,
        [&] (int y, float *values) {
          choose_values (ratio_.ptr<float> (y), mask.ptr (y), n, values);
        },
        [&] (int y, const float *sums) {
          compare_brightness ({ratio_.ptr<float> (y), tolerance_.ptr<float> (y), sums,
                                  counts_.ptr<std::uint16_t> (y)},
              min_count, n, like.ptr (y));
        });
  });
}

/* Ignores shadows and light of any strength where depth matches the background all around. */
void
Segmenter::ignore_lighting (int reach)
{
  const int side = 2 * reach + 1, n = sides_.cols;
  cv::compare (sides_, int (Side::kForeground), opened_, cv::CMP_EQ);
  cv::dilate (opened_, opened_, square (side));
  inverse_.create (sides_.size (), CV_8U);
  for_this_cpu ([&] {
    box_counts_.find (
        sides_.size (), reach, cv::BORDER_DEFAULT,
        [&] (int y, std::uint16_t *counts) { count_pixels (placed_.ptr (y), n, counts); },
        [&] (int y, const std::uint16_t *counts) {
          mark_majority (counts, lit_.ptr (y), side * side / 2, n, inverse_.ptr (y));
        });
  });
  inverse_.setTo (0, opened_);
  other_.setTo (0, inverse_);
  /* A shadow that reaches the person's feet: pixels without depth have the brightness of the shadow
   * next to them. */
  if (cv::countNonZero (inverse_) == 0)
    return;
  constexpr int kEnough = 5; /* pixels */
  compare_with_mean (inverse_, reach, kEnough, opened_);
  cv::bitwise_and (opened_, lit_, opened_);
  opened_.setTo (0, surrounded_);
  cv::compare (sides_, int (Side::kForeground), inverse_, cv::CMP_EQ);
  opened_.setTo (0, inverse_);
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
  majority_.find (same_, 1, opened_); /* single pixels may match by chance */
  cv::bitwise_and (opened_, nearer_, same_);
}

void
Segmenter::join_cues (const SegmentationSettings &settings)
{
  if (settings.cue != Cue::kBoth || settings.fringe <= 1) {
    cv::bitwise_or (other_, nearer_, mask_);
    return;
  }
  find_sides (settings);
  ignore_lighting (settings.fringe);
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
  majority_.find (mask_, 1, opened_);
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
      for (int x = 0; x < image.roi.width; x++) {
        const std::uint16_t kept = depth[x];
        depth[x] = clear[x] ? kInvalidDepth : kept;
      }
    }
    remove_small_in_space (
        image, depth_unit_m, background.depth_noise () / depth_unit_m, settings.min_area);
    extend_depth (image, settings);
  } catch (const cv::Exception &) {
    return kFailed;
  }
  return {};
}

Status
Segmenter::clear_background (const RangeImage &image, const BackgroundModel &background,
    double depth_unit_m, const SegmentationSettings &settings)
{
  const Status status = decide (image, background, depth_unit_m, settings);
  return status.ok () ? clear (image, background, depth_unit_m, settings) : status;
}

} // namespace rangecast
