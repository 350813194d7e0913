/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* glTF as tools export it, and files that are not what they should be. */
#include "../test-support.hpp"

#ifdef RANGECAST_HAVE_MODELS

#include <random>
#include <rangecast/scene/model.hpp>

#include "model-support.hpp"

using namespace rangecast;
using namespace rangecast::testing;

namespace {

/* The fact and the message of a model that cannot be loaded. */
void
expect_refused (const GlbWriter &glb, StatusCode code, const std::string &text)
{
  Figure figure;
  const Status status = load (glb, figure);
  EXPECT_EQ (status.code (), code) << status.message ();
  EXPECT_NE (status.message ().find (text), std::string::npos) << status.message ();
  EXPECT_NE (status.message ().find ("model.glb"), std::string::npos) << status.message ();
  EXPECT_TRUE (figure.empty ());
}

/* Five by two squares, each of its own mesh and texture. */
GlbWriter
ten_squares ()
{
  GlbWriter glb;
  constexpr Rgbx kColours[] = {kRed, kGreen, kBlue, kWhite};
  for (int i = 0; i < 10; i++)
    glb.add_mesh_node (glb.add_square (float (i % 5) - 2, float (i / 5) - 0.5f, 0, 0.45f,
        glb.add_textured_material (glb.add_texture (plain_png (kColours[i % 4])))));
  return glb;
}

} // namespace

TEST (Gltf, test_ten_meshes_keep_their_own_textures)
{
  RenderedModel shown = rendered (ten_squares ());
  const char *names[] = {"red", "green", "blue", "white"};
  const double scale = 0.5 / 4.9;
  for (int i = 0; i < 10; i++)
    EXPECT_EQ (shown.at (scale * (i % 5 - 2), scale * (i / 5 - 0.5)), names[i % 4]) << i;
  EXPECT_EQ (shown.at (0, 0), "room") << "between the rows";
}

TEST (Gltf, test_base_colour_factor_is_multiplied_with_the_texture)
{
  GlbWriter glb;
  const int texture = glb.add_texture (plain_png ({200, 200, 200, 255}));
  glb.add_mesh_node (glb.add_square (0, 0, 0, 1,
      glb.add_material (
          R"("pbrMetallicRoughness":{"baseColorFactor":[1,0.5,0,1],"baseColorTexture":{"index":)" +
          std::to_string (texture) + "}}")));
  const Rgbx p = rendered (glb).colour (0, 0);
  EXPECT_NEAR (p.r, 170, 4); /* 200 in the light that falls on it */
  EXPECT_NEAR (p.g, 0.735 * p.r, 4) << "0.5 of linear light is 0.735 on a display";
  EXPECT_EQ (p.b, 0);
}

TEST (Gltf, test_vertex_colours_are_blended_between_vertices)
{
  GlbWriter glb;
  const int colours = glb.add_accessor (
      std::vector<std::uint8_t>{255, 0, 0, 255, 0, 0, 255, 255, 0, 0, 255, 255, 255, 0, 0, 255},
      5121, "VEC4", 4, R"(,"normalized":true)");
  glb.add_mesh_node (glb.add_square (0, 0, 0, 1, -1, R"(,"COLOR_0":)" + std::to_string (colours)));
  RenderedModel shown = rendered (glb);
  EXPECT_EQ (shown.at (-0.24, 0), "red");
  EXPECT_EQ (shown.at (0.24, 0), "blue");
  const Rgbx middle = shown.colour (0, 0);
  EXPECT_NEAR (middle.r, middle.b, 6);
  EXPECT_GT (middle.r, 80);
}

TEST (Gltf, test_nodes_transform_their_meshes_and_children)
{
  GlbWriter glb;
  const int red =
      glb.add_square (0, 0, 0, 1, glb.add_textured_material (glb.add_texture (plain_png (kRed))));
  const int blue =
      glb.add_square (0, 0, 0, 1, glb.add_textured_material (glb.add_texture (plain_png (kBlue))));
  glb.add_mesh_node (red);
  glb.add_mesh_node (blue, R"(,"translation":[2,0,0])"); /* relative to its parent: 2 above */
  glb.add_node (
      R"("children":[1],"rotation":[0,0,0.70710678,0.70710678],"scale":[0.5,0.5,0.5],"translation":[0,1,0])");
  glb.scene_nodes = "0,2";
  /* The blue one has a side of 1 about (0, 2); all is 2 wide and 3.5 high, from -1 to 2.5. */
  RenderedModel shown = rendered (glb);
  const double scale = 0.5 / 3.5;
  EXPECT_EQ (shown.at (0, scale * (0 - 0.75)), "red");
  EXPECT_EQ (shown.at (0, scale * (2 - 0.75)), "blue");
  EXPECT_EQ (shown.at (scale * 0.7, scale * (2 - 0.75)), "room");
}

