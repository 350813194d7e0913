/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "depth_fill.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <opencv2/imgproc.hpp>

namespace rangecast {
namespace {

/* Neighbourhood for the plane fit: all pixels within kAll; beyond, every second one of every second
 * row with a weight of four. */
constexpr int kAll = 2, kAround = 6;
/* Maximum relative depth difference per pixel of distance on one surface, and between a new pixel
 * and its neighbour. */
constexpr float kSlant = 0.02f, kStep = 0.03f;
/* Colour difference (sum over R, G, B) with weight 0.6, and the required sum of weights: one
 * neighbour of the same colour or several similar ones. */
constexpr float kLike = 25, kEnough = 1;
/* Regularization added to the variance of positions, pixels squared, so that a few collinear or
 * noisy samples do not tilt the plane. */
constexpr float kFlat = 0.1f;

struct Sample {
  int x, y;
  float weight, slant;
};

constexpr int kSamples =
    (2 * kAll + 1) * (2 * kAll + 1) - 1 + (kAround + 1) * (kAround + 1) - (kAll + 1) * (kAll + 1);

constexpr auto kPattern = [] {
  std::array<Sample, kSamples> pattern{};
  std::size_t n = 0;
  for (int y = -kAround; y <= kAround; y++)
    for (int x = -kAround; x <= kAround; x++) {
      const int far = std::max (x < 0 ? -x : x, y < 0 ? -y : y);
      if (far == 0 || (far > kAll && (x % 2 != 0 || y % 2 != 0)))
        continue;
      const float near = 1 / (1 + 0.25f * float (x * x + y * y));
      pattern[n++] = {x, y, far > kAll ? 4 * near : near, kSlant * float (far)};
    }
  return pattern;
}();

const std::array<float, 3 * 255 + 1> &
weights_of_colour ()
{
  static const auto weights = [] {
    std::array<float, 3 * 255 + 1> w;
    for (std::size_t i = 0; i < w.size (); i++)
      w[i] = std::exp (-0.5f * float (i * i) / (kLike * kLike));
    return w;
  }();
  return weights;
}

std::size_t
unlike (Rgbx a, Rgbx b)
{
  return std::size_t (std::abs (a.r - b.r) + std::abs (a.g - b.g) + std::abs (a.b - b.b));
}

/* Calls visit (u, v) for the neighbours of a pixel that are inside the image. */
template <typename Visit>
void
for_neighbours (const RangeImage &image, int x, int y, const Visit &visit)
{
  for (int v = std::max (0, y - 1); v <= std::min (image.depth.height - 1, y + 1); v++)
    for (int u = std::max (0, x - 1); u <= std::min (image.depth.width - 1, x + 1); u++)
      visit (u, v);
}

/* Depth of the neighbour with the most similar colour, or kInvalidDepth. */
std::uint16_t
likeliest (const RangeImage &image, int x, int y)
{
  std::uint16_t depth = kInvalidDepth;
  std::size_t smallest = SIZE_MAX;
  for_neighbours (image, x, y, [&] (int u, int v) {
    const std::uint16_t d = image.depth.at (u, v);
    const std::size_t difference = unlike (image.colour.at (u, v), image.colour.at (x, y));
    if (d != kInvalidDepth && difference < smallest) {
      smallest = difference;
      depth = d;
    }
  });
  return depth;
}

/* Weighted least-squares fit of a plane, evaluated at the origin. */
class PlaneFit {
public:
  void add (float x, float y, float value, float weight)
  {
    const float wx = weight * x, wy = weight * y;
    n_ += weight, x_ += wx, y_ += wy, value_ += weight * value;
    xx_ += wx * x, xy_ += wx * y, yy_ += wy * y, xv_ += wx * value, yv_ += wy * value;
  }
  [[nodiscard]] float weight () const { return n_; }
  /* Requires samples. */
  [[nodiscard]] float at_origin () const
  {
    const float mx = x_ / n_, my = y_ / n_, mv = value_ / n_;
    const float xx = xx_ - mx * x_ + kFlat * n_, yy = yy_ - my * y_ + kFlat * n_,
                xy = xy_ - mx * y_, xv = xv_ - mx * value_, yv = yv_ - my * value_,
                det = xx * yy - xy * xy;
    return mv - (mx * (xv * yy - yv * xy) + my * (yv * xx - xv * xy)) / det;
  }

private:
  float n_ = 0, x_ = 0, y_ = 0, value_ = 0, xx_ = 0, xy_ = 0, yy_ = 0, xv_ = 0, yv_ = 0;
};

/* Depth of a pixel as continuation of a neighbouring surface; kInvalidDepth if there is none. */
std::uint16_t
depth_of (const RangeImage &image, int x, int y, bool any_colour)
{
  const std::uint16_t beside = likeliest (image, x, y);
  if (beside == kInvalidDepth)
    return kInvalidDepth;
  const auto &weights = weights_of_colour ();
  const Rgbx own = image.colour.at (x, y);
  PlaneFit plane;
  for (const Sample &s : kPattern) {
    const int u = x + s.x, v = y + s.y;
    if (u < 0 || v < 0 || u >= image.depth.width || v >= image.depth.height)
      continue;
    const std::uint16_t d = image.depth.at (u, v);
    const float away = float (d) - float (beside);
    if (d == kInvalidDepth || std::abs (away) > s.slant * float (beside))
      continue;
    const float like = any_colour ? 1 : weights[unlike (image.colour.at (u, v), own)];
    plane.add (float (s.x), float (s.y), away, s.weight * like);
  }
  if (plane.weight () < kEnough)
    return kInvalidDepth;
  const float most = kStep * float (beside), by = std::clamp (plane.at_origin (), -most, most);
  return static_cast<std::uint16_t> (std::clamp (float (beside) + by + 0.5f, 1.f, 65535.f));
}

} // namespace

/* The front: pixels without depth next to pixels with depth. */
void
DepthFill::begin (const RangeImage &image, const cv::Mat &allowed)
{
  const cv::Mat depth (
      allowed.size (), CV_16U, image.depth.data, static_cast<std::size_t> (image.depth.stride));
  cv::compare (depth, kInvalidDepth, known_, cv::CMP_NE);
  cv::dilate (known_, seen_, cv::Mat ());
  cv::bitwise_and (seen_, allowed, seen_);
  seen_.setTo (0, known_);
  cv::findNonZero (seen_, front_);
}

void
DepthFill::advance (const RangeImage &image, const cv::Mat &allowed)
{
  next_front_.clear ();
  for (std::size_t i = 0; i < front_.size ();
       i++) /* pixels without depth may be reached again from elsewhere */
    if (found_[i] == kInvalidDepth)
      seen_.at<std::uint8_t> (front_[i]) = 0;
  for (std::size_t i = 0; i < front_.size (); i++) {
    if (found_[i] == kInvalidDepth)
      continue;
    for_neighbours (image, front_[i].x, front_[i].y, [&] (int u, int v) {
      std::uint8_t &seen = seen_.at<std::uint8_t> (v, u);
      if (seen || !allowed.at<std::uint8_t> (v, u) || image.depth.at (u, v) != kInvalidDepth)
        return;
      seen = 1;
      next_front_.emplace_back (u, v);
    });
  }
  std::swap (front_, next_front_);
}

int
DepthFill::fill (const RangeImage &image, const cv::Mat &allowed, int reach, bool any_colour)
{
  int filled = 0;
  begin (image, allowed);
  for (int ring = 0; ring < reach && !front_.empty (); ring++) {
    found_.clear ();
    for (const cv::Point &at : front_)
      found_.push_back (depth_of (image, at.x, at.y, any_colour));
    for (std::size_t i = 0; i < front_.size (); i++) {
      image.depth.at (front_[i].x, front_[i].y) = found_[i]; /* it was invalid, or still is */
      filled += found_[i] != kInvalidDepth;
    }
    advance (image, allowed);
  }
  return filled;
}

} // namespace rangecast
