/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* StereoDepth on rendered pictures, held against their true depth. */
#include "../test-support.hpp"

#include <opencv2/core.hpp>
#include <random>
#include <rangecast/base/cpu.hpp>
#include <rangecast/scene/scene.hpp>
#include <rangecast/stereo/stereo_depth.hpp>

using namespace rangecast;
using rangecast::testing::Image;

namespace {

constexpr int kWidth = 320, kHeight = 240;
constexpr Roi kWhole = {0, 0, kWidth, kHeight};

/* What three cameras see at one moment, and the truth. */
struct Shot {
  Image<Rgbx> left{kWidth, kHeight}, right{kWidth, kHeight}, third{kWidth, kHeight};
  Image<std::uint16_t> truth{kWidth, kHeight};
  Image<std::uint8_t> mask{kWidth, kHeight};

  Shot (Scene &scene, double time_s, bool empty = false)
  {
    EXPECT_TRUE (scene
                     .render (0, SceneCamera::kLeft, time_s, empty, left.view (), truth.view (),
                         mask.view ())
                     .ok ());
    EXPECT_TRUE (scene.render (0, SceneCamera::kRight, time_s, empty, right.view (), {}, {}).ok ());
    EXPECT_TRUE (scene.render (0, SceneCamera::kThird, time_s, empty, third.view (), {}, {}).ok ());
  }
  Roi box ()
  {
    int x0 = kWidth, x1 = 0, y0 = kHeight, y1 = 0;
    for (int y = 0; y < kHeight; y++)
      for (int x = 0; x < kWidth; x++)
        if (mask.view ().at (x, y)) {
          x0 = std::min (x0, x), x1 = std::max (x1, x + 1);
          y0 = std::min (y0, y), y1 = std::max (y1, y + 1);
        }
    return {x0, y0, x1 - x0, y1 - y0};
  }
};

/* Depth of the whole picture; what was not asked for is 0. */
struct Depth {
  Image<std::uint16_t> depth{kWidth, kHeight};
  Image<Rgbx> colour{kWidth, kHeight};

  Status match (StereoDepth &stereo, Shot &shot, const Roi &roi = kWhole, bool third = false)
  {
    depth = Image<std::uint16_t> (kWidth, kHeight);
    return stereo.process (shot.left.view (), shot.right.view (),
        {0, roi, depth.view ().crop (roi.x, roi.y, roi.width, roi.height),
            colour.view ().crop (roi.x, roi.y, roi.width, roi.height), 0},
        third ? ImageView<const Rgbx> (shot.third.view ()) : ImageView<const Rgbx>{});
  }
};

/* Shares are 0 to 1. */
struct Judgement {
  double found = 0; ///< of the person's pixels
  double off = 0;   ///< of all valid pixels: more than 5 cm from the true surface
  double error = 0; ///< pixels of disparity: root mean square of those less than 2
};

class Judge {
public:
  void add (Shot &shot, Depth &depth)
  {
    for (int y = 0; y < kHeight; y++)
      for (int x = 0; x < kWidth; x++) {
        const int z = depth.depth.view ().at (x, y), t = shot.truth.view ().at (x, y);
        person_ += t > 0;
        valid_ += z > 0;
        found_ += z > 0 && t > 0;
        off_ += z > 0 && (t == 0 || std::abs (z - t) > 500);
        const double d = z && t ? 320000.0 / z - 320000.0 / t : 9;
        if (std::abs (d) < 2)
          squares_ += d * d, good_++;
      }
  }
  Judgement judgement () const
  {
    return {found_ / person_, off_ / std::max (1.0, valid_), std::sqrt (squares_ / good_)};
  }

private:
  double person_ = 0, valid_ = 0, found_ = 0, off_ = 0, good_ = 0, squares_ = 0;
};

/* By a tenth, as another camera. */
void
darken (Image<Rgbx> &picture)
{
  for (int y = 0; y < kHeight; y++)
    for (int x = 0; x < kWidth; x++) {
      Rgbx &p = picture.view ().at (x, y);
      p = {
          std::uint8_t (p.r * 9 / 10), std::uint8_t (p.g * 9 / 10), std::uint8_t (p.b * 9 / 10), 0};
    }
}

std::unique_ptr<Scene>
make_scene (double motion = 1, double distance_m = 0.8)
{
  SceneSettings settings;
  settings.views = 1;
  settings.noise_sigma = 1.5;
  settings.motion = motion;
  settings.distance_m = distance_m;
  std::unique_ptr<Scene> scene;
  EXPECT_TRUE (Scene::create (settings, scene).ok ());
  return scene;
}

} // namespace

