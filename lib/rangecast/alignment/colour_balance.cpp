/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "colour_balance.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

#include "../base/cholesky.hpp"
#include "../base/parallel.hpp"

namespace rangecast {

namespace {

constexpr int kSamples = 8192;       ///< grid pixels of all images together
constexpr int kFirstSamples = 65536; ///< in the first frame
constexpr float kBinsPerLog = 400;   ///< so histograms reach from -0.8 to 0.8: 0.45 to 2.2
constexpr float kMinShared = 30;     ///< shared pixels of a pair that counts
constexpr float kKept = 0.9f;        ///< weight of older counts in the next frame
/* Maximum difference of depth of two views of one place, metres. A third of what stereo errs by:
 * where it is wrong on a shaded surface the colours are always wrong the same way, so places that
 * it has right tell more than many that it has nearly right. */
constexpr double kSamePlaceM = 0.0045;
constexpr double kMaxShared = 300; ///< more do not add weight to a pair
/* Pulls gains towards 1 where overlaps say little: as 3 shared pixels. */
constexpr double kPrior = 0.01;

const std::array<float, 256> &
log_table ()
{
  static const std::array<float, 256> table = [] {
    std::array<float, 256> t{};
    for (int i = 1; i < 256; i++)
      t[static_cast<std::size_t> (i)] = std::log (static_cast<float> (i));
    return t;
  }();
  return table;
}

bool
has_colour (const RangeImage &image)
{
  return !image.depth.empty () && image.colour.same_size (image.depth);
}

/* Dark pixels have hardly any colour, bright ones may be clipped. Both are tested together, so that
 * no side's ratios are favoured. */
bool
are_usable (int a, int b)
{
  return a + b >= 50 && a + b <= 450 && a >= 8 && b >= 8 && a < 250 && b < 250;
}

/* Whether the surface about a pixel is seen well enough: all round it, and no more than 60 degrees
 * off. Where a view looks along a surface, or at its edge, stereo errs most, and always the same
 * way: that would pass for a difference in colour.
 *  @param steepest  Camera::steepest */
bool
is_steady (const RangeImage &image, int x, int y, float steepest)
{
  constexpr int kReach = 2;
  if (x < kReach || y < kReach || x + kReach >= image.depth.width ||
      y + kReach >= image.depth.height)
    return false;
  const int left = image.depth.at (x - kReach, y), right = image.depth.at (x + kReach, y),
            above = image.depth.at (x, y - kReach), below = image.depth.at (x, y + kReach);
  if (!left || !right || !above || !below)
    return false;
  const float max_change = steepest * image.depth.at (x, y) * 2 * kReach;
  return static_cast<float> (std::abs (right - left)) < max_change &&
         static_cast<float> (std::abs (below - above)) < max_change;
}

/* The median of a histogram, linear within its bin. */
float
median_of (std::span<const float> bins, float count)
{
  const float half = count / 2;
  float before = 0;
  std::size_t at = 0;
  while (at + 1 < bins.size () && before + bins[at] < half)
    before += bins[at++];
  const float share = bins[at] > 0 ? (half - before) / bins[at] : 0.5f;
  return (static_cast<float> (at) + share - static_cast<float> (bins.size ()) / 2) / kBinsPerLog;
}

/* Multiplies colours by factors in 1/32768, with 16 bits, so that compilers vectorize it. */
void
multiply_row (Rgbx *pixels, int count, const std::uint16_t (&factors)[4])
{
  auto *__restrict bytes = reinterpret_cast<std::uint8_t *> (pixels);
  for (int x = 0; x < 4 * count; x += 4)
    for (int c = 0; c < 4; c++) {
      const auto wide = static_cast<std::uint16_t> (bytes[x + c] << 8);
      const auto product = static_cast<std::uint16_t> ((std::uint32_t{wide} * factors[c]) >> 16);
      const auto rounded = static_cast<std::uint16_t> ((product + 64) >> 7);
      bytes[x + c] = static_cast<std::uint8_t> (std::min<std::uint16_t> (rounded, 255));
    }
}

/* Only between the first and the last valid pixel of each row. */
void
multiply (const RangeImage &image, const ColourBalance::Gains &gains)
{
  static_assert (ColourBalance::kMaxGain < 2);
  if (gains == ColourBalance::Gains{1, 1, 1})
    return;
  std::uint16_t factors[4] = {};
  for (std::size_t c = 0; c < 3; c++)
    factors[c] = static_cast<std::uint16_t> (std::lround (gains[c] * 32768));
  for (int y = 0; y < image.depth.height; y++) {
    const std::uint16_t *depth = image.depth.row (y);
    int first = 0, end = image.depth.width;
    while (first < end && depth[first] == kInvalidDepth)
      first++;
    while (end > first && depth[end - 1] == kInvalidDepth)
      end--;
    multiply_row (image.colour.row (y) + first, end - first, factors);
  }
}

} // namespace

void
ColourBalance::set_rig (const Rig &rig)
{
  for (const View &view : rig.views)
    cameras_[static_cast<std::size_t> (view.id)] = {PixelRays (view), PixelLookup (view),
        static_cast<float> (kSamePlaceM / view.depth_unit_m),
        static_cast<float> (std::sqrt (3.0) / view.intrinsics.fx)};
}

void
ColourBalance::reset ()
{
  started_ = 0;
  frame_ = 0;
  pairs_.clear ();
}

/* Reduces the older counts of pairs of this frame's views; those of missing views are kept. */
void
ColourBalance::age (std::span<const RangeImage> images)
{
  fresh_ = false;
  for (std::size_t i = 0; i < images.size (); i++)
    for (std::size_t j = i + 1; j < images.size (); j++) {
      if (images[i].view_id == images[j].view_id)
        continue;
      for (Histogram &bins : pairs_.get (images[i].view_id, images[j].view_id, &fresh_).ratios)
        for (float &bin : bins)
          bin *= kKept;
    }
}

void
ColourBalance::compare (std::span<const RangeImage> images, std::size_t from, int x, int y)
{
  const RangeImage &image = images[from];
  const Camera &camera = cameras_[static_cast<std::size_t> (image.view_id)];
  const std::uint16_t depth = image.depth.at (x, y);
  if (depth == kInvalidDepth || !is_steady (image, x, y, camera.steepest))
    return;
  float point[3];
  camera.rays.point (
      static_cast<float> (image.roi.x + x), static_cast<float> (image.roi.y + y), depth, point);
  const auto &logs = log_table ();
  for (const RangeImage &other : images) {
    if (other.view_id == image.view_id || !has_colour (other))
      continue;
    const Camera &seen_by = cameras_[static_cast<std::size_t> (other.view_id)];
    float u, v, z;
    seen_by.lookup.find (point, u, v, z);
    u -= static_cast<float> (other.roi.x);
    v -= static_cast<float> (other.roi.y);
    /* False for NaN. */
    if (!(z > 0 && u >= 0 && v >= 0 && u <= static_cast<float> (other.depth.width - 1) &&
            v <= static_cast<float> (other.depth.height - 1)))
      continue;
    const int column = static_cast<int> (u + 0.5f), row = static_cast<int> (v + 0.5f);
    const std::uint16_t there = other.depth.at (column, row);
    if (there == kInvalidDepth || !(std::abs (z - there) < seen_by.max_difference) ||
        !is_steady (other, column, row, seen_by.steepest))
      continue;
    const Rgbx mine = image.colour.at (x, y), theirs = other.colour.at (column, row);
    const bool forward = image.view_id < other.view_id;
    const Rgbx &first = forward ? mine : theirs, &second = forward ? theirs : mine;
    Pair &pair = pairs_.get (image.view_id, other.view_id);
    const std::uint8_t a[] = {first.r, first.g, first.b}, b[] = {second.r, second.g, second.b};
    for (std::size_t c = 0; c < 3; c++) {
      if (!are_usable (a[c], b[c]))
        continue;
      const float bin = (logs[a[c]] - logs[b[c]]) * kBinsPerLog + kBins / 2.0f;
      if (bin >= 0 && bin < kBins)
        pair.ratios[c][static_cast<std::size_t> (bin)]++;
    }
  }
}

/* Counts every step-th pixel of every step-th row, other ones in each frame. */
void
ColourBalance::count_ratios (std::span<const RangeImage> images, std::size_t from)
{
  const RangeImage &image = images[from];
  if (!has_colour (image))
    return;
  const double share = double (image.depth.width) * image.depth.height /
                       (double (fresh_ ? kFirstSamples : kSamples) / double (images.size ()));
  const int step = std::max (1, static_cast<int> (std::ceil (std::sqrt (share))));
  const auto steps = static_cast<std::uint32_t> (step);
  /* Visits all places of a step x step square soon. */
  const int left = static_cast<int> (frame_ * 5 % steps),
            top = static_cast<int> ((frame_ * 3 + frame_ / steps) % steps);
  for (int y = top; y < image.depth.height; y += step)
    for (int x = left; x < image.depth.width; x += step)
      compare (images, from, x, y);
}

/* The median of what was found for the views that share surface with others: where that is 1, one
 * camera whose exposure is wrong does not change the others. */
double
ColourBalance::middle_of_linked (std::uint64_t views)
{
  sorted_.clear ();
  for (std::uint64_t rest = views & linked_; rest; rest &= rest - 1)
    sorted_.push_back (right_[number_among (views, std::countr_zero (rest))]);
  if (sorted_.empty ())
    return 0;
  std::ranges::sort (sorted_);
  return (sorted_[(sorted_.size () - 1) / 2] + sorted_[sorted_.size () / 2]) / 2;
}

/* Least squares: for each pair the difference of both log gains is minus the median. The same
 * matrix for all channels, the graph's Laplacian. Of all views that were ever there: would one that
 * is missing for a frame be left out, the mean gain of the others would move. */
void
ColourBalance::solve ()
{
  const std::uint64_t views = pairs_.views ();
  const auto n = static_cast<std::size_t> (std::popcount (views));
  linked_ = 0;
  for (std::size_t c = 0; c < 3 && n > 0; c++) {
    matrix_.assign (n * n, 0);
    right_.assign (n, 0);
    for (std::size_t i = 0; i < n; i++)
      matrix_[i * n + i] = kPrior;
    for (const Pair &pair : pairs_) {
      const Histogram &bins = pair.ratios[c];
      float count = 0;
      for (float bin : bins)
        count += bin;
      if (count < kMinShared)
        continue;
      linked_ |= std::uint64_t{1} << pair.first | std::uint64_t{1} << pair.second;
      const std::size_t i = number_among (views, pair.first), j = number_among (views, pair.second);
      const double weight = std::min (1.0, double{count} / kMaxShared),
                   ratio = median_of (bins, count);
      matrix_[i * n + i] += weight;
      matrix_[j * n + j] += weight;
      matrix_[i * n + j] -= weight;
      matrix_[j * n + i] -= weight;
      right_[i] -= weight * ratio;
      right_[j] += weight * ratio;
    }
    if (!solve_cholesky (matrix_, right_))
      std::fill (right_.begin (), right_.end (), 0); /* never: the prior makes it definite */
    const double middle = middle_of_linked (views);
    for (std::uint64_t rest = views; rest; rest &= rest - 1) {
      const int id = std::countr_zero (rest);
      measured_[static_cast<std::size_t> (id)][c] =
          static_cast<float> (right_[number_among (views, id)] - middle);
    }
  }
}

void
ColourBalance::follow (std::span<const RangeImage> images)
{
  const float max = std::log (kMaxGain);
  for (const RangeImage &image : images) {
    const auto id = static_cast<std::size_t> (image.view_id);
    if (!(linked_ >> id & 1)) /* keeps its gains */
      continue;
    if (!(started_ >> id & 1))
      frames_[id] = 0;
    started_ |= std::uint64_t{1} << id;
    frames_[id] = std::min (frames_[id] + 1, 1000);
    const float share = std::max (kShareOfNew, 1 / static_cast<float> (frames_[id]));
    for (std::size_t c = 0; c < 3; c++) {
      float &gain = log_gains_[id][c];
      gain += share * (std::clamp (measured_[id][c], -max, max) - gain);
    }
  }
}

ColourBalance::Gains
ColourBalance::gains (int view_id) const
{
  Gains gains{1, 1, 1};
  if (!has_gains (view_id))
    return gains;
  for (std::size_t c = 0; c < 3; c++) {
    const float g = log_gains_[static_cast<std::size_t> (view_id)][c];
    gains[c] = std::exp (std::copysign (std::max (std::abs (g) - kLeftUndone, 0.0f), g));
  }
  return gains;
}

void
ColourBalance::process (std::span<const RangeImage> images, int threads)
{
  frame_++;
  if (images.size () > 1) { /* a single view keeps its gains */
    age (images);
    for (std::size_t i = 0; i < images.size (); i++)
      count_ratios (images, i);
    solve ();
    follow (images);
  }
  in_parallel (images.size (), threads, [&] (std::size_t i) {
    if (has_colour (images[i]))
      multiply (images[i], gains (images[i].view_id));
  });
}

} // namespace rangecast
