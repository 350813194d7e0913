/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "../test-support.hpp"

#include <cstring>
#include <rangecast/scene/scene.hpp>

using namespace rangecast;
using rangecast::testing::Image;

struct Picture {
  Image<Rgbx> colour{320, 240};
  Image<std::uint16_t> depth{320, 240};
  Image<std::uint8_t> mask{320, 240};
};

static std::unique_ptr<Scene>
make_scene (SceneSettings settings = {})
{
  std::unique_ptr<Scene> scene;
  const Status status = Scene::create (settings, scene);
  EXPECT_TRUE (status.ok ()) << status.message ();
  return scene;
}

static void
render (Scene &scene, int view, SceneCamera camera, double time_s, Picture &out, bool empty = false)
{
  const Status status = scene.render (
      view, camera, time_s, empty, out.colour.view (), out.depth.view (), out.mask.view ());
  ASSERT_TRUE (status.ok ()) << status.message ();
}

static int
different_pixels (Picture &a, Picture &b)
{
  int n = 0;
  for (int y = 0; y < 240; y++)
    for (int x = 0; x < 320; x++)
      n += std::memcmp (&a.colour.view ().at (x, y), &b.colour.view ().at (x, y), 3) != 0;
  return n;
}

TEST (Scene, test_rigs_are_valid_and_view_0_stands_on_z)
{
  const auto scene = make_scene ();
  EXPECT_TRUE (validate (scene->rig ()).ok ());
  ASSERT_EQ (scene->range_rig ().views.size (), 4u);
  EXPECT_TRUE (scene->range_rig ().views[3].is_range_view ());
  const View &front = scene->rig ().views[0];
  EXPECT_NEAR (front.world_from_view.translation.z, 0.8, 1e-12);
  ASSERT_TRUE (front.right && front.third);
  EXPECT_NEAR (front.right->partner_from_left.translation.x, -0.1, 1e-12);
}

TEST (Scene, test_figure_moves_unless_motion_is_0)
{
  SceneSettings settings;
  settings.noise_sigma = 0;
  Picture first, second;
  auto scene = make_scene (settings);
  render (*scene, 0, SceneCamera::kLeft, 0, first);
  render (*scene, 0, SceneCamera::kLeft, 1, second);
  EXPECT_GT (different_pixels (first, second), 5000);
  settings.motion = 0;
  scene = make_scene (settings);
  render (*scene, 0, SceneCamera::kLeft, 0, first);
  render (*scene, 0, SceneCamera::kLeft, 1, second);
  EXPECT_EQ (different_pixels (first, second), 0);
}

/* What left and right see agrees through exact depth: x_right = x_left - fx * baseline / z. */
TEST (Scene, test_depth_of_left_and_right_agree_by_disparity)
{
  const auto scene = make_scene ();
  Picture left, right;
  render (*scene, 0, SceneCamera::kLeft, 0.4, left);
  render (*scene, 0, SceneCamera::kRight, 0.4, right);
  int compared = 0, agree = 0;
  for (int y = 0; y < 240; y++)
    for (int x = 0; x < 320; x++) {
      const double z = left.depth.view ().at (x, y) * 1e-4;
      const int xr = z > 0 ? int (std::lround (x - 320 * 0.1 / z)) : -1;
      if (xr < 0 || right.depth.view ().at (xr, y) == 0)
        continue;
      compared++;
      agree += std::abs (right.depth.view ().at (xr, y) - z * 1e4) < 60; /* 6 mm: slopes */
    }
  EXPECT_GT (compared, 15000);
  EXPECT_GT (agree, compared * 9 / 10);
}

TEST (Scene, test_bounding_boxes_hold_all_depth)
{
  const auto scene = make_scene ();
  Picture pictures[2];
  RangeImage images[2];
  Roi boxes[2];
  for (int i = 0; i < 2; i++)
    images[i] = {i, {0, 0, 320, 240}, pictures[i].depth.view (), pictures[i].colour.view (), 0};
  ASSERT_TRUE (scene->render_range (images, 1.0, false, boxes, 2).ok ());
  for (int i = 0; i < 2; i++) {
    const Roi box = boxes[i];
    EXPECT_FALSE (box.empty ());
    for (int y = 0; y < 240; y++)
      for (int x = 0; x < 320; x++)
        if (x < box.x || y < box.y || x >= box.x + box.width || y >= box.y + box.height) {
          ASSERT_EQ (images[i].depth.at (x, y), 0);
        }
  }
}

TEST (Scene, test_model_that_cannot_be_read_is_named)
{
  SceneSettings settings;
  settings.model = "/nowhere/head.glb";
  std::unique_ptr<Scene> scene;
  const Status status = Scene::create (settings, scene);
  EXPECT_FALSE (status.ok ());
  EXPECT_NE (status.message ().find ("/nowhere/head.glb"), std::string::npos);
}

TEST (Scene, test_scanned_head_faces_the_first_view)
{
  RANGECAST_NEED_DATA ("lps_head");
  SceneSettings settings;
  settings.model = rangecast::testing::data_dir () + "/lps_head/LeePerrySmith.glb";
  settings.motion = 0;
  const auto scene = make_scene (settings);
  Picture front, back;
  render (*scene, 0, SceneCamera::kLeft, 0, front);
  render (*scene, 2, SceneCamera::kLeft, 0, back);
  /* The nose is nearer to the front camera than the rest of the face's column. */
  int nearest = 65535, row = 0;
  for (int y = 30; y < 150; y++)
    if (const int z = front.depth.view ().at (160, y); z && z < nearest)
      nearest = z, row = y;
  EXPECT_GT (row, 60);
  EXPECT_LT (row, 130);
  EXPECT_GT (back.depth.view ().at (160, row), nearest);
}

TEST (Scene, test_far_reaches_the_walls)
{
  SceneSettings settings;
  settings.far_m = 4.5;
  settings.noise_sigma = 0;
  Picture bare;
  render (*make_scene (settings), 0, SceneCamera::kLeft, 0, bare, true);
  EXPECT_NEAR (bare.depth.view ().at (160, 20), 30000, 100); /* 0.8 m before and 2.2 m behind 0 */
}

TEST (Scene, test_room_settings_out_of_range_are_named)
{
  const auto refuse = [] (auto change, const char *name) {
    SceneSettings settings;
    change (settings);
    std::unique_ptr<Scene> scene;
    const Status status = Scene::create (settings, scene);
    EXPECT_EQ (status.code (), StatusCode::kBadValue);
    EXPECT_NE (status.message ().find (name), std::string::npos);
  };
  refuse ([] (SceneSettings &s) { s.distance_m = 3; }, "distance");
  refuse ([] (SceneSettings &s) { s.far_m = 0.5; }, "far");
  refuse ([] (SceneSettings &s) { s.wall_texture = 2; }, "wall-texture");
  refuse ([] (SceneSettings &s) { s.wall_warmth = 2; }, "wall-warmth");
}
