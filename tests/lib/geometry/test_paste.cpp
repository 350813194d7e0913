/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "../test-support.hpp"

#include <opencv2/imgproc.hpp>
#include <rangecast/geometry/paste.hpp>
#include <vector>

using namespace rangecast;

namespace {

/* One row of depths at (1, 1) of a picture that is larger by one pixel on each side. */
template <typename T>
std::vector<T>
map_of (std::vector<std::uint16_t> depth, std::uint16_t near, std::uint16_t far)
{
  const int width = static_cast<int> (depth.size ());
  std::vector<Rgbx> colour (depth.size ());
  ConstRangeImage image;
  image.roi = {1, 1, width, 1};
  image.depth = {depth.data (), width, 1, 2 * width};
  image.colour = {colour.data (), width, 1, 4 * width};
  std::vector<T> full (std::size_t (3 * (width + 2)), T{});
  const ImageView<T> view = {
      full.data (), width + 2, 3, static_cast<std::ptrdiff_t> (sizeof (T)) * (width + 2)};
  paste_depth_map (image, near, far, view);
  return {view.row (1), view.row (1) + width + 2};
}

} // namespace

TEST (DepthMap, grey_falls_from_near_to_far_and_is_black_where_depth_is_invalid)
{
  const auto grey = map_of<std::uint8_t> ({0, 1000, 1500, 2000, 65535, 1}, 1000, 2000);
  EXPECT_EQ (grey, (std::vector<std::uint8_t>{0, 0, 255, 128, 1, 1, 255, 0}));
}

TEST (DepthMap, turbo_is_near_opencv_s)
{
  std::vector<std::uint16_t> depth;
  for (int level = 255; level >= 1; level--)
    depth.push_back (static_cast<std::uint16_t> (2001 - level));
  const auto turbo = map_of<Rgbx> (depth, 1746, 2000);
  EXPECT_EQ (turbo.front ().r + turbo.front ().g + turbo.front ().b, 0); /* outside the ROI */
  int sum = 0;
  for (std::size_t i = 0; i < depth.size (); i++) {
    const cv::Mat level (1, 1, CV_8UC1, cv::Scalar (255 * (2000 - depth[i]) / 254.0));
    cv::Mat expected;
    cv::applyColorMap (level, expected, cv::COLORMAP_TURBO);
    const auto bgr = expected.at<cv::Vec3b> (0, 0);
    const int channels[][2] = {
        {turbo[i + 1].r, bgr[2]}, {turbo[i + 1].g, bgr[1]}, {turbo[i + 1].b, bgr[0]}};
    for (const auto &[ours, theirs] : channels) {
      EXPECT_NEAR (ours, theirs, 33) << "depth " << depth[i];
      sum += std::abs (ours - theirs);
    }
  }
  EXPECT_LT (sum, 8 * 3 * static_cast<int> (depth.size ()));
}

TEST (SwapBytes, changes_each_pixel_in_place)
{
  std::vector<std::uint16_t> pixels = {0x0102, 0xff00, 0, 0x1234};
  const ImageView<std::uint16_t> view = {pixels.data (), 2, 2, 4};
  swap_bytes ({pixels.data (), 2, 2, 4}, view);
  EXPECT_EQ (pixels, (std::vector<std::uint16_t>{0x0201, 0x00ff, 0, 0x3412}));
}
