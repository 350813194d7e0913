/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Rigs from corners that were projected by cameras known exactly: chains, faults, world frames. */
#include "../board-renderer.hpp"
#include "../test-support.hpp"

#include <rangecast/calibration/bundle.hpp>
#include <rangecast/calibration/rig_calibration.hpp>
#include <rangecast/geometry/rectified_pose.hpp>

using namespace rangecast;
using namespace rangecast::testing;

namespace {

constexpr double kNoisePx = 0.05;

std::vector<TrueCamera>
ring (int count, double step_deg)
{
  std::vector<TrueCamera> list;
  for (int i = 0; i < count; i++) {
    TrueCamera t;
    t.camera = {"camera " + std::to_string (i), i, CameraRole::kLeft, 640, 480};
    t.lens = {600. + 10 * i, 601. + 9 * i, 320, 238. + i, -0.1, 0.05, 0.0005, -0.0003, 0.01};
    t.world_from_camera = ring_pose (step_deg * i, 1);
    list.push_back (t);
  }
  return list;
}

std::vector<CalibrationCamera>
cameras_of (const std::vector<TrueCamera> &truth)
{
  std::vector<CalibrationCamera> list;
  for (const TrueCamera &t : truth)
    list.push_back (t.camera);
  return list;
}

/* Boards before the cameras `seen_by`, which alone look at them; each board in all their pictures.
 */
void
add_frames (std::vector<CalibrationFrame> &frames, const std::vector<TrueCamera> &truth,
    const BoardSpec &board, const std::vector<int> &seen_by, int count, unsigned seed)
{
  std::mt19937 random (seed);
  std::uniform_real_distribution<double> distance (0.6, 1.1);
  for (int tries = 0; count > 0 && tries < 100000; tries++) {
    const TrueCamera &near = truth[seen_by[tries % seen_by.size ()]];
    const Pose world_from_board =
        near.world_from_camera * random_board (near, board, distance (random), 0.7, 40, random);
    CalibrationFrame frame;
    for (const int i : seen_by) {
      Sighting sighting{
          i, project_board (truth[i], truth[i].world_from_camera.inverse () * world_from_board,
                 board, kNoisePx, random)};
      if (!sighting.corners.empty ())
        frame.sightings.push_back (std::move (sighting));
    }
    if (frame.sightings.size () < seen_by.size ())
      continue;
    frames.push_back (std::move (frame));
    count--;
  }
  ASSERT_EQ (count, 0);
}

std::vector<CalibrationFrame>
frames_for (
    const std::vector<TrueCamera> &truth, const std::vector<std::vector<int>> &groups, int count)
{
  std::vector<CalibrationFrame> frames;
  unsigned seed = 1;
  for (const auto &group : groups)
    add_frames (frames, truth, {}, group, count, seed++);
  return frames;
}

/* Camera 0 is at home in both. */
void
expect_poses (const std::vector<TrueCamera> &truth, const Rig &rig, double degrees, double metres)
{
  ASSERT_EQ (rig.views.size (), truth.size ());
  for (std::size_t i = 0; i < truth.size (); i++) {
    const Pose expected = truth[0].world_from_camera.inverse () * truth[i].world_from_camera;
    const Pose found = rig.views[0].world_from_view.inverse () * rig.views[i].world_from_view;
    EXPECT_LT (angle_between (expected, found), degrees) << "camera " << i;
    EXPECT_LT (norm (expected.translation - found.translation), metres) << "camera " << i;
  }
}

/* A pair 0.1 m apart, both looking along -z. */
std::vector<TrueCamera>
stereo_pair ()
{
  auto truth = ring (2, 0);
  for (TrueCamera &t : truth)
    t.camera.view_id = 0;
  truth[1].camera.role = CameraRole::kRight;
  truth[1].world_from_camera.translation.x = 0.1;
  return truth;
}

#define EXPECT_ERROR(status, text)                                                                 \
  do {                                                                                             \
    const Status error = (status);                                                                 \
    EXPECT_FALSE (error.ok ());                                                                    \
    EXPECT_NE (error.message ().find (text), std::string::npos) << error.message ();               \
  } while (0)

} // namespace

