/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "surroundings.hpp"

#include <utility>

namespace rangecast {

/* Half of the directions: along the row and to the three pixels of the row before, which is the one
 * above for step 1 and the one below for step -1. */
void
Surroundings::look (const cv::Mat &sides, int reach, int step)
{
  const int width = sides.cols, height = sides.rows;
  /* What a pixel sees in a direction is its neighbour there, or what that one sees. */
  const auto beyond = [reach] (Side side, Sight neighbour) -> Sight {
    if (side != Side::kUnknown)
      return {side, 1};
    if (neighbour.distance == 0 || neighbour.distance >= reach)
      return neighbour;
    return {neighbour.side, static_cast<std::uint8_t> (neighbour.distance + 1)};
  };
  const auto count = [reach] (Sight sight, std::uint8_t &foreground, std::uint8_t &background) {
    if (sight.distance == 0)
      return;
    const bool found = sight.side == Side::kForeground && sight.distance < reach;
    foreground += found;
    background += !found;
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
      const bool unknown = Side (side[x]) == Side::kUnknown;
      along = j > 0 ? beyond (Side (side[x - step]), along) : Sight{};
      if (unknown)
        count (along, foreground[x], background[x]);
      for (int k = 0; k < 3; k++) {
        const int u = x + k - 1;
        const bool outside = !side_before || u < 0 || u >= width;
        row_[k][x] = outside ? Sight{} : beyond (Side (side_before[u]), before_[k][u]);
        if (unknown)
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
  foreground_ = cv::Mat::zeros (sides.size (), CV_8U);
  background_ = cv::Mat::zeros (sides.size (), CV_8U);
  look (sides, reach, 1);
  look (sides, reach, -1);
  inside.create (sides.size (), CV_8U);
  for (int y = 0; y < sides.rows; y++) {
    const auto foreground = foreground_.ptr<std::uint8_t> (y),
               background = background_.ptr<std::uint8_t> (y);
    auto in = inside.ptr<std::uint8_t> (y);
    for (int x = 0; x < sides.cols; x++)
      in[x] = foreground[x] >= kMinDirections && foreground[x] >= 3 * background[x] ? 255 : 0;
  }
}

} // namespace rangecast