/* Whole pictures, parts of them, a third camera: loops that end beyond vectors, and refining. */
TEST (StereoScene, every_rung_of_the_cpu_and_number_of_threads_finds_the_same_depth)
{
  const auto scene = make_scene ();
  const Roi roi = {61, 15, 201, 213};
  StereoDepth plain, wide;
  Depth of_plain, of_wide;
  for (bool third : {false, true}) {
    ASSERT_TRUE (plain.set (scene->rig ().views[0], 1, third).ok ());
    ASSERT_TRUE (wide.set (scene->rig ().views[0], 3, third).ok ());
    for (int i = 0; i < 3; i++) {
      Shot shot (*scene, 0.04 * i, i == 0);
      const Roi &part = i == 2 ? roi : kWhole;
      darken (shot.right);
      limit_cpu (CpuLevel::kScalar);
      ASSERT_TRUE (of_plain.match (plain, shot, part, third).ok ());
      limit_cpu (CpuLevel::kAvx2);
      ASSERT_TRUE (of_wide.match (wide, shot, part, third).ok ());
      for (int y = 0; y < kHeight; y++)
        for (int x = 0; x < kWidth; x++)
          ASSERT_EQ (of_plain.depth.view ().at (x, y), of_wide.depth.view ().at (x, y))
              << "picture " << i << " at " << x << ", " << y;
    }
  }
}

/* Another scene after a break is matched as if nothing had been before. */
TEST (StereoScene, reset_forgets_all_that_was_seen)
{
  const auto before = make_scene (), after = make_scene (1, 0.6);
  StereoDepth used, fresh;
  Depth of_used, of_fresh;
  ASSERT_TRUE (used.set (after->rig ().views[0], 0, true).ok ());
  ASSERT_TRUE (fresh.set (after->rig ().views[0], 0, true).ok ());
  for (int i = 0; i < 3; i++) {
    Shot shot (*before, 0.04 * i, i == 0);
    darken (shot.right);
    ASSERT_TRUE (of_used.match (used, shot, i < 2 ? kWhole : shot.box (), true).ok ());
  }
  used.reset ();
  for (int i = 0; i < 3; i++) {
    Shot shot (*after, 0.04 * i);
    const Roi part = i == 1 ? shot.box () : kWhole;
    if (i == 0) {
      ASSERT_TRUE (used.rectify (shot.left.view (), shot.right.view ()).ok ());
      EXPECT_TRUE (used.changed_outside (shot.box ()));
    }
    ASSERT_TRUE (of_used.match (used, shot, part, true).ok ());
    ASSERT_TRUE (of_fresh.match (fresh, shot, part, true).ok ());
    for (int y = 0; y < kHeight; y++)
      for (int x = 0; x < kWidth; x++)
        ASSERT_EQ (of_used.depth.view ().at (x, y), of_fresh.depth.view ().at (x, y))
            << "picture " << i << " at " << x << ", " << y;
  }
}

/* Without that, noise changes the depth of 23 edge pixels in each image. */
TEST (StereoScene, what_stands_still_keeps_its_depth)
{
  const auto scene = make_scene (0);
  StereoDepth stereo;
  ASSERT_TRUE (stereo.set (scene->rig ().views[0]).ok ());
  Depth now;
  int changes = 0;
  constexpr int kFirst = 5, kImages = 10;
  for (int i = 0; i < kImages; i++) {
    Image<std::uint16_t> before = now.depth;
    Shot shot (*scene, 0.04 * i);
    ASSERT_TRUE (now.match (stereo, shot).ok ());
    for (int y = 0; y < kHeight && i >= kFirst; y++)
      for (int x = 0; x < kWidth; x++)
        changes += std::abs (now.depth.view ().at (x, y) - before.view ().at (x, y)) > 500;
  }
  EXPECT_LT (changes / (kImages - kFirst), 12);
}

