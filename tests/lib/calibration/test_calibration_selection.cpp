/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Which frames are worth keeping, and what is still missing. */
#include "../board-renderer.hpp"
#include "../test-support.hpp"

#include <rangecast/calibration/selection.hpp>

using namespace rangecast;
using namespace rangecast::testing;

namespace {

constexpr std::uint64_t kSecond = 1'000'000'000;

class SelectionTest : public ::testing::Test {
protected:
  void SetUp () override
  {
    true_.camera = cameras_[0];
    true_.lens = {600, 600, 319.5, 239.5};
    selector_.set (board_, {});
  }

  /* A board facing the camera, moved and turned (about y, then x), seen by one camera or two. */
  CalibrationFrame frame (
      double x_m, double y_m, double z_m, double yaw_deg = 0, double pitch_deg = 0, int cameras = 1)
  {
    Pose pose = rotation_about ({0, 1, 0}, yaw_deg * kDegree) *
                rotation_about ({1, 0, 0}, pitch_deg * kDegree);
    pose.translation = {x_m, y_m, z_m};
    pose = pose * Pose{kIdentity3, -0.5 * board_.corner (board_.corner_count () - 1)};
    CalibrationFrame made;
    for (int i = 0; i < cameras; i++)
      made.sightings.push_back ({i, project_board (true_, pose, board_, 0, random_)});
    EXPECT_FALSE (made.sightings[0].corners.empty ());
    return made;
  }
  FrameVerdict offer (CalibrationFrame f, std::vector<double> edges = {})
  {
    time_ += 10 * kSecond;
    return selector_.offer (cameras_, std::move (f), edges, time_);
  }
  CameraCoverage coverage () { return selector_.coverage (cameras_[0], 0); }

  BoardSpec board_;
  std::vector<CalibrationCamera> cameras_ = {
      {"a", 0, CameraRole::kLeft, 640, 480}, {"b", 1, CameraRole::kLeft, 640, 480}};
  TrueCamera true_;
  std::mt19937 random_;
  FrameSelector selector_;
  std::uint64_t time_ = 0;
};

} // namespace

TEST_F (SelectionTest, board_at_a_new_place_is_taken_and_at_an_old_one_is_not)
{
  EXPECT_EQ (offer (frame (0, 0, 0.6)), FrameVerdict::kTaken);
  EXPECT_EQ (offer (frame (0, 0, 0.6)), FrameVerdict::kSimilar);
  EXPECT_EQ (offer (frame (0.01, 0, 0.6)), FrameVerdict::kSimilar);
  EXPECT_EQ (offer (frame (0.12, 0, 0.6)), FrameVerdict::kTaken);
  EXPECT_EQ (offer (frame (0, 0, 0.6, 30)), FrameVerdict::kTaken);
  EXPECT_EQ (offer (frame (0, 0, 0.42)), FrameVerdict::kTaken);
  EXPECT_EQ (offer ({}), FrameVerdict::kNoBoard);
  EXPECT_EQ (selector_.frames ().size (), 4U);
}

TEST_F (SelectionTest, board_that_moves_is_not_taken_until_it_stands_still)
{
  const auto soon = [&] (double x) {
    return selector_.offer (cameras_, frame (x, 0, 0.6), {}, time_ += kSecond / 5);
  };
  EXPECT_EQ (selector_.offer (cameras_, {}, {}, 0), FrameVerdict::kNoBoard);
  EXPECT_EQ (soon (0), FrameVerdict::kMoving); /* who knows */
  EXPECT_EQ (soon (0.02), FrameVerdict::kMoving);
  EXPECT_EQ (soon (0.04), FrameVerdict::kMoving);
  EXPECT_EQ (soon (0.0405), FrameVerdict::kTaken);
}

