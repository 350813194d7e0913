/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "segmentation.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

namespace rangecast {
namespace {

constexpr std::uint8_t kYes = 255;
/* Fraction of frames with valid depth from which the background's depth is known; below it, the
 * scene there is out of range. From kSteadyShare on it is reliable. */
constexpr float kKnownShare = 0.05f, kSteadyShare = 0.5f;
/* Factor on the limits of shadow and highlight where depth matches the background. */
constexpr float kConfirmed = 2;
/* A pixel matches the background within this number of standard deviations (at least kMinSpread
 * grey levels) and this fraction of its brightness. */
constexpr float kSameFactor = 2.5f, kMinSpread = 1.5f, kSameShare = 0.08f;
constexpr float kBurntOut = 250; /* grey levels */
/* Relative noise of brightness above which the background's colour is not used. */
constexpr float kVague = 0.3f;
/* Search range around a pixel for foreground or background, relative to the width. */
constexpr double kSight = 0.125;
/* Distance from the foreground at which pixels without depth may update the background, pixels.
 */
constexpr int kGuard = 7;
constexpr std::uint8_t kPerhaps = 128;

/* Thresholds in units of the pixels. */
struct Limits {
  bool use_colour, use_depth;
  bool doubt_depth; /* depth comes from stereo: unreliable without texture */
  float noise_factor, colour, shadow, highlight;
  float nearness;    /* depth units */
  float depth_noise; /* BackgroundModel::depth_noise() */
  std::array<float, 3> light;
};

/* kSomewhere: valid depth where the background had none. */
enum class Where { kUnknown, kBackground, kSomewhere, kNearer };

Where
place_of (
    std::uint16_t depth, const BackgroundPixel &background, float inferred, const Limits &limits)
{
  if (depth == kInvalidDepth)
    return Where::kUnknown;
  if (background.depth_share < kKnownShare) {
    if (inferred <= 0)
      return Where::kSomewhere;
    const float doubt =
        std::max (limits.nearness, limits.noise_factor * limits.depth_noise * inferred * inferred);
    return float (depth) < inferred - doubt   ? Where::kSomewhere
           : float (depth) < inferred + doubt ? Where::kBackground
                                              : Where::kUnknown;
  }
  /* Where stereo alternates between two surfaces, their distance is not noise: only depth in front
   * of the nearer one is foreground. */
  const float sensor = limits.depth_noise * background.depth * background.depth;
  const float wavers = background.depth - background.nearest + limits.noise_factor * sensor;
  /* Stereo is stable without texture, too, but its error grows when a shadow adds texture. */
  float noise = std::max ({limits.nearness, limits.noise_factor * sensor,
      std::min (limits.noise_factor * background.depth_spread, wavers)});
  if (background.depth_share < kSteadyShare)
    noise *= 2; /* learnt from few frames */
  if (float (depth) < background.depth - noise)
    return Where::kNearer;
  return float (depth) < background.depth + noise ? Where::kBackground : Where::kUnknown;
}

/* Comparison of a colour with the background's under the current light. */
struct Comparison {
  float distortion; /* chromatic, grey levels, squared */
  float brightness; /* relative to the background's */
  float noise;      /* standard deviation of brightness */
};

Comparison
compare (Rgbx colour, const BackgroundPixel &background, const Limits &limits)
{
  /* Offset by one, so that black has a brightness. */
  const float rgb[] = {float (colour.r) + 1, float (colour.g) + 1, float (colour.b) + 1};
  float mean[3], mixed = 0, square = 0, distortion = 0;
  for (int c = 0; c < 3; c++) {
    mean[c] = background.mean[c] * limits.light[c] + 1;
    if (rgb[c] > kBurntOut) /* saturated: only a lower bound is known */
      mean[c] = std::min (mean[c], 256.f);
    mixed += rgb[c] * mean[c];
    square += mean[c] * mean[c];
  }
  const float brightness = mixed / square;
  for (int c = 0; c < 3; c++) {
    const float d = rgb[c] - brightness * mean[c];
    distortion += d * d;
  }
  return {distortion, brightness, std::max (background.spread, kMinSpread) / std::sqrt (square)};
}

bool
has_other_hue (const Comparison &c, const BackgroundPixel &background, const Limits &limits)
{
  const float chroma = std::max (limits.colour, limits.noise_factor * background.spread);
  return c.distortion > chroma * chroma;
}

bool
has_other_light (const Comparison &c, bool confirmed, const Limits &limits)
{
  const float beyond = confirmed ? kConfirmed : 1;
  const float noise = limits.noise_factor * c.noise;
  return c.brightness < limits.shadow / beyond - noise ||
         c.brightness > 1 + beyond * (limits.highlight - 1) + noise;
}

bool
has_same_hue (const Comparison &c, const BackgroundPixel &background)
{
  constexpr float kChannels = 1.6f; /* the distortion has two degrees of freedom */
  const float chroma = kSameFactor * kChannels * std::max (background.spread, kMinSpread);
  return c.distortion < chroma * chroma;
}

/* Saturated, without texture. */
bool
is_burnt_out (const BackgroundPixel &background)
{
  return std::ranges::all_of (background.mean, [] (float level) { return level > kBurntOut; });
}

/* Histogram of brightness ratios from 1/4 to 4, to find the mode. */
class RatioPeak {
public:
  void add (float ratio)
  {
    const int bin = static_cast<int> (std::floor (std::log2 (ratio) * kPerOctave)) + kBins / 2;
    if (bin >= 0 && bin < kBins)
      counts_[bin]++;
    all_++;
  }
  /** @return the mode if at least a sixth of all samples share it, else the fallback */
  [[nodiscard]] float peak (float fallback) const
  {
    constexpr int kReach = 3;
    int best = 0, best_sum = 0;
    for (int i = kReach; i < kBins - kReach; i++) {
      int sum = 0;
      for (int k = -kReach; k <= kReach; k++)
        sum += counts_[i + k];
      if (sum > best_sum)
        best = i, best_sum = sum;
    }
    if (best_sum == 0 || best_sum * 6 < all_)
      return fallback;
    float mean = 0;
    for (int k = -kReach; k <= kReach; k++)
      mean += float (counts_[best + k]) * (float (best + k - kBins / 2) + 0.5f);
    return std::exp2 (mean / float (best_sum) / kPerOctave);
  }

private:
  static constexpr int kPerOctave = 32, kBins = 4 * kPerOctave;
  std::array<int, kBins> counts_{};
  int all_ = 0;
};

/* Estimated from every sixteenth pixel that is not nearer than the background, without very dark
 * and saturated ones. */
void
estimate_light (const ConstRangeImage &image, const BackgroundModel &background,
    const Limits &limits, std::array<float, 3> &light)
{
  constexpr int kLightStep = 4;
  RatioPeak ratios[3];
  const auto usable = [] (float level) { return level >= 16 && level <= 240; };
  for (int y = 0; y < image.roi.height; y += kLightStep) {
    const BackgroundPixel *behind = background.row (image.roi.y + y) + image.roi.x;
    const float *inferred = background.inferred_depth (image.roi.y + y) + image.roi.x;
    const Rgbx *colour = image.colour.row (y);
    for (int x = 0; x < image.roi.width; x += kLightStep) {
      if (behind[x].spread < 0 ||
          (limits.use_depth && place_of (image.depth.at (x, y), behind[x], inferred[x], limits) >=
                                   Where::kSomewhere))
        continue;
      const float rgb[] = {float (colour[x].r), float (colour[x].g), float (colour[x].b)};
      for (int c = 0; c < 3; c++)
        if (usable (behind[x].mean[c]) && usable (rgb[c]))
          ratios[c].add (rgb[c] / behind[x].mean[c]);
    }
  }
  for (int c = 0; c < 3; c++)
    light[c] = ratios[c].peak (light[c]);
}

const Status kFailed = {StatusCode::kNoSpace, "background subtraction: OpenCV failed"};

} // namespace

void
Segmenter::classify (const ConstRangeImage &image, const BackgroundModel &background,
    double depth_unit_m, const SegmentationSettings &settings)
{
  Limits limits = {settings.cue != Cue::kDepth, settings.cue != Cue::kColour,
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
  for (int y = 0; y < image.roi.height; y++) {
    const BackgroundPixel *behind = background.row (image.roi.y + y) + image.roi.x;
    const float *inferred = background.inferred_depth (image.roi.y + y) + image.roi.x;
    const std::uint16_t *depth = image.depth.row (y);
    const Rgbx *colour = image.colour.row (y);
    std::uint8_t *other = other_.ptr (y), *nearer = nearer_.ptr (y), *same = same_.ptr (y),
                 *calm = calm_.ptr (y), *lit = lit_.ptr (y), *blank = blank_.ptr (y),
                 *placed = placed_.ptr (y), *seen = seen_.ptr (y);
    auto ratio = ratio_.ptr<float> (y), tolerance = tolerance_.ptr<float> (y);
    for (int x = 0; x < image.roi.width; x++) {
      Where where =
          limits.use_depth ? place_of (depth[x], behind[x], inferred[x], limits) : Where::kUnknown;
      const bool unseen = behind[x].spread < 0; /* treated as a different colour */
      const Comparison c =
          unseen || !limits.use_colour ? Comparison{} : compare (colour[x], behind[x], limits);
      const bool alike = !unseen && has_same_hue (c, behind[x]);
      const bool hue = unseen || has_other_hue (c, behind[x], limits);
      const bool light = has_other_light (c, where == Where::kBackground, limits);
      ratio[x] = c.brightness;
      tolerance[x] = kSameShare + kSameFactor * c.noise;
      other[x] = limits.use_colour && (hue || light) ? kYes : 0;
      lit[x] = light && !hue ? kYes : 0;
      placed[x] = where == Where::kBackground ? kYes : 0;
      seen[x] = behind[x].depth_share >= kSteadyShare ? kYes : 0;
      blank[x] = is_burnt_out (behind[x]) || tolerance[x] > kVague ? kYes : 0;
      same[x] = alike ? kYes : 0;
      const bool quiet = alike && std::abs (c.brightness - 1) < tolerance[x];
      /* Stereo sometimes finds false depth without texture; colour is more reliable there. */
      const bool textureless = limits.doubt_depth && is_burnt_out (behind[x]);
      if (where == Where::kSomewhere || (where == Where::kNearer && textureless))
        where = quiet && limits.use_colour ? Where::kUnknown : Where::kNearer;
      nearer[x] = where == Where::kNearer ? kYes : 0;
      calm[x] = where == Where::kNearer || (limits.use_colour && !quiet) ? 0
                : where == Where::kBackground                            ? kYes
                                                                         : kPerhaps;
    }
  }
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
  cv::bitwise_or (seen_, blank_, by_colour_);
  cv::bitwise_or (by_colour_, other_, by_colour_);
  cv::bitwise_not (by_colour_, by_colour_);
  cv::medianBlur (by_colour_, by_colour_, 5);
  sides_.setTo (int (Side::kBackground), by_colour_);
  sides_.setTo (int (Side::kForeground), opened_);
  const int reach = std::clamp (int (kSight * sides_.cols), 16, 255);
  surroundings_.find_inside (sides_, reach, surrounded_);
  /* A region that matches the background conclusively is a hole through which it is seen. Stereo
   * finds the depth of wide ones. */
  const int wide = 2 * settings.fringe + 1;
  cv::morphologyEx (surrounded_, opened_, cv::MORPH_OPEN,
      cv::getStructuringElement (cv::MORPH_RECT, cv::Size (wide, wide)));
  cv::bitwise_and (opened_, seen_, opened_);
  cv::bitwise_or (opened_, blank_, opened_);
  cv::bitwise_not (opened_, inverse_);
  cv::bitwise_and (inverse_, calm_, inverse_);
  cv::compare (inverse_, 0, inverse_, cv::CMP_GT);
  cv::medianBlur (inverse_, opened_, 5);
  cv::bitwise_or (inverse_, opened_, inverse_);
  surrounded_.copyTo (inside_);
  inside_.setTo (0, inverse_);
}

/* Ignores shadows and light of any strength where depth matches the background all around. */
void
Segmenter::ignore_lighting (int reach)
{
  const cv::Size window (2 * reach + 1, 2 * reach + 1);
  cv::compare (sides_, int (Side::kForeground), opened_, cv::CMP_EQ);
  cv::dilate (opened_, opened_, cv::getStructuringElement (cv::MORPH_RECT, window));
  placed_.convertTo (behind_, CV_32F, 1.0 / kYes);
  cv::boxFilter (behind_, behind_, CV_32F, window);
  cv::compare (behind_, 0.5, inverse_, cv::CMP_GT);
  cv::bitwise_and (inverse_, lit_, inverse_);
  inverse_.setTo (0, opened_);
  other_.setTo (0, inverse_);
  /* A shadow that reaches the person's feet: pixels without depth have the brightness of the shadow
   * next to them. */
  if (cv::countNonZero (inverse_) == 0)
    return;
  inverse_.convertTo (dark_, CV_32F, 1.0 / kYes);
  cv::multiply (ratio_, dark_, dark_beside_);
  cv::boxFilter (dark_beside_, dark_beside_, CV_32F, window, {-1, -1}, false, cv::BORDER_CONSTANT);
  cv::boxFilter (dark_, dark_, CV_32F, window, {-1, -1}, false, cv::BORDER_CONSTANT);
  for (int y = 0; y < other_.rows; y++) {
    std::uint8_t *other = other_.ptr (y);
    const std::uint8_t *lit = lit_.ptr (y), *side = sides_.ptr (y), *in = surrounded_.ptr (y);
    const auto sum = dark_beside_.ptr<float> (y), count = dark_.ptr<float> (y);
    const auto ratio = ratio_.ptr<float> (y), tolerance = tolerance_.ptr<float> (y);
    for (int x = 0; x < other_.cols; x++)
      if (other[x] && lit[x] && !in[x] && Side (side[x]) != Side::kForeground && count[x] > 4.5f &&
          std::abs (ratio[x] - sum[x] / count[x]) < tolerance[x])
        other[x] = 0;
  }
}

/* Of the pixels with the background's hue, only those with the brightness of background within
 * reach stay `same`, in shadow or not. Pixels without background within reach are marked in
 * inverse_. */
void
Segmenter::find_same (int reach)
{
  const cv::Size window (2 * reach + 1, 2 * reach + 1);
  cv::bitwise_or (other_, nearer_, opened_);
  cv::bitwise_or (opened_, surrounded_, opened_);
  cv::compare (opened_, 0, opened_, cv::CMP_EQ);
  opened_.convertTo (behind_, CV_32F, 1.0 / kYes);
  cv::multiply (ratio_, behind_, light_beside_);
  cv::boxFilter (
      light_beside_, light_beside_, CV_32F, window, {-1, -1}, false, cv::BORDER_CONSTANT);
  cv::boxFilter (behind_, behind_, CV_32F, window, {-1, -1}, false, cv::BORDER_CONSTANT);
  inverse_.create (same_.size (), CV_8U);
  for (int y = 0; y < same_.rows; y++) {
    std::uint8_t *same = same_.ptr (y), *alone = inverse_.ptr (y);
    const auto sum = light_beside_.ptr<float> (y), count = behind_.ptr<float> (y);
    const auto ratio = ratio_.ptr<float> (y), tolerance = tolerance_.ptr<float> (y);
    for (int x = 0; x < same_.cols; x++) {
      alone[x] = count[x] < 0.5f ? kYes : 0;
      if (alone[x] || std::abs (ratio[x] - sum[x] / count[x]) > tolerance[x])
        same[x] = 0;
    }
  }
  cv::medianBlur (same_, opened_, 3); /* single pixels may match by chance */
  cv::bitwise_and (opened_, nearer_, same_);
}

void
Segmenter::join_cues (const SegmentationSettings &settings)
{
  if (settings.cue != Cue::kBoth || settings.fringe <= 1) {
    cv::bitwise_or (other_, nearer_, mask_);
    return;
  }
  const int side = settings.fringe | 1; /* an even kernel shifts by half a pixel */
  if (kernel_.rows != side)
    kernel_ = cv::getStructuringElement (cv::MORPH_RECT, cv::Size (side, side));
  find_sides (settings);
  ignore_lighting (settings.fringe);
  find_same (settings.fringe);
  cv::bitwise_and (inverse_, nearer_, inverse_);
  cv::bitwise_or (inverse_, same_, inverse_); /* wide where it extends into the object */
  cv::morphologyEx (inverse_, opened_, cv::MORPH_OPEN, kernel_);
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
  const int count = cv::connectedComponentsWithStats (mask, labels_, stats_, centroids_, 8, CV_32S);
  areas_.clear ();
  for (int i = 1; i < count; i++)
    areas_.push_back (stats_.at<int> (i, cv::CC_STAT_AREA));
  int min_kept = min_area;
  if (keep > 0 && keep < static_cast<int> (areas_.size ())) {
    std::nth_element (areas_.begin (), areas_.begin () + keep - 1, areas_.end (), std::greater ());
    min_kept = std::max (min_kept, areas_[static_cast<std::size_t> (keep - 1)]);
  }
  if (std::ranges::none_of (areas_, [min_kept] (int area) { return area < min_kept; }))
    return;
  for (int y = 0; y < mask.rows; y++) {
    std::uint8_t *row = mask.ptr (y);
    const int *label = labels_.ptr<int> (y);
    for (int x = 0; x < mask.cols; x++)
      if (row[x] && stats_.at<int> (label[x], cv::CC_STAT_AREA) < min_kept)
        row[x] = 0;
  }
}

void
Segmenter::find_quiet ()
{
  if (guard_.empty ())
    guard_ = cv::getStructuringElement (cv::MORPH_RECT, cv::Size (2 * kGuard + 1, 2 * kGuard + 1));
  cv::dilate (mask_, opened_, guard_);
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
  constexpr double kStep = 128;
  make_steps (depth_unit_m, noise);
  steps_.create (image.roi.height, image.roi.width, CV_16S);
  for (int y = 0; y < image.roi.height; y++) {
    const std::uint16_t *depth = image.depth.row (y);
    auto step = steps_.ptr<std::int16_t> (y);
    for (int x = 0; x < image.roi.width; x++)
      step[x] = step_of_depth_[depth[x]];
  }
  cv::filterSpeckles (steps_, 0, min_area - 1, kStep, speckles_);
  for (int y = 0; y < image.roi.height; y++) {
    std::uint16_t *depth = image.depth.row (y);
    const auto step = steps_.ptr<std::int16_t> (y);
    for (int x = 0; x < image.roi.width; x++)
      if (step[x] == 0)
        depth[x] = kInvalidDepth;
  }
}

/* Not into single pixels that stick out of the silhouette, nor, with colour, where the image
 * matches the background: a closed hole may be a real one. Farther where the hue differs, because a
 * shadow's does not. */
void
Segmenter::extend_depth (const RangeImage &image, const SegmentationSettings &settings)
{
  if (settings.fill <= 0)
    return;
  cv::medianBlur (mask_, opened_, 3);
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
        if (clear[x])
          depth[x] = kInvalidDepth;
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
