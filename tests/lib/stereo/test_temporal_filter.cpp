/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Disparities of a textured surface that moves: noise, holes, and motion that nothing follows. */
#include "../test-support.hpp"

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <rangecast/stereo/temporal_filter.hpp>

using namespace rangecast;

namespace {

constexpr int kWidth = 96, kHeight = 64;
const cv::Rect kRoi (8, 5, 80, 52); /* begins and ends within blocks */

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

  cv::Mat picture_;

private:
  const cv::Point motion_;
  const int rise_; /* 1/16 pixel */
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
    disparity (cv::Rect (50, 20, 14, 9)).setTo (0); /* nothing there, whatever moves */
    if (i == 4) {
      disparity (cv::Rect (20, 18, 6, 5)).setTo (0);
      truth.at<std::uint16_t> (24, 57) = disparity.at<std::uint16_t> (24, 57) = 420;
    }
    filtered = film.filter (disparity);
  }
  EXPECT_LE (
      cv::norm (filtered (cv::Rect (20, 18, 6, 5)), truth (cv::Rect (20, 18, 6, 5)), cv::NORM_INF),
      2);
  EXPECT_EQ (filtered.at<std::uint16_t> (24, 57), 0);
  for (int i = 0; i < 2; i++) /* it stays, and so is shown; the hole stays, and so do not */
    film.filter (disparity = film.next ());
  EXPECT_EQ (cv::countNonZero (film.filter (film.next ()) == 0), 0);
}

TEST (TemporalFilter, disparities_that_jump_are_put_out_as_found)
{
  Film film;
  for (int i = 0; i < 6; i++) {
    cv::Mat disparity = film.next ();
    disparity += i % 2 * 60;
    EXPECT_EQ (cv::countNonZero (film.filter (disparity) != disparity), 0) << i;
  }
}

TEST (TemporalFilter, picture_that_is_another_one_leaves_disparities_alone)
{
  Film film, other (1, {-30, 20});
  cv::RNG random (3);
  for (int i = 0; i < 4; i++) {
    cv::Mat disparity = with_noise (film.next (), random);
    random.fill (film.picture_, cv::RNG::UNIFORM, 0, 255);
    const cv::Mat filtered = film.filter (disparity);
    /* by chance a pixel is like another one */
    EXPECT_LT (cv::countNonZero (filtered != disparity), kRoi.area () / 4) << i;
  }
}

TEST (TemporalFilter, threads_do_not_matter)
{
  Film one (1), three (3);
  cv::RNG random (7);
  for (int i = 0; i < 5; i++) {
    three.next ();
    const cv::Mat disparity = with_noise (one.next (), random);
    EXPECT_EQ (cv::countNonZero (one.filter (disparity) != three.filter (disparity)), 0);
  }
}
