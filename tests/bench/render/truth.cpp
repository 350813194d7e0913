/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "truth.hpp"

#include <cmath>
#include <memory>
#include <opencv2/imgproc.hpp>

#include "frames.hpp"

using namespace rangecast;

namespace bench {
namespace {

/* A ring of so many cameras, of which some stand at the wanted angle to one of four. */
struct Ring {
  int angle_deg, cameras, which[4];
};
constexpr Ring kRings[] = {{0, 4, {0, 1, 2, 3}}, {20, 18, {1, 8, 10, 17}}, {45, 8, {1, 3, 5, 7}}};

template <typename T>
ImageView<T>
view_of (cv::Mat &m)
{
  return {reinterpret_cast<T *> (m.data), m.cols, m.rows, std::ptrdiff_t (m.step)};
}

cv::Mat
drawn (const cv::Mat &rgba)
{
  cv::Mat alpha;
  cv::extractChannel (rgba, alpha, 3);
  return alpha >= 128;
}

/* The luma, 0 where the other picture has nothing. */
cv::Mat
luma_in (const cv::Mat &rgba, const cv::Mat &where)
{
  cv::Mat grey, luma = cv::Mat::zeros (rgba.size (), CV_32F);
  cv::cvtColor (rgba, grey, cv::COLOR_RGBA2GRAY);
  grey.convertTo (grey, CV_32F);
  grey.copyTo (luma, where);
  return luma;
}

/* Windows see only the pixels that both pictures have, which `where` tells: the zeros beyond would
 * be an edge that both have in common, and make pictures alike along their outlines. */
double
sum_of_ssim (const cv::Mat &a, const cv::Mat &b, const cv::Mat &where)
{
  const auto sums = [] (const cv::Mat &m) {
    cv::Mat out;
    cv::GaussianBlur (m, out, {11, 11}, 1.5);
    return out;
  };
  cv::Mat ones;
  where.convertTo (ones, CV_32F, 1 / 255.0);
  const cv::Mat weights = cv::max (sums (ones), 1e-6);
  const auto mean = [&] (const cv::Mat &m) -> cv::Mat { return sums (m) / weights; };
  constexpr double kC1 = 0.01 * 255 * 0.01 * 255, kC2 = 0.03 * 255 * 0.03 * 255;
  const cv::Mat ma = mean (a), mb = mean (b), maa = ma.mul (ma), mbb = mb.mul (mb),
                mab = ma.mul (mb);
  const cv::Mat va = mean (a.mul (a)) - maa, vb = mean (b.mul (b)) - mbb,
                vab = mean (a.mul (b)) - mab;
  const cv::Mat above = (2 * mab + kC1).mul (2 * vab + kC2);
  const cv::Mat below = (maa + mbb + kC1).mul (va + vb + kC2);
  cv::Mat ssim, inside;
  cv::divide (above, below, ssim);
  ssim.copyTo (inside, where);
  return cv::sum (inside)[0];
}

} // namespace

Status
make_truth (SceneSettings settings, int angle_deg, std::vector<Shot> &shots)
{
  const Ring *ring = kRings;
  while (ring->angle_deg != angle_deg)
    ring++;
  settings.views = ring->cameras;
  settings.arc_deg = 360;
  settings.width = kWidth;
  settings.height = kHeight;
  settings.noise_sigma = 0;
  std::unique_ptr<Scene> scene;
  Status status = Scene::create (settings, scene);
  for (int i = 0; i < 4 && status.ok (); i++) {
    Shot shot{360.0 * ring->which[i] / ring->cameras, {kHeight, kWidth, CV_8UC4},
        {kHeight, kWidth, CV_8U}};
    status = scene->render (ring->which[i], SceneCamera::kLeft, kMoment, false,
        view_of<Rgbx> (shot.colour), {}, view_of<std::uint8_t> (shot.mask));
    shot.mask *= 255;
    shots.push_back (shot);
  }
  return status;
}

void
Score::add (const Shot &truth, const cv::Mat &rgba)
{
  const cv::Mat ours = drawn (rgba), both = ours & truth.mask;
  cv::Mat difference, wide;
  cv::absdiff (truth.colour, rgba, difference);
  difference.setTo (0, ~both);
  difference.convertTo (wide, CV_32F);
  const cv::Scalar sums = cv::sum (wide.mul (wide));
  squares_ += sums[0] + sums[1] + sums[2];
  truth_ += cv::countNonZero (truth.mask);
  both_ += cv::countNonZero (both);
  missing_ += cv::countNonZero (truth.mask & ~ours);
  beside_ += cv::countNonZero (ours & ~truth.mask);
  ssim_ += sum_of_ssim (luma_in (truth.colour, both), luma_in (rgba, both), both);
}

double
Score::psnr () const
{
  return both_ > 0 ? 10 * std::log10 (255.0 * 255 / std::max (squares_ / (3 * both_), 1e-6)) : 0;
}

cv::Mat
comparison (const Shot &truth, const cv::Mat &rgba)
{
  const cv::Mat ours = drawn (rgba);
  cv::Mat parts[3], sheet, wide;
  cv::cvtColor (truth.colour, parts[0], cv::COLOR_RGBA2BGR);
  parts[0].setTo (cv::Scalar (40, 36, 32), ~truth.mask);
  cv::cvtColor (rgba, parts[1], cv::COLOR_RGBA2BGR);
  parts[1].setTo (cv::Scalar (40, 36, 32), ~ours);
  cv::subtract (parts[1], parts[0], wide, {}, CV_16S);
  wide.convertTo (parts[2], CV_8U, 4, 128);
  parts[2].setTo (cv::Scalar (255, 0, 255), truth.mask & ~ours);
  parts[2].setTo (cv::Scalar (255, 255, 0), ours & ~truth.mask);
  cv::hconcat (parts, 3, sheet);
  return sheet;
}

} // namespace bench
