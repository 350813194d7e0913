/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "../test-support.hpp"

#include <fstream>
#include <unistd.h>

#include <cstring>
#include <opencv2/imgcodecs.hpp>
#include <rangecast/scene/scene.hpp>

using namespace rangecast;
using rangecast::testing::Image;
namespace fs = std::filesystem;

#ifdef RANGECAST_HAVE_MODELS
#define RANGECAST_NEED_MODELS
#else
#define RANGECAST_NEED_MODELS GTEST_SKIP () << "built without models"
#endif

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

TEST (Scene, test_same_settings_and_time_give_the_same_picture)
{
  const auto a = make_scene (), b = make_scene ();
  Picture first, second;
  render (*a, 1, SceneCamera::kLeft, 9.0, first); /* its past must not matter */
  render (*a, 1, SceneCamera::kLeft, 0.7, first);
  render (*b, 1, SceneCamera::kLeft, 0.7, second);
  EXPECT_EQ (different_pixels (first, second), 0);
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

TEST (Scene, test_empty_room_has_no_person_and_no_depth)
{
  const auto scene = make_scene ();
  Picture picture;
  render (*scene, 0, SceneCamera::kLeft, 0, picture, true);
  for (int y = 0; y < 240; y++)
    for (int x = 0; x < 320; x++)
      ASSERT_EQ (picture.mask.view ().at (x, y) + picture.depth.view ().at (x, y), 0);
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

/* No holes inside the figure: a row of the mask has at most the gaps of neck and shoulders. */
TEST (Scene, test_mesh_has_no_cracks)
{
  SceneSettings settings;
  settings.motion = 0;
  const auto scene = make_scene (settings);
  Picture picture;
  render (*scene, 0, SceneCamera::kLeft, 0, picture);
  for (int y = 0; y < 240; y++) {
    int runs = 0;
    for (int x = 1; x < 320; x++)
      runs += picture.mask.view ().at (x, y) > picture.mask.view ().at (x - 1, y);
    EXPECT_LE (runs, 1) << "row " << y;
  }
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

TEST (Scene, test_bad_settings_are_named)
{
  SceneSettings settings;
  settings.distance_m = 3;
  std::unique_ptr<Scene> scene;
  const Status status = Scene::create (settings, scene);
  EXPECT_EQ (status.code (), StatusCode::kBadValue);
  EXPECT_NE (status.message ().find ("distance"), std::string::npos);
  EXPECT_FALSE (scene);
}

TEST (Scene, test_wrong_view_and_size_are_refused)
{
  const auto scene = make_scene ();
  Image<Rgbx> small (100, 100), right (320, 240);
  EXPECT_EQ (scene->render (4, SceneCamera::kLeft, 0, false, right.view (), {}, {}).code (),
      StatusCode::kNotFound);
  EXPECT_EQ (scene->render (0, SceneCamera::kLeft, 0, false, small.view (), {}, {}).code (),
      StatusCode::kBadSize);
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

TEST (Scene, test_file_that_is_no_model_is_named)
{
  const std::string path =
      ::testing::TempDir () + "no-model-" + std::to_string (getpid ()) + ".glb";
  std::ofstream (path) << "this is no model";
  SceneSettings settings;
  settings.model = path;
  std::unique_ptr<Scene> scene;
  const Status status = Scene::create (settings, scene);
  std::filesystem::remove (path);
  EXPECT_EQ (status.code (), StatusCode::kBadData);
  EXPECT_TRUE (status.message ().starts_with (path)) << status.message ();
}

TEST (Scene, test_small_obj_is_fitted_and_drawn)
{
  const std::string path = ::testing::TempDir () + "small-" + std::to_string (getpid ()) + ".obj";
  std::ofstream (path) << "v -9 -9 0\nv 9 -9 0\nv 9 9 0\nv -9 9 0\nf 1 2 3\nf 1 3 4\n";
  SceneSettings settings;
  settings.model = path;
  settings.motion = 0;
  std::unique_ptr<Scene> scene;
  const Status status = Scene::create (settings, scene);
  std::filesystem::remove (path);
  ASSERT_TRUE (status.ok ()) << status.message ();
  Image<Rgbx> colour (320, 240);
  Image<std::uint16_t> depth (320, 240);
  ASSERT_TRUE (
      scene->render (0, SceneCamera::kLeft, 0, false, colour.view (), depth.view (), {}).ok ());
  EXPECT_NEAR (depth.view ().at (160, 120), 8000, 40) << "a plane through the origin, 0.8 m away";
}

TEST (Scene, test_model_with_numbers_out_of_range_is_refused_by_name)
{
  const std::string path = ::testing::TempDir () + "wild-" + std::to_string (getpid ()) + ".obj";
  for (const char *wild :
      {"vt 1e30 0", "vt 0 -1e30", "vt nan 0", "vt 0 inf", "v 1e38 0 0", "v nan 0 0"}) {
    std::ofstream (path) << "v -9 -9 0\nv 9 -9 0\nv 9 9 0\nv -9 9 0\nvt 0 0\nvt 1 1\n"
                         << wild << "\nf 1/1 2/2 3/1\nf 1/1 3/2 4/1\nf -1/-1 2/2 3/-1\n";
    SceneSettings settings;
    settings.model = path;
    std::unique_ptr<Scene> scene;
    const Status status = Scene::create (settings, scene);
    if (status.ok ()) { // the importer reads some of these words as 0
      Image<Rgbx> colour (320, 240);
      Image<std::uint16_t> depth (320, 240);
      EXPECT_TRUE (
          scene->render (0, SceneCamera::kLeft, 0, false, colour.view (), depth.view (), {}).ok ());
      EXPECT_TRUE (std::string (wild).find ("1e") == std::string::npos) << wild;
    } else {
      EXPECT_TRUE (status.message ().starts_with (path)) << status.message ();
    }
  }
  std::filesystem::remove (path);
}

/* A folder with a square that faces view 0, as OBJ and as glTF, and a picture for it: red above,
 * blue below. Each format's v runs its own way; the picture's top belongs to the square's. */
class TexturedSquare {
public:
  TexturedSquare ()
      : folder_ (fs::path (::testing::TempDir ()) / ("square-" + std::to_string (getpid ())))
  {
    fs::create_directories (folder_);
    write_picture ("paint.png");
  }
  ~TexturedSquare () { fs::remove_all (folder_); }

  [[nodiscard]] std::string path (const char *name) const { return (folder_ / name).string (); }

  void write_picture (const char *name) const
  {
    cv::Mat picture (4, 2, CV_8UC3, cv::Scalar (200, 0, 0));
    picture.rowRange (0, 2) = cv::Scalar (0, 0, 200);
    cv::imwrite ((folder_ / name).string (), picture);
  }

  /** OBJ counts v from the picture's bottom. */
  void write_obj (const char *picture) const
  {
    std::ofstream obj (folder_ / "square.obj");
    if (*picture) {
      std::ofstream (folder_ / "square.mtl") << "newmtl m\nKd 1 1 1\nmap_Kd " << picture << "\n";
      obj << "mtllib square.mtl\nusemtl m\n";
    }
    obj << "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
           "f 1/1 2/2 3/3\nf 1/1 3/3 4/4\n";
  }

  /** glTF counts v from the picture's top. */
  void write_gltf (const std::string &picture) const
  {
    const float positions[] = {-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0};
    const float places[] = {0, 1, 1, 1, 1, 0, 0, 0};
    const std::uint16_t corners[] = {0, 1, 2, 0, 2, 3};
    std::ofstream bin (folder_ / "square.bin", std::ios::binary);
    bin.write (reinterpret_cast<const char *> (positions), sizeof positions);
    bin.write (reinterpret_cast<const char *> (places), sizeof places);
    bin.write (reinterpret_cast<const char *> (corners), sizeof corners);
    const std::string material =
        picture.empty () ? ""
                         : R"("images":[{"uri":")" + picture +
                               R"("}],"textures":[{"source":0}],"materials":[{)"
                               R"("pbrMetallicRoughness":{"baseColorTexture":{"index":0}}}],)";
    std::ofstream (folder_ / "square.gltf")
        << R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],)"
        << material << R"("meshes":[{"primitives":[{"attributes":{"POSITION":0,"TEXCOORD_0":1},)"
        << R"("indices":2)" << (picture.empty () ? "" : R"(,"material":0)") << R"(}]}],)"
        << R"("accessors":[{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3",)"
           R"("min":[-1,-1,0],"max":[1,1,0]},)"
           R"({"bufferView":1,"componentType":5126,"count":4,"type":"VEC2"},)"
           R"({"bufferView":2,"componentType":5123,"count":6,"type":"SCALAR"}],)"
           R"("bufferViews":[{"buffer":0,"byteOffset":0,"byteLength":48},)"
           R"({"buffer":0,"byteOffset":48,"byteLength":32},)"
           R"({"buffer":0,"byteOffset":80,"byteLength":12}],)"
           R"("buffers":[{"uri":"square.bin","byteLength":92}]})";
  }

