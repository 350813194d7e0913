/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What stereo matching is filtered with, held against the plainest code that does the same. */
#include "../test-support.hpp"

#include <algorithm>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <rangecast/stereo/box_sum.hpp>
#include <rangecast/stereo/disparity_filter.hpp>
#include <rangecast/stereo/occupancy.hpp>
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

TEST (StereoFilters, window_sums_are_the_sums_of_windows)
{
  Plane from, sums;
  from.set_size (29, 17);
  cv::RNG random (1);
  for (int y = 0; y < 17; y++)
    for (int x = 0; x < 29; x++)
      from.row (y)[x] = static_cast<std::int16_t> (random.uniform (-255, 256));
  std::vector<std::int16_t> memory;
  sum_windows<3> (from, sums, memory);
  ASSERT_EQ (sums.width (), 23);
  ASSERT_EQ (sums.height (), 11);
  for (int y = 0; y < 11; y++)
    for (int x = 0; x < 23; x++) {
      int sum = 0;
      for (int v = 0; v < 7; v++)
        for (int u = 0; u < 7; u++)
          sum += from.row (y + v)[x + u];
      ASSERT_EQ (sums.row (y)[x], sum) << x << "," << y;
    }
}

TEST (StereoFilters, greys_of_the_other_picture_are_linear_between_pixels_and_stay_inside)
{
  const std::vector<std::uint8_t> row = {10, 200, 30, 250, 0, 90};
  std::vector<std::int16_t> disparity, grey (200);
  for (int d = -40; d < 160; d++)
    disparity.push_back (static_cast<std::int16_t> (d));
  /* All of them at column 4: pixel i lies at 4, not at 4 + i. */
  for (int i = 0; i < 200; i++) {
    look_up (&disparity[std::size_t (i)], 1, row.data (), 6, 4, &grey[std::size_t (i)]);
    const int there = 64 - disparity[std::size_t (i)];
    if (there < 0 || there >= 80)
      continue; /* outside: only that nothing else is read */
    const int u = there / 16, f = there % 16;
    const double exact = (row[std::size_t (u)] * (16 - f) + row[std::size_t (u) + 1] * f) / 16.0;
    EXPECT_NEAR (grey[std::size_t (i)], exact, 0.51) << disparity[std::size_t (i)];
  }
  std::vector<std::int16_t> same (130, 24), long_grey (130);
  std::vector<std::uint8_t> ramp (150);
  for (std::size_t i = 0; i < ramp.size (); i++)
    ramp[i] = static_cast<std::uint8_t> (i);
  look_up (same.data (), 130, ramp.data (), 150, 10, long_grey.data ());
  for (int i = 0; i < 130; i++)
    EXPECT_NEAR (long_grey[std::size_t (i)], i + 8.5, 0.51);
}

TEST (StereoFilters, specks_go_as_with_opencv)
{
  for (int seed = 0; seed < 6; seed++) {
    cv::Mat mine = made_up_disparity (90, 61, seed);
    const auto parts = two_parts (mine);
    cv::Mat theirs = mine.clone (), memory;
    Tiles tiles;
    tiles.set (parts, 2);
    DisparityFilter filter;
    filter.clear_specks (40, 48, kMin, kMin, tiles, mine);
    cv::filterSpeckles (theirs, kNone, 40, 48, memory);
    EXPECT_EQ (cv::countNonZero (mine != theirs), 0) << seed;
    EXPECT_GT (cv::countNonZero (mine == kNone), 90 * 61 / 5);
  }
}

TEST (StereoFilters, specks_farther_than_what_is_of_interest_stay)
{
  cv::Mat disparity (8, 8, CV_16S, cv::Scalar (kNone));
  disparity.at<std::int16_t> (2, 2) = 100;
  disparity.at<std::int16_t> (2, 3) = 400;
  Tiles tiles;
  const cv::Rect all (0, 0, 8, 8);
  tiles.set ({&all, 1}, 1);
  DisparityFilter filter;
  filter.clear_specks (10, 32, kMin, 300, tiles, disparity);
  EXPECT_EQ (disparity.at<std::int16_t> (2, 2), 100);
  EXPECT_EQ (disparity.at<std::int16_t> (2, 3), kNone);
}

