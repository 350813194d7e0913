/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Disparities of a textured surface that moves: noise, holes, and motion that nothing follows. */
#include "../test-support.hpp"

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <rangecast/stereo/temporal_filter.hpp>

using namespace rangecast;

namespace {

constexpr int kWidth = 96, kHeight = 64;
const cv::Rect kRoi (9, 5, 78, 52); /* begins and ends within blocks */

/* A picture of which each image shows a part, `motion` further to the left and above; and
 * disparities that rise to the right, and from image to image where it moves. */
class Film {
public:
  explicit Film (int n_threads = 1, cv::Point motion = {3, 1})
      : motion_ (motion), rise_ (motion == cv::Point () ? 0 : 3)
  {
    cv::RNG random (5);
    big_.create (2 * kHeight, 3 * kWidth, CV_8UC4);
    random.fill (big_, cv::RNG::UNIFORM, 40, 200);
    cv::GaussianBlur (big_, big_, {0, 0}, 1.5);
    filter_.set ({kWidth, kHeight}, n_threads);
  }

  /* @return of the ROI: the true disparities of the next image */
  cv::Mat next ()
  {
    const cv::Point at = cv::Point (60, 30) - images_ * motion_;
    picture_ = big_ (cv::Rect (at.x, at.y, kWidth, kHeight)).clone ();
    cv::Mat truth (kRoi.size (), CV_16U);
    for (int y = 0; y < truth.rows; y++)
      for (int x = 0; x < truth.cols; x++)
        truth.at<std::uint16_t> (y, x) =
            std::uint16_t (400 + rise_ * images_ + (kRoi.x + x - images_ * motion_.x) / 2);
    images_++;
    return truth;
  }
  cv::Mat filter (const cv::Mat &disparity)
  {
    cv::Mat to = disparity.clone ();
    still_.add (picture_, cv::Rect (0, 0, kWidth, kHeight));
    filter_.apply (picture_, kRoi, still_, to);
    return to;
  }

  /* Of the filters; the film goes back to its first image. */
  void reset ()
  {
    still_.reset ();
    filter_.reset ();
    images_ = 0;
  }

  cv::Mat picture_;

private:
  cv::Point motion_;
  int rise_; /* 1/16 pixel */
  cv::Mat big_;
  StillAverage still_;
  TemporalFilter filter_;
  int images_ = 0;
};

/* Not at its border, where what is seen was not in the ROI before. */
const cv::Rect kInner (12, 8, 56, 36);

double
mean_error (const cv::Mat &disparity, const cv::Mat &truth)
{
  return cv::norm (disparity (kInner), truth (kInner), cv::NORM_L1) / kInner.area ();
}

cv::Mat
with_noise (const cv::Mat &truth, cv::RNG &random)
{
  cv::Mat noise (truth.size (), CV_16S), sum;
  random.fill (noise, cv::RNG::NORMAL, 0, 2.5);
  cv::add (truth, noise, sum, cv::noArray (), CV_16U);
  return sum;
}

} // namespace

TEST (TemporalFilter, noise_of_what_moves_becomes_less_and_nothing_lags)
{
  for (const cv::Point motion : {cv::Point (3, 1), cv::Point (-7, 0), cv::Point (0, 0)}) {
    Film film (1, motion);
    cv::RNG random (9);
    double before = 0, after = 0, offset = 0;
    for (int i = 0; i < 8; i++) {
      const cv::Mat truth = film.next (), noisy = with_noise (truth, random),
                    filtered = film.filter (noisy);
      if (i < 3)
        continue;
      before += mean_error (noisy, truth);
      after += mean_error (filtered, truth);
      offset += cv::mean (filtered (kInner))[0] - cv::mean (truth (kInner))[0];
    }
    EXPECT_LT (after, 0.75 * before) << motion;
    EXPECT_LT (std::abs (offset) / 5, 2) << motion; /* an eighth of a pixel */
  }
}

