/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "background.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "storage_check.hpp"

namespace rangecast {
namespace {

static_assert (sizeof (BackgroundPixel) == 8 * sizeof (float));

constexpr int kFileVersion = 2;
/* A pixel takes 43 bytes in base64, and spaces: enough for about 20 views of 1920x1080. */
constexpr std::uint64_t kMaxFileBytes = std::uint64_t{2} << 30;
constexpr std::uint32_t kMaxAdaptMs = 10'000;
constexpr int kAdaptSteps = 1000; // of 10 ms

/* Files are untrusted; the segmenter requires values within their ranges. */
bool
is_sound (const BackgroundPixel &p)
{
  const auto within = [] (float v, float low, float high) { return v >= low && v <= high; };
  return within (p.mean[0], 0, 255) && within (p.mean[1], 0, 255) && within (p.mean[2], 0, 255) &&
         within (p.spread, -1, 255) && within (p.depth, 0, 65535) &&
         within (p.depth_spread, 0, 65535) && within (p.depth_share, 0, 1) &&
         within (p.nearest, 0, 65535);
}

} // namespace

void
BackgroundModel::reset (int width, int height)
{
  width_ = width;
  height_ = height;
  frames_ = 0;
  depth_noise_ = 0;
  const auto pixels = static_cast<std::size_t> (width) * static_cast<std::size_t> (height);
  pixels_.assign (pixels, {});
  sums_.assign (pixels, {});
  inferred_.assign (pixels, 0);
  taught_ms_.clear ();
}

Status
BackgroundModel::learn (const ConstRangeImage &image)
{
  const Roi &roi = image.roi;
  if (!covers (roi))
    return {StatusCode::kBadSize, "view " + std::to_string (image.view_id) +
                                      ": the ROI does not lie in the image of the background"};
  for (int y = 0; y < roi.height; y++) {
    const std::size_t first = static_cast<std::size_t> (roi.y + y) * width_ + roi.x;
    const Rgbx *colour = image.colour.row (y);
    const std::uint16_t *depth = image.depth.row (y);
    for (int x = 0; x < roi.width; x++) {
      BackgroundPixel &pixel = pixels_[first + x];
      Sums &sums = sums_[first + x];
      const float rgb[] = {float (colour[x].r), float (colour[x].g), float (colour[x].b)};
      const float weight = 1.f / float (++sums.colour_n);
      for (int c = 0; c < 3; c++) {
        const float before = rgb[c] - pixel.mean[c];
        pixel.mean[c] += before * weight;
        sums.colour_m2 += before * (rgb[c] - pixel.mean[c]);
      }
      if (depth[x] != kInvalidDepth) {
        pixel.nearest = sums.depth_n ? std::min (pixel.nearest, float (depth[x])) : depth[x];
        const float before = depth[x] - pixel.depth;
        pixel.depth += before / float (++sums.depth_n);
        sums.depth_m2 += before * (depth[x] - pixel.depth);
      }
    }
  }
  frames_++;
  return {};
}

void
BackgroundModel::finish ()
{
  for (std::size_t i = 0; i < pixels_.size (); i++) {
    BackgroundPixel &pixel = pixels_[i];
    const Sums &sums = sums_[i];
    pixel.spread = sums.colour_n ? std::sqrt (sums.colour_m2 / (3.f * float (sums.colour_n))) : -1;
    pixel.depth_spread = sums.depth_n ? std::sqrt (sums.depth_m2 / float (sums.depth_n)) : 0;
    pixel.depth_share = frames_ ? float (sums.depth_n) / float (frames_) : 0;
  }
  measure_noise ();
  infer_depth ();
}

void
BackgroundModel::move_towards (BackgroundPixel &pixel, const Rgbx &colour, std::uint16_t depth,
    const float *to_model, float share)
{
  const float rgb[] = {float (colour.r), float (colour.g), float (colour.b)};
  for (int c = 0; c < 3; c++)
    pixel.mean[c] += share * (std::min (rgb[c] * to_model[c], 255.f) - pixel.mean[c]);
  if (depth == kInvalidDepth || pixel.depth_share <= 0)
    return;
  const float step = share * (float (depth) - pixel.depth);
  pixel.depth += step;
  pixel.nearest += step;
}

void
BackgroundModel::adapt (const ConstRangeImage &image, ImageView<const std::uint8_t> teach,
    const std::array<float, 3> &light, double adapt_time_s)
{
  const Roi &roi = image.roi;
  if (!covers (roi))
    return;
  if (taught_ms_.empty () || image.capture_time_ns < adapt_base_ns_) {
    taught_ms_.assign (pixels_.size (), 0);
    adapt_base_ns_ = image.capture_time_ns;
  }
  const auto now_ms = static_cast<std::uint32_t> (
      std::min<std::uint64_t> ((image.capture_time_ns - adapt_base_ns_) / 1'000'000, UINT32_MAX));
  std::array<float, kAdaptSteps + 1> shares; // by the time since a pixel's last update
  for (int i = 0; i <= kAdaptSteps; i++)
    shares[i] = float (
        std::min (1 - std::exp (-i * (kMaxAdaptMs * 1e-3 / kAdaptSteps) / adapt_time_s), 0.5));
  const float to_model[] = {1 / light[0], 1 / light[1], 1 / light[2]};
  for (int y = 0; y < roi.height; y++) {
    const std::size_t first = static_cast<std::size_t> (roi.y + y) * width_ + roi.x;
    const std::uint8_t *use = teach.row (y);
    const Rgbx *colour = image.colour.row (y);
    const std::uint16_t *depth = image.depth.row (y);
    for (int x = 0; x < roi.width; x++) {
      if (!use[x])
        continue;
      const std::uint32_t since = now_ms - std::min (now_ms, taught_ms_[first + x]);
      taught_ms_[first + x] = now_ms;
      move_towards (pixels_[first + x], colour[x], depth[x], to_model,
          shares[std::min (since, kMaxAdaptMs) * kAdaptSteps / kMaxAdaptMs]);
    }
  }
}

void
BackgroundModel::measure_noise ()
{
  constexpr float kSteadyShare = 0.5f;
  std::vector<float> noise;
  for (const BackgroundPixel &pixel : pixels_)
    if (pixel.depth_share >= kSteadyShare && pixel.depth > 0)
      noise.push_back (pixel.depth_spread / (pixel.depth * pixel.depth));
  depth_noise_ = 0;
  if (noise.empty ())
    return;
  const auto middle = noise.begin () + static_cast<std::ptrdiff_t> (noise.size () / 2);
  std::nth_element (noise.begin (), middle, noise.end ());
  depth_noise_ = *middle;
}

/* Fills holes with the inverse depth of their surroundings, which is linear on a plane: averages
 * known pixels down an image pyramid, then interpolates into the holes on the way up. */
void
BackgroundModel::infer_depth ()
{
  constexpr float kKnownShare = 0.05f; /* as in the segmenter */
  constexpr int kLevels = 6;           /* holes of up to about 64 pixels */
  std::array<cv::Mat, kLevels + 1> sum, weight;
  sum[0].create (height_, width_, CV_32F);
  weight[0].create (height_, width_, CV_32F);
  for (int y = 0; y < height_; y++) {
    const BackgroundPixel *pixel = row (y);
    auto s = sum[0].ptr<float> (y), w = weight[0].ptr<float> (y);
    for (int x = 0; x < width_; x++) {
      w[x] = pixel[x].depth_share >= kKnownShare && pixel[x].depth > 0 ? pixel[x].depth_share : 0;
      s[x] = w[x] > 0 ? w[x] / pixel[x].depth : 0;
    }
  }
  int top = 0;
  while (top < kLevels && sum[top].cols > 1 && sum[top].rows > 1) {
    cv::pyrDown (sum[top], sum[top + 1]);
    cv::pyrDown (weight[top], weight[top + 1]);
    top++;
  }
  constexpr float kEnough = 1e-3f;
  cv::Mat above;
  for (int level = top; level >= 0; level--) {
    cv::Mat value (sum[level].size (), CV_32F);
    cv::Mat coarse;
    if (level < top)
      cv::resize (above, coarse, value.size (), 0, 0, cv::INTER_LINEAR);
    for (int y = 0; y < value.rows; y++)
      for (int x = 0; x < value.cols; x++) {
        const float w = weight[level].at<float> (y, x);
        value.at<float> (y, x) = w > kEnough       ? sum[level].at<float> (y, x) / w
                                 : coarse.empty () ? 0
                                                   : coarse.at<float> (y, x);
      }
    above = value;
  }
  inferred_.assign (pixels_.size (), 0);
  for (std::size_t i = 0; i < pixels_.size (); i++)
    if (const float inverse = above.ptr<float> ()[i];
        pixels_[i].depth_share < kKnownShare && inverse > 0)
      inferred_[i] = 1 / inverse;
}

Status
save_backgrounds (
    const std::string &path, const std::vector<std::pair<int, const BackgroundModel *>> &views)
{
  try {
    cv::FileStorage file (path, cv::FileStorage::WRITE | cv::FileStorage::BASE64);
    if (!file.isOpened ())
      return {StatusCode::kNotFound, path + ": cannot be opened for writing"};
    file << "rangecast_background" << kFileVersion;
    file.startWriteStruct ("views", cv::FileNode::SEQ);
    for (const auto &[id, model] : views) {
      const cv::Mat pixels (model->height_, model->width_, CV_32FC (8),
          const_cast<BackgroundPixel *> (model->pixels_.data ()));
      file.startWriteStruct ("", cv::FileNode::MAP);
      file << "id" << id << "frames" << model->frames_ << "pixels" << pixels;
      file.endWriteStruct ();
    }
    file.endWriteStruct ();
    file.release ();
  } catch (const std::exception &) {
    return {StatusCode::kBadValue,
        path + ": cannot be written; expected a name that ends in .yml, .yaml or .json"};
  }
  return {};
}

/* Reads one view. @return false if it does not have the form that save_backgrounds() writes */
bool
BackgroundModel::read (const cv::FileNode &node, int &id, BackgroundModel &model)
{
  cv::Mat pixels;
  node["pixels"] >> pixels;
  if (!node["id"].isInt () || !node["frames"].isInt ())
    return false;
  id = static_cast<int> (node["id"]);
  if (id < 0 || id >= kMaxViews || pixels.type () != CV_32FC (8) || pixels.empty () ||
      !pixels.isContinuous () || pixels.cols > kMaxImageSide || pixels.rows > kMaxImageSide)
    return false;
  const auto first = reinterpret_cast<const BackgroundPixel *> (pixels.data);
  if (!std::all_of (first, first + pixels.total (), is_sound))
    return false;
  model.reset (pixels.cols, pixels.rows);
  model.pixels_.assign (first, first + pixels.total ());
  model.frames_ = std::max (1, static_cast<int> (node["frames"]));
  model.measure_noise ();
  model.infer_depth ();
  return true;
}

Status
load_backgrounds (const std::string &path, std::vector<std::pair<int, BackgroundModel>> &views)
{
  const std::string expected =
      "expected a background file (rangecast_background " + std::to_string (kFileVersion) + ")";
  const auto bad = [&] (const std::string &what) {
    return Status{StatusCode::kBadData, path + ": " + what + "; " + expected};
  };
  std::error_code error;
  if (!std::filesystem::is_regular_file (path, error))
    return {StatusCode::kNotFound, path + ": no such file; " + expected};
  if (Status s = check_storage (path, {.max_bytes = kMaxFileBytes, .binary_type = "8f"}); !s.ok ())
    return {s.code (), s.message () + "; " + expected};
  std::vector<std::pair<int, BackgroundModel>> loaded;
  try {
    const cv::FileStorage file (path, cv::FileStorage::READ);
    const cv::FileNode version = file["rangecast_background"];
    if (!file.isOpened () || !version.isInt ())
      return bad ("has no rangecast_background version");
    if (static_cast<int> (version) != kFileVersion)
      return bad ("is version " + std::to_string (static_cast<int> (version)));
    for (const cv::FileNode &node : file["views"]) {
      int id = 0;
      BackgroundModel model;
      if (loaded.size () >= kMaxViews || !BackgroundModel::read (node, id, model))
        return bad ("views[" + std::to_string (loaded.size ()) + "] is damaged");
      loaded.emplace_back (id, std::move (model));
    }
  } catch (const std::exception &) {
    return bad ("cannot be read");
  }
  views = std::move (loaded);
  return {};
}

} // namespace rangecast