private:
  fs::path folder_;
};

/* "red", "blue" or neither, in the upper and in the lower half of the square. */
static std::string
halves_of (const std::string &model)
{
  SceneSettings settings;
  settings.model = model;
  settings.motion = settings.noise_sigma = 0;
  const auto scene = make_scene (settings);
  Picture picture;
  if (scene)
    render (*scene, 0, SceneCamera::kLeft, 0, picture);
  const auto name = [&] (int y) {
    const Rgbx p = picture.colour.view ().at (160, y);
    return p.r > 100 && p.b < 10 ? "red" : p.b > 100 && p.r < 10 ? "blue" : "neither";
  };
  return std::string (name (60)) + " over " + name (180);
}

TEST (Scene, test_texture_that_the_material_names_stands_upright)
{
  RANGECAST_NEED_MODELS;
  const TexturedSquare square;
  square.write_obj ("paint.png");
  square.write_gltf ("paint.png");
  EXPECT_EQ (halves_of (square.path ("square.obj")), "red over blue");
  EXPECT_EQ (halves_of (square.path ("square.gltf")), "red over blue");
}

TEST (Scene, test_colour_map_beside_a_gltf_file_counts_v_from_its_bottom)
{
  RANGECAST_NEED_MODELS;
  const TexturedSquare square;
  square.write_obj ("");
  square.write_gltf ("");
  fs::rename (square.path ("paint.png"), square.path ("Map-COL.png")); /* read by its content */
  EXPECT_EQ (halves_of (square.path ("square.obj")), "red over blue");
  EXPECT_EQ (halves_of (square.path ("square.gltf")), "blue over red");
}

