/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* How much of a model is shown and how large, textures that are files. */
#include "../test-support.hpp"

#ifdef RANGECAST_HAVE_MODELS

#include "model-support.hpp"

using namespace rangecast;
using namespace rangecast::testing;

TEST (Model, test_size_does_not_depend_on_the_files_unit)
{
  for (const float half : {1e-4f, 1.f, 5e6f}) {
    GlbWriter glb;
    glb.add_mesh_node (glb.add_square (half * 50, 0, 7 * half, half, -1));
    Figure figure;
    ASSERT_TRUE (load (glb, figure).ok ());
    for (const MeshVertex &v : figure[0].vertices) {
      EXPECT_NEAR (std::abs (v.x), 0.25, 1e-4) << half;
      EXPECT_NEAR (std::abs (v.y), 0.25, 1e-4) << half;
    }
  }
}

/* A person of 180 units: twelve boxes one above the other, of which the fourth has arms. */
static GlbWriter
standing_person ()
{
  GlbWriter glb;
  for (int i = 0; i < 12; i++)
    for (const float depth : {-10.f, 10.f}) {
      const float y = 15 * float (i) + 7.5f;
      glb.add_mesh_node (glb.add_square (0, y, depth, 7.5f, -1));
      if (i == 9)
        for (const float x : {-80.f, -30.f, 30.f, 80.f})
          glb.add_mesh_node (glb.add_square (x, y, depth, 7.5f, -1));
    }
  return glb;
}

struct Extent {
  double width, height;
};

static Extent
extent_of (const Figure &figure)
{
  double low[2] = {1e9, 1e9}, high[2] = {-1e9, -1e9};
  for (const Mesh &mesh : figure)
    for (const MeshVertex &v : mesh.vertices)
      for (int i = 0; i < 2; i++) {
        low[i] = std::min (low[i], double ((&v.x)[i]));
        high[i] = std::max (high[i], double ((&v.x)[i]));
      }
  EXPECT_NEAR (low[1], -high[1], 1e-5) << "about the origin";
  return {high[0] - low[0], high[1] - low[1]};
}

TEST (Model, test_of_a_standing_person_head_and_shoulders_are_shown)
{
  Figure figure;
  ASSERT_TRUE (load (standing_person (), figure, kTopAutomatic).ok ());
  EXPECT_NEAR (extent_of (figure).height, 0.45, 1e-5) << "three boxes of 0.15 m in 0.5 m";
  for (const Mesh &mesh : figure)
    for (const MeshVertex &v : mesh.vertices)
      if (std::abs (v.y + 0.075) > 0.01) { /* the neck lies 0.27 m below the crown */
        EXPECT_EQ (v.head, v.y > 0 ? 1 : 0) << v.y;
      }
}

TEST (Model, test_model_top_keeps_so_much_of_a_person_and_no_hands_before_the_cameras)
{
  Figure figure;
  ASSERT_TRUE (load (standing_person (), figure, 0.9).ok ());
  EXPECT_NEAR (extent_of (figure).height, 0.9, 1e-5);
  EXPECT_NEAR (extent_of (figure).width, 0.75, 1e-5) << "the outer squares lie at 0.8 m";
}

TEST (Model, test_model_top_with_nothing_in_it_is_an_error)
{
  Figure figure;
  const Status status = load (red_square (), figure, 0.3);
  EXPECT_EQ (status.code (), StatusCode::kBadValue);
  EXPECT_NE (status.message ().find ("model-top"), std::string::npos) << status.message ();
}

static std::string
halves_of (RenderedModel &&shown)
{
  return shown.at (0, 0.12) + " over " + shown.at (0, -0.12);
}

/* v runs down in glTF, but up in a colour map that no material names. */
TEST (Model, test_textures_stand_upright_and_are_found_beside_the_file)
{
  const auto picture = png (1, 4, {kRed, kRed, kBlue, kBlue});
  GlbWriter named, bare;
  named.add_mesh_node (
      named.add_square (0, 0, 0, 1, named.add_textured_material (named.add_texture (picture))));
  EXPECT_EQ (halves_of (rendered (named)), "red over blue");
  bare.add_mesh_node (bare.add_square (0, 0, 0, 1, -1));
  const Folder folder;
  (void)folder.write ("Map-COL.png", std::string (picture.begin (), picture.end ()));
  EXPECT_EQ (halves_of (RenderedModel (folder.write ("bare.glb", bare.glb ()))), "blue over red");
}

TEST (Model, test_texture_that_is_missing_is_named)
{
  GlbWriter glb;
  glb.extra = R"("images":[{"uri":"gone.png"}],)";
  glb.add_mesh_node (glb.add_square (
      0, 0, 0, 1, glb.add_textured_material (glb.add_bare_texture (R"("source":0)"))));
  Figure figure;
  const Status status = load (glb, figure);
  EXPECT_EQ (status.code (), StatusCode::kNotFound);
  EXPECT_NE (status.message ().find ("gone.png"), std::string::npos) << status.message ();
}

TEST (Model, test_numbers_out_of_range_are_refused_by_name)
{
  for (const float wild : {1e30f, -1e30f, std::nanf (""), HUGE_VALF})
    for (const bool is_position : {false, true}) {
      GlbWriter glb;
      const int position =
          glb.add_floats ({-9, -9, 0, is_position ? wild : 9, -9, 0, 9, 9, 0, -9, 9, 0}, "VEC3", 4);
      const int place = glb.add_floats ({0, is_position ? 1 : wild, 1, 1, 1, 0, 0, 0}, "VEC2", 4);
      glb.add_mesh_node (
          glb.add_square_of (position, R"(,"TEXCOORD_0":)" + std::to_string (place), -1));
      Figure figure;
      const Status status = load (glb, figure);
      EXPECT_EQ (status.code (), StatusCode::kBadData) << wild;
      EXPECT_NE (status.message ().find ("model.glb"), std::string::npos) << status.message ();
    }
}

TEST (Model, test_dressed_head_has_ten_meshes_in_their_own_colours)
{
  RANGECAST_NEED_DATA ("dressed_head");
  const std::string path = rangecast::testing::data_dir () + "/dressed_head/dressed_head.glb";
  if (!std::filesystem::exists (path))
    GTEST_SKIP () << "no dressed_head";
  Figure figure;
  ASSERT_TRUE (load (path, figure, kTopAutomatic).ok ());
  ASSERT_EQ (figure.size (), 10u);
  RenderedModel front (path), back (path, 2);
  const Rgbx forehead = front.colour (0, 0.19), nape = back.colour (0, 0.05);
  EXPECT_GT (forehead.r, 120) << "skin";
  EXPECT_LT (nape.r, 110) << "brown hair";
  EXPECT_LT (nape.b, nape.r / 2);
}

#else

TEST (Model, test_models)
{
  GTEST_SKIP () << "built without models";
}

#endif
