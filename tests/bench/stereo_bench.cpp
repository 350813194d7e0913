/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* stereodepth's way from a pair to disparities, beside OpenCV's matchers alone in the same run.
 *
 * Density, bad-1 and bad-2 are shares of the pixels whose truth is known; bad and median are over
 * pixels that have a disparity. --help lists the options. */
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <rangecast/stereo/stereo_depth.hpp>
#include <string>
#include <vector>

#include "options.hpp"

using namespace rangecast;

namespace {

const char *const kUsage =
    "usage: stereo_bench --left FILE --right FILE --ground-truth FILE --focal-length PX\n"
    "                    --baseline M [--scale S] [--doffs PX] [--near M] [--far M] [--rounds N]\n"
    "  --ground-truth FILE  8 or 16 bit grey, --scale per pixel of disparity, 0 = unknown\n"
    "  --scale S            (default 1)\n"
    "  --focal-length PX    of both rectified pictures, pixels\n"
    "  --baseline M         between the cameras, metres\n"
    "  --doffs PX           by how much the right principal point lies further right (default 0)\n"
    "  --near M, --far M    metres (default 0.3 and 3)\n"
    "  --rounds N           times are medians of so many (default 5)\n";

struct Job {
  std::string left, right, truth;
  double focal = 0, baseline = 0, offset = 0, scale = 1, near_m = 0.3, far_m = 3;
  int rounds = 5;
};

double
median_ms (int rounds, const std::function<void ()> &work)
{
  std::vector<double> times;
  for (int i = 0; i < rounds; i++) {
    const auto begin = std::chrono::steady_clock::now ();
    work ();
    times.push_back (
        std::chrono::duration<double, std::milli> (std::chrono::steady_clock::now () - begin)
            .count ());
  }
  std::ranges::nth_element (times, times.begin () + rounds / 2);
  return times[rounds / 2];
}

/* Disparities in 1/16 pixel, at most 0 = none. */
void
report (const char *name, const cv::Mat &disparity16, const cv::Mat &truth, double ms)
{
  std::vector<double> errors;
  int known = 0, bad1 = 0, bad2 = 0;
  for (int y = 0; y < truth.rows; y++)
    for (int x = 0; x < truth.cols; x++) {
      const float t = truth.at<float> (y, x);
      if (!(t > 0))
        continue;
      known++;
      const double d = disparity16.at<std::int16_t> (y, x) / 16.0;
      if (d <= 0)
        continue;
      const double error = std::abs (d - t);
      errors.push_back (error);
      bad1 += error > 1;
      bad2 += error > 2;
    }
  if (errors.empty ())
    errors.push_back (0);
  std::ranges::nth_element (errors, errors.begin () + errors.size () / 2);
  const double n = double (errors.size ());
  std::printf ("%-28s %7.1f %% %6.1f %% %6.1f %% %8.3f %9.1f\n", name, 100 * n / known,
      100 * bad1 / n, 100 * bad2 / n, errors[errors.size () / 2], ms);
}

ImageView<const Rgbx>
view_of (const cv::Mat &m)
{
  return {reinterpret_cast<const Rgbx *> (m.data), m.cols, m.rows, std::ptrdiff_t (m.step)};
}

void
run_ours (const View &view, const cv::Mat &left, const cv::Mat &right, const cv::Mat &truth,
    MatchAlgorithm algorithm, const char *name, int rounds, double offset)
{
  StereoSettings settings;
  settings.match.algorithm = algorithm;
  StereoDepth stereo;
  if (const Status s = stereo.set (view, settings); !s.ok ()) {
    std::fprintf (stderr, "stereo_bench: %s\n", s.message ().c_str ());
    std::exit (1);
  }
  cv::Mat depth (left.size (), CV_16U), colour (left.size (), CV_8UC4);
  const RangeImage image = {0, {0, 0, left.cols, left.rows},
      {depth.ptr<std::uint16_t> (), left.cols, left.rows, std::ptrdiff_t (depth.step)},
      {reinterpret_cast<Rgbx *> (colour.data), left.cols, left.rows, std::ptrdiff_t (colour.step)},
      0};
  const double ms = median_ms (rounds, [&] {
    if (!stereo.process (view_of (left), view_of (right), image).ok ())
      std::abort ();
  });
  cv::Mat disparity (left.size (), CV_16S);
  for (int y = 0; y < left.rows; y++)
    for (int x = 0; x < left.cols; x++) /* what the range image keeps */
      disparity.at<std::int16_t> (y, x) = std::int16_t (
          depth.at<std::uint16_t> (y, x) ? stereo.disparity ().at (x, y) - 16 * offset : 0);
  report (name, disparity, truth, ms);
}

void
run_opencv (const cv::Ptr<cv::StereoMatcher> &matcher, const cv::Mat &left, const cv::Mat &right,
    const cv::Mat &truth, const char *name, int rounds, int least)
{
  cv::Mat disparity;
  matcher->setMinDisparity (least);
  /* The same limits as ours; StereoBM's own uniqueness is 15 by default, too. */
  matcher->setDisp12MaxDiff (1);
  matcher->setSpeckleWindowSize (60);
  matcher->setSpeckleRange (2);
  const double ms = median_ms (rounds, [&] { matcher->compute (left, right, disparity); });
  disparity.setTo (0, disparity < 16 * least); /* OpenCV's mark for no match */
  report (name, disparity, truth, ms);
}

void
add_options (Options &options, Job &job)
{
  options.text ("--left", job.left);
  options.text ("--right", job.right);
  options.text ("--ground-truth", job.truth);
  options.number ("--scale", job.scale, 1e-6, 1e6);
  options.number ("--focal-length", job.focal, 1.0, 1e6);
  options.number ("--baseline", job.baseline, 1e-4, 1e3);
  options.number ("--doffs", job.offset, -1e4, 1e4);
  options.number ("--near", job.near_m, 1e-3, 1e5);
  options.number ("--far", job.far_m, 1e-3, 1e5);
  options.number ("--rounds", job.rounds, 1, 100000);
}

/* The rectified pair as a view of a rig. */
View
make_view (const Job &job, int width, int height)
{
  View view;
  view.width = width;
  view.height = height;
  view.intrinsics = {job.focal, job.focal, (width - 1) / 2.0, (height - 1) / 2.0};
  view.near_m = job.near_m;
  view.far_m = job.far_m;
  view.depth_unit_m = std::max (1e-4, view.far_m / 65000);
  PartnerCamera partner;
  partner.intrinsics = view.intrinsics;
  partner.intrinsics.cx += job.offset;
  partner.partner_from_left.translation.x = -job.baseline;
  view.right = partner;
  return view;
}

/* Runs all matchers. `truth` is as the file has it. */
void
measure (const Job &job, const cv::Mat &left, const cv::Mat &right, cv::Mat truth)
{
  if (truth.channels () > 1)
    cv::cvtColor (truth, truth, cv::COLOR_BGR2GRAY);
  truth.convertTo (truth, CV_32F, 1 / job.scale);
  const View view = make_view (job, left.cols, left.rows);
  const int least = int (std::floor (job.focal * job.baseline / view.far_m - job.offset));
  const int most = int (std::ceil (job.focal * job.baseline / view.near_m - job.offset));
  const int count = (most - least + 1 + 15) / 16 * 16;
  cv::Mat left_rgb, right_rgb, left_grey, right_grey;
  cv::cvtColor (left, left_rgb, cv::COLOR_BGR2RGBA);
  cv::cvtColor (right, right_rgb, cv::COLOR_BGR2RGBA);
  cv::cvtColor (left, left_grey, cv::COLOR_BGR2GRAY);
  cv::cvtColor (right, right_grey, cv::COLOR_BGR2GRAY);
  std::printf (
      "%-28s %9s %8s %8s %8s %9s\n", "matcher", "density", "bad-1", "bad-2", "median", "ms");
  run_ours (view, left_rgb, right_rgb, truth, MatchAlgorithm::kSgbm3Way, "stereodepth sgbm-3way",
      job.rounds, job.offset);
  run_ours (view, left_rgb, right_rgb, truth, MatchAlgorithm::kSgbm, "stereodepth sgbm", job.rounds,
      job.offset);
  run_ours (view, left_rgb, right_rgb, truth, MatchAlgorithm::kBm, "stereodepth bm", job.rounds,
      job.offset);
  for (int mode : {cv::StereoSGBM::MODE_SGBM_3WAY, cv::StereoSGBM::MODE_SGBM})
    run_opencv (cv::StereoSGBM::create (least, count, 5, 200, 800, 1, 31,
                    MatchSettings ().uniqueness_ratio, 60, 2, mode),
        left_grey, right_grey, truth,
        mode == cv::StereoSGBM::MODE_SGBM ? "OpenCV SGBM" : "OpenCV SGBM 3-way", job.rounds, least);
  run_opencv (cv::StereoBM::create (count, 15), left_grey, right_grey, truth, "OpenCV BM",
      job.rounds, least);
}

} // namespace

int
main (int argc, char **argv)
{
  Job job;
  Options options ("stereo_bench", kUsage);
  add_options (options, job);
  if (const auto status = options.parse (argc, argv))
    return *status;
  if (job.left.empty () || job.right.empty () || job.truth.empty () || job.focal <= 0 ||
      job.baseline <= 0)
    return options.refuse (
        "expected --left, --right, --ground-truth, --focal-length and --baseline");
  cv::Mat left = cv::imread (job.left), right = cv::imread (job.right);
  cv::Mat truth = cv::imread (job.truth, cv::IMREAD_UNCHANGED);
  if (left.empty () || left.size () != right.size () || left.size () != truth.size ()) {
    std::fprintf (stderr, "stereo_bench: %s, %s, %s: expected pictures of one size\n",
        job.left.c_str (), job.right.c_str (), job.truth.c_str ());
    return 1;
  }
  measure (job, left, right, truth);
  return 0;
}
