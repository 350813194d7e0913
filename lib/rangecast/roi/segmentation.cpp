/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "segmentation.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

namespace rangecast {
namespace {

constexpr std::uint8_t kYes = 255;
/* The background's depth is known where it was valid in at least this share of its frames; where
 * it was not, the scene is out of reach there. */
constexpr float kKnownShare = 0.05f, kSteadyShare = 0.5f;
/* Where depth says that the background is there, shadow and light may go so much farther. */
constexpr float kConfirmed = 2;
/* A pixel looks just like the background within so many standard deviations (which are at least
 * kMinSpread grey levels), and within this share of its brightness. */
constexpr float kSameFactor = 2.5f, kMinSpread = 1.5f, kSameShare = 0.08f;
constexpr float kBurntOut = 250; /* grey levels */
/* Noise of brightness from which the background's colour tells nothing. */
constexpr float kVague = 0.3f;
/* How far around a pixel the person or the background is looked for, as a share of the width. */
constexpr double kSight = 0.125;
/* What teaches the background and has no depth to prove it keeps so far from what is kept, pixels.
 */
constexpr int kGuard = 7;
constexpr std::uint8_t kPerhaps = 128;

/* Thresholds in the units of the pixels. */
struct Limits {
  bool use_colour, use_depth;
  bool doubt_depth; /* depth is of stereo: it means nothing where there is no texture */
  float noise_factor, colour, shadow, highlight;
  float nearness;    /* depth units */
  float depth_noise; /* BackgroundModel::depth_noise() */
  std::array<float, 3> light;
};

/* kSomewhere: there is depth where the background never had any. */
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
  /* Where stereo wavers between two surfaces, their distance is no noise: only what is nearer than
   * the nearer one is new. */
  const float sensor = limits.depth_noise * background.depth * background.depth;
  const float wavers = background.depth - background.nearest + limits.noise_factor * sensor;
  /* Stereo is steady where there is no texture, too, and errs by more when a shadow brings some. */
  float noise = std::max ({limits.nearness, limits.noise_factor * sensor,
      std::min (limits.noise_factor * background.depth_spread, wavers)});
  if (background.depth_share < kSteadyShare)
    noise *= 2; /* learnt from few */
  if (float (depth) < background.depth - noise)
    return Where::kNearer;
  return float (depth) < background.depth + noise ? Where::kBackground : Where::kUnknown;
}

/* How a colour compares with the background's in the present light. */
struct Comparison {
  float distortion; /* chromatic, grey levels, squared */
  float brightness; /* as a share of the background's */
  float noise;      /* of brightness: one standard deviation */
};

Comparison
compare (Rgbx colour, const BackgroundPixel &background, const Limits &limits)
{
  /* One is added to all, so that black has a brightness to compare. */
  const float rgb[] = {float (colour.r) + 1, float (colour.g) + 1, float (colour.b) + 1};
  float mean[3], mixed = 0, square = 0, distortion = 0;
  for (int c = 0; c < 3; c++) {
    mean[c] = background.mean[c] * limits.light[c] + 1;
    if (rgb[c] > kBurntOut) /* what was too bright says only that */
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
  constexpr float kChannels = 1.6f; /* the distance has two free directions */
  const float chroma = kSameFactor * kChannels * std::max (background.spread, kMinSpread);
  return c.distortion < chroma * chroma;
}

/* White without texture. */
bool
is_burnt_out (const BackgroundPixel &background)
{
  return std::ranges::all_of (background.mean, [] (float level) { return level > kBurntOut; });
}

/* A histogram of brightness ratios, from a quarter to four times, that finds the commonest. */
class RatioPeak {
public:
  void add (float ratio)
  {
    const int bin = static_cast<int> (std::floor (std::log2 (ratio) * kPerOctave)) + kBins / 2;
    if (bin >= 0 && bin < kBins)
      counts_[bin]++;
    all_++;
  }
  /** @return the ratio that at least a sixth of all share, or the fallback */
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

} // namespace

/* From every sixteenth pixel that is no nearer than the background, but not from very dark or burnt
 * out ones, whose ratios say little. */
static void
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
      const bool unseen = behind[x].spread < 0; /* as good as another colour */
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
      /* Stereo finds something now and then where there is no texture; colour knows better. */
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

/* What is known by depth, and by colour where depth is unknown; then what is surrounded. Small
 * patches of depth are as good as none. */
void
Segmenter::find_sides (const SegmentationSettings &settings)
{
  nearer_.copyTo (opened_);
  remove_small (opened_, settings.min_area, 0);
  sides_.create (nearer_.size (), CV_8U);
  sides_.setTo (int (Side::kUnknown));
  sides_.setTo (int (Side::kBackground), placed_);
  /* Where the background never had depth, colour decides, if it says something. */
  cv::bitwise_or (seen_, blank_, by_colour_);
  cv::bitwise_or (by_colour_, other_, by_colour_);
  cv::bitwise_not (by_colour_, by_colour_);
  cv::medianBlur (by_colour_, by_colour_, 5);
  sides_.setTo (int (Side::kBackground), by_colour_);
  sides_.setTo (int (Side::kForeground), opened_);
  const int reach = std::clamp (int (kSight * sides_.cols), 16, 255);
  surroundings_.find_inside (sides_, reach, surrounded_);
  /* What looks just like the background, where that says something, is a hole to look through.
   * Stereo finds the depth of wide ones. */
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

/* However deep a shadow or bright a light: where depth says all around that the background is
 * there, it is the background's. */
void
Segmenter::forgive_light (int reach)
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
  /* A shadow that reaches the person's feet: what has no depth there has the light of the shadow
   * beside it. */
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

/* Of the pixels with the background's hue only those stay `same` that have the light of background
 * within reach, be it in shadow or not. What has none within reach is marked in inverse_. */
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
  cv::medianBlur (same_, opened_, 3); /* one pixel may look like the background by chance */
  cv::bitwise_and (opened_, nearer_, same_);
}

void
Segmenter::join_cues (const SegmentationSettings &settings)
{
  if (settings.cue != Cue::kBoth || settings.fringe <= 1) {
    cv::bitwise_or (other_, nearer_, mask_);
    return;
  }
  const int side = settings.fringe | 1; /* an even kernel would move things by half a pixel */
  if (kernel_.rows != side)
    kernel_ = cv::getStructuringElement (cv::MORPH_RECT, cv::Size (side, side));
  find_sides (settings);
  forgive_light (settings.fringe);
  find_same (settings.fringe);
  cv::bitwise_and (inverse_, nearer_, inverse_);
  cv::bitwise_or (inverse_, same_, inverse_); /* wide where it goes on into the thing */
  cv::morphologyEx (inverse_, opened_, cv::MORPH_OPEN, kernel_);
  cv::bitwise_not (same_, inverse_);
  cv::bitwise_and (nearer_, inverse_, mask_); /* nearer, and does not look like the background */
  cv::bitwise_or (mask_, other_, mask_);
  cv::bitwise_or (mask_, opened_, mask_);
  cv::bitwise_or (mask_, inside_, mask_);
}

/* Islands of fewer than min_area pixels go; of the others only the `keep` largest stay. */
void
Segmenter::remove_small (cv::Mat &mask, int min_area, int keep)
{
  if (min_area <= 1 && keep <= 0)
    return;
  const int count = cv::connectedComponentsWithStats (mask, labels_, stats_, centroids_, 8, CV_32S);
  areas_.clear ();
  for (int i = 1; i < count; i++)
    areas_.push_back (stats_.at<int> (i, cv::CC_STAT_AREA));
  int least = min_area;
  if (keep > 0 && keep < static_cast<int> (areas_.size ())) {
    std::nth_element (areas_.begin (), areas_.begin () + keep - 1, areas_.end (), std::greater ());
    least = std::max (least, areas_[static_cast<std::size_t> (keep - 1)]);
  }
  if (std::ranges::none_of (areas_, [least] (int area) { return area < least; }))
    return;
  for (int y = 0; y < mask.rows; y++) {
    std::uint8_t *row = mask.ptr (y);
    const int *label = labels_.ptr<int> (y);
    for (int x = 0; x < mask.cols; x++)
      if (row[x] && stats_.at<int> (label[x], cv::CC_STAT_AREA) < least)
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

/* For every depth a number that grows by 128 where neighbours are just too far apart: by 30 mm, or,
 * farther away, by what noise does between two pixels (it grows with the square of depth). */
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

/* Islands in space: patches beside the person in the picture, but well before or behind it. What
 * stereo makes of a silhouette is often such a patch. */
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

/* Not to single pixels that stick out of the silhouette, which may be chance; nor, with colour, to
 * what looks just like the background: a hole that was closed may be one. Farther where the hue
 * differs, as a shadow's does not. */
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

static const Status kFailed = {StatusCode::kNoSpace, "background subtraction: OpenCV failed"};

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
    clear_where (inverse_, image);
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