TEST (Gltf, test_matrix_that_mirrors_leaves_fronts_in_front)
{
  GlbWriter glb = red_square ();
  const int blue =
      glb.add_square (3, 0, 0, 1, glb.add_textured_material (glb.add_texture (plain_png (kBlue))));
  glb.add_mesh_node (blue, R"(,"matrix":[-1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1])");
  RenderedModel shown = rendered (glb);
  EXPECT_EQ (shown.at (-0.2, 0), "blue");
  EXPECT_EQ (shown.at (0.2, 0), "red");
}

/* Its own node's transform must not count. */
TEST (Gltf, test_mesh_with_a_skin_is_drawn_where_its_first_joint_is)
{
  GlbWriter glb = red_square ();
  const int blue =
      glb.add_square (0, 0, 0, 1, glb.add_textured_material (glb.add_texture (plain_png (kBlue))));
  glb.add_mesh_node (blue, R"(,"skin":0,"translation":[100,0,0],"scale":[9,9,9])");
  glb.add_node (R"("translation":[1,0,0])");
  const int inverse = glb.add_floats ({1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 2, 0, 0, 1}, "MAT4", 1);
  glb.extra = R"("skins":[{"joints":[2],"inverseBindMatrices":)" + std::to_string (inverse) + "}],";
  RenderedModel shown = rendered (glb); /* blue about (3, 0) */
  EXPECT_EQ (shown.at (-0.15, 0), "red");
  EXPECT_EQ (shown.at (0.15, 0), "blue");
  EXPECT_EQ (shown.at (0, 0), "room");
}

/* Left half opaque, right half clear. */
static std::string
halves_with (const std::string &alpha)
{
  GlbWriter glb;
  const int texture = glb.add_texture (png (4, 1, {kRed, kRed, {200, 0, 0, 60}, {200, 0, 0, 60}}));
  glb.add_mesh_node (glb.add_square (0, 0, 0, 1, glb.add_textured_material (texture, alpha)));
  RenderedModel shown = rendered (glb);
  return shown.at (-0.2, 0) + ", " + shown.at (0.2, 0);
}

TEST (Gltf, test_alpha_below_the_cutoff_is_not_drawn)
{
  EXPECT_EQ (halves_with (R"(,"alphaMode":"MASK")"), "red, room");
  EXPECT_EQ (halves_with (R"(,"alphaMode":"MASK","alphaCutoff":0.2)"), "red, red");
  EXPECT_EQ (halves_with (R"(,"alphaMode":"BLEND")"), "red, room");
}

TEST (Gltf, test_only_double_sided_meshes_are_seen_from_behind)
{
  EXPECT_EQ (rendered (red_square (), 2).covered (), 0);
  EXPECT_EQ (rendered (red_square (R"(,"doubleSided":true)"), 2).at (0, 0), "red");
}

/* Texture coordinates from 0 to 2: red and blue twice over. */
static std::string
columns_with (const std::string &sampler)
{
  GlbWriter glb;
  const int texture = glb.add_texture (png (2, 1, {kRed, kBlue}));
  const int position = glb.add_floats ({-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0}, "VEC3", 4);
  const int place = glb.add_floats ({4, 1, 6, 1, 6, 0, 4, 0}, "VEC2", 4);
  const int sampled =
      glb.add_bare_texture (R"("source":)" + std::to_string (texture) + R"(,"sampler":0)");
  glb.extra = R"("samplers":[{)" + sampler + "}],";
  glb.add_mesh_node (glb.add_square_of (
      position, R"(,"TEXCOORD_0":)" + std::to_string (place), glb.add_textured_material (sampled)));
  RenderedModel shown = rendered (glb);
  std::string columns;
  for (const double x : {-0.1875, -0.0625, 0.0625, 0.1875})
    columns += shown.at (x, 0) + " ";
  return columns;
}

TEST (Gltf, test_textures_repeat_mirror_or_end_as_their_sampler_says)
{
  EXPECT_EQ (columns_with (""), "red blue red blue ");
  EXPECT_EQ (columns_with (R"("wrapS":33648)"), "red blue blue red ");
  EXPECT_EQ (columns_with (R"("wrapS":33071)"), "blue blue blue blue ");
}