TEST (StereoFilters, flying_pixels_are_those_that_few_neighbours_follow)
{
  constexpr double kStep = 0.02;
  constexpr int kSupport = 4, kOffset = 60;
  for (int seed = 0; seed < 4; seed++) {
    cv::Mat from = made_up_disparity (83, 50, seed), to (50, 83, CV_16S, cv::Scalar (kNone)),
            expected = from.clone ();
    const auto parts = two_parts (from);
    Tiles tiles;
    tiles.set (parts, 2);
    DisparityFilter filter;
    filter.clear_flying (kStep, kSupport, kOffset, kMin, tiles, from, to);
    for (int y = 0; y < from.rows; y++)
      for (int x = 0; x < from.cols; x++) {
        const int d = from.at<std::int16_t> (y, x),
                  most = std::max (8, (d + kOffset) * int (65536 * kStep) >> 16);
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
  DisparityFilter ().fill_gaps (colour, 30, kMin, tiles, disparity);
  EXPECT_EQ (cv::countNonZero (disparity (cv::Rect (0, 20, 20, 8)) != kNone), 0);
  EXPECT_EQ (cv::countNonZero (disparity (cv::Rect (0, 28, 4, 16)) != kNone), 0);
  for (const cv::Rect &part : {upper, lower, last})
    EXPECT_EQ (cv::countNonZero (disparity (part) != 320), 0);
}

TEST (StereoFilters, what_the_right_camera_cannot_see_goes)
{
  cv::Mat disparity (1, 64, CV_16S, cv::Scalar (160));
  disparity.colRange (40, 50).setTo (320);
  Tiles tiles;
  const cv::Rect all (0, 0, 64, 1);
  tiles.set ({&all, 1}, 1);
  DisparityFilter filter;
  filter.clear_hidden (kMin, tiles, disparity);
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
  Tiles tiles;
  const cv::Rect all (0, 0, 200, 1);
  tiles.set ({&all, 1}, 1);
  DisparityFilter filter;
  filter.clear_doubled (left, right, 0, kMin, tiles, disparity);
  EXPECT_EQ (cv::countNonZero (disparity.colRange (102, 106) == kNone), 4);
  EXPECT_EQ (cv::countNonZero (disparity.colRange (20, 90) == 20 * 16), 70);
}

TEST (StereoFilters, thin_thing_before_a_wall_of_another_colour_stays)
{
  cv::Mat left, right, disparity = wall_with_doubled_bar (left, right, false);
  Tiles tiles;
  const cv::Rect all (0, 0, 200, 1);
  tiles.set ({&all, 1}, 1);
  DisparityFilter filter;
  filter.clear_doubled (left, right, 0, kMin, tiles, disparity);
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
    return std::max (16, (d + s.offset) * int (65536 * s.step) >> 16);
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
    const SilhouetteFilter::Settings settings = {radius, 0.02, 20, kMin, 250};
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

/* ---- where to look ---- */

namespace {

constexpr int kWidth = 160, kHeight = 96;

struct Seen {
  rangecast::testing::Image<Rgbx> colour{kWidth, kHeight};
  rangecast::testing::Image<std::uint16_t> depth{kWidth, kHeight};
  ChangeDetector changes;
  Occupancy occupancy;

  Seen () { occupancy.set (kWidth, kHeight); }
  void learn ()
  {
    look ();
    changes.set_reference ();
    look ();
    occupancy.learn ({0, {0, 0, kWidth, kHeight}, depth.view (), colour.view (), 0});
  }
  void look ()
  {
    const auto view = colour.view ();
    changes.update (
        cv::Mat (kHeight, kWidth, CV_8UC4, view.data, static_cast<std::size_t> (view.stride)));
  }
  void fill_depth (int x0, int y0, int x1, int y1)
  {
    for (int y = y0; y < y1; y++)
      for (int x = x0; x < x1; x++)
        depth.view ().at (x, y) = 1000;
  }
  int covered ()
  {
    int n = 0;
    for (const cv::Rect &part : *occupancy.find (changes, {0, 0, kWidth, kHeight}))
      n += part.area ();
    return n;
  }
  bool covers (int x0, int y0, int x1, int y1)
  {
    cv::Mat mask = cv::Mat::zeros (kHeight, kWidth, CV_8U);
    for (const cv::Rect &part : *occupancy.find (changes, {0, 0, kWidth, kHeight}))
      mask (part & cv::Rect (0, 0, kWidth, kHeight)).setTo (255);
    return cv::countNonZero (mask (cv::Rect (x0, y0, x1 - x0, y1 - y0))) == (x1 - x0) * (y1 - y0);
  }
};

} // namespace

TEST (Occupancy, looks_everywhere_while_nothing_is_known)
{
  Seen seen;
  EXPECT_EQ (seen.occupancy.find (seen.changes, {0, 0, kWidth, kHeight}), nullptr);
  seen.learn ();
  EXPECT_NE (seen.occupancy.find (seen.changes, {0, 0, kWidth, kHeight}), nullptr);
  seen.occupancy.reset ();
  EXPECT_EQ (seen.occupancy.find (seen.changes, {0, 0, kWidth, kHeight}), nullptr);
}

TEST (Occupancy, looks_where_depth_was_and_a_block_around_and_not_much_further)
{
  Seen seen;
  seen.fill_depth (64, 8, 80, 40);   /* a head */
  seen.fill_depth (32, 48, 128, 90); /* shoulders */
  seen.learn ();
  EXPECT_TRUE (seen.covers (56, 0, 88, 48));
  EXPECT_TRUE (seen.covers (24, 40, 136, 96));
  EXPECT_LE (seen.covered (), 32 * 48 + 112 * 56 + 8 * 112);
}

TEST (Occupancy, looks_where_the_picture_has_changed)
{
  Seen seen;
  seen.fill_depth (64, 48, 80, 64);
  seen.learn ();
  EXPECT_FALSE (seen.covers (120, 48, 128, 56));
  for (int y = 48; y < 56; y++)
    for (int x = 120; x < 128; x++)
      seen.colour.view ().at (x, y) = {6, 6, 6, 0};
  seen.look ();
  EXPECT_TRUE (seen.covers (112, 40, 136, 64));
}

TEST (Occupancy, few_wrong_pixels_do_not_keep_a_block)
{
  Seen seen;
  seen.fill_depth (64, 48, 67, 49);
  seen.learn ();
  EXPECT_EQ (seen.covered (), 0);
}
