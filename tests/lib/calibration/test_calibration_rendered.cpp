/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Boards rendered into four views whose poses are known: the whole way from pictures to a rig. */
#include "../board-renderer.hpp"
#include "../test-support.hpp"

#include <cstdio>
#include <rangecast/calibration/rig_calibration.hpp>

using namespace rangecast;
using namespace rangecast::testing;

namespace {

constexpr int kWidth = 640, kHeight = 480, kFrames = 40;

/* Four cameras a metre from the origin, each with a lens of its own. */
std::vector<TrueCamera>
four_views ()
{
  std::vector<TrueCamera> list;
  for (int i = 0; i < 4; i++) {
    TrueCamera t;
    t.camera = {"camera " + std::to_string (i), i, CameraRole::kLeft, kWidth, kHeight};
    t.lens = {610. + 7 * i, 612. + 6 * i, 322. - 3 * i, 236. + 2 * i, -0.12 + 0.03 * i,
        0.08 - 0.02 * i, 0.0005 * i, -0.0004, 0.01};
    t.world_from_camera =
        ring_pose (-36 + 24 * i, 1) * rotation_about ({1, 0.3, 0.1}, (2 * i - 3) * kDegree);
    list.push_back (t);
  }
  return list;
}

/* Finds the board in rendered pictures of every camera. */
std::vector<CalibrationFrame>
render_frames (const std::vector<TrueCamera> &views, const BoardSpec &board, int frames)
{
  std::mt19937 random (7);
  std::vector<BoardRenderer> renderers;
  for (const TrueCamera &t : views)
    renderers.emplace_back (t, board);
  BoardDetector detector;
  EXPECT_TRUE (detector.set (board).ok ());
  std::vector<CalibrationFrame> list;
  for (int f = 0; f < frames; f++) {
    const TrueCamera &near = views[f % views.size ()];
    std::uniform_real_distribution<double> distance (0.45, 1.1);
    const Pose world_from_board =
        near.world_from_camera * random_board (near, board, distance (random), 0.7, 40, random);
    CalibrationFrame frame;
    for (std::size_t i = 0; i < views.size (); i++) {
      const auto picture =
          renderers[i].render (views[i].world_from_camera.inverse () * world_from_board, 2, random);
      Sighting sighting{int (i), {}};
      EXPECT_TRUE (
          detector.detect ({picture.data (), kWidth, kHeight, kWidth}, sighting.corners).ok ());
      if (!sighting.corners.empty ())
        frame.sightings.push_back (std::move (sighting));
    }
    list.push_back (std::move (frame));
  }
  return list;
}

void
expect_poses (const std::vector<TrueCamera> &views, const CalibrationResult &result)
{
  for (std::size_t i = 0; i < views.size (); i++) {
    const Pose truth = views[0].world_from_camera.inverse () * views[i].world_from_camera;
    const Pose found =
        result.rig.views[0].world_from_view.inverse () * result.rig.views[i].world_from_view;
    const double angle = angle_between (truth, found);
    const double shift_mm = 1000 * norm (truth.translation - found.translation);
    std::printf (
        "camera %zu: %d frames, rms %.3f px, rotation error %.4f degrees, translation error "
        "%.3f mm, focal length error %.2f px\n",
        i, result.cameras[i].frames, result.cameras[i].rms_px, angle, shift_mm,
        result.rig.views[i].intrinsics.fx - views[i].lens[0]);
    EXPECT_LT (angle, 0.1);
    EXPECT_LT (shift_mm, 1);
  }
}

/* Calibrates the four views with pictures of a board. */
void
expect_calibrated (BoardKind kind, double most_rms_px)
{
  CalibrationSettings settings;
  settings.board.kind = kind;
  settings.board.square_m = 0.03;
  const auto views = four_views ();
  std::vector<CalibrationCamera> cameras;
  for (const TrueCamera &t : views)
    cameras.push_back (t.camera);
  CalibrationResult result;
  const Status status =
      calibrate_rig (cameras, render_frames (views, settings.board, kFrames), settings, result);
  ASSERT_TRUE (status.ok ()) << status.message ();
  EXPECT_LT (result.rms_px, most_rms_px);
  expect_poses (views, result);
}

} // namespace

TEST (CalibrationRendered, four_views_are_placed_to_a_tenth_of_a_degree_and_a_millimetre)
{
  expect_calibrated (BoardKind::kChessboard, 0.2);
}

TEST (CalibrationRendered, four_views_are_placed_by_a_charuco_board)
{
  expect_calibrated (BoardKind::kCharuco, 0.3);
}