TEST (StereoScene, hardly_any_pixel_hangs_in_the_air)
{
  const auto scene = make_scene ();
  StereoDepth stereo;
  ASSERT_TRUE (stereo.set (scene->rig ().views[0]).ok ());
  Judge judge;
  Depth depth;
  for (int i = 0; i < 4; i++) {
    Shot shot (*scene, 0.9 * i);
    ASSERT_TRUE (depth.match (stereo, shot).ok ());
    judge.add (shot, depth);
  }
  EXPECT_LT (judge.judgement ().off, 0.003);
  EXPECT_GT (judge.judgement ().found, 0.98);
  EXPECT_LT (judge.judgement ().error, 0.3);
}

TEST (StereoScene, wall_beyond_far_is_not_taken_for_something_nearer)
{
  const auto scene = make_scene ();
  Shot shot (*scene, 0, true);
  StereoDepth stereo;
  Depth depth;
  ASSERT_TRUE (stereo.set (scene->rig ().views[0]).ok ());
  ASSERT_TRUE (depth.match (stereo, shot).ok ());
  int valid = 0;
  for (int y = 0; y < kHeight; y++)
    for (int x = 0; x < kWidth; x++)
      valid += depth.depth.view ().at (x, y) != 0;
  EXPECT_LT (valid, kWidth * kHeight / 1000);
}

TEST (StereoScene, part_of_picture_and_depths_is_as_good_as_the_whole)
{
  const auto scene = make_scene (1, 1.1); /* the person's box is a quarter of the picture */
  StereoDepth whole, part;
  ASSERT_TRUE (whole.set (scene->rig ().views[0]).ok ());
  ASSERT_TRUE (part.set (scene->rig ().views[0]).ok ());
  Judge of_whole, of_part;
  Depth depth;
  for (int i = 0; i < 8; i++) {
    Shot shot (*scene, 0.04 * i);
    ASSERT_TRUE (depth.match (part, shot, i ? shot.box () : kWhole).ok ());
    if (i)
      of_part.add (shot, depth);
    ASSERT_TRUE (depth.match (whole, shot).ok ());
    if (i)
      of_whole.add (shot, depth);
  }
  EXPECT_GT (of_part.judgement ().found, 0.99 * of_whole.judgement ().found);
  EXPECT_LT (of_part.judgement ().error, 1.05 * of_whole.judgement ().error);
  EXPECT_LT (of_part.judgement ().off, 0.003);
}

/* Beside the person is background that the right camera does not see: it may match anything. */
TEST (StereoScene, depths_looked_at_stay_those_of_a_person_who_moves)
{
  SceneSettings settings;
  settings.width = 640, settings.height = 480;
  settings.views = 1;
  settings.noise_sigma = 1.5;
  std::unique_ptr<Scene> scene;
  ASSERT_TRUE (Scene::create (settings, scene).ok ());
  StereoDepth stereo;
  ASSERT_TRUE (stereo.set (scene->rig ().views[0]).ok ());
  Image<Rgbx> left{640, 480}, right{640, 480}, colour{640, 480};
  Image<std::uint16_t> depth{640, 480};
  int pixels = 0, nearer = 0;
  for (int i = 0; i < 16; i++) {
    for (auto [camera, picture] :
        {std::pair{SceneCamera::kLeft, &left}, std::pair{SceneCamera::kRight, &right}})
      ASSERT_TRUE (scene->render (0, camera, 0.1 * i, i == 0, picture->view (), {}, {}).ok ());
    const Roi roi = i < 2 ? Roi{0, 0, 640, 480} : Roi{110, 40, 430, 440};
    const auto found = depth.view ().crop (roi.x, roi.y, roi.width, roi.height);
    ASSERT_TRUE (
        stereo
            .process (left.view (), right.view (),
                {0, roi, found, colour.view ().crop (roi.x, roi.y, roi.width, roi.height), 0})
            .ok ());
    for (int y = 0; y < roi.height; y++)
      for (int x = 0; x < roi.width; x++) {
        pixels += found.at (x, y) > 0;
        nearer += found.at (x, y) > 0 && found.at (x, y) < 6000;
      }
  }
  EXPECT_LT (nearer, pixels / 500);
}

