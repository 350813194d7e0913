/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "surroundings.hpp"

#include <algorithm>
#include <utility>

#include "../base/simd.hpp"

namespace rangecast {

/* Values are not loaded by condition in the loops below, so that vectors are. */
namespace {

/* The sides of blocks of 2 x 2 pixels.
 * @param width  of the rows above and below; @param more  scratch memory for one more */
void
halve_row (const std::uint8_t *__restrict above, const std::uint8_t *__restrict below, int width,
    std::int8_t *__restrict more, std::uint8_t *__restrict blocks)
{
  const auto sign_of = [] (std::uint8_t side) {
    return (side == std::uint8_t (Side::kForeground)) - (side == std::uint8_t (Side::kBackground));
  };
  for (int x = 0; x < width; x++)
    more[x] = std::int8_t (sign_of (above[x]) + sign_of (below[x]));
  more[width] = more[width - 1];
  for (int x = 0; x < (width + 1) / 2; x++) {
    const auto sum = std::int8_t (more[2 * x] + more[2 * x + 1]);
    blocks[x] = std::uint8_t ((sum > 0) * std::uint8_t (Side::kForeground) |
                              (sum < 0) * std::uint8_t (Side::kBackground));
  }
}

} // namespace

void
Surroundings::halve (const cv::Mat &sides)
{
  static_assert (int (Side::kUnknown) == 0);
  blocks_.create ((sides.rows + 1) / 2, (sides.cols + 1) / 2, CV_8U);
  more_.resize (std::size_t (sides.cols) + 1);
  for_this_cpu ([&] {
    for (int y = 0; y < blocks_.rows; y++)
      halve_row (sides.ptr<std::uint8_t> (2 * y),
          sides.ptr<std::uint8_t> (std::min (2 * y + 1, sides.rows - 1)), sides.cols, more_.data (),
          blocks_.ptr<std::uint8_t> (y));
  });
}

namespace {

/* What the pixels of a row see one step further, given what the next pixels in that direction are
 * and see. Columns are those of the next pixels. */
void
step_row (const std::uint8_t *__restrict side, const std::uint8_t *__restrict seen,
    const std::uint8_t *__restrict distance, int n, int reach, std::uint8_t *__restrict new_seen,
    std::uint8_t *__restrict new_distance)
{
  const auto most = static_cast<std::uint8_t> (reach);
  for (int x = 0; x < n; x++) {
    const std::uint8_t own = side[x], before = seen[x],
                       farther = std::min (static_cast<std::uint8_t> (distance[x] + 1), most);
    new_seen[x] = own ? own : before;
    new_distance[x] = own ? std::uint8_t{1} : farther;
  }
}

void
count_row (const std::uint8_t *__restrict seen, const std::uint8_t *__restrict distance, int n,
    int reach, std::uint8_t *__restrict foreground, std::uint8_t *__restrict background)
{
  for (int x = 0; x < n; x++) {
    const bool within = distance[x] < reach;
    foreground[x] =
        std::uint8_t (foreground[x] + (within & (seen[x] == std::uint8_t (Side::kForeground))));
    background[x] =
        std::uint8_t (background[x] + (!within | (seen[x] == std::uint8_t (Side::kBackground))));
  }
}

} // namespace

/* Four of the eight directions: along the row, and to three pixels of the previous row, which is
 * above for step 1 and below for step -1. Rows have a border of one pixel, from which a pixel sees
 * nothing. */
void
Surroundings::look (int reach, int step)
{
  static_assert (int (Side::kUnknown) == 0);
  const int width = blocks_.cols, height = blocks_.rows;
  const auto n = static_cast<std::size_t> (width) + 2;
  side_before_.assign (n, 0);
  for (auto *rows : {before_, row_})
    for (int k = 0; k < 3; k++) {
      rows[k].seen.assign (n, 0);
      rows[k].distance.assign (n, 0);
    }
  along_.seen.resize (n);
  along_.distance.resize (n);
  const int first = step > 0 ? 0 : height - 1;
  for (int i = 0, y = first; i < height; i++, y += step) {
    const auto side = blocks_.ptr<std::uint8_t> (y);
    auto foreground = foreground_.ptr<std::uint8_t> (y),
         background = background_.ptr<std::uint8_t> (y);
    std::uint8_t seen = 0, distance = 0;
    for (int j = 0, x = step > 0 ? 0 : width - 1; j < width; j++, x += step) {
      const std::uint8_t next = j > 0 ? side[x - step] : 0;
      seen = next ? next : seen;
      distance =
          next ? std::uint8_t{1} : static_cast<std::uint8_t> (std::min (distance + 1, reach));
      along_.seen[static_cast<std::size_t> (x)] = seen;
      along_.distance[static_cast<std::size_t> (x)] = distance;
    }
    for_this_cpu ([&] {
      count_row (
          along_.seen.data (), along_.distance.data (), width, reach, foreground, background);
      for (int k = 0; k < 3; k++) {
        step_row (side_before_.data () + k, before_[k].seen.data () + k,
            before_[k].distance.data () + k, width, reach, row_[k].seen.data () + 1,
            row_[k].distance.data () + 1);
        count_row (row_[k].seen.data () + 1, row_[k].distance.data () + 1, width, reach, foreground,
            background);
        std::swap (row_[k], before_[k]);
      }
    });
    std::copy_n (side, width, side_before_.begin () + 1);
  }
}

void
Surroundings::find_inside (const cv::Mat &sides, int reach, cv::Mat &inside)
{
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
  for_this_cpu ([&] { choose (sides, inside); });
}

/* The pixels without a side whose block sees foreground in enough directions. */
void
Surroundings::choose (const cv::Mat &sides, cv::Mat &inside)
{
  constexpr int kMinDirections = 4;
  const int width = sides.cols, n = blocks_.cols;
  enough_.resize (2 * static_cast<std::size_t> (n));
  std::uint8_t *__restrict enough = enough_.data ();
  for (int y = 0; y < sides.rows; y++) {
    const auto side = sides.ptr<std::uint8_t> (y);
    if (y % 2 == 0) {
      const auto foreground = foreground_.ptr<std::uint8_t> (y / 2),
                 background = background_.ptr<std::uint8_t> (y / 2);
      for (int x = 0; x < n; x++) {
        const std::uint8_t yes =
            (foreground[x] >= kMinDirections) & (foreground[x] >= 3 * background[x]) ? 255 : 0;
        enough[2 * x] = yes;
        enough[2 * x + 1] = yes;
      }
    }
    std::uint8_t *__restrict in = inside.ptr<std::uint8_t> (y);
    for (int x = 0; x < width; x++) {
      const std::uint8_t seen = enough[x];
      in[x] = side[x] == std::uint8_t (Side::kUnknown) ? seen : std::uint8_t{0};
    }
  }
}

} // namespace rangecast
