/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "background.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "../rigfile/yaml_tree.hpp"

namespace rangecast {
namespace {

constexpr int kFields = 8;
static_assert (sizeof (BackgroundPixel) == kFields * sizeof (float));

constexpr int kFileVersion = 3;
constexpr std::uint64_t kMaxFileBytes = 65536;
/* A field v is stored as (v + bias) * scale, so that any 16 bits are a value in its range. */
struct Code {
  float bias, scale;
};
constexpr Code kCodes[kFields] = {
    {0, 257}, {0, 257}, {0, 257}, {1, 255}, {0, 1}, {0, 16}, {0, 65535}, {0, 1}};

std::string
image_path (const std::string &path, int id)
{
  const std::filesystem::path file = path;
  return (file.parent_path () / (file.stem ().string () + "-" + std::to_string (id) + ".pgm"))
      .string ();
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
  adapt_base_ns_ = UINT64_MAX;
}

Status
BackgroundModel::learn (const ConstRangeImage &image)
{
  const Roi &roi = image.roi;
  if (!covers (roi))
    return {StatusCode::kBadSize, "view " + std::to_string (image.view_id) +
                                      ": the ROI does not lie in the image of the background"};
  for (int y = 0; y < roi.height; y++) {
    Sums *sums = &sums_[static_cast<std::size_t> (roi.y + y) * width_ + roi.x];
    const Rgbx *colour = image.colour.row (y);
    const std::uint16_t *depth = image.depth.row (y);
    for (int x = 0; x < roi.width; x++)
      sums[x].add ({float (colour[x].r), float (colour[x].g), float (colour[x].b)}, depth[x]);
  }
  frames_++;
  return {};
}

void
BackgroundModel::Sums::add (const float (&rgb)[3], std::uint16_t depth)
{
  const float weight = 1.f / float (++colour_n);
  for (int c = 0; c < 3; c++) {
    const float before = rgb[c] - pixel.mean[c];
    pixel.mean[c] += before * weight;
    colour_m2 += before * (rgb[c] - pixel.mean[c]);
  }
  if (depth == kInvalidDepth)
    return;
  pixel.nearest = depth_n ? std::min (pixel.nearest, float (depth)) : depth;
  const float before = depth - pixel.depth;
  pixel.depth += before / float (++depth_n);
  depth_m2 += before * (depth - pixel.depth);
}

BackgroundPixel
BackgroundModel::Sums::result () const
{
  BackgroundPixel all = pixel;
  all.spread = colour_n ? std::sqrt (colour_m2 / (3.f * float (colour_n))) : -1;
  all.depth_spread = depth_n ? std::sqrt (depth_m2 / float (depth_n)) : 0;
  all.depth_share = colour_n ? float (depth_n) / float (colour_n) : 0;
  return all;
}

void
BackgroundModel::finish ()
{
  std::ranges::transform (sums_, pixels_.begin (), &Sums::result);
  sums_.assign (sums_.size (), {});
  measure_noise ();
  infer_depth ();
}

void
BackgroundModel::adapt (const ConstRangeImage &image, ImageView<const std::uint8_t> teach,
    const std::array<float, 3> &light, double adapt_time_s)
{
  constexpr double kLearnAgainS = 3;
  constexpr int kMinImages = 5;
  const Roi &roi = image.roi;
  if (!covers (roi))
    return;
  if (image.capture_time_ns < adapt_base_ns_) {
    sums_.assign (sums_.size (), {});
    adapt_base_ns_ = image.capture_time_ns;
  }
  const auto now_ms = static_cast<std::uint32_t> (
      std::min<std::uint64_t> ((image.capture_time_ns - adapt_base_ns_) / 1'000'000, UINT32_MAX));
  for (int y = 0; y < roi.height; y++) {
    const std::size_t first = static_cast<std::size_t> (roi.y + y) * width_ + roi.x;
    const std::uint8_t *use = teach.row (y);
    const Rgbx *colour = image.colour.row (y);
    const std::uint16_t *depth = image.depth.row (y);
    for (int x = 0; x < roi.width; x++) {
      Sums &sums = sums_[first + x];
      if (!use[x] || (sums.colour_n > 0 && depth[x] == kInvalidDepth)) /* depth tells a change */
        continue;
      BackgroundPixel &pixel = pixels_[first + x];
      const float rgb[] = {std::min (float (colour[x].r) / light[0], 255.f),
          std::min (float (colour[x].g) / light[1], 255.f),
          std::min (float (colour[x].b) / light[2], 255.f)};
      const double since_s = (now_ms - std::min (now_ms, sums.since_ms)) * 1e-3;
      if (use[x] != kDifferent) {
        const auto share = float (std::min (since_s / adapt_time_s, 0.5));
        for (int c = 0; c < 3; c++)
          pixel.mean[c] += share * (rgb[c] - pixel.mean[c]);
        if (depth[x] != kInvalidDepth && pixel.depth_share > 0) {
          const float step = share * (float (depth[x]) - pixel.depth);
          pixel.depth += step;
          pixel.nearest += step;
        }
        sums = {};
        sums.since_ms = now_ms;
        continue;
      }
      if (sums.colour_n == 0)
        sums.since_ms = now_ms;
      sums.add (rgb, depth[x]);
      if (sums.colour_n < kMinImages || since_s < kLearnAgainS)
        continue;
      pixel = sums.result ();
      sums = {};
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
  std::ofstream list (path, std::ios::binary);
  list << "%YAML:1.0\n---\nrangecast_background: " << kFileVersion << "\nviews:\n";
  for (const auto &[id, model] : views) {
    list << "   - { id: " << id << ", frames: " << model->frames_ << " }\n";
    const std::string name = image_path (path, id);
    std::ofstream image (name, std::ios::binary);
    image << "P5\n" << model->width_ << " " << kFields * model->height_ << "\n65535\n";
    std::string row (2 * model->pixels_.size (), 0);
    for (std::size_t field = 0; field < kFields; field++) {
      for (std::size_t i = 0; i < model->pixels_.size (); i++) {
        const float v = (&model->pixels_[i].mean[0])[field];
        const auto code = static_cast<unsigned> (std::lround (
            std::clamp ((v + kCodes[field].bias) * kCodes[field].scale, 0.f, 65535.f)));
        row[2 * i] = static_cast<char> (code >> 8);
        row[2 * i + 1] = static_cast<char> (code & 255);
      }
      image.write (row.data (), static_cast<std::streamsize> (row.size ()));
    }
    if (!image.flush ())
      return {StatusCode::kNotFound, name + ": cannot be written"};
  }
  if (!list.flush ())
    return {StatusCode::kNotFound, path + ": cannot be written"};
  return {};
}

/* Nothing is allocated that the file is too short for. */
Status
BackgroundModel::read (const std::string &path, int frames)
{
  std::ifstream file (path, std::ios::binary);
  std::string magic;
  int width = 0, height = 0, greatest = 0;
  file >> magic >> width >> height >> greatest;
  file.get ();
  std::error_code error;
  const auto size = std::filesystem::file_size (path, error);
  if (!file || error || magic != "P5" || greatest != 65535 || width < 1 || width > kMaxImageSide ||
      height < kFields || height > kFields * kMaxImageSide || height % kFields != 0 ||
      size < std::uint64_t (width) * std::uint64_t (height) * 2)
    return {StatusCode::kBadData, path + ": is missing or no 16-bit PGM image of a background"};
  reset (width, height / kFields);
  std::string row (2 * pixels_.size (), 0);
  for (std::size_t field = 0; field < kFields; field++) {
    if (!file.read (row.data (), static_cast<std::streamsize> (row.size ())))
      return {StatusCode::kTruncated, path + ": ends too early"};
    for (std::size_t i = 0; i < pixels_.size (); i++) {
      const auto byte = [&] (std::size_t k) { return static_cast<std::uint8_t> (row[2 * i + k]); };
      (&pixels_[i].mean[0])[field] =
          float (byte (0) << 8 | byte (1)) / kCodes[field].scale - kCodes[field].bias;
    }
  }
  frames_ = std::max (1, frames);
  measure_noise ();
  infer_depth ();
  return {};
}

Status
load_backgrounds (const std::string &path, std::vector<std::pair<int, BackgroundModel>> &views)
{
  YamlNode list;
  if (Status s = read_yaml (path, kMaxFileBytes, list); !s.ok ())
    return s;
  if (list["rangecast_background"].integer () != kFileVersion)
    return {StatusCode::kBadData, path + ": is no background file of version " +
                                      std::to_string (kFileVersion) +
                                      "; save the background again"};
  std::vector<std::pair<int, BackgroundModel>> loaded;
  for (const YamlNode &view : list["views"].items) {
    const auto id = view["id"].integer (), frames = view["frames"].integer ();
    if (!id || !frames || *id < 0 || *id >= kMaxViews || loaded.size () >= kMaxViews)
      return {StatusCode::kBadData,
          path + ": views[" + std::to_string (loaded.size ()) + "]: needs an id and frames"};
    BackgroundModel &model = loaded.emplace_back (*id, BackgroundModel ()).second;
    if (Status s = model.read (image_path (path, *id), *frames); !s.ok ())
      return s;
  }
  views = std::move (loaded);
  return {};
}

} // namespace rangecast