TEST (Calibration, cameras_that_share_boards_only_with_a_neighbour_are_chained)
{
  const auto truth = ring (4, 35);
  CalibrationResult result;
  const Status status = calibrate_rig (
      cameras_of (truth), frames_for (truth, {{0, 1}, {1, 2}, {2, 3}}, 14), {}, result);
  ASSERT_TRUE (status.ok ()) << status.message ();
  expect_poses (truth, result.rig, 0.1, 0.002);
  EXPECT_EQ (result.frames, 42);
  ASSERT_EQ (result.pairs.size (), 3U);
  for (int i = 0; i < 3; i++) {
    EXPECT_EQ (result.pairs[i].a, i);
    EXPECT_EQ (result.pairs[i].b, i + 1);
    EXPECT_EQ (result.pairs[i].frames, 14);
  }
  EXPECT_NEAR (result.rms_px, kNoisePx * std::sqrt (2), 0.01);
}

TEST (Calibration, ends_soon_when_asked_to)
{
  const auto truth = ring (2, 20);
  std::stop_source stop;
  stop.request_stop ();
  CalibrationResult result;
  const auto frames = frames_for (truth, {{0, 1}}, 14);
  EXPECT_EQ (calibrate_rig (cameras_of (truth), frames, {}, result, stop.get_token ()).code (),
      StatusCode::kInterrupted);

  Bundle bundle{{truth[0].lens, truth[1].lens}, std::vector<Pose> (2), {}};
  bundle.first_from_board.assign (frames.size (), {});
  for (Pose &board : bundle.first_from_board)
    board.translation.z = 1;
  EXPECT_EQ (
      adjust_bundle ({}, frames, {}, bundle, stop.get_token ()).code (), StatusCode::kInterrupted);
}

TEST (Calibration, groups_of_cameras_without_common_boards_are_named)
{
  const auto truth = ring (4, 35);
  CalibrationResult result;
  EXPECT_ERROR (
      calibrate_rig (cameras_of (truth), frames_for (truth, {{0, 1}, {2, 3}}, 12), {}, result),
      "camera 0 (view 0, left), camera 1 (view 1, left) | camera 2 (view 2, left), camera 3 (view "
      "3, left)");
}

TEST (Calibration, swapped_left_and_right_are_told)
{
  auto truth = stereo_pair ();
  const auto frames = frames_for (truth, {{0, 1}}, 15);
  CalibrationResult result;
  ASSERT_TRUE (calibrate_rig (cameras_of (truth), frames, {}, result).ok ());
  EXPECT_NEAR (result.rig.views[0].right->partner_from_left.translation.x, -0.1, 0.001);
  std::swap (truth[0].camera.role, truth[1].camera.role);
  EXPECT_ERROR (calibrate_rig (cameras_of (truth), frames, {}, result),
      "view 0: left and right cameras are swapped: camera 0 (right) stands 0.1");
}

TEST (Calibration, cameras_one_above_the_other_are_no_stereo_pair)
{
  auto truth = stereo_pair ();
  truth[1].world_from_camera.translation = truth[0].world_from_camera.translation + Vec3{0, 0.1, 0};
  CalibrationResult result;
  EXPECT_ERROR (calibrate_rig (cameras_of (truth), frames_for (truth, {{0, 1}}, 15), {}, result),
      "0.100 m above and 0.00");
  truth[1].camera.role = CameraRole::kThird; /* a third camera may stand above */
  EXPECT_TRUE (
      calibrate_rig (cameras_of (truth), frames_for (truth, {{0, 1}}, 15), {}, result).ok ());
  EXPECT_TRUE (result.rig.views[0].third);
}

TEST (Calibration, camera_that_is_rolled_against_its_partner_is_told)
{
  for (const auto &[degrees, text] : {std::pair{180., "is upside down against camera 0 (left)"},
           {-90., "lies on its side against camera 0 (left)"}}) {
    auto truth = stereo_pair ();
    truth[1].world_from_camera =
        truth[1].world_from_camera * rotation_about ({0, 0, 1}, degrees * kDegree);
    CalibrationResult result;
    EXPECT_ERROR (
        calibrate_rig (cameras_of (truth), frames_for (truth, {{0, 1}}, 15), {}, result), text);
  }
}

