/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "temporal_filter.hpp"

#include <algorithm>
#include <cmath>

namespace rangecast {
namespace {

constexpr int kBlock = 8;
constexpr float kDrift = 0.15f;  /* pixels of disparity, in two successive images */
constexpr float kJump = 1.0f;    /* the same, of one pixel */
constexpr float kMaxNoise = 6.f; /* grey levels: more is motion */

float
grey_of (const Rgbx &p)
{
  return (2.f * p.r + 5.f * p.g + p.b) / 8.f;
}

} // namespace

void
TemporalFilter::set (int width, int height, double steady, double focal_baseline)
{
  weight_ = static_cast<float> (1 - 0.9 * std::clamp (steady, 0.0, 1.0));
  focal_baseline_ = static_cast<float> (focal_baseline);
  columns_ = (width + kBlock - 1) / kBlock;
  rows_ = (height + kBlock - 1) / kBlock;
  held_ = cv::Mat::zeros (height, width, CV_32F);
  grey_ = cv::Mat::zeros (height, width, CV_32F);
  blocks_.assign (static_cast<std::size_t> (columns_) * static_cast<std::size_t> (rows_), {});
  changes_.reserve (blocks_.size ());
}

/* Compares the part of a block that is in the ROI. */
void
TemporalFilter::compare_block (const RangeImage &image, int bx, int by, Block &block) const
{
  const Roi &roi = image.roi;
  const int x0 = std::max (bx * kBlock, roi.x),
            x1 = std::min ((bx + 1) * kBlock, roi.x + roi.width);
  const int y0 = std::max (by * kBlock, roi.y),
            y1 = std::min ((by + 1) * kBlock, roi.y + roi.height);
  float change = 0, drift = 0;
  int n = 0;
  for (int y = y0; y < y1; y++) {
    const Rgbx *colour = image.colour.row (y - roi.y) - roi.x;
    const std::uint16_t *depth = image.depth.row (y - roi.y) - roi.x;
    const auto held = held_.ptr<float> (y), grey = grey_.ptr<float> (y);
    for (int x = x0; x < x1; x++) {
      change += std::abs (grey_of (colour[x]) - grey[x]);
      if (!depth[x] || held[x] <= 0)
        continue;
      drift +=
          std::clamp (focal_baseline_ * (held[x] - depth[x]) / (held[x] * depth[x]), -1.f, 1.f);
      n++;
    }
  }
  block.change = change / static_cast<float> (std::max (1, (x1 - x0) * (y1 - y0)));
  block.drift = drift / static_cast<float> (std::max (16, n));
}

/* Noise, estimated from the quarter of all blocks that change least. */
float
TemporalFilter::noise ()
{
  if (changes_.empty ())
    return 0;
  const auto quarter = changes_.begin () + static_cast<std::ptrdiff_t> (changes_.size () / 4);
  std::ranges::nth_element (changes_, quarter);
  return std::min (*quarter, kMaxNoise);
}

void
TemporalFilter::average (const RangeImage &image)
{
  const Roi &roi = image.roi;
  for (int y = roi.y; y < roi.y + roi.height; y++) {
    const Rgbx *colour = image.colour.row (y - roi.y) - roi.x;
    std::uint16_t *depth = image.depth.row (y - roi.y) - roi.x;
    auto held = held_.ptr<float> (y), grey = grey_.ptr<float> (y);
    for (int x = roi.x; x < roi.x + roi.width; x++) {
      bool moves = blocks_[static_cast<std::size_t> (y / kBlock * columns_ + x / kBlock)].drifts;
      for (int by = std::max (0, y / kBlock - 1); by <= std::min (rows_ - 1, y / kBlock + 1); by++)
        for (int bx = std::max (0, x / kBlock - 1); bx <= std::min (columns_ - 1, x / kBlock + 1);
             bx++)
          moves |= blocks_[static_cast<std::size_t> (by * columns_ + bx)].moves;
      const float g = grey_of (colour[x]), z = depth[x];
      grey[x] += (moves ? 1 : weight_) * (g - grey[x]);
      if (moves)
        held[x] = z;
      if (z <= 0 || moves)
        continue;
      /* A jump in a single image where nothing else moves is wrong: limit its effect. */
      const float max_step = kJump * z * z / focal_baseline_;
      held[x] = held[x] > 0 ? held[x] + weight_ * std::clamp (z - held[x], -max_step, max_step) : z;
      depth[x] = static_cast<std::uint16_t> (std::lround (held[x]));
    }
  }
}

void
TemporalFilter::apply (const RangeImage &image)
{
  const Roi &roi = image.roi;
  changes_.clear ();
  for (Block &block : blocks_)
    block = {0, 0, block.drift, false, false};
  const auto each = [&] (auto &&work) {
    for (int by = roi.y / kBlock; by <= (roi.y + roi.height - 1) / kBlock; by++)
      for (int bx = roi.x / kBlock; bx <= (roi.x + roi.width - 1) / kBlock; bx++)
        work (bx, by, blocks_[static_cast<std::size_t> (by * columns_ + bx)]);
  };
  each ([&] (int bx, int by, Block &block) {
    compare_block (image, bx, by, block);
    changes_.push_back (block.change);
  });
  const float max_change = 1 + 1.5f * noise ();
  each ([&] (int, int, Block &block) {
    const float both = block.drift * block.drift_before > 0
                           ? std::min (std::abs (block.drift), std::abs (block.drift_before))
                           : 0;
    block.moves = block.change > max_change;
    block.drifts = both > kDrift;
  });
  average (image);
}

} // namespace rangecast