TEST (TemporalFilter, hole_of_one_image_is_filled_and_what_appears_in_one_is_not_shown)
{
  Film film;
  cv::Mat truth, disparity, filtered;
  for (int i = 0; i < 5; i++) {
    truth = film.next ();
    disparity = truth.clone ();
    disparity (cv::Rect (38 + 3 * i, 16 + i, 14, 9)).setTo (0); /* a hole that stays */
    if (i == 4) {
      disparity (cv::Rect (20, 18, 6, 5)).setTo (0);
      disparity.at<std::uint16_t> (24, 57) = 420;
    }
    filtered = film.filter (disparity);
  }
  EXPECT_LE (
      cv::norm (filtered (cv::Rect (20, 18, 6, 5)), truth (cv::Rect (20, 18, 6, 5)), cv::NORM_INF),
      2);
  EXPECT_EQ (filtered.at<std::uint16_t> (24, 57), 0);
  for (int i = 0; i < 2; i++) /* two images without the hole: now the pixels are shown */
    filtered = film.filter (film.next ());
  EXPECT_EQ (cv::countNonZero (filtered == 0), 0);
}

TEST (TemporalFilter, disparities_that_do_not_follow_the_picture_are_output_as_found)
{
  Film film;
  for (int i = 0; i < 6; i++) {
    cv::Mat disparity = film.next ();
    for (int y = 0; y < disparity.rows; y += 2) /* by less than a pixel, in rows that do not move */
      disparity.row (y) += 12;
    /* a block may be found in a wrong place, by chance */
    EXPECT_LT (cv::countNonZero (film.filter (disparity) (kInner) != disparity (kInner)),
        kInner.area () / 20)
        << i;
  }
}

TEST (TemporalFilter, picture_that_is_another_one_leaves_disparities_alone)
{
  Film film;
  cv::RNG random (3);
  for (int i = 0; i < 4; i++) {
    cv::Mat disparity = with_noise (film.next (), random);
    random.fill (film.picture_, cv::RNG::UNIFORM, 0, 255);
    const cv::Mat filtered = film.filter (disparity);
    /* by chance a pixel is like another one */
    EXPECT_LT (cv::countNonZero (filtered != disparity), kRoi.area () / 4) << i;
  }
}

TEST (TemporalFilter, threads_and_what_was_before_a_reset_do_not_matter)
{
  Film one (1), three (3);
  cv::RNG random (7);
  for (int i = 0; i < 12; i++) {
    if (i == 6) {
      one = Film (1);
      three.reset ();
    }
    const cv::Mat disparity = with_noise (one.next (), random);
    three.next ();
    EXPECT_EQ (cv::countNonZero (one.filter (disparity) != three.filter (disparity)), 0) << i;
  }
}

/* For the sanitizers: regions that move, up to the image's edges, and sizes that are no blocks. */
TEST (TemporalFilter, any_region_of_any_image)
{
  cv::RNG random (11);
  TemporalFilter filter;
  for (const cv::Size size : {cv::Size (1, 1), cv::Size (13, 9), cv::Size (75, 43)}) {
    StillAverage still;
    filter.set (size, 2);
    for (int i = 0; i < 20; i++) {
      cv::Mat picture (size, CV_8UC4), disparity;
      random.fill (picture, cv::RNG::UNIFORM, 0, 255);
      const int x = random.uniform (0, size.width), y = random.uniform (0, size.height);
      const cv::Rect roi (
          x, y, random.uniform (1, size.width - x + 1), random.uniform (1, size.height - y + 1));
      disparity.create (roi.size (), CV_16U);
      random.fill (disparity, cv::RNG::UNIFORM, 100, 110);
      still.add (picture, cv::Rect ({}, size));
      filter.apply (picture, roi, still, disparity);
      EXPECT_TRUE (cv::checkRange (disparity, true, nullptr, 1, 200)) << size << roi;
    }
  }
}
