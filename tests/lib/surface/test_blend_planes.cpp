/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "../test-support.hpp"

#include <cmath>
#include <cstring>
#include <rangecast/base/cpu.hpp>
#include <rangecast/surface/blend_planes.hpp>
#include <rangecast/surface/strips.hpp>

using namespace rangecast;
using rangecast::testing::Image;
using rangecast::testing::ring_rig;

namespace {

constexpr int kWidth = 64, kHeight = 48;
constexpr Roi kRoi{128, 96, kWidth, kHeight}; /* in the middle of 320x240 */

/* A frame set of a rig's views, nothing in it at first. */
struct Scene {
  Rig rig;
  std::vector<Image<std::uint16_t>> depths;
  std::vector<Image<Rgbx>> colours;

  explicit Scene (int views) : rig (ring_rig (views))
  {
    for (int i = 0; i < views; i++) {
      depths.emplace_back (kWidth, kHeight);
      colours.emplace_back (kWidth, kHeight);
    }
  }
  [[nodiscard]] std::vector<SurfaceView> views ()
  {
    std::vector<SurfaceView> all;
    for (std::size_t i = 0; i < depths.size (); i++)
      all.push_back (
          {{rig.views[i].id, kRoi, depths[i].view (), colours[i].view (), 0}, &rig.views[i]});
    return all;
  }
  BlendPlanes planes (std::size_t which)
  {
    BlendPlanes to;
    make_blend_planes (views (), which, 0.03, to);
    return to;
  }
  /* Depth of a view as a function of the pixel. */
  template <typename Depth> void fill (std::size_t which, const Depth &depth)
  {
    for (int y = 0; y < kHeight; y++)
      for (int x = 0; x < kWidth; x++)
        depths[which].view ().at (x, y) = static_cast<std::uint16_t> (depth (x, y));
  }
};

int
weight (const BlendPlanes &planes, int x, int y)
{
  return planes.weight[static_cast<std::size_t> (y * planes.width + x)];
}

bool
joins_right (const BlendPlanes &planes, int x, int y)
{
  return planes.colour_plane ().at (x, y).x & kJoinsRight;
}

} // namespace

TEST (BlendPlanes, weight_grows_from_the_outline_inwards_and_is_0_outside)
{
  Scene scene (1);
  scene.fill (0, [] (int x, int) { return x >= 10 && x < 50 ? 8000 : 0; });
  const BlendPlanes planes = scene.planes (0);
  EXPECT_EQ (weight (planes, 9, 24), 0);
  EXPECT_GT (weight (planes, 10, 24), 0);
  for (int x = 10; x < 10 + kFeatherPixels - 1; x++)
    EXPECT_LT (weight (planes, x, 24), weight (planes, x + 1, 24)) << x;
  EXPECT_GT (weight (planes, 32, 24), 245);
}

TEST (BlendPlanes, weight_is_the_cosine_of_the_slant)
{
  Scene scene (1);
  const Intrinsics &lens = scene.rig.views[0].intrinsics;
  const double slope = 8000 / lens.fx; /* 45 degrees in the middle of the picture */
  scene.fill (0, [&] (int x, int) { return std::lround (8000 + slope * (x + kRoi.x - lens.cx)); });
  EXPECT_NEAR (weight (scene.planes (0), kWidth / 2, kHeight / 2), 255 * std::sqrt (0.5), 6);
}

TEST (BlendPlanes, surfaces_end_at_depth_steps)
{
  Scene scene (1);
  scene.fill (0, [] (int x, int) { return x < 30 ? 8000 : 8400; });
  const BlendPlanes planes = scene.planes (0);
  EXPECT_TRUE (joins_right (planes, 28, 24));
  EXPECT_FALSE (joins_right (planes, 29, 24));
  EXPECT_LT (weight (planes, 29, 24), weight (planes, 20, 24));
}

/* A step of 2.5 % that one view takes for a surface; the other one stands 90 degrees to the side.
 */
TEST (BlendPlanes, steep_step_that_another_view_sees_through_joins_nothing)
{
  Scene scene (4);
  for (View &view : scene.rig.views)
    view.intrinsics.fx = view.intrinsics.fy = 400; /* a pixel is 2 mm wide */
  const auto step = [] (int x, int) { return x < 30 ? 8000 : 8200; };
  scene.fill (0, step);
  EXPECT_FALSE (joins_right (scene.planes (0), 29, 24)); /* others see the background there */
  for (std::size_t i : {1u, 2u, 3u})
    scene.fill (i, [] (int, int) { return 5000; }); /* something hides it from them */
  EXPECT_TRUE (joins_right (scene.planes (0), 29, 24));
}

