/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "surroundings.hpp"

#include <algorithm>
#include <utility>

namespace rangecast {

void
Surroundings::halve (const cv::Mat &sides)
{
  blocks_.create ((sides.rows + 1) / 2, (sides.cols + 1) / 2, CV_8U);
  const auto more = [] (std::uint8_t side) {
    return (Side (side) == Side::kForeground) - (Side (side) == Side::kBackground);
  };
  for (int y = 0; y < blocks_.rows; y++) {
    const auto above = sides.ptr<std::uint8_t> (2 * y);
    const auto below = sides.ptr<std::uint8_t> (std::min (2 * y + 1, sides.rows - 1));
    auto block = blocks_.ptr<std::uint8_t> (y);
    for (int x = 0; x < blocks_.cols; x++) {
      const int u = 2 * x, v = std::min (u + 1, sides.cols - 1);
      const int sum = more (above[u]) + more (above[v]) + more (below[u]) + more (below[v]);
      block[x] = std::uint8_t (sum > 0   ? Side::kForeground
                               : sum < 0 ? Side::kBackground
                                         : Side::kUnknown);
    }
  }
}

/* Four of the eight directions: along the row, and to three pixels of the previous row, which is
 * above for step 1 and below for step -1. */
void
Surroundings::look (int reach, int step)
{
  const cv::Mat &sides = blocks_;
  const int width = sides.cols, height = sides.rows;
  /* A pixel sees its neighbour in a direction, or what that one sees. */
  const auto beyond = [reach] (Side side, Sight neighbour) -> Sight {
    if (side != Side::kUnknown)
      return {side, 1};
    if (neighbour.distance >= reach)
      return neighbour;
    return {neighbour.side, static_cast<std::uint8_t> (neighbour.distance + 1)};
  };
  const auto count = [reach] (Sight sight, std::uint8_t &foreground, std::uint8_t &background) {
    const bool within = sight.distance < reach;
    foreground += within && sight.side == Side::kForeground;
    background += !within || sight.side == Side::kBackground;
  };
  for (auto *rows : {before_, row_})
    for (int k = 0; k < 3; k++)
      rows[k].assign (static_cast<std::size_t> (width), {});
  const int first = step > 0 ? 0 : height - 1;
  for (int i = 0, y = first; i < height; i++, y += step) {
    const auto side = sides.ptr<std::uint8_t> (y);
    const auto side_before = i > 0 ? sides.ptr<std::uint8_t> (y - step) : nullptr;
    auto foreground = foreground_.ptr<std::uint8_t> (y),
         background = background_.ptr<std::uint8_t> (y);
    Sight along;
    for (int j = 0, x = step > 0 ? 0 : width - 1; j < width; j++, x += step) {
      along = j > 0 ? beyond (Side (side[x - step]), along) : Sight{};
      count (along, foreground[x], background[x]);
      for (int k = 0; k < 3; k++) {
        const int u = x + k - 1;
        const bool outside = !side_before || u < 0 || u >= width;
        row_[k][x] = outside ? Sight{} : beyond (Side (side_before[u]), before_[k][u]);
        count (row_[k][x], foreground[x], background[x]);
      }
    }
    for (int k = 0; k < 3; k++)
      std::swap (row_[k], before_[k]);
  }
}

void
Surroundings::find_inside (const cv::Mat &sides, int reach, cv::Mat &inside)
{
  constexpr int kMinDirections = 4;
  halve (sides);
  inside.create (sides.size (), CV_8U);
  inside.setTo (0);
  cv::compare (blocks_, int (Side::kForeground), foreground_, cv::CMP_EQ);
  if (cv::countNonZero (foreground_) == 0)
    return;
  foreground_.setTo (0);
  background_.create (blocks_.size (), CV_8U);
  background_.setTo (0);
  look (std::max (1, reach / 2), 1);
  look (std::max (1, reach / 2), -1);
  for (int y = 0; y < sides.rows; y++) {
    const auto side = sides.ptr<std::uint8_t> (y);
    const auto foreground = foreground_.ptr<std::uint8_t> (y / 2),
               background = background_.ptr<std::uint8_t> (y / 2);
    auto in = inside.ptr<std::uint8_t> (y);
    for (int x = 0; x < sides.cols; x++)
      if (Side (side[x]) == Side::kUnknown && foreground[x / 2] >= kMinDirections &&
          foreground[x / 2] >= 3 * background[x / 2])
        in[x] = 255;
  }
}

} // namespace rangecast
