/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "score.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace bench {
namespace {

constexpr double kGrey = 128;

cv::Mat
box (int side)
{
  return cv::Mat::ones (side, side, CV_8U);
}

/** Masks and pictures of one truth and what was drawn of it. */
struct Comparison {
  cv::Mat truth, ours;        ///< CV_8UC3, RGB, over mid-grey
  cv::Mat real, drawn, known; ///< CV_8U masks; known: not near what no camera sees
  cv::Mat inside;

  Comparison (const Shot &shot, const cv::Mat &rgba);
};

/* The colours, by their coverage, over mid-grey. */
cv::Mat
over_grey (const cv::Mat &rgb, const cv::Mat &coverage)
{
  cv::Mat contrast, share, shares, result;
  rgb.convertTo (contrast, CV_32F);
  contrast -= cv::Scalar::all (kGrey);
  coverage.convertTo (share, CV_32F, 1 / 255.0);
  cv::merge (std::vector<cv::Mat>{share, share, share}, shares);
  cv::Mat (contrast.mul (shares) + cv::Scalar::all (kGrey)).convertTo (result, CV_8U);
  return result;
}

Comparison::Comparison (const Shot &shot, const cv::Mat &rgba)
{
  cv::Mat rgb, alpha, closed, unseen;
  cv::cvtColor (rgba, rgb, cv::COLOR_RGBA2RGB);
  cv::extractChannel (rgba, alpha, 3);
  truth = over_grey (shot.colour, shot.coverage);
  ours = over_grey (rgb, alpha);
  real = shot.coverage > 127;
  drawn = alpha > 127;
  cv::morphologyEx (shot.seen, closed, cv::MORPH_CLOSE, box (3));
  cv::dilate (real & ~closed, unseen, box (9));
  known = ~unseen;
  cv::erode (real & drawn & known, inside, box (7), {-1, -1}, 1, cv::BORDER_CONSTANT, 0);
}

/* One value a pixel, mean of the channels. */
cv::Mat
ssim_map (const cv::Mat &a_bytes, const cv::Mat &b_bytes)
{
  cv::Mat a, b;
  a_bytes.convertTo (a, CV_64F);
  b_bytes.convertTo (b, CV_64F);
  const auto local_mean = [] (const cv::Mat &m) {
    cv::Mat out;
    cv::GaussianBlur (m, out, {11, 11}, 1.5);
    return out;
  };
  constexpr double kC1 = 0.01 * 255 * 0.01 * 255, kC2 = 0.03 * 255 * 0.03 * 255;
  const cv::Scalar c1 = cv::Scalar::all (kC1), c2 = cv::Scalar::all (kC2);
  const cv::Mat ma = local_mean (a), mb = local_mean (b), maa = ma.mul (ma), mbb = mb.mul (mb),
                mab = ma.mul (mb);
  const cv::Mat va = local_mean (a.mul (a)) - maa, vb = local_mean (b.mul (b)) - mbb,
                vab = local_mean (a.mul (b)) - mab;
  const cv::Mat luminance = 2 * mab + c1, structure = 2 * vab + c2, below1 = maa + mbb + c1,
                below2 = va + vb + c2;
  cv::Mat channels, mean;
  cv::divide (luminance.mul (structure), below1.mul (below2), channels);
  cv::transform (channels, mean, cv::Matx13d (1 / 3.0, 1 / 3.0, 1 / 3.0));
  return mean;
}

double
share_of (const cv::Mat &part, const cv::Mat &all)
{
  const int n = cv::countNonZero (all);
  return n > 0 ? double (cv::countNonZero (part)) / n : 0;
}

/* Distances from the outline of one mask to that of the other. */
void
append_distances (
    const cv::Mat &from, const cv::Mat &to, const cv::Mat &known, std::vector<float> &distances)
{
  cv::Mat outline, other, distance;
  cv::morphologyEx (from, outline, cv::MORPH_GRADIENT, box (3));
  cv::morphologyEx (to, other, cv::MORPH_GRADIENT, box (3));
  if (cv::countNonZero (other) == 0)
    return;
  cv::distanceTransform (~other, distance, cv::DIST_L2, 5);
  outline &= known;
  for (int y = 0; y < outline.rows; y++)
    for (int x = 0; x < outline.cols; x++)
      if (outline.at<uchar> (y, x))
        distances.push_back (distance.at<float> (y, x));
}

cv::Mat
gradient (const cv::Mat &rgb)
{
  cv::Mat grey, x, y, length;
  cv::cvtColor (rgb, grey, cv::COLOR_RGB2GRAY);
  cv::Sobel (grey, x, CV_64F, 1, 0);
  cv::Sobel (grey, y, CV_64F, 0, 1);
  cv::magnitude (x, y, length);
  return length;
}

double
seam_of (const Comparison &c)
{
  const cv::Mat ours = gradient (c.ours), truth = gradient (c.truth);
  cv::Mat near_by;
  cv::dilate (truth, near_by, box (5));
  const cv::Mat extra = cv::max (ours - near_by, 0);
  const auto sum = [&] (const cv::Mat &m) {
    cv::Mat part = cv::Mat::zeros (m.size (), m.type ());
    m.copyTo (part, c.inside);
    return cv::sum (part)[0];
  };
  const double real = sum (truth);
  return real > 0 ? sum (extra) / real : 0;
}

} // namespace

