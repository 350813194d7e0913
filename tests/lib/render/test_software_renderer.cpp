/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "../test-support.hpp"

#include <atomic>
#include <cmath>
#include <cstring>
#include <list>
#include <new>
#include <random>
#include <rangecast/base/cpu.hpp>
#include <rangecast/render/software_renderer.hpp>

using namespace rangecast;
using rangecast::testing::Image;
using rangecast::testing::ring_rig;

/* Counts what is allocated, for the test that nothing is. Not inlined, or compilers see a free that
 * has no malloc and warn. */
static std::atomic<int> allocations;

[[gnu::noinline]] void *
operator new (std::size_t size)
{
  allocations++;
  if (void *memory = std::malloc (size ? size : 1))
    return memory;
  throw std::bad_alloc ();
}
[[gnu::noinline]] void
operator delete (void *memory) noexcept
{
  std::free (memory);
}
[[gnu::noinline]] void
operator delete (void *memory, std::size_t) noexcept
{
  std::free (memory);
}

namespace {

constexpr StripMode kModes[] = {
    StripMode::kBlend, StripMode::kStrips, StripMode::kRectangles, StripMode::kPoints};

/* A ball with noise on it that all cameras of a ring see, and the scene of it. */
struct Ball {
  Rig rig;
  std::list<Image<std::uint16_t>> depths;
  std::list<Image<Rgbx>> colours;
  std::vector<RangeImage> images;
  SurfaceScene scene;

  explicit Ball (int views) : rig (ring_rig (views))
  {
    std::mt19937 random (7);
    for (const View &view : rig.views) {
      auto &depth = depths.emplace_back (view.width, view.height);
      auto &colour = colours.emplace_back (view.width, view.height);
      const double radius = 0.35 * view.height;
      for (int y = 0; y < view.height; y++)
        for (int x = 0; x < view.width; x++) {
          const double r = std::hypot (x - view.width / 2.0, y - view.height / 2.0) / radius;
          depth.view ().at (x, y) = std::uint16_t (
              r < 1 ? 8000 - 1500 * std::sqrt (1 - r * r) + double (random () % 20) : 0);
          colour.view ().at (x, y) = {
              std::uint8_t (random () % 32 + 100), std::uint8_t (2 * x), std::uint8_t (2 * y), 0};
        }
      images.push_back (
          {view.id, {0, 0, view.width, view.height}, depth.view (), colour.view (), 0});
    }
    scene.set_rig (rig);
  }

  void build (StripMode mode, const Orbit &orbit)
  {
    SurfaceSettings settings;
    settings.strips.mode = mode;
    scene.build (images, settings, orbit, false);
  }

  [[nodiscard]] SurfacePicture picture (
      StripMode mode, const Orbit &orbit, int width, int height) const
  {
    SurfacePicture p;
    p.mode = mode;
    p.clip_from_world = orbit_matrices (
        scene.frame (), orbit, double (width) / height, true, {}, scene.hull (), 2 * kViewGap_m)
                            .clip_from_world;
    p.background[0] = 0.25f;
    p.pixels_per_unit = float (pixels_per_unit (scene.frame (), orbit, height));
    p.width = width;
    p.height = height;
    p.part = {0, 0, width, height};
    p.covered = covered_part (p.clip_from_world, scene.hull (), width, height, p.part);
    return p;
  }