/* As when the images of one moment arrive too far apart: each camera is compared with its own. */
TEST_F (SelectionTest, motion_is_judged_from_the_last_image_of_the_same_camera)
{
  const CalibrationFrame both = frame (0, 0, 0.6, 0, 0, 2), moved = frame (0.2, 0, 0.6, 0, 0, 2);
  const auto soon = [&] (const CalibrationFrame &f, bool first, bool second) {
    CalibrationFrame seen;
    for (const Sighting &sighting : f.sightings)
      if (sighting.camera == 0 ? first : second)
        seen.sightings.push_back (sighting);
    return selector_.offer (cameras_, seen, {}, time_ += kSecond / 10, {first, second});
  };
  EXPECT_EQ (soon (both, true, false), FrameVerdict::kTaken);
  EXPECT_EQ (soon (both, false, true), FrameVerdict::kTaken);
  EXPECT_EQ (soon (moved, true, false), FrameVerdict::kMoving);
  EXPECT_EQ (soon (moved, false, true), FrameVerdict::kMoving);
  EXPECT_EQ (soon (moved, true, false), FrameVerdict::kTaken);
  EXPECT_EQ (soon ({}, false, true), FrameVerdict::kNoBoard);
  EXPECT_EQ (soon (moved, false, true), FrameVerdict::kMoving); /* it was away */
}

TEST_F (SelectionTest, blurred_board_is_not_taken)
{
  EXPECT_EQ (offer (frame (0, 0, 0.6), {7}), FrameVerdict::kBlurred);
  EXPECT_EQ (offer (frame (0, 0, 0.6), {3}), FrameVerdict::kTaken);
}

TEST_F (SelectionTest, full_list_gives_up_the_frame_most_like_others_but_the_first)
{
  selector_.set (board_, {3, true});
  const CalibrationFrame first = frame (0, 0, 0.6);
  EXPECT_EQ (offer (first), FrameVerdict::kTaken);
  EXPECT_EQ (offer (frame (0.001, 0, 0.6)), FrameVerdict::kTaken);
  EXPECT_EQ (offer (frame (0.2, 0, 0.6)), FrameVerdict::kTaken);
  EXPECT_EQ (offer (frame (-0.2, 0, 0.6)), FrameVerdict::kTaken);
  EXPECT_EQ (selector_.frames ()[0].sightings[0].corners[0].x, first.sightings[0].corners[0].x);
  ASSERT_EQ (selector_.frames ().size (), 3U);
  EXPECT_EQ (offer (frame (-0.2, 0, 0.6)), FrameVerdict::kSimilar);
  double leftmost = 640, rightmost = 0;
  for (const CalibrationFrame &f : selector_.frames ()) {
    leftmost = std::min (leftmost, f.sightings[0].corners[0].x);
    rightmost = std::max (rightmost, f.sightings[0].corners[0].x);
  }
  EXPECT_LT (leftmost, 60);
  EXPECT_GT (rightmost, 400);
}

TEST_F (SelectionTest, coverage_says_which_cells_tilts_and_distances_are_missing)
{
  EXPECT_EQ (coverage ().share (), 0);
  EXPECT_EQ (coverage ().missing ().size (), 17U);
  offer (frame (-0.2, -0.15, 0.8));
  const CameraCoverage c = coverage ();
  EXPECT_EQ (c.frames, 1);
  EXPECT_TRUE (c.cells[0]); /* the top left one */
  EXPECT_FALSE (c.cells[3]);
  EXPECT_FALSE (c.tilted_left || c.tilted_right || c.tilted_up || c.tilted_down || c.distances);
  const auto missing = c.missing ();
  EXPECT_NE (std::ranges::find (missing, "board at the bottom right of the image"), missing.end ());
  EXPECT_EQ (std::ranges::find (missing, "board at the top left of the image"), missing.end ());
}

TEST_F (SelectionTest, boards_all_over_the_picture_complete_the_coverage)
{
  for (const double x : {-0.2, -0.07, 0.07, 0.2})
    for (const double y : {-0.16, 0., 0.16})
      offer (frame (x, y, 0.6));
  offer (frame (0, 0, 0.4));
  for (const double angle : {-30., 30.}) {
    offer (frame (0, 0, 0.6, angle));
    offer (frame (0, 0, 0.6, 0, angle));
  }
  EXPECT_TRUE (coverage ().complete ()) << coverage ().missing ().front ();
  EXPECT_EQ (coverage ().share (), 1);
}