void
Score::add (const Shot &shot, const cv::Mat &rgba)
{
  const Comparison c (shot, rgba);
  const cv::Mat seen = shot.seen & c.real & c.known, spilt = c.drawn & ~c.real & c.known;
  holes_ += share_of (seen & ~c.drawn, seen);
  const int figure = cv::countNonZero (c.real);
  spill_ += figure > 0 ? double (cv::countNonZero (spilt)) / figure : 0;

  cv::Mat difference, worst, wide, around;
  cv::absdiff (c.truth, c.ours, difference);
  difference.convertTo (wide, CV_64F);
  const cv::Scalar squares = cv::mean (wide.mul (wide), c.inside);
  psnr_ +=
      10 * std::log10 (255.0 * 255 / std::max ((squares[0] + squares[1] + squares[2]) / 3, 1e-6));
  cv::reduce (difference.reshape (1, int (difference.total ())), worst, 1, cv::REDUCE_MAX);
  worst = worst.reshape (1, difference.rows);
  bad_ += share_of ((worst > 40) & c.inside, c.inside);

  const cv::Mat ssim = ssim_map (c.truth, c.ours);
  cv::dilate (c.real | c.drawn, around, box (5));
  ssim_ += cv::mean (ssim, c.inside)[0];
  ssim_all_ += cv::mean (ssim, around & c.known)[0];

  std::vector<float> distances;
  append_distances (c.drawn, c.real, c.known, distances);
  append_distances (c.real, c.drawn, c.known, distances);
  if (!distances.empty ()) {
    double sum = 0;
    for (const float d : distances)
      sum += d;
    edge_ += sum / double (distances.size ());
    const auto at = distances.begin () + std::ptrdiff_t (0.95 * double (distances.size () - 1));
    std::nth_element (distances.begin (), at, distances.end ());
    edge95_ += *at;
  }
  seam_ += seam_of (c);
  shots_++;
}

void
MotionScore::add (int place, const Shot &truth, const cv::Mat &rgba)
{
  score_.add (truth, rgba);
  Last &last = last_[place];
  if (!last.rgba.empty ()) {
    const Comparison now (truth, rgba), then (last.truth, last.rgba);
    cv::Mat inside, ours, real, channels[3];
    cv::erode (now.real & now.drawn & then.real & then.drawn, inside, box (5), {-1, -1}, 1,
        cv::BORDER_CONSTANT, 0);
    cv::subtract (now.ours, then.ours, ours, cv::noArray (), CV_16S);
    cv::subtract (now.truth, then.truth, real, cv::noArray (), CV_16S);
    cv::split (cv::abs (ours - real), channels);
    const cv::Mat most = cv::max (cv::max (channels[0], channels[1]), channels[2]);
    flicker_ += share_of ((most > 20) & inside, inside);
    outline_ += share_of ((now.drawn ^ then.drawn) & ~(now.real ^ then.real), now.real);
    changes_++;
  }
  last = {truth, rgba.clone ()};
}

cv::Mat
comparison (const Shot &shot, const cv::Mat &rgba)
{
  const Comparison c (shot, rgba);
  cv::Mat parts[3], sheet, wide;
  cv::cvtColor (c.truth, parts[0], cv::COLOR_RGB2BGR);
  cv::cvtColor (c.ours, parts[1], cv::COLOR_RGB2BGR);
  cv::subtract (parts[1], parts[0], wide, {}, CV_16S);
  wide.convertTo (parts[2], CV_8U, 4, kGrey);
  parts[2].setTo (cv::Scalar (255, 0, 255), shot.seen & c.real & c.known & ~c.drawn);
  parts[2].setTo (cv::Scalar (255, 255, 0), c.drawn & ~c.real & c.known);
  cv::hconcat (parts, 3, sheet);
  return sheet;
}

} // namespace bench
