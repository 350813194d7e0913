/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "matchers.hpp"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <functional>
#include <opencv2/imgproc.hpp>

using namespace rangecast;

namespace bench {
namespace {

/* The least processor time of all threads: other programs add to each time. */
double
min_cpu_ms (int rounds, const std::function<void ()> &work)
{
  double min_ms = INFINITY;
  for (int i = 0; i < rounds; i++) {
    const std::clock_t begin = std::clock ();
    work ();
    min_ms = std::min (min_ms, 1000.0 * double (std::clock () - begin) / CLOCKS_PER_SEC);
  }
  return min_ms;
}

/* @param disparity  CV_32F, NaN = none */
Row
judge (const std::string &name, const cv::Mat &disparity, const cv::Mat &truth, double ms)
{
  std::vector<double> errors;
  int known = 0, found = 0, bad1 = 0, bad2 = 0;
  for (int y = 0; y < disparity.rows; y++)
    for (int x = 0; x < disparity.cols; x++) {
      const float d = disparity.at<float> (y, x), t = truth.empty () ? 0 : truth.at<float> (y, x);
      known += truth.empty () || t > 0;
      if (std::isnan (d) || (!truth.empty () && t <= 0))
        continue;
      found++;
      if (truth.empty ())
        continue;
      errors.push_back (std::abs (d - t));
      bad1 += errors.back () > 1;
      bad2 += errors.back () > 2;
    }
  Row row{name, double (found) / std::max (1, known), 0, 0, 0, ms};
  if (!errors.empty ()) {
    std::ranges::nth_element (errors, errors.begin () + std::ptrdiff_t (errors.size () / 2));
    row.bad1 = bad1 / double (errors.size ());
    row.bad2 = bad2 / double (errors.size ());
    row.median_px = errors[errors.size () / 2];
  }
  return row;
}

ImageView<const Rgbx>
view_of (const cv::Mat &m)
{
  return {reinterpret_cast<const Rgbx *> (m.data), m.cols, m.rows, std::ptrdiff_t (m.step)};
}

/* As a careful user would set them: of a grid of 144 settings (block 3 to 7, penalties, uniqueness
 * 0 to 15, speckles 100/2 and 200/1, cap 31 and 63), none was both denser and less often wrong by 2
 * pixels, on aloe and on motorcycle. */
constexpr int kBlock = 3, kArea = kBlock * kBlock, kUniqueness = 10, kCap = 31, kLeftRight = 1,
              kSpeckleWindow = 200, kSpeckleRange = 1;

cv::Ptr<cv::StereoSGBM>
make_sgbm (const Pair &pair, int mode)
{
  return cv::StereoSGBM::create (pair.least, pair.count, kBlock, 8 * kArea, 32 * kArea, kLeftRight,
      kCap, kUniqueness, kSpeckleWindow, kSpeckleRange, mode);
}

Row
run_opencv (const Pair &pair, cv::StereoMatcher &matcher, const std::string &name, int rounds,
    bool widened = false)
{
  const int missing = widened ? std::max (0, pair.least + pair.count) : 0;
  cv::Mat greys[2], raw;
  const double ms = min_cpu_ms (rounds, [&] {
    for (int i = 0; i < 2; i++)
      if (missing)
        cv::copyMakeBorder (pair.greys[i], greys[i], 0, 0, missing, 0, cv::BORDER_REPLICATE);
    matcher.compute (missing ? greys[0] : pair.greys[0], missing ? greys[1] : pair.greys[1], raw);
  });
  cv::Mat disparity (pair.greys[0].size (), CV_32F, cv::Scalar (NAN));
  for (int y = 0; y < disparity.rows; y++)
    for (int x = 0; x < disparity.cols; x++)
      if (const int d = raw.at<std::int16_t> (y, x + missing);
          d >= 16 * pair.least && d <= 16 * x + 16 * pair.count * !missing)
        disparity.at<float> (y, x) = float (d) / 16;
  return judge (name, disparity, pair.truth, ms);
}

} // namespace

Status
prepare (Pair &pair)
{
  Rectifier rectifier;
  if (Status s = rectifier.set (pair.view); !s.ok ())
    return s;
  const View &range = rectifier.range_view ();
  pair.focal_baseline = range.intrinsics.fx * rectifier.baseline_m ();
  pair.offset = rectifier.principal_offset ();
  pair.least = int (std::floor (pair.focal_baseline / range.far_m - pair.offset));
  const int most = int (std::ceil (pair.focal_baseline / range.near_m - pair.offset));
  pair.count = (most - pair.least + 1 + 15) / 16 * 16;
  for (int i = 0; i < 2; i++) {
    cv::Mat rectified;
    rectifier.rectify (i, i ? pair.right : pair.left, rectified);
    cv::cvtColor (rectified, pair.greys[i], cv::COLOR_RGBA2GRAY);
  }
  return {};
}

Status
run_ours (const Pair &pair, int n_threads, int rounds, Row &row)
{
  StereoDepth stereo;
  if (Status s = stereo.set (pair.view, n_threads); !s.ok ())
    return s;
  const cv::Size size = pair.left.size ();
  cv::Mat depth (size, CV_16U), colour (size, CV_8UC4), disparity (size, CV_32F, cv::Scalar (NAN));
  const RangeImage image = {pair.view.id, {0, 0, size.width, size.height},
      {depth.ptr<std::uint16_t> (), size.width, size.height, std::ptrdiff_t (depth.step)},
      {reinterpret_cast<Rgbx *> (colour.data), size.width, size.height,
          std::ptrdiff_t (colour.step)},
      0};
  Status status;
  const double ms = min_cpu_ms (
      rounds, [&] { status = stereo.process (view_of (pair.left), view_of (pair.right), image); });
  if (!status.ok ())
    return status;
  for (int y = 0; y < size.height; y++)
    for (int x = 0; x < size.width; x++)
      if (depth.at<std::uint16_t> (y, x)) /* finer than depth units are */
        disparity.at<float> (y, x) = float (stereo.disparity ().at (x, y) / 16.0 - pair.offset);
  row = judge ("stereodepth", disparity, pair.truth, ms);
  return {};
}

std::vector<Row>
run_peers (const Pair &pair, int rounds)
{
  std::vector<Row> rows;
  const auto threeway = make_sgbm (pair, cv::StereoSGBM::MODE_SGBM_3WAY);
  rows.push_back (run_opencv (pair, *threeway, "OpenCV SGBM 3-way", rounds));
  rows.push_back (run_opencv (pair, *threeway, "OpenCV SGBM 3-way, widened", rounds, true));
  const auto sgbm = make_sgbm (pair, cv::StereoSGBM::MODE_SGBM);
  rows.push_back (run_opencv (pair, *sgbm, "OpenCV SGBM", rounds));
  const auto bm = cv::StereoBM::create (pair.count, 15);
  bm->setMinDisparity (pair.least);
  bm->setDisp12MaxDiff (kLeftRight);
  bm->setSpeckleWindowSize (kSpeckleWindow);
  bm->setSpeckleRange (kSpeckleRange);
  rows.push_back (run_opencv (pair, *bm, "OpenCV BM", rounds));
  return rows;
}

} // namespace bench
