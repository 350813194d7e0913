/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The person of the test scene, found in rooms with shadows, drifting light and a chair. */
#include "../test-support.hpp"

#include "../roi-scene.hpp"

using namespace rangecast;
using rangecast::testing::RoiScore;
using rangecast::testing::RoiStage;
using rangecast::testing::RoiTrial;

namespace {

RoiTrial
short_trial ()
{
  RoiTrial trial = RoiTrial::standard ();
  trial.background_frames = 10;
  trial.frames = 2;
  trial.first_s = 2;
  trial.step_s = 9; /* through a quarter of the swing of light and back */
  return trial;
}

RoiScore
score_of (const RoiTrial &trial)
{
  RoiStage stage (trial);
  RoiScore score;
  const Status status = run_roi_trial (stage, trial, score);
  EXPECT_TRUE (status.ok ()) << status.message ();
  EXPECT_GT (score.person_pixels, 20000);
  return score;
}

void
expect_clean (const RoiScore &score, double deepest)
{
  EXPECT_GE (score.worst_iou, 0.97);
  EXPECT_GT (score.shadow_pixels, 700);
  EXPECT_EQ (score.shadow_kept, 0);
  EXPECT_EQ (score.outside_kept, 0);
  EXPECT_LE (score.eaten, deepest);
}

} // namespace

TEST (Segmentation, person_is_found_to_the_pixel_beside_shadow_chair_and_drifting_light)
{
  const RoiTrial trial = short_trial ();
  expect_clean (score_of (trial), 1);
}

TEST (Segmentation, more_noise_in_colour_and_depth_is_as_good)
{
  RoiTrial trial = short_trial ();
  trial.scene.noise_sigma = 6;
  trial.depth_noise = 0.5;
  expect_clean (score_of (trial), 4);
  trial.settings.fringe = 0; /* exact depth has no fringes that noise could be taken for */
  expect_clean (score_of (trial), 1);
}

TEST (Segmentation, shadow_too_deep_for_colour_is_told_by_depth)
{
  RoiTrial trial = short_trial ();
  trial.cast_shadow = 0.7;
  expect_clean (score_of (trial), 1);
  trial.settings.cue = Cue::kColour;
  EXPECT_LT (score_of (trial).worst_iou, 0.9);
}

TEST (Segmentation, clothes_and_skin_like_the_wall_are_told_by_depth)
{
  RoiTrial trial = short_trial ();
  trial.scene.wall_warmth = 1;
  expect_clean (score_of (trial), 8); /* in a few narrow patches just like the wall */
  trial.settings.fringe = 0;
  expect_clean (score_of (trial), 1);
  trial.settings.cue = Cue::kColour;
  EXPECT_LT (score_of (trial).worst_iou, 0.9);
}

TEST (Segmentation, wall_out_of_reach_is_behind_whatever_has_depth)
{
  RoiTrial trial = short_trial ();
  trial.scene.far_m = 1.3;
  expect_clean (score_of (trial), 1);
  trial.settings.cue = Cue::kDepth;
  expect_clean (score_of (trial), 1);
}

TEST (Segmentation, exposure_may_jump)
{
  RoiTrial trial = short_trial ();
  trial.exposure = 1.6;
  expect_clean (score_of (trial), 1);
  trial.settings.cue = Cue::kColour;
  const double followed = score_of (trial).worst_iou;
  trial.settings.follow_light = false;
  EXPECT_GT (followed, score_of (trial).worst_iou + 0.2);
}

TEST (Segmentation, stereo_is_cut_at_the_silhouette_with_both_cues_and_not_with_depth_alone)
{
  RoiTrial trial = short_trial ();
  trial.stereo = true;
  trial.background_frames = 15;
  const RoiScore both = score_of (trial);
  EXPECT_GE (both.worst_iou, 0.97);
  EXPECT_GE (both.mean_mask_iou, 0.99);
  EXPECT_LT (both.outside_kept, both.person_pixels / 250);
  trial.settings.cue = Cue::kDepth;
  const RoiScore depth = score_of (trial);
  EXPECT_LT (depth.worst_iou, both.worst_iou);
  EXPECT_GT (depth.outside_kept, 2 * both.outside_kept);
}

namespace {

/* A person sits still for a minute while the light falls to 60 %; what is left of it at the end. */
RoiScore
score_after_a_minute (RoiStage &stage, double adapt_time_s)
{
  RoiScore last;
  EXPECT_TRUE (stage.prepare ().ok () && stage.learn ().ok ());
  for (int i = 0; i < 60; i++) {
    stage.take (10 + i, false);
    stage.dim (1 - 0.4 * std::min (i, 50) / 50);
    EXPECT_TRUE (stage.decide ().ok ());
    if (adapt_time_s > 0)
      stage.adapt (adapt_time_s);
    EXPECT_TRUE (stage.clear ().ok ());
    if (i >= 55)
      stage.score (last);
  }
  return last;
}

constexpr double kFast = 5; /* seconds */

} // namespace

TEST (Segmentation, slow_adaptation_follows_the_room_and_never_absorbs_who_sits_still)
{
  RoiTrial trial = short_trial ();
  trial.scene.motion = 0.05;
  trial.light_drift = 0;
  trial.settings.follow_light = false;
  RoiStage stage (trial);
  const RoiScore last = score_after_a_minute (stage, kFast);
  EXPECT_GE (last.worst_iou, 0.97);
  EXPECT_EQ (last.outside_kept, 0);
  EXPECT_NEAR (
      stage.background ().row (10)[160].mean[1] / stage.first_mean (160, 10)[1], 0.6, 0.05);
}
