/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What stereo matching is filtered with. */
#include "../test-support.hpp"

#include <opencv2/core.hpp>
#include <rangecast/stereo/disparity_filter.hpp>
#include <rangecast/stereo/edge_filter.hpp>
#include <rangecast/stereo/silhouette_filter.hpp>

using namespace rangecast;

namespace {

constexpr int kMin = 32, kNone = kMin - 16;

} // namespace

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

TEST (StereoFilters, floor_that_slants_away_has_no_rims)
{
  cv::Mat disparity (60, 60, CV_16S);
  const cv::Mat colour (60, 60, CV_8UC4, cv::Scalar (90, 100, 110, 0));
  for (int y = 0; y < 60; y++)
    disparity.row (y).setTo (160 + 8 * y);
  cv::Mat cleared = disparity.clone ();
  SilhouetteFilter ().apply ({}, colour, all_of (disparity), disparity, cleared);
  const cv::Rect inside (0, 4, 60, 52); /* above and below, nothing says that it slants */
  EXPECT_EQ (cv::countNonZero (cleared (inside) != disparity (inside)), 0);
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

/* A slanted wall before another one, whose edge runs down with noise of up to half a pixel. */
static cv::Mat
noisy_edge ()
{
  cv::Mat disparity (40, 60, CV_16U);
  for (int y = 0; y < 40; y++)
    for (int x = 0; x < 60; x++) {
      const int noise = x == 30 || x == 29 ? (y * 7 % 5 - 2) * 4 : 0;
      disparity.at<std::uint16_t> (y, x) =
          static_cast<std::uint16_t> (x < 30 ? 160 + noise / 2 : 640 + 2 * y + noise);
    }
  return disparity;
}

TEST (StereoFilters, noise_along_a_depth_edge_is_smoothed_and_nothing_else_changes)
{
  const cv::Mat before = noisy_edge ();
  cv::Mat after = before.clone ();
  EdgeFilter ().apply (16, 1, after);
  for (int y = 0; y < 40; y++)
    for (int x = 0; x < 60; x++) {
      const int d = after.at<std::uint16_t> (y, x);
      if (x == 29 || x == 30)
        EXPECT_NEAR (d, x < 30 ? 160 : 640 + 2 * y, x < 30 ? 2 : 4) << x << " " << y;
      else
        EXPECT_EQ (d, before.at<std::uint16_t> (y, x)) << x << " " << y;
    }
}

TEST (StereoFilters, smoothed_edges_do_not_depend_on_threads_and_none_crosses_the_least_disparity)
{
  const cv::Mat before = noisy_edge ();
  cv::Mat one = before.clone (), four = before.clone ();
  EdgeFilter ().apply (158, 1, one);
  EdgeFilter ().apply (158, 4, four);
  EXPECT_EQ (cv::countNonZero (one != four), 0);
  for (int y = 0; y < 40; y++) {
    const int d = before.at<std::uint16_t> (y, 29), now = one.at<std::uint16_t> (y, 29);
    if (d < 158)
      EXPECT_EQ (now, d) << y;
    else
      EXPECT_GE (now, 158) << y;
  }
}
