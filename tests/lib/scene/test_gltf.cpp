/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* glTF as tools export it, and files that are not what they should be. */
#include "../test-support.hpp"

#ifdef RANGECAST_HAVE_MODELS

#include <random>
#include <rangecast/scene/model_file.hpp>

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

/* Two squares that follow two joints; their own node's transform must not count. */
TEST (Gltf, test_skin_is_drawn_where_its_joints_are)
{
  GlbWriter glb;
  std::vector<float> places, weights, inverse;
  std::vector<std::uint8_t> joints;
  for (const float x : {-1.f, 1.f})
    for (const auto &[dx, dy] : {std::pair{-1.f, -1.f}, {1.f, -1.f}, {1.f, 1.f}, {-1.f, 1.f}}) {
      places.insert (places.end (), {x + 0.5f * dx, 0.5f * dy, 0});
      joints.insert (joints.end (), {std::uint8_t (x > 0), 0, 0, 0});
      weights.insert (weights.end (), {1, 0, 0, 0});
    }
  for (const float x : {-1.f, 1.f}) /* each joint is bound in the middle of its square */
    inverse.insert (inverse.end (), {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, -x, 0, 0, 1});
  const std::string attributes =
      R"("attributes":{"POSITION":)" + std::to_string (glb.add_floats (places, "VEC3", 8)) +
      R"(,"JOINTS_0":)" + std::to_string (glb.add_accessor (joints, 5121, "VEC4", 8)) +
      R"(,"WEIGHTS_0":)" + std::to_string (glb.add_floats (weights, "VEC4", 8)) +
      R"(},"indices":)" +
      std::to_string (glb.add_accessor (
          std::vector<std::uint8_t>{0, 1, 2, 0, 2, 3, 4, 5, 6, 4, 6, 7}, 5121, "SCALAR", 12));
  const int red = glb.add_textured_material (glb.add_texture (plain_png (kRed)));
  const int mesh = glb.add_mesh (attributes + R"(,"material":)" + std::to_string (red));
  glb.add_mesh_node (mesh, R"(,"skin":0,"translation":[100,0,0],"scale":[9,9,9])");
  glb.add_node (R"("translation":[-1,0,0],"children":[2])");
  glb.add_node (R"("translation":[1,3,0])"); /* at (0, 3): straight above the first one's right */
  glb.extra = R"("skins":[{"joints":[1,2],"inverseBindMatrices":)" +
              std::to_string (glb.add_floats (inverse, "MAT4", 2)) + "}],";
  glb.scene_nodes = "0,1";
  /* Squares of side 1 about (-1, 0) and (0, 3): the box is 2 by 4, about (-0.5, 1.5). */
  RenderedModel shown = rendered (glb);
  const double scale = 0.5 / 4;
  EXPECT_EQ (shown.at (scale * -0.5, scale * -1.5), "red");
  EXPECT_EQ (shown.at (scale * 0.5, scale * 1.5), "red");
  EXPECT_EQ (shown.at (scale * 0.5, scale * -1.5), "room");
}

/* A primitive without joints stays where its node puts it, skin or not. */
TEST (Gltf, test_mirrored_node_with_an_unused_skin_leaves_fronts_in_front)
{
  GlbWriter glb = red_square ();
  const int blue =
      glb.add_square (3, 0, 0, 1, glb.add_textured_material (glb.add_texture (plain_png (kBlue))));
  glb.add_mesh_node (blue, R"(,"skin":0,"scale":[-1,1,1])");
  glb.extra = R"("skins":[{"joints":[0]}],)";
  RenderedModel shown = rendered (glb);
  EXPECT_EQ (shown.at (-0.2, 0), "blue");
  EXPECT_EQ (shown.at (0.2, 0), "red");
}

/* 16,384 joints times 16,400 nodes would be more elements than a file may use. */
TEST (Gltf, test_nodes_that_share_a_skin_read_it_once)
{
  GlbWriter glb;
  constexpr std::size_t kJoints = 16384;
  const int inverse = glb.add_floats (std::vector<float> (16 * kJoints), "MAT4", kJoints);
  std::string joints = "0";
  for (std::size_t i = 1; i < kJoints; i++)
    joints += ",0";
  glb.extra = R"("skins":[{"joints":[)" + joints + R"(],"inverseBindMatrices":)" +
              std::to_string (inverse) + R"(}],"meshes":[{"primitives":[]}],)";
  for (int i = 0; i < 16400; i++)
    glb.add_mesh_node (0, R"(,"skin":0)");
  const Folder folder;
  rangecast::Model model;
  const Status status = read_gltf (folder.write ("model.glb", glb.glb ()), model);
  EXPECT_TRUE (status.ok ()) << status.message ();
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
}