/* ---- what cannot be read ---- */

TEST (Gltf, test_extensions_that_are_required_and_unknown_are_named)
{
  for (const char *name : {"KHR_draco_mesh_compression", "EXT_meshopt_compression",
           "KHR_texture_basisu", "EXT_mesh_gpu_instancing"}) {
    GlbWriter glb = red_square ();
    glb.extra = R"("extensionsUsed":[")" + std::string (name) +
                R"("],"extensionsRequired":["KHR_materials_unlit",")" + name + R"("],)";
    expect_refused (glb, StatusCode::kUnsupported, name);
  }
}

TEST (Gltf, test_texture_that_only_an_extension_gives_is_named)
{
  GlbWriter glb;
  const int texture = glb.add_bare_texture (R"("extensions":{"KHR_texture_basisu":{"source":0}})");
  glb.add_mesh_node (glb.add_square (0, 0, 0, 1, glb.add_textured_material (texture)));
  expect_refused (glb, StatusCode::kUnsupported, "KHR_texture_basisu");
}

TEST (Gltf, test_json_of_too_many_or_too_deep_values_is_refused)
{
  GlbWriter many = red_square (), deep = red_square ();
  std::string zeros = "0";
  for (int i = 1; i < 4'000'000; i++)
    zeros += ",0";
  many.extra = R"("extras":[)" + zeros + "],";
  expect_refused (many, StatusCode::kUnsupported, "4 million JSON values");
  constexpr std::size_t kDeep = 1'000'000;
  deep.extra = R"("extras":)" + std::string (kDeep, '[') + std::string (kDeep, ']') + ",";
  expect_refused (deep, StatusCode::kUnsupported, "64 levels");
}

TEST (Gltf, test_nodes_that_are_no_tree_are_refused)
{
  GlbWriter cycle = red_square ();
  cycle.add_node (R"("children":[2])");
  cycle.add_node (R"("children":[1])");
  cycle.scene_nodes = "0,1";
  expect_refused (cycle, StatusCode::kBadData, "node");
  GlbWriter diamond = red_square ();
  diamond.add_node (R"("children":[0,0])");
  expect_refused (diamond, StatusCode::kBadData, "two parents");
}

TEST (Gltf, test_indices_and_accessors_out_of_range_are_refused)
{
  GlbWriter index;
  const int position = index.add_floats ({-1, -1, 0, 1, -1, 0, 1, 1, 0}, "VEC3", 3);
  index.add_mesh_node (index.add_square_of (position, "", -1));
  expect_refused (index, StatusCode::kBadData, "vertex that is missing");
  GlbWriter count;
  count.add_mesh_node (
      count.add_square_of (count.add_accessor (std::vector<float> (12), 5126, "VEC3", 5), "", -1));
  expect_refused (count, StatusCode::kBadData, "beyond its buffer view");
  GlbWriter joint = red_square ();
  joint.extra = R"("skins":[{"joints":[77]}],)";
  joint.add_mesh_node (0, R"(,"skin":0)");
  expect_refused (joint, StatusCode::kBadData, "skin");
}

TEST (Gltf, test_every_truncated_prefix_is_one_error)
{
  const Folder folder;
  const std::string file = red_square ().glb ();
  for (std::size_t n = 0; n < file.size (); n++) {
    Figure figure;
    const Status status = load (folder.write ("cut.glb", file.substr (0, n)), figure);
    ASSERT_FALSE (status.ok ()) << n;
    ASSERT_NE (status.message ().find ("cut.glb"), std::string::npos) << status.message ();
  }
}

TEST (Gltf, test_damaged_bytes_give_a_model_or_one_error)
{
  const Folder folder;
  GlbWriter glb = ten_squares ();
  const std::string file = glb.glb ();
  std::mt19937 random (1);
  for (int round = 0; round < 300; round++) {
    std::string damaged = file;
    for (int i = 0; i < 1 + round % 4; i++)
      damaged[random () % damaged.size ()] =
          round % 2 ? char (random ()) : char ('0' + random () % 10);
    Figure figure;
    const Status status = load (folder.write ("damaged.glb", damaged), figure);
    if (!status.ok ()) {
      ASSERT_NE (status.message ().find ("damaged.glb"), std::string::npos) << status.message ();
    }
  }
}

#else

TEST (Gltf, test_models)
{
  GTEST_SKIP () << "built without models";
}

#endif
