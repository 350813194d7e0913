/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The 13 stereo pairs of OpenCV's documentation: a chessboard of 9x6 inner corners, 25 mm. */
#include "../test-support.hpp"

#include <cstdio>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <rangecast/calibration/rig_calibration.hpp>

using namespace rangecast;
using namespace rangecast::testing;

namespace {

constexpr const char *kFolder = "/usr/share/doc/opencv-doc/examples/data/";
constexpr int kPairs = 13;

struct Pairs {
  std::vector<CalibrationCamera> cameras = {
      {"left", 0, CameraRole::kLeft, 640, 480}, {"right", 0, CameraRole::kRight, 640, 480}};
  std::vector<CalibrationFrame> frames;
  BoardSpec board;
};

/* Found once for all tests; no frames where there are no pictures. */
const Pairs &
pairs ()
{
  static const Pairs found = [] {
    Pairs p;
    BoardDetector detector;
    EXPECT_TRUE (detector.set (p.board).ok ());
    for (int i = 1; i <= 14; i++) {
      CalibrationFrame frame;
      for (int camera = 0; camera < 2; camera++) {
        char path[128];
        std::snprintf (path, sizeof path, "%s%s%02d.jpg", kFolder, camera ? "right" : "left", i);
        if (!std::filesystem::exists (path))
          continue; /* there is no tenth pair */
        const cv::Mat m = cv::imread (path, cv::IMREAD_GRAYSCALE);
        Sighting sighting{camera, {}};
        const Status status =
            detector.detect ({m.data, m.cols, m.rows, std::ptrdiff_t (m.step)}, sighting.corners);
        EXPECT_TRUE (status.ok ()) << status.message ();
        if (!sighting.corners.empty ())
          frame.sightings.push_back (std::move (sighting));
      }
      if (!frame.sightings.empty ())
        p.frames.push_back (std::move (frame));
    }
    return p;
  }();
  return found;
}

#define NEED_PAIRS()                                                                               \
  if (!std::filesystem::exists (std::string (kFolder) + "left01.jpg"))                             \
  GTEST_SKIP () << "no test data: expected Debian's opencv-doc in " << kFolder

/* What OpenCV alone makes of the same corners. */
double
opencv_stereo_rms (const Pairs &p, int flags)
{
  std::vector<std::vector<cv::Point3f>> object;
  std::vector<std::vector<cv::Point2f>> image[2];
  for (const CalibrationFrame &frame : p.frames) {
    object.emplace_back ();
    for (const BoardCorner &c : frame.sightings[0].corners)
      object.back ().emplace_back (
          float (p.board.corner (c.id).x), float (p.board.corner (c.id).y), 0.0F);
    for (int side = 0; side < 2; side++) {
      image[side].emplace_back ();
      for (const BoardCorner &c : frame.sightings[side].corners)
        image[side].back ().emplace_back (float (c.x), float (c.y));
    }
  }
  cv::Mat k[2], d[2], r, t, e, f;
  std::vector<cv::Mat> rvecs, tvecs;
  for (int side = 0; side < 2; side++)
    cv::calibrateCamera (object, image[side], {640, 480}, k[side], d[side], rvecs, tvecs);
  return cv::stereoCalibrate (object, image[0], image[1], k[0], d[0], k[1], d[1], {640, 480}, r, t,
      e, f, flags, {cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 200, 1e-9});
}

} // namespace

TEST (CalibrationReal, stereo_error_is_no_larger_than_opencvs_on_the_same_corners)
{
  NEED_PAIRS ();
  CalibrationResult result;
  CalibrationSettings settings;
  const Status status = calibrate_rig (pairs ().cameras, pairs ().frames, settings, result);
  ASSERT_TRUE (status.ok ()) << status.message ();
  EXPECT_EQ (result.frames, kPairs);
  EXPECT_TRUE (result.dropped.empty ());
  ASSERT_EQ (result.pairs.size (), 1U);
  const double held = opencv_stereo_rms (pairs (), cv::CALIB_FIX_INTRINSIC);
  const double free = opencv_stereo_rms (pairs (), cv::CALIB_USE_INTRINSIC_GUESS);
  std::printf (
      "rms: ours %.5f px, cv::stereoCalibrate %.5f px (lenses held), %.5f px (free); median "
      "|dy| %.3f px, baseline %.5f m\n",
      result.pairs[0].rms_px, held, free, result.pairs[0].row_error_px, result.pairs[0].distance_m);
  EXPECT_LE (result.pairs[0].rms_px, held);
  EXPECT_LE (result.pairs[0].rms_px, free + 1e-6);
  EXPECT_DOUBLE_EQ (result.pairs[0].rms_px, result.rms_px);
}
