/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "plain.hpp"

#include <cmath>
#include <opencv2/imgproc.hpp>

namespace bench {
namespace {

constexpr int kSamples = 4; /* of a pixel, along its row */

/* A plane behind a rectangle of the left picture. */
struct Surface {
  cv::Rect2d area;
  double at, across, down; /* disparity at the area's top left, and its change per pixel, pixels */
  cv::Mat texture;         /* CV_32F: grey levels, of twice the picture's width */

  [[nodiscard]] double disparity (double x, double y) const
  {
    return at + across * (x - area.x) + down * (y - area.y);
  }
  [[nodiscard]] float grey (double x, int y) const
  {
    const auto row = texture.ptr<float> (y);
    const auto at = [&] (int column) {
      return row[cv::borderInterpolate (column, texture.cols, cv::BORDER_REFLECT)];
    };
    const int before = int (std::floor (2 * x));
    const auto share = float (2 * x - before);
    return at (before) * (1 - share) + at (before + 1) * share;
  }
  /* The column of the left picture that the right one shows at x. */
  [[nodiscard]] double seen_at (double x, double y) const
  {
    return (x + at - across * area.x + down * (y - area.y)) / (1 - across);
  }
};

/* Noise of several scales, and a gradient from left to right. */
cv::Mat
make_texture (cv::Size size, double contrast, double level, double gradient, cv::RNG &random)
{
  cv::Mat texture (size.height, 2 * size.width, CV_32F);
  for (int x = 0; x < texture.cols; x++)
    texture.col (x).setTo (level + gradient * x / texture.cols);
  for (const int scale : {2, 6, 25, 100}) {
    cv::Mat coarse (texture.rows / scale + 2, texture.cols / scale + 2, CV_32F), fine;
    random.fill (coarse, cv::RNG::NORMAL, 0, contrast * std::sqrt (scale / 2.0));
    cv::resize (coarse, fine, texture.size (), 0, 0, cv::INTER_CUBIC);
    texture += fine;
  }
  return texture;
}

std::vector<Surface>
make_room (cv::Size size, cv::RNG &random)
{
  const double w = size.width, h = size.height, unit = w / 640, floor = 0.62 * h;
  std::vector<Surface> room = {
      {{-w, -h, 3 * w, 3 * h}, 12 * unit, 0.004, 0, make_texture (size, 0.6, 190, 40, random)},
      {{-w, floor, 3 * w, h}, 13 * unit, 0, 34 * unit / (h - floor),
          make_texture (size, 1.5, 110, 20, random)}};
  for (int i = 0; i < 6; i++) {
    const cv::Rect2d area (w * (0.13 + 0.14 * i), h * random.uniform (0.05, 0.5), 0.11 * w,
        h * random.uniform (0.2, 0.45));
    room.push_back ({area, unit * random.uniform (18.0, 46.0), random.uniform (-0.06, 0.06), 0,
        make_texture (size, random.uniform (0.5, 1.0), i == 3 ? 275 : random.uniform (70.0, 220.0),
            random.uniform (-60.0, 60.0), random)});
  }
  return room;
}

/* The grey levels that a camera sees, and the disparities that it shows. */
void
draw (const std::vector<Surface> &room, cv::Size size, bool is_right, cv::Mat &grey, cv::Mat &truth)
{
  cv::Mat samples (size.height, size.width * kSamples, CV_32F);
  truth.create (size, CV_32F);
  for (int y = 0; y < size.height; y++)
    for (int i = 0; i < samples.cols; i++) {
      const double x = (i + 0.5) / kSamples - 0.5;
      double nearest = 0;
      for (const Surface &s : room) {
        const double column = is_right ? s.seen_at (x, y) : x, d = s.disparity (column, y);
        if (d <= nearest || !s.area.contains ({column, double (y)}))
          continue;
        nearest = d;
        samples.at<float> (y, i) = s.grey (column, y);
      }
      if (i % kSamples == kSamples / 2)
        truth.at<float> (y, i / kSamples) = float (nearest);
    }
  cv::resize (samples, grey, size, 0, 0, cv::INTER_AREA);
  cv::GaussianBlur (grey, grey, {}, 0.6);
}

} // namespace

void
render_plain (cv::Size size, double noise_sigma, Pair &pair)
{
  cv::RNG random (5);
  const std::vector<Surface> room = make_room (size, random);
  for (int i = 0; i < 2; i++) {
    cv::Mat grey, seen, noise (size, CV_32FC4), picture;
    draw (room, size, i == 1, grey, seen);
    if (i == 0)
      pair.truth = seen;
    cv::cvtColor (grey * (i == 1 ? 1.03 : 1), picture, cv::COLOR_GRAY2RGBA);
    random.fill (noise, cv::RNG::NORMAL, 0, noise_sigma);
    cv::add (picture, noise, picture);
    picture.convertTo (i == 1 ? pair.right : pair.left, CV_8U);
  }
}

} // namespace bench