TEST (BlendPlanes, copies_take_the_mean_of_what_is_near_and_other_pixels_keep_their_colour)
{
  Scene scene (1);
  scene.fill (0, [] (int, int) { return 8000; });
  for (int y = 0; y < kHeight; y++)
    for (int x = 0; x < kWidth; x++) {
      const auto level = static_cast<std::uint8_t> (100 + x / 4 * 4); /* runs of four copies */
      scene.colours[0].view ().at (x, y) = {level, level, level, 0};
    }
  const BlendPlanes planes = scene.planes (0);
  EXPECT_EQ (scene.colours[0].view ().at (34, 24).r, 132);
  EXPECT_GT (planes.colour_plane ().at (35, 24).r, 132);
  EXPECT_LT (planes.colour_plane ().at (36, 24).r, 136);
  limit_cpu (CpuLevel::kScalar);
  const BlendPlanes scalar = scene.planes (0);
  limit_cpu (cpu_supports ());
  EXPECT_EQ (
      std::memcmp (scalar.colour.data (), planes.colour.data (), 4 * planes.colour.size ()), 0);

  for (int y = 0; y < kHeight; y++)
    for (int x = 0; x < kWidth; x++) {
      const auto level = static_cast<std::uint8_t> (100 + (x * 7 + y * 3) % 8); /* all differ */
      scene.colours[0].view ().at (x, y) = {
          level, static_cast<std::uint8_t> (x), static_cast<std::uint8_t> (y), 0};
    }
  const BlendPlanes other = scene.planes (0);
  for (int y = 0; y < kHeight; y++)
    for (int x = 0; x < kWidth; x++)
      EXPECT_EQ (other.colour_plane ().at (x, y).r, scene.colours[0].view ().at (x, y).r);
}

TEST (BlendPlanes, images_of_any_size_are_taken)
{
  for (const auto &[width, height] :
      {std::pair{1, 1}, {1, 5}, {5, 1}, {2, 2}, {3, 3}, {9, 3}, {13, 2}}) {
    Image<std::uint16_t> depth (width, height);
    Image<Rgbx> colour (width, height);
    for (int y = 0; y < height; y++)
      for (int x = 0; x < width; x++)
        depth.view ().at (x, y) = 8000;
    const Rig rig = ring_rig (1);
    const SurfaceView view = {
        {0, {0, 0, width, height}, depth.view (), colour.view (), 0}, &rig.views[0]};
    BlendPlanes planes;
    make_blend_planes ({&view, 1}, 0, 0.03, planes);
    StripSettings settings;
    std::vector<StripVertex> vertices;
    StripResult result;
    build_strips (view.image, settings, vertices, result, &planes);
    EXPECT_EQ (result.points, std::uint64_t (width * height));
  }
}

/* A slanted wall, every fifth pixel of it too far, and a nearer one from column 32 on. */
TEST (BlendPlanes, depths_of_one_surface_are_smoothed_but_not_slopes_and_steps)
{
  Scene scene (1);
  const auto clean = [] (int x, int y) { return (x < 32 ? 8000 : 7000) + 10 * x + 4 * y; };
  scene.fill (0, [&] (int x, int y) { return clean (x, y) + ((x + 2 * y) % 5 == 0 ? 20 : 0); });
  const BlendPlanes planes = scene.planes (0);
  const ConstRangeImage image = scene.views ()[0].image;
  std::vector<StripVertex> strips;
  StripResult result;
  build_strips (image, {}, strips, result, &planes);
  std::vector<SurfaceVertex> vertices;
  make_vertices (image, &planes, strips, 2, vertices);
  for (std::size_t i = 0; i < strips.size (); i++) {
    const int x = static_cast<int> (strips[i] & 8191),
              y = static_cast<int> (strips[i] >> 13 & 8191);
    const bool inside = x % 32 > 0 && x % 32 < 31 && y > 0 && y < kHeight - 1;
    ASSERT_NEAR (vertices[i].depth, clean (x, y) + (inside ? 4 : 10), inside ? 0.5 : 10);
  }
}