TEST (Scene, test_scanned_head_faces_the_first_view)
{
  RANGECAST_NEED_DATA ("lps_head");
  SceneSettings settings;
  settings.model = rangecast::testing::data_dir () + "/lps_head/LeePerrySmith.glb";
  settings.motion = 0;
  std::unique_ptr<Scene> scene;
  const Status status = Scene::create (settings, scene);
  ASSERT_TRUE (status.ok ()) << status.message ();
  Image<Rgbx> colour (320, 240);
  Image<std::uint16_t> front (320, 240), back (320, 240);
  ASSERT_TRUE (
      scene->render (0, SceneCamera::kLeft, 0, false, colour.view (), front.view (), {}).ok ());
  ASSERT_TRUE (
      scene->render (2, SceneCamera::kLeft, 0, false, colour.view (), back.view (), {}).ok ());
  /* The nose is nearer to the front camera than the rest of its face's column. */
  int nearest_row = 0;
  for (int y = 30; y < 150; y++)
    if (front.view ().at (160, y) &&
        front.view ().at (160, y) < front.view ().at (160, nearest_row))
      nearest_row = y;
    else if (!front.view ().at (160, nearest_row))
      nearest_row = y;
  EXPECT_GT (nearest_row, 60);
  EXPECT_LT (nearest_row, 130);
  EXPECT_GT (back.view ().at (160, nearest_row), front.view ().at (160, nearest_row));
}

TEST (Scene, test_far_reaches_the_walls_and_a_chair_stands_before_them)
{
  SceneSettings settings;
  settings.far_m = 4.5;
  settings.noise_sigma = 0;
  Picture bare, furnished;
  render (*make_scene (settings), 0, SceneCamera::kLeft, 0, bare, true);
  settings.chair = true;
  render (*make_scene (settings), 0, SceneCamera::kLeft, 0, furnished, true);
  int nearer = 0;
  for (int y = 0; y < 240; y++)
    for (int x = 0; x < 320; x++) {
      EXPECT_GT (bare.depth.view ().at (x, y), 20000);
      EXPECT_EQ (furnished.mask.view ().at (x, y), 0);
      nearer += furnished.depth.view ().at (x, y) + 5000 < bare.depth.view ().at (x, y);
    }
  EXPECT_NEAR (bare.depth.view ().at (160, 20), 30000, 100); /* 0.8 m before and 2.2 m behind 0 */
  EXPECT_GT (nearer, 3000);
}

