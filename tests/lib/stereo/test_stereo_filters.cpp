/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What stereo matching is filtered with, held against the plainest code that does the same. */
#include "../test-support.hpp"

#include <algorithm>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <rangecast/stereo/disparity_filter.hpp>
#include <rangecast/stereo/silhouette_filter.hpp>

using namespace rangecast;

namespace {

constexpr int kMin = 32, kNone = kMin - 16;

/* Two surfaces with steps, noise and holes. */
cv::Mat
made_up_disparity (int width, int height, int seed)
{
  cv::RNG random (static_cast<std::uint64_t> (seed));
  cv::Mat disparity (height, width, CV_16S);
  for (int y = 0; y < height; y++)
    for (int x = 0; x < width; x++) {
      const bool near = std::abs (x - width / 2) + std::abs (y - height / 2) < height / 2;
      const int noise =
          random.uniform (0, 12) ? random.uniform (-5, 6) : random.uniform (-300, 300);
      const int d = random.uniform (0, 8) ? (near ? 800 : 200) + noise : kNone;
      disparity.at<std::int16_t> (y, x) = static_cast<std::int16_t> (d < kMin ? kNone : d);
    }
  return disparity;
}

cv::Mat
made_up_colour (int width, int height, int seed)
{
  cv::Mat colour (height, width, CV_8UC4);
  cv::theRNG ().state = static_cast<std::uint64_t> (seed) + 7;
  cv::randu (colour, 0, 90);
  return colour;
}

/* Two parts one below the other, of different width, and what lies outside of them cleared. */
std::vector<cv::Rect>
two_parts (cv::Mat &disparity)
{
  const int w = disparity.cols, h = disparity.rows;
  const std::vector<cv::Rect> parts = {{w / 4, 2, w / 3, h / 3}, {3, h / 3 + 2, w - 5, h / 2}};
  cv::Mat outside (disparity.size (), CV_8U, cv::Scalar (255));
  for (const cv::Rect &part : parts)
    outside (part).setTo (0);
  disparity.setTo (kNone, outside);
  return parts;
}

int
count_differences (const cv::Mat &a, const cv::Mat &b, const std::vector<cv::Rect> &parts)
{
  int n = 0;
  for (const cv::Rect &part : parts)
    n += cv::countNonZero (a (part) != b (part));
  return n;
}

} // namespace

TEST (StereoFilters, specks_go_as_with_opencv)
{
  for (int seed = 0; seed < 6; seed++) {
    cv::Mat mine = made_up_disparity (90, 61, seed);
    const auto parts = two_parts (mine);
    cv::Mat theirs = mine.clone (), memory;
    Tiles tiles;
    tiles.set (parts, 2);
    DisparityFilter filter;
    filter.clear_specks (kMin, kMin, tiles, mine);
    cv::filterSpeckles (theirs, kNone, 100, 32, memory);
    EXPECT_EQ (cv::countNonZero (mine != theirs), 0) << seed;
    EXPECT_GT (cv::countNonZero (mine == kNone), 90 * 61 / 5);
  }
}

TEST (StereoFilters, flying_pixels_are_those_that_few_neighbours_follow)
{
  constexpr int kSupport = 4, kOffset = 60;
  for (int seed = 0; seed < 4; seed++) {
    cv::Mat from = made_up_disparity (83, 50, seed), to (50, 83, CV_16S, cv::Scalar (kNone)),
            expected = from.clone ();
    const auto parts = two_parts (from);
    Tiles tiles;
    tiles.set (parts, 2);
    DisparityFilter filter;
    filter.clear_flying (kOffset, kMin, tiles, from, to);
    for (int y = 0; y < from.rows; y++)
      for (int x = 0; x < from.cols; x++) {
        const int d = from.at<std::int16_t> (y, x),
                  most = std::max (8, (d + kOffset) * int (65536 * kSurfaceStep) >> 16);
        int n = -1;
        for (int v = std::max (0, y - 1); v <= std::min (from.rows - 1, y + 1); v++)
          for (int u = std::max (0, x - 1); u <= std::min (from.cols - 1, x + 1); u++) {
            const int other = from.at<std::int16_t> (v, u);
            n += other >= kMin && std::abs (other - d) <= most;
          }
        if (d < kMin || n < kSupport)
          expected.at<std::int16_t> (y, x) = kNone;
      }
    to.setTo (kNone, to < kMin);
    EXPECT_EQ (count_differences (to, expected, parts), 0) << seed;
  }
}