TEST (Gltf, test_blended_surface_is_drawn_where_it_is_at_least_half_opaque)
{
  EXPECT_EQ (halves_with (R"(,"alphaMode":"BLEND")"), "red, room");
}

TEST (Gltf, test_lenses_that_light_passes_through_are_not_drawn)
{
  GlbWriter glb = red_square ();
  glb.add_mesh_node (glb.add_square (0, 0, 0.2f, 1,
      glb.add_material (
          R"("alphaMode":"BLEND","pbrMetallicRoughness":{"baseColorFactor":[0,0,1,0.2]})")));
  glb.add_mesh_node (glb.add_square (0, 0, 0.4f, 1,
      glb.add_material (
          R"("extensions":{"KHR_materials_transmission":{"transmissionFactor":0.9}})")));
  EXPECT_EQ (rendered (glb).at (0, 0), "red");
}

/* A quarter of the texels are opaque, in lines one texel wide. */
TEST (Gltf, test_masked_strands_do_not_thin_out_when_they_are_small)
{
  std::vector<Rgbx> pixels (256 * 256);
  for (std::size_t i = 0; i < pixels.size (); i++)
    pixels[i] = {200, 0, 0, std::uint8_t (i % 4 == 0 ? 255 : 0)};
  const MipMap texture (256, 256, pixels, 128);
  for (int level = 0; level < 6; level++) {
    const auto view = texture.level (level);
    int opaque = 0;
    for (int y = 0; y < view.height; y++)
      for (int x = 0; x < view.width; x++)
        opaque += view.at (x, y).x >= 128;
    EXPECT_GE (opaque, view.width * view.height / 4) << level;
  }
}

TEST (Gltf, test_only_double_sided_meshes_are_seen_from_behind)
{
  EXPECT_EQ (rendered (red_square (), 2).covered (), 0);
  EXPECT_EQ (rendered (red_square (R"(,"doubleSided":true)"), 2).at (0, 0), "red");
}

TEST (Gltf, test_sheet_with_both_sides_as_triangles_is_lit_as_one_with_one)
{
  const auto level = [] (std::vector<std::uint16_t> corners) {
    GlbWriter glb;
    const int position = glb.add_floats ({-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0}, "VEC3", 4);
    const std::size_t n = corners.size ();
    const int indices = glb.add_accessor (corners, 5123, "SCALAR", n);
    const int white = glb.add_material (
        R"("doubleSided":true,"pbrMetallicRoughness":{"baseColorFactor":[1,1,1,1]})");
    glb.add_mesh_node (glb.add_mesh (R"("attributes":{"POSITION":)" + std::to_string (position) +
                                     R"(},"indices":)" + std::to_string (indices) +
                                     R"(,"material":)" + std::to_string (white)));
    return int (rendered (glb).colour (0, 0).g);
  };
  const int one = level ({0, 1, 2, 0, 2, 3});
  EXPECT_GT (one, 200);
  EXPECT_EQ (level ({0, 1, 2, 0, 2, 3, 2, 1, 0, 3, 2, 0}), one);
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

TEST (Gltf, test_normalised_integer_texture_coordinates_and_quantised_positions_are_read)
{
  GlbWriter glb;
  const int texture = glb.add_texture (png (2, 1, {kRed, kBlue}));
  const int position = glb.add_accessor (
      std::vector<std::int16_t>{-100, -100, 0, 0, 100, -100, 0, 0, 100, 100, 0, 0, -100, 100, 0, 0},
      5122, "VEC3", 4);
  const int place =
      glb.add_accessor (std::vector<std::uint16_t>{0, 65535, 65535, 65535, 65535, 0, 0, 0}, 5123,
          "VEC2", 4, R"(,"normalized":true)");
  glb.extra = R"("extensionsRequired":["KHR_mesh_quantization"],)";
  glb.add_mesh_node (glb.add_square_of (
      position, R"(,"TEXCOORD_0":)" + std::to_string (place), glb.add_textured_material (texture)));
  std::string json = glb.json (); /* rows of four numbers, of which three count */
  const std::string first = R"("byteLength":32})";
  std::string file = glb.glb ();
  const auto at = file.find (first);
  ASSERT_NE (at, std::string::npos);
  /* the stride goes where the JSON chunk's padding was */
  const Folder folder;
  json.replace (json.find (first), first.size (), R"("byteLength":32,"byteStride":8})");
  json.replace (json.find (R"("buffers":[{)"), 12, R"("buffers":[{"uri":"model%20data.bin",)");
  (void)folder.write ("model data.bin", glb.binary ());
  RenderedModel shown (folder.write ("model.gltf", json));
  EXPECT_EQ (shown.at (-0.2, 0), "red");
  EXPECT_EQ (shown.at (0.2, 0), "blue");
}

TEST (Gltf, test_texture_transform_is_applied)
{
  GlbWriter glb;
  const int texture = glb.add_texture (png (4, 1, {kRed, kGreen, kBlue, kWhite}));
  glb.extra = R"("extensionsRequired":["KHR_texture_transform"],)";
  glb.add_mesh_node (glb.add_square (0, 0, 0, 1,
      glb.add_material (
          R"("pbrMetallicRoughness":{"baseColorTexture":{"index":)" + std::to_string (texture) +
          R"(,"extensions":{"KHR_texture_transform":{"offset":[0.5,0],"scale":[0.25,1]}}}})")));
  EXPECT_EQ (rendered (glb).at (0, 0), "blue");
}

static std::string
base64 (const std::vector<std::uint8_t> &bytes)
{
  const char *digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t bit = 0; bit < 8 * bytes.size (); bit += 6) {
    const unsigned next = bit / 8 + 1 < bytes.size () ? bytes[bit / 8 + 1] : 0;
    text += digits[((bytes[bit / 8] << 8 | next) >> (10 - bit % 8)) & 63];
  }
  text.append ((4 - text.size () % 4) % 4, '=');
  return text;
}