  std::vector<std::uint8_t> draw (SoftwareRenderer &renderer, StripMode mode, const Orbit &orbit,
      int width, int height, bool is_bgra = false) const
  {
    Image<Rgbx> to (width, height);
    renderer.draw (picture (mode, orbit, width, height), scene.layers (), to.view (), is_bgra);
    std::vector<std::uint8_t> bytes (std::size_t (4) * std::size_t (width) * std::size_t (height));
    for (int y = 0; y < height; y++)
      std::memcpy (&bytes[std::size_t (4) * std::size_t (y) * std::size_t (width)],
          to.view ().row (y), std::size_t (4) * std::size_t (width));
    return bytes;
  }
};

Orbit
orbit_at (double azimuth_deg, double distance_m = 0)
{
  Orbit orbit;
  orbit.azimuth_deg = azimuth_deg;
  orbit.distance_m = distance_m;
  return orbit;
}

TEST (SoftwareRenderer, picture_depends_neither_on_threads_nor_on_the_processor)
{
  Ball ball (4);
  for (const StripMode mode : kModes)
    for (const double azimuth : {0.0, 33.0, 140.0}) {
      const Orbit orbit = orbit_at (azimuth);
      ball.build (mode, orbit);
      SoftwareRenderer one (1), three (3);
      const auto expected = ball.draw (one, mode, orbit, 200, 150);
      EXPECT_EQ (ball.draw (three, mode, orbit, 200, 150), expected);
      limit_cpu (CpuLevel::kScalar);
      EXPECT_EQ (ball.draw (one, mode, orbit, 200, 150), expected);
      limit_cpu (cpu_supports ());
    }
}

TEST (SoftwareRenderer, colours_of_one_surface_come_out_as_they_went_in)
{
  Ball ball (1);
  const View &view = ball.rig.views[0];
  for (const StripMode mode : kModes) {
    ball.build (mode, {});
    SoftwareRenderer renderer;
    const auto rgba = ball.draw (renderer, mode, {}, view.width, view.height);
    const auto bgra = ball.draw (renderer, mode, {}, view.width, view.height, true);
    const std::size_t middle =
        std::size_t (4) * std::size_t (view.width * (view.height / 2) + view.width / 2);
    EXPECT_NEAR (rgba[middle + 1], 2 * (view.width / 2) % 256, 6);
    EXPECT_NEAR (rgba[middle + 2], 2 * (view.height / 2) % 256, 6);
    EXPECT_EQ (rgba[middle + 3], 255);
    EXPECT_EQ (rgba[middle], bgra[middle + 2]);
    EXPECT_EQ (rgba[middle + 2], bgra[middle]);
    EXPECT_EQ (rgba[0], 64) << "the background";
    EXPECT_EQ (bgra[2], 64);
  }
}

TEST (SoftwareRenderer, any_size_place_and_roi_is_drawn)
{
  Ball ball (64);
  for (RangeImage &image : ball.images) { /* one pixel, and less in some */
    image.roi = {image.roi.width / 2, image.roi.height / 2, 1, 1};
    image.depth = image.depth.crop (image.roi.x, image.roi.y, 1, 1);
    image.colour = image.colour.crop (image.roi.x, image.roi.y, 1, 1);
  }
  Ball whole (2);
  SoftwareRenderer renderer;
  for (const StripMode mode : kModes)
    for (const double distance : {0.0, 1e-3, 0.05, 0.3, 900.0}) {
      const Orbit orbit = orbit_at (50, distance);
      for (Ball *scene : {&ball, &whole}) {
        scene->build (mode, orbit);
        for (const auto &[width, height] :
            {std::pair{1, 1}, {1, 4000}, {4000, 1}, {7, 5}, {333, 251}})
          scene->draw (renderer, mode, orbit, width, height);
      }
    }
}

TEST (SoftwareRenderer, only_the_pictures_part_is_written)
{
  Ball ball (2);
  const Orbit orbit = orbit_at (10, 0.4); /* larger than the picture */
  SoftwareRenderer renderer;
  for (const StripMode mode : kModes) {
    ball.build (mode, orbit);
    Image<Rgbx> to (100, 80);
    for (int y = 0; y < 80; y++)
      for (int x = 0; x < 100; x++)
        to.view ().at (x, y) = {1, 2, 3, 4};
    SurfacePicture p = ball.picture (mode, orbit, 100, 80);
    p.part = {20, 10, 50, 40};
    p.covered = covered_part (p.clip_from_world, ball.scene.hull (), 100, 80, p.part);
    renderer.draw (p, ball.scene.layers (), to.view ());
    for (int y = 0; y < 80; y++)
      for (int x = 0; x < 100; x++) {
        const bool inside = x >= 20 && x < 70 && y >= 10 && y < 50;
        ASSERT_EQ (to.view ().at (x, y).x == 4, !inside) << x << ", " << y;
      }
  }
}

TEST (SoftwareRenderer, nothing_is_allocated_once_a_picture_has_been_drawn)
{
  Ball ball (4);
  ball.build (StripMode::kBlend, {});
  SoftwareRenderer renderer (1);
  Image<Rgbx> to (320, 240);
  const SurfacePicture picture = ball.picture (StripMode::kBlend, {}, 320, 240);
  renderer.draw (picture, ball.scene.layers (), to.view ());
  const int before = allocations;
  for (int i = 0; i < 3; i++)
    renderer.draw (picture, ball.scene.layers (), to.view ());
  EXPECT_EQ (allocations, before);
}

} // namespace