TEST (StereoFilters, gaps_are_filled_within_a_part_and_not_between_parts)
{
  cv::Mat colour (60, 20, CV_8UC4, cv::Scalar::all (90));
  const cv::Rect upper (0, 4, 20, 16), lower (4, 28, 16, 16), last (0, 44, 20, 16);
  cv::Mat disparity (60, 20, CV_16S, cv::Scalar (kNone));
  for (const cv::Rect &part : {upper, lower, last})
    disparity (part).setTo (320);
  disparity (cv::Rect (8, 10, 1, 5)).setTo (kNone);  /* in a part */
  disparity (cv::Rect (10, 40, 1, 8)).setTo (kNone); /* across two that touch */
  Tiles tiles;
  tiles.set (std::vector{upper, lower, last}, 1);
  DisparityFilter ().fill_gaps (colour, kMin, tiles, disparity);
  EXPECT_EQ (cv::countNonZero (disparity (cv::Rect (0, 20, 20, 8)) != kNone), 0);
  EXPECT_EQ (cv::countNonZero (disparity (cv::Rect (0, 28, 4, 16)) != kNone), 0);
  for (const cv::Rect &part : {upper, lower, last})
    EXPECT_EQ (cv::countNonZero (disparity (part) != 320), 0);
}

static Tiles
all_of (const cv::Mat &image)
{
  const cv::Rect all ({0, 0}, image.size ());
  Tiles tiles;
  tiles.set ({&all, 1}, 1);
  return tiles;
}

TEST (StereoFilters, gap_in_one_surface_is_filled_and_one_between_two_is_not)
{
  cv::Mat disparity (1, 40, CV_16S, cv::Scalar (320));
  cv::Mat colour (1, 40, CV_8UC4, cv::Scalar (90, 100, 110, 0));
  disparity.colRange (5, 10).setTo (-16);
  disparity.colRange (20, 40).setTo (400); /* a step of 5 pixels */
  disparity.colRange (18, 22).setTo (-16);
  disparity.colRange (30, 34).setTo (-16);
  colour.colRange (31, 33).setTo (cv::Scalar (200, 10, 10, 0)); /* something else is there */
  DisparityFilter ().fill_gaps (colour, 0, all_of (disparity), disparity);
  for (int x = 0; x < 40; x++)
    EXPECT_EQ (disparity.at<std::int16_t> (0, x) < 0, (x >= 18 && x < 22) || (x >= 30 && x < 34))
        << x;
}

TEST (StereoFilters, rim_of_the_walls_colour_is_cleared)
{
  cv::Mat disparity (40, 60, CV_16S, cv::Scalar (160));
  cv::Mat colour (40, 60, CV_8UC4, cv::Scalar (40, 40, 40, 0));
  colour.colRange (30, 60).setTo (cv::Scalar (200, 180, 160, 0));
  disparity.colRange (27, 60).setTo (480); /* what is near has grown by 3 columns */
  cv::Mat cleared = disparity.clone ();
  SilhouetteFilter::Settings settings;
  SilhouetteFilter ().apply (settings, colour, all_of (disparity), disparity, cleared);
  for (int x = 0; x < 60; x++)
    EXPECT_EQ (cleared.at<std::int16_t> (20, x), x < 27 ? 160 : x < 30 ? -16 : 480) << x;
}

TEST (StereoFilters, patch_that_looks_otherwise_is_cleared_and_a_darker_one_is_not)
{
  cv::Mat left (40, 80, CV_8U), right (40, 80, CV_8U);
  cv::randu (left, 0, 255);
  cv::randu (right, 0, 255);
  for (int y = 0; y < 40; y++)
    for (int x = 40; x < 80; x++) /* seen 10 pixels further left, and darker */
      right.at<std::uint8_t> (y, x - 10) = std::uint8_t (left.at<std::uint8_t> (y, x) * 7 / 8);
  cv::Mat disparity (40, 80, CV_16S, cv::Scalar (160));
  cv::Mat cleared = disparity.clone ();
  DisparityFilter ().clear_unlike (left, right, 0, 0, all_of (disparity), disparity, cleared);
  EXPECT_LT (cv::countNonZero (cleared.colRange (15, 35) >= 0), 40 * 20 / 10);
  EXPECT_GT (cv::countNonZero (cleared.colRange (45, 75) >= 0), 40 * 30 * 95 / 100);
}

TEST (StereoFilters, what_the_right_camera_cannot_see_goes)
{
  cv::Mat disparity (1, 64, CV_16S, cv::Scalar (160));
  disparity.colRange (40, 50).setTo (320);
  DisparityFilter ().clear_hidden (kMin, all_of (disparity), disparity);
  /* What stands 10 pixels of disparity before the wall hides the 10 pixels left of it. */
  for (int x = 0; x < 64; x++)
    EXPECT_EQ (disparity.at<std::int16_t> (0, x) == kNone, x >= 30 && x < 40) << x;
}

/* A wall with a bar at columns 40 to 43 and one at 102 to 105, of which the right camera sees the
 * first alone; the second was matched with that, and so lies 62 pixels nearer. */