/* Little contrast everywhere: many of the person's pixels look like the remembered background.
 * Something far away that comes beside them is found only if all depths are searched. */
TEST (StereoScene, clothes_like_the_background_do_not_widen_the_search)
{
  SceneSettings settings;
  settings.views = 1;
  std::unique_ptr<Scene> scene;
  ASSERT_TRUE (Scene::create (settings, scene).ok ());
  StereoDepth stereo;
  ASSERT_TRUE (stereo.set (scene->rig ().views[0]).ok ());
  Depth depth;
  std::minstd_rand random;
  const auto disparity_of_far_thing = [&] (int i, const Roi &roi) {
    Shot shot (*scene, 0, i == 0);
    for (Image<Rgbx> *picture : {&shot.left, &shot.right})
      for (int y = 0; y < kHeight; y++)
        for (int x = 0; x < kWidth; x++) {
          Rgbx &p = picture->view ().at (x, y);
          p.r = p.g = p.b = std::uint8_t (60 + p.g / 8);
        }
    for (int y = 24; y < 40 && i > 3; y++)
      for (int x = 67; x < 83; x++) {
        Rgbx &p = shot.left.view ().at (x, y);
        p.r = p.g = p.b = std::uint8_t (random () % 256);
        shot.right.view ().at (x - 1, y) = p;
      }
    EXPECT_TRUE (depth.match (stereo, shot, roi).ok ());
    return stereo.disparity ().at (75 - roi.x, 32 - roi.y);
  };
  const Roi part = {50, 10, 220, 220};
  for (int i = 0; i < 4; i++)
    disparity_of_far_thing (i, i < 2 ? kWhole : part);
  for (int i = 4; i < 6; i++)
    EXPECT_NE (disparity_of_far_thing (i, part) / 16, 1);
  EXPECT_EQ (disparity_of_far_thing (6, kWhole) / 16, 1);
}

TEST (StereoScene, who_steps_nearer_than_the_depths_looked_at_is_seen_at_once)
{
  const auto far = make_scene (0, 1.1), near = make_scene (0, 0.7);
  StereoDepth stereo;
  ASSERT_TRUE (stereo.set (far->rig ().views[0]).ok ());
  Depth depth;
  Shot before (*far, 0), after (*near, 0);
  const Roi box = after.box ();
  ASSERT_TRUE (depth.match (stereo, before).ok ());
  ASSERT_TRUE (depth.match (stereo, before, box).ok ());
  ASSERT_TRUE (depth.match (stereo, after, box).ok ());
  Judge judge;
  judge.add (after, depth);
  EXPECT_GT (judge.judgement ().found, 0.95);
  EXPECT_LT (judge.judgement ().error, 0.4);
}

TEST (StereoScene, third_camera_fills_a_third_of_the_holes)
{
  const auto scene = make_scene ();
  Judgement of[2];
  for (const bool third : {false, true}) {
    StereoDepth stereo;
    ASSERT_TRUE (stereo.set (scene->rig ().views[0], 0, third).ok ());
    Judge judge;
    Depth depth;
    for (int i = 0; i < 3; i++) {
      Shot shot (*scene, 0.7 * i);
      ASSERT_TRUE (depth.match (stereo, shot, kWhole, third).ok ());
      judge.add (shot, depth);
    }
    of[third] = judge.judgement ();
  }
  EXPECT_LT (1 - of[1].found, (1 - of[0].found) * 2 / 3);
  EXPECT_LE (of[1].error, of[0].error);
  EXPECT_LT (of[1].off, 0.003);
}

TEST (StereoScene, third_camera_that_cannot_be_used_is_named)
{
  View view = make_scene ()->rig ().views[0];
  StereoDepth stereo;
  view.third->partner_from_left.translation = {0, 0, 0.1};
  EXPECT_NE (stereo.set (view, 0, true).message ().find ("before or behind"), std::string::npos);
  view.third->partner_from_left.translation = {0, 0, 0};
  EXPECT_NE (stereo.set (view, 0, true).message ().find ("third"), std::string::npos);
  view.third.reset ();
  EXPECT_EQ (stereo.set (view, 0, true).code (), StatusCode::kNotFound);
}