/* Instead of rows that differ, which follow from it. */
TEST (Calibration, pair_that_converges_or_is_staggered_is_one_warning_that_says_so)
{
  for (const auto &[degrees, ahead_m, text] :
      {std::tuple{5., 0.01, ""}, {22., 0., "directions that differ by 22.0 degrees"},
          {0., 0.04, "stands 0.040 m ahead of the left one, at a distance of 0.108 m"}}) {
    auto truth = stereo_pair ();
    truth[1].world_from_camera.translation.z -= ahead_m;
    for (int i : {0, 1})
      truth[i].world_from_camera =
          truth[i].world_from_camera * rotation_about ({0, 1, 0}, (0.5 - i) * degrees * kDegree);
    CalibrationResult result;
    ASSERT_TRUE (
        calibrate_rig (cameras_of (truth), frames_for (truth, {{0, 1}}, 15), {}, result).ok ());
    ASSERT_EQ (result.warnings.size (), std::size_t (*text ? 1 : 0));
    EXPECT_NE ((*text ? result.warnings[0] : "").find (text), std::string::npos);
    EXPECT_EQ (describe_misalignment (result.rig.views[0]), *text ? result.warnings[0] : "");
  }
}

/* Its columns are numbered from the other end, as BoardDetector does. */
TEST (Calibration, pictures_of_one_camera_that_are_mirrored_get_a_hint)
{
  const auto truth = stereo_pair ();
  auto frames = frames_for (truth, {{0, 1}}, 9);
  const int columns = BoardSpec{}.columns;
  for (CalibrationFrame &frame : frames)
    for (BoardCorner &corner : frame.sightings[1].corners) {
      corner.x = 639 - corner.x;
      corner.id = corner.id / columns * columns + columns - 1 - corner.id % columns;
    }
  CalibrationResult result;
  EXPECT_ERROR (calibrate_rig (cameras_of (truth), frames, {}, result),
      "Each camera alone fits: were their images captured at the same time, and are those of "
      "one of them mirrored?");
}

TEST (Calibration, board_that_moved_between_two_cameras_is_skipped_and_reported)
{
  const auto truth = stereo_pair ();
  auto frames = frames_for (truth, {{0, 1}}, 20);
  for (BoardCorner &corner : frames[7].sightings[1].corners)
    corner.x += 12;
  frames[7].number = 1007;
  CalibrationResult result;
  const Status status = calibrate_rig (cameras_of (truth), frames, {}, result);
  ASSERT_TRUE (status.ok ()) << status.message ();
  ASSERT_FALSE (result.dropped.empty ());
  for (const DroppedBoard &dropped : result.dropped)
    EXPECT_EQ (dropped.frame, 1007U);
  EXPECT_NEAR (result.rig.views[0].right->partner_from_left.translation.x, -0.1, 0.001);
  EXPECT_LT (result.rms_px, 0.1);
}

TEST (Calibration, too_few_frames_name_the_camera_and_the_number)
{
  const auto truth = ring (2, 20);
  CalibrationResult result;
  EXPECT_ERROR (
      calibrate_rig (cameras_of (truth), frames_for (truth, {{0, 1}, {0}}, 5), {}, result),
      "camera 1 (view 1, left): the board was found in 5 frames; show it in at least 8");
  EXPECT_ERROR (calibrate_rig (cameras_of (truth), frames_for (truth, {{0}}, 10), {}, result),
      "camera 1 (view 1, left): no board was found; show one with 9x6 inner corners");
  EXPECT_ERROR (calibrate_rig ({}, {}, {}, result), "no cameras");
}

