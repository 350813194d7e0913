/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "segmentation.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

namespace rangecast {
namespace {

constexpr std::uint8_t kForeground = 255;
/* The background's depth is known where it was valid in at least this share of its frames. */
constexpr float kKnownShare = 0.5f;

/* Neighbours further apart in depth do not belong to one island, metres. */
constexpr double kIslandStepM = 0.03;

/* Thresholds in the units of the pixels. */
struct Limits {
  bool use_colour, use_depth;
  float noise_factor, colour, shadow, highlight;
  float nearness; /* depth units */
};

bool
is_nearer (std::uint16_t depth, const BackgroundPixel &background, const Limits &limits)
{
  if (depth == kInvalidDepth || background.depth_share < kKnownShare)
    return false;
  const float noise = std::max (limits.nearness, limits.noise_factor * background.depth_spread);
  return float (depth) < background.depth - noise;
}

bool
has_other_colour (Rgbx colour, const BackgroundPixel &background, const Limits &limits)
{
  if (background.spread < 0)
    return true;
  const float *mean = background.mean;
  const float rgb[] = {float (colour.r), float (colour.g), float (colour.b)};
  /* One is added to all, so that black has a brightness to compare. */
  float mixed = 0, square = 0;
  for (int c = 0; c < 3; c++) {
    mixed += (rgb[c] + 1) * (mean[c] + 1);
    square += (mean[c] + 1) * (mean[c] + 1);
  }
  const float brightness = mixed / square;
  float distortion = 0;
  for (int c = 0; c < 3; c++) {
    const float d = rgb[c] + 1 - brightness * (mean[c] + 1);
    distortion += d * d;
  }
  const float chroma = std::max (limits.colour, limits.noise_factor * background.spread);
  if (distortion > chroma * chroma)
    return true;
  /* Darker or brighter beyond shadow and light; noise of dark pixels is no change of light. */
  const float noise = limits.noise_factor * std::max (background.spread, 2.f) / std::sqrt (square);
  return brightness < limits.shadow - noise || brightness > limits.highlight + noise;
}

} // namespace

void
Segmenter::classify (const RangeImage &image, const BackgroundModel &background,
    double depth_unit_m, const SegmentationSettings &settings)
{
  const Limits limits = {settings.cue != Cue::kDepth, settings.cue != Cue::kColour,
      float (settings.noise_factor), float (settings.colour_threshold), float (settings.shadow),
      float (settings.highlight), float (settings.depth_threshold_m / depth_unit_m)};
  mask_.create (image.roi.height, image.roi.width, CV_8U);
  nearer_only_.create (image.roi.height, image.roi.width, CV_8U);
  for (int y = 0; y < image.roi.height; y++) {
    const BackgroundPixel *behind = background.row (image.roi.y + y) + image.roi.x;
    const std::uint16_t *depth = image.depth.row (y);
    const Rgbx *colour = image.colour.row (y);
    auto mask = mask_.ptr<std::uint8_t> (y);
    auto nearer_only = nearer_only_.ptr<std::uint8_t> (y);
    for (int x = 0; x < image.roi.width; x++) {
      const bool nearer = limits.use_depth && is_nearer (depth[x], behind[x], limits);
      const bool other = limits.use_colour && has_other_colour (colour[x], behind[x], limits);
      mask[x] = other ? kForeground : 0;
      nearer_only[x] = nearer && !other ? kForeground : 0;
    }
  }
}

/* What only depth speaks for must be as wide as a thing is. Beside a silhouette stereo gives the
 * background that one camera does not see the depth of what hides it: narrow fringes of the
 * background's own colour. */
void
Segmenter::join_cues (Cue cue)
{
  constexpr int kFringe = 9; /* pixels */
  if (cue == Cue::kBoth) {
    if (kernel_.empty ())
      kernel_ = cv::getStructuringElement (cv::MORPH_RECT, cv::Size (kFringe, kFringe));
    cv::morphologyEx (nearer_only_, opened_, cv::MORPH_OPEN, kernel_);
    cv::bitwise_or (mask_, opened_, mask_);
  } else {
    cv::bitwise_or (mask_, nearer_only_, mask_);
  }
}

void
Segmenter::remove_small (cv::Mat &mask, int min_area)
{
  if (min_area <= 1)
    return;
  const int count = cv::connectedComponentsWithStats (mask, labels_, stats_, centroids_, 8, CV_32S);
  bool any = false;
  for (int i = 1; i < count; i++)
    any |= stats_.at<int> (i, cv::CC_STAT_AREA) < min_area;
  if (!any)
    return;
  for (int y = 0; y < mask.rows; y++) {
    auto row = mask.ptr<std::uint8_t> (y);
    const int *label = labels_.ptr<int> (y);
    for (int x = 0; x < mask.cols; x++)
      if (row[x] && stats_.at<int> (label[x], cv::CC_STAT_AREA) < min_area)
        row[x] = 0;
  }
}

/* Islands in space: patches beside the person in the picture, but well before or behind it. What
 * stereo makes of a silhouette is often such a patch. */
void
Segmenter::remove_small_in_space (const RangeImage &image, double depth_unit_m, int min_area)
{
  if (min_area <= 1)
    return;
  /* cv::filterSpeckles takes signed numbers only; half of a depth is one. */
  constexpr int kHalf = 2;
  halves_.create (image.roi.height, image.roi.width, CV_16S);
  for (int y = 0; y < image.roi.height; y++) {
    const std::uint16_t *depth = image.depth.row (y);
    auto half = halves_.ptr<std::int16_t> (y);
    for (int x = 0; x < image.roi.width; x++)
      half[x] = static_cast<std::int16_t> ((depth[x] + (depth[x] == 1)) / kHalf);
  }
  cv::filterSpeckles (
      halves_, kInvalidDepth, min_area - 1, kIslandStepM / depth_unit_m / kHalf, speckles_);
  for (int y = 0; y < image.roi.height; y++) {
    std::uint16_t *depth = image.depth.row (y);
    const auto half = halves_.ptr<std::int16_t> (y);
    for (int x = 0; x < image.roi.width; x++)
      if (half[x] == kInvalidDepth)
        depth[x] = kInvalidDepth;
  }
}

static void
clear_where (const cv::Mat &mask, const RangeImage &image)
{
  for (int y = 0; y < image.roi.height; y++) {
    const auto clear = mask.ptr<std::uint8_t> (y);
    std::uint16_t *depth = image.depth.row (y);
    for (int x = 0; x < image.roi.width; x++)
      if (clear[x])
        depth[x] = kInvalidDepth;
  }
}

Status
Segmenter::clear_background (const RangeImage &image, const BackgroundModel &background,
    double depth_unit_m, const SegmentationSettings &settings)
{
  const Roi &roi = image.roi;
  if (roi.empty ())
    return {};
  if (roi.x < 0 || roi.y < 0 || roi.x + roi.width > background.width () ||
      roi.y + roi.height > background.height ())
    return {StatusCode::kBadSize, "view " + std::to_string (image.view_id) +
                                      ": the ROI does not lie in the image of the background"};
  try {
    classify (image, background, depth_unit_m, settings);
    join_cues (settings.cue);
    remove_small (mask_, settings.min_area);
    cv::bitwise_not (mask_, inverse_);
    remove_small (inverse_, settings.max_hole);
    clear_where (inverse_, image);
    remove_small_in_space (image, depth_unit_m, settings.min_area);
  } catch (const cv::Exception &) {
    return {StatusCode::kNoSpace, "background subtraction: OpenCV failed"};
  }
  return {};
}

} // namespace rangecast