static cv::Mat
wall_with_doubled_bar (cv::Mat &left, cv::Mat &right, bool same_colour)
{
  left = cv::Mat (1, 200, CV_8U, cv::Scalar (100));
  right = left.clone ();
  left.colRange (40, 44).setTo (same_colour ? 50 : 100);
  left.colRange (102, 106).setTo (50);
  right.colRange (20, 24).setTo (50);
  cv::Mat disparity (1, 200, CV_16S, cv::Scalar (kNone));
  disparity.colRange (20, 90).setTo (20 * 16);
  disparity.colRange (102, 106).setTo (82 * 16);
  return disparity;
}

TEST (StereoFilters, pattern_that_repeats_is_not_seen_twice)
{
  cv::Mat left, right, disparity = wall_with_doubled_bar (left, right, true);
  DisparityFilter ().clear_doubled (left, right, 0, kMin, all_of (disparity), disparity);
  EXPECT_EQ (cv::countNonZero (disparity.colRange (102, 106) == kNone), 4);
  EXPECT_EQ (cv::countNonZero (disparity.colRange (20, 90) == 20 * 16), 70);
}

TEST (StereoFilters, thin_thing_before_a_wall_of_another_colour_stays)
{
  cv::Mat left, right, disparity = wall_with_doubled_bar (left, right, false);
  DisparityFilter ().clear_doubled (left, right, 0, kMin, all_of (disparity), disparity);
  EXPECT_EQ (cv::countNonZero (disparity.colRange (102, 106) == 82 * 16), 4);
}

/* SilhouetteFilter for one pixel, without vectors. */
static int
judge_plainly (const SilhouetteFilter::Settings &s, const cv::Mat &colour, const cv::Mat &disparity,
    int x, int y)
{
  const int own = disparity.at<std::int16_t> (y, x), reach = s.radius * 2 / 3;
  const bool valid = own >= s.min;
  const auto tolerance = [&] (int d) {
    return std::max (16, (d + s.offset) * int (65536 * kSurfaceStep) >> 16);
  };
  const cv::Rect all (0, 0, disparity.cols, disparity.rows);
  double lowest, highest;
  cv::minMaxLoc (disparity (cv::Rect (x - reach, y - reach, 2 * reach + 1, 2 * reach + 1) & all),
      &lowest, &highest);
  if (highest < std::max (s.min, s.nearest) ||
      (valid && (own < s.nearest || lowest >= own - tolerance (own))))
    return own;
  const auto each = [&] (auto &&work) {
    for (int v = y / 2 - s.radius / 2; v < y / 2 - s.radius / 2 + s.radius; v++)
      for (int u = x / 2 - s.radius / 2; u < x / 2 - s.radius / 2 + s.radius; u++)
        if (u >= 0 && v >= 0 && 2 * u < disparity.cols && 2 * v < disparity.rows) {
          const auto &a = colour.at<cv::Vec4b> (y, x), &b = colour.at<cv::Vec4b> (2 * v, 2 * u);
          const int unlike =
              std::abs (a[0] - b[0]) + std::abs (a[1] - b[1]) + std::abs (a[2] - b[2]);
          work (std::max (0, 60 - unlike), disparity.at<std::int16_t> (2 * v, 2 * u));
        }
  };
  int d = own, sum = 0, weights = 0;
  each ([&] (int weight, int depth) {
    if (depth >= s.min)
      sum += weight * depth, weights += weight;
  });
  if (!valid)
    d = weights < 160 ? s.min - 1 : sum / weights;
  if (d < std::max (s.min, s.nearest))
    return own;
  int same = 0, near = 0, far = 0, none = 0;
  each ([&] (int weight, int depth) {
    (depth < s.min                  ? none
        : depth > d + tolerance (d) ? near
        : depth < d - tolerance (d) ? far
                                    : same) += weight;
  });
  if (valid)
    return far + none > same ? s.min - 16 : own;
  return same > 4 * (near + far) && same > none ? d : own;
}

TEST (StereoFilters, silhouettes_are_judged_as_without_vectors)
{
  for (int radius : {3, 10, 19}) {
    cv::Mat from = made_up_disparity (71, 46, radius), to (46, 71, CV_16S, cv::Scalar (kNone));
    const cv::Mat colour = made_up_colour (71, 46, radius);
    const auto parts = two_parts (from);
    Tiles tiles;
    tiles.set (parts, 2);
    SilhouetteFilter filter;
    const SilhouetteFilter::Settings settings = {radius, 20, kMin, 250};
    filter.apply (settings, colour, tiles, from, to);
    int changed = 0, differ = 0;
    for (const cv::Rect &part : parts)
      for (int y = part.y; y < part.br ().y; y++)
        for (int x = part.x; x < part.br ().x; x++) {
          changed += to.at<std::int16_t> (y, x) != from.at<std::int16_t> (y, x);
          differ += to.at<std::int16_t> (y, x) != judge_plainly (settings, colour, from, x, y);
        }
    EXPECT_EQ (differ, 0) << radius;
    EXPECT_GT (changed, 0) << radius;
  }
}