TEST (Calibration, cameras_that_make_up_no_view_are_refused)
{
  auto cameras = cameras_of (stereo_pair ());
  EXPECT_TRUE (check_cameras (cameras, {}).ok ());
  cameras[1].height = 360;
  EXPECT_ERROR (check_cameras (cameras, {}), "camera 1 (view 0, right) is 640x360; use the size");
  cameras[1].role = CameraRole::kLeft;
  EXPECT_ERROR (
      check_cameras (cameras, {}), "camera 0 and camera 1 are both the left camera of view 0");
  cameras[1].view_id = 1;
  EXPECT_TRUE (check_cameras (cameras, {}).ok ()); /* other views may have other sizes */
  cameras[1].role = CameraRole::kThird;
  EXPECT_ERROR (check_cameras (cameras, {}), "its view has no left camera");
  cameras[1].view_id = 64;
  EXPECT_ERROR (check_cameras (cameras, {}), "use a view from 0 to 63");
}

TEST (Calibration, board_that_looks_the_same_upside_down_is_for_one_camera)
{
  const auto cameras = cameras_of (stereo_pair ());
  BoardSpec board;
  board.columns = 8;
  EXPECT_ERROR (check_cameras (cameras, board), "8x6 inner corners looks the same upside down");
  EXPECT_TRUE (check_cameras ({cameras[0]}, board).ok ());
  board.kind = BoardKind::kCharuco;
  EXPECT_TRUE (check_cameras (cameras, board).ok ());
}

TEST (Calibration, cameras_of_different_sizes_need_videoscale)
{
  auto cameras = cameras_of (stereo_pair ());
  cameras[1].width = 1280;
  EXPECT_ERROR (check_cameras (cameras, {}),
      "camera 1 (view 0, right) is 1280x480; use the size of camera 0 (view 0, left), 640x480: add "
      "videoscale before the pad");
}

/* ---- the world ---- */

TEST (CalibrationWorld, lies_where_the_cameras_look_with_y_up_and_the_first_view_on_z)
{
  const auto truth = ring (3, 30);
  CalibrationResult result;
  ASSERT_TRUE (
      calibrate_rig (cameras_of (truth), frames_for (truth, {{0, 1, 2}}, 20), {}, result).ok ());
  for (int i = 0; i < 3; i++) {
    const Pose &found = result.rig.views[i].world_from_view;
    EXPECT_LT (angle_between (truth[i].world_from_camera, found), 0.2);
    EXPECT_LT (norm (truth[i].world_from_camera.translation - found.translation), 0.005);
  }
}

TEST (CalibrationWorld, board_on_the_floor_is_the_xz_plane_below_the_cameras)
{
  /* Both cameras look down at boards of which the first lies level. */
  auto truth = ring (2, 30);
  for (TrueCamera &t : truth) {
    t.world_from_camera = ring_pose (30. * t.camera.view_id, 0.01);
    t.world_from_camera = t.world_from_camera * rotation_about ({1, 0, 0}, -60 * kDegree);
    t.world_from_camera.translation =
        -0.9 * (t.world_from_camera.rotation * Vec3{0, 0, 1}); /* looks at the origin */
  }
  std::mt19937 random (5);
  const BoardSpec board;
  Pose level{{1, 0, 0, 0, 0, -1, 0, 1, 0}, {}};
  level.translation = -0.5 * (level.rotation * board.corner (board.corner_count () - 1));
  CalibrationFrame first;
  for (int i = 0; i < 2; i++)
    first.sightings.push_back (
        {i, project_board (
                truth[i], truth[i].world_from_camera.inverse () * level, board, kNoisePx, random)});
  ASSERT_FALSE (first.sightings[0].corners.empty ());
  ASSERT_FALSE (first.sightings[1].corners.empty ());
  auto frames = frames_for (truth, {{0, 1}}, 15);
  frames.insert (frames.begin (), first);
  CalibrationSettings settings;
  settings.world = WorldFrame::kBoard;
  CalibrationResult result;
  const Status status = calibrate_rig (cameras_of (truth), frames, settings, result);
  ASSERT_TRUE (status.ok ()) << status.message ();
  for (int i = 0; i < 2; i++)
    EXPECT_NEAR (result.rig.views[i].world_from_view.translation.y,
        truth[i].world_from_camera.translation.y, 0.005);
  const Vec3 at = result.rig.views[0].world_from_view.translation;
  EXPECT_NEAR (at.x, 0, 0.005);
  EXPECT_GT (at.z, 0.1);
}
