/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Depth for pixels that have none, from those beside them. */
#include "../test-support.hpp"

#include <cmath>
#include <opencv2/core.hpp>
#include <rangecast/roi/depth_fill.hpp>

using namespace rangecast;
using rangecast::testing::Image;

namespace {

constexpr int kWidth = 48, kHeight = 40;
constexpr Rgbx kSkin = {190, 140, 120, 0}, kHair = {50, 35, 25, 0};

/* One surface of one colour, with depth everywhere. */
struct Frame {
  Image<std::uint16_t> depth{kWidth, kHeight};
  Image<Rgbx> colour{kWidth, kHeight};
  cv::Mat allowed{kHeight, kWidth, CV_8U, cv::Scalar (255)};

  /* Depth units a pixel to the right and down. */
  explicit Frame (double right = 0, double down = 0)
  {
    for (int y = 0; y < kHeight; y++)
      for (int x = 0; x < kWidth; x++) {
        depth.view ().at (x, y) = plane (x, y, right, down);
        colour.view ().at (x, y) = kSkin;
      }
  }
  static std::uint16_t plane (int x, int y, double right, double down)
  {
    return static_cast<std::uint16_t> (std::lround (8000 + right * x + down * y));
  }
  void clear (int x0, int y0, int x1, int y1)
  {
    for (int y = y0; y < y1; y++)
      for (int x = x0; x < x1; x++)
        depth.view ().at (x, y) = kInvalidDepth;
  }
  int fill (int reach)
  {
    DepthFill filler;
    return filler.fill (
        {0, {0, 0, kWidth, kHeight}, depth.view (), colour.view (), 0}, allowed, reach);
  }
  [[nodiscard]] int at (int x, int y) { return depth.view ().at (x, y); }
};

} // namespace

TEST (DepthFill, slanted_surface_goes_on_as_it_slopes)
{
  Frame frame (20, -10);
  frame.clear (30, 0, kWidth, kHeight);
  EXPECT_EQ (frame.fill (4), 4 * kHeight);
  for (int y = 0; y < kHeight; y++)
    for (int x = 30; x < 34; x++)
      EXPECT_NEAR (frame.at (x, y), Frame::plane (x, y, 20, -10), 16) << x << " " << y;
}

TEST (DepthFill, what_is_not_allowed_stays_without_depth)
{
  Frame frame;
  frame.clear (30, 0, kWidth, kHeight);
  frame.allowed.colRange (31, kWidth).setTo (0);
  EXPECT_EQ (frame.fill (9), kHeight);
}

TEST (DepthFill, another_colour_stays_without_depth)
{
  Frame frame;
  frame.clear (30, 0, kWidth, kHeight);
  for (int y = 0; y < kHeight; y++)
    for (int x = 30; x < kWidth; x++)
      frame.colour.view ().at (x, y) = kHair;
  EXPECT_EQ (frame.fill (4), 0);
}

TEST (DepthFill, of_two_surfaces_the_one_of_the_same_colour_goes_on)
{
  Frame frame; /* hair far behind, at the right; what is missing between them has hair's colour */
  for (int y = 0; y < kHeight; y++)
    for (int x = 24; x < kWidth; x++) {
      frame.depth.view ().at (x, y) = 10000;
      frame.colour.view ().at (x, y) = kHair;
    }
  frame.clear (24, 0, 30, kHeight);
  EXPECT_EQ (frame.fill (6), 6 * kHeight);
  for (int x = 24; x < 30; x++)
    EXPECT_EQ (frame.at (x, 20), 10000) << x;
}

TEST (DepthFill, no_depth_between_two_surfaces_comes_up)
{
  Frame frame; /* the same colour on both sides of a step */
  for (int y = 0; y < kHeight; y++)
    for (int x = 24; x < kWidth; x++)
      frame.depth.view ().at (x, y) = 10000;
  frame.clear (20, 0, 28, kHeight);
  frame.fill (9);
  for (int x = 20; x < 28; x++)
    EXPECT_TRUE (frame.at (x, 20) == 8000 || frame.at (x, 20) == 10000) << frame.at (x, 20);
}
