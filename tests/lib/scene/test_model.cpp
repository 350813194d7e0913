/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* How much of a model is shown and how large; models in Wavefront OBJ. */
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

TEST (Model, test_obj_file_gives_each_group_its_material)
{
  const Folder folder;
  (void)folder.write ("paint.mtl", "newmtl a\nKd 1 1 1\nmap_Kd red.png\nnewmtl b\nKd 0 0 0.9\n");
  const auto red = plain_png (kRed);
  (void)folder.write ("red.png", std::string (red.begin (), red.end ()));
  RenderedModel shown (folder.write ("two.obj",
      "mtllib paint.mtl\nv -2 -1 0\nv 0 -1 0\nv 0 1 0\nv -2 1 0\nv 2 -1 0\nv 2 1 0\nvt 0 0\n"
      "usemtl a\nf 1/1 2/1 3/1\nf 1/1 3/1 4/1\nusemtl b\nf 2/1 5/1 6/1\nf 2/1 6/1 3/1\n"));
  EXPECT_EQ (shown.at (-0.12, 0), "red");
  EXPECT_EQ (shown.at (0.12, 0), "blue");
}

static std::string
halves_of (RenderedModel &&shown)
{
  return shown.at (0, 0.12) + " over " + shown.at (0, -0.12);
}

/* v runs up in OBJ and down in glTF; a colour map beside a glTF file counts from its bottom. */
TEST (Model, test_textures_stand_upright_and_are_found_beside_the_file)
{
  const Folder folder;
  const auto picture = png (1, 4, {kRed, kRed, kBlue, kBlue});
  (void)folder.write ("paint.png", std::string (picture.begin (), picture.end ()));
  (void)folder.write ("paint.mtl", "newmtl a\nmap_Kd C:\\work\\paint.png\n");
  const std::string square = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\n"
                             "vt 0 1\nf 1/1 2/2 3/3 4/4\n";
  EXPECT_EQ (halves_of (RenderedModel (
                 folder.write ("square.obj", "mtllib paint.mtl\nusemtl a\n" + square))),
      "red over blue");
  GlbWriter named, bare;
  named.add_mesh_node (
      named.add_square (0, 0, 0, 1, named.add_textured_material (named.add_texture (picture))));
  EXPECT_EQ (halves_of (rendered (named)), "red over blue");
  bare.add_mesh_node (bare.add_square (0, 0, 0, 1, -1));
  const Folder another;
  (void)another.write ("Map-COL.png", std::string (picture.begin (), picture.end ()));
  EXPECT_EQ (halves_of (RenderedModel (another.write ("bare.glb", bare.glb ()))), "blue over red");
}

TEST (Model, test_texture_that_is_missing_is_named)
{
  const Folder folder;
  (void)folder.write ("paint.mtl", "newmtl a\nmap_Kd gone.png\n");
  Figure figure;
  const Status status =
      load (folder.write ("one.obj", "mtllib paint.mtl\nv -1 -1 0\nv 1 -1 0\nv 1 1 0\n"
                                     "vt 0 0\nusemtl a\nf 1/1 2/1 3/1\n"),
          figure);
  EXPECT_EQ (status.code (), StatusCode::kNotFound);
  EXPECT_NE (status.message ().find ("gone.png"), std::string::npos) << status.message ();
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
