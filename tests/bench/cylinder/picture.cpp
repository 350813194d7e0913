/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "picture.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

using namespace rangecast;

namespace bench {

namespace {

constexpr int kSide = 640, kLower = 400, kTitle = 40;
constexpr double kHalfHeight = 0.004; ///< metres
constexpr double kZoom = 4;

/* What of the slice a square shows. */
struct Window {
  double x, z, size; ///< its middle and its side, metres
};

std::vector<Spot>
slice_of (FrameSet &set, double y)
{
  std::vector<Spot> spots = spots_of (set);
  std::erase_if (spots, [&] (const Spot &s) { return std::abs (s.point.y - y) > kHalfHeight; });
  return spots;
}

/* Dots smaller than a pixel's width are drawn in fixed point, so that lines of points stay thin. */
void
draw_points (const std::vector<Spot> &spots, const Window &window, double radius, cv::Mat square)
{
  /* Told apart by all but few eyes, also where they lie side by side. */
  const cv::Scalar colours[] = {{180, 119, 31}, {14, 127, 255}, {44, 160, 44}, {40, 39, 214},
      {189, 103, 148}, {75, 86, 140}, {34, 189, 188}, {194, 119, 227}};
  constexpr int kBits = 4;
  for (const Spot &s : spots) {
    const double x = (0.5 + (s.point.x - window.x) / window.size) * kSide,
                 y = square.rows / 2.0 + (s.point.z - window.z) / window.size * kSide;
    if (x > -9 && y > -9 && x < kSide + 9 && y < kSide + 9)
      cv::circle (square, cv::Point (int (x * (1 << kBits)), int (y * (1 << kBits))),
          int (radius * (1 << kBits)), colours[s.view % 8], cv::FILLED, cv::LINE_AA, kBits);
  }
}

void
draw_column (const std::vector<Spot> &spots, const Window &all, const Window &part,
    const char *title, cv::Mat column)
{
  const std::string text = std::string (title) + ": " + std::to_string (spots.size ()) + " points";
  cv::putText (column, text, {12, 28}, cv::FONT_HERSHEY_SIMPLEX, 0.8, {40, 40, 40}, 1, cv::LINE_AA);
  cv::Mat upper = column.rowRange (kTitle, kTitle + kSide),
          lower = column.rowRange (kTitle + kSide, kTitle + kSide + kLower);
  draw_points (spots, all, 1.6, upper);
  draw_points (spots, part, 3.5, lower);
  const double scale = kSide / all.size;
  const int half = int (part.size / 2 * scale), flat = half * kLower / kSide,
            x = int (kSide / 2 + (part.x - all.x) * scale),
            y = int (kSide / 2 + (part.z - all.z) * scale);
  cv::rectangle (upper, {x - half, y - flat}, {x + half, y + flat}, {120, 120, 120}, 1);
  cv::rectangle (lower, {0, 0}, {kSide - 1, kLower - 1}, {120, 120, 120}, 1);
}

} // namespace

Status
draw_slice (FrameSet &set, double y, const std::string &path)
{
  FrameSet fresh = set;
  fresh.restore ();
  const std::vector<Spot> before = slice_of (fresh, y), after = slice_of (set, y);
  if (before.empty ())
    return {StatusCode::kBadValue, "--picture: no point lies in the slice"};
  /* Without the outermost hundredth: a stray point would make all else small. */
  std::vector<double> xs, zs;
  for (const Spot &s : before)
    xs.push_back (s.point.x), zs.push_back (s.point.z);
  std::ranges::sort (xs);
  std::ranges::sort (zs);
  const auto end = [] (const std::vector<double> &v, double share) {
    return v[std::size_t (share * double (v.size () - 1))];
  };
  const double left = end (xs, 0.005), right = end (xs, 0.995), back = end (zs, 0.005),
               front = end (zs, 0.995);
  const Window all{
      (left + right) / 2, (back + front) / 2, 1.15 * std::max (right - left, front - back)};
  /* The front: the nose. */
  const Window part{all.x, front - 0.25 * all.size / kZoom, all.size / kZoom};
  cv::Mat picture (kTitle + kSide + kLower, 2 * kSide, CV_8UC3, cv::Scalar (255, 255, 255));
  draw_column (before, all, part, "before", picture.colRange (0, kSide));
  draw_column (after, all, part, "after", picture.colRange (kSide, 2 * kSide));
  try {
    if (cv::imwrite (path, picture, {cv::IMWRITE_PNG_COMPRESSION, 9, cv::IMWRITE_JPEG_QUALITY, 90}))
      return {};
  } catch (const cv::Exception &) { /* no such kind of picture */
  }
  return {StatusCode::kBadValue, "--picture " + path + ": cannot be written, expected FILE.png"};
}

} // namespace bench