TEST (Scene, test_shadow_darkens_the_room_and_neither_depth_nor_person)
{
  SceneSettings settings;
  settings.far_m = 4.5;
  settings.noise_sigma = 0;
  Picture lit, dark;
  render (*make_scene (settings), 0, SceneCamera::kLeft, 1, lit);
  settings.cast_shadow = 0.5;
  render (*make_scene (settings), 0, SceneCamera::kLeft, 1, dark);
  int darker = 0;
  for (int y = 0; y < 240; y++)
    for (int x = 0; x < 320; x++) {
      const int before = lit.colour.view ().at (x, y).r, after = dark.colour.view ().at (x, y).r;
      EXPECT_EQ (lit.depth.view ().at (x, y), dark.depth.view ().at (x, y));
      if (lit.mask.view ().at (x, y)) {
        EXPECT_EQ (before, after) << x << " " << y;
      }
      EXPECT_LE (after, before);
      darker += after < before * 6 / 10;
    }
  EXPECT_GT (darker, 3000);
}

TEST (Scene, test_light_drifts_by_its_share_and_back)
{
  SceneSettings settings;
  settings.noise_sigma = 0;
  settings.light_drift = 0.2;
  const auto scene = make_scene (settings);
  const auto level = [&] (double time_s) {
    Picture picture;
    render (*scene, 0, SceneCamera::kLeft, time_s, picture, true);
    return double (picture.colour.view ().at (100, 60).g);
  };
  EXPECT_NEAR (level (10) / level (0), 1.2, 0.02);
  EXPECT_NEAR (level (30) / level (0), 0.8, 0.02);
  EXPECT_EQ (level (20), level (0));
}

TEST (Scene, test_three_persons_are_three_islands)
{
  SceneSettings settings;
  settings.persons = 3;
  settings.distance_m = 1.2;
  Picture picture;
  render (*make_scene (settings), 0, SceneCamera::kLeft, 0, picture);
  int islands = 0; /* in a row through the chests */
  for (int x = 1; x < 320; x++)
    islands += picture.mask.view ().at (x, 150) && !picture.mask.view ().at (x - 1, 150);
  EXPECT_EQ (islands + (picture.mask.view ().at (0, 150) != 0), 3);
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
  refuse ([] (SceneSettings &s) { s.persons = 4; }, "persons");
  refuse ([] (SceneSettings &s) { s.far_m = 0.5; }, "far");
  refuse ([] (SceneSettings &s) { s.cast_shadow = 1; }, "cast-shadow");
  refuse ([] (SceneSettings &s) { s.light_drift = -1; }, "light-drift");
  refuse ([] (SceneSettings &s) { s.wall_texture = 2; }, "wall-texture");
  refuse ([] (SceneSettings &s) { s.wall_warmth = 2; }, "wall-warmth");
}

/* ---- what the built-in figure wears ---- */

static int
nearer_pixels (unsigned dress, int view)
{
  SceneSettings settings;
  settings.motion = settings.noise_sigma = 0;
  Image<Rgbx> colour (320, 240);
  Image<std::uint16_t> depths[2] = {{320, 240}, {320, 240}};
  for (int i = 0; i < 2; i++) {
    settings.dress = i ? dress : 0;
    std::unique_ptr<Scene> scene;
    EXPECT_TRUE (Scene::create (settings, scene).ok ());
    EXPECT_TRUE (
        scene->render (view, SceneCamera::kLeft, 0, false, colour.view (), depths[i].view (), {})
            .ok ());
  }
  int nearer = 0, farther = 0;
  for (int y = 0; y < 240; y++)
    for (int x = 0; x < 320; x++) {
      const int bare = depths[0].view ().at (x, y), dressed = depths[1].view ().at (x, y);
      nearer += dressed && (!bare || dressed + 20 < bare); /* 2 mm */
      farther += bare && (!dressed || dressed > bare);
    }
  EXPECT_EQ (farther, 0) << "what it wears takes nothing of the figure away";
  return nearer;
}

TEST (Dress, test_each_piece_lies_before_the_bare_figure)
{
  EXPECT_GT (nearer_pixels (kDressHair, 0), 2000);
  EXPECT_GT (nearer_pixels (kDressHair, 2), 5000);
  EXPECT_GT (nearer_pixels (kDressGlasses, 0), 60);
  EXPECT_GT (nearer_pixels (kDressCollar, 1), 100);
  EXPECT_GT (nearer_pixels (kDressHand, 0), 2500);
}

TEST (Dress, test_unknown_flags_are_refused)
{
  SceneSettings settings;
  settings.dress = 16;
  std::unique_ptr<Scene> scene;
  const Status status = Scene::create (settings, scene);
  EXPECT_EQ (status.code (), StatusCode::kBadValue);
  EXPECT_NE (status.message ().find ("dress"), std::string::npos);
}