TEST (Gltf, test_picture_may_be_a_data_uri)
{
  GlbWriter glb;
  glb.extra = R"("images":[{"uri":"data:image/png;base64,)" + base64 (plain_png (kRed)) + R"("}],)";
  glb.add_mesh_node (glb.add_square (
      0, 0, 0, 1, glb.add_textured_material (glb.add_bare_texture (R"("source":0)"))));
  EXPECT_EQ (rendered (glb).at (0, 0), "red");
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

TEST (Gltf, test_mesh_whose_data_only_an_extension_gives_is_refused)
{
  GlbWriter glb = red_square ();
  const int position = glb.add_bare_accessor (R"("componentType":5126,"type":"VEC3","count":4)");
  glb.add_mesh_node (
      glb.add_mesh (R"("attributes":{"POSITION":)" + std::to_string (position) +
                    R"(},"extensions":{"KHR_draco_mesh_compression":{"bufferView":0}})"));
  expect_refused (glb, StatusCode::kUnsupported, "without compression");
}

TEST (Gltf, test_texture_that_only_an_extension_gives_is_named)
{
  GlbWriter glb;
  const int texture = glb.add_bare_texture (R"("extensions":{"KHR_texture_basisu":{"source":0}})");
  glb.add_mesh_node (glb.add_square (0, 0, 0, 1, glb.add_textured_material (texture)));
  expect_refused (glb, StatusCode::kUnsupported, "KHR_texture_basisu");
}

TEST (Gltf, test_texture_that_is_no_jpeg_or_png_is_named)
{
  GlbWriter glb;
  const std::string ktx = "\xabKTX 20\xbb\r\n\x1a\n-----------------------";
  glb.add_mesh_node (glb.add_square (0, 0, 0, 1,
      glb.add_textured_material (
          glb.add_texture (std::vector<std::uint8_t> (ktx.begin (), ktx.end ())))));
  expect_refused (glb, StatusCode::kBadData, "picture 0");
}

TEST (Gltf, test_picture_whose_header_says_that_it_is_huge_is_refused)
{
  auto bytes = plain_png (kRed);
  bytes[16] = bytes[20] = 0;
  bytes[17] = bytes[21] = 0;
  bytes[18] = bytes[22] = 0x3f; /* 16,128 or so, squared */
  GlbWriter glb;
  glb.add_mesh_node (
      glb.add_square (0, 0, 0, 1, glb.add_textured_material (glb.add_texture (bytes))));
  expect_refused (glb, StatusCode::kUnsupported, "at most 64 million");
}

TEST (Gltf, test_large_texture_is_made_smaller)
{
  std::vector<std::uint8_t> bytes;
  cv::imencode (".png", cv::Mat (4096, 3000, CV_8UC3, cv::Scalar (0, 0, 200)), bytes);
  GlbWriter glb;
  glb.add_mesh_node (
      glb.add_square (0, 0, 0, 1, glb.add_textured_material (glb.add_texture (bytes))));
  Figure figure;
  ASSERT_TRUE (load (glb, figure).ok ());
  EXPECT_EQ (figure[0].texture->level (0).height, 2048);
  EXPECT_EQ (figure[0].texture->level (0).width, 1500);
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
  for (int round = 0; round < 1500; round++) {
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
