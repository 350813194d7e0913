/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* cylinderfilter where rigs are hostile, and where memory ends. */
#include <atomic>
#include <climits>
#include <cstdlib>
#include <new>
#include <random>
#include <rangecast/overlap/colour_match.hpp>

#include "cylinder-support.hpp"

/* After so many allocations there is no memory left. Not inlined, or compilers see a free that has
 * no malloc and warn. */
static std::atomic<int> allocations_left{INT_MAX};

[[gnu::noinline]] void *
operator new (std::size_t size)
{
  void *memory = allocations_left-- > 0 ? std::malloc (size ? size : 1) : nullptr;
  if (!memory)
    throw std::bad_alloc ();
  return memory;
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

using namespace rangecast;
using namespace rangecast::testing;

namespace {

/* All cameras at one place, so that each cell has all of them. */
Rig
same_place_rig (int views, int width, int height)
{
  Rig rig;
  for (int i = 0; i < views; i++)
    rig.views.push_back (ring_view (i, 0, 0.8, width, height));
  return rig;
}

} // namespace

/* Eight columns, one slice, and no two points of a view on the same surface. What takes a second
 * here takes hours where work grows with the square of a cell's points. */
TEST (Limits, as_many_layers_as_points_in_cells_that_all_views_share)
{
  const Rig rig = same_place_rig (16, 640, 480);
  Frame frame (rig);
  std::mt19937 random (1);
  std::size_t points = 0;
  for (auto &image : frame.depth)
    for (int v = 0; v < 480; v++)
      for (int u = 0; u < 640; u++, points++)
        image.view ().at (u, v) = static_cast<std::uint16_t> (1 + random () % 65535);
  CylinderSettings settings = vertical_through_origin ();
  settings.cells = {10, 8, 0, 1};
  CylinderFilter filter;
  ASSERT_TRUE (filter.set_rig (rig).ok ());
  const CylinderResult result = run (filter, frame, settings);
  EXPECT_EQ (result.points_in, points);
  EXPECT_LE (result.points_out, result.points_in);
}

TEST (Limits, with_layers_tangents_are_those_of_each_surface)
{
  /* Two walls one behind the other, which the second camera sees more squarely: both are its own,
   * though each cell has points of both. */
  Rig rig;
  rig.views = {ring_view (0, 40), ring_view (1, 0)};
  const Surface near = patch (0), far = [near] (Vec3 o, Vec3 d) {
    return near (o + Vec3{0, 0, 0.08}, d);
  };
  Frame frame (rig, near);
  Frame behind (rig, far);
  for (std::size_t i = 0; i < 2; i++) {
    auto to = frame.depth[i].view (), from = behind.depth[i].view ();
    for (int v = 0; v < kHeight; v += 2) /* every other row sees the wall behind */
      std::copy_n (from.row (v), kWidth, to.row (v));
  }
  CylinderSettings settings = vertical_through_origin ();
  CylinderFilter filter;
  ASSERT_TRUE (filter.set_rig (rig).ok ());
  const std::size_t squarely = frame.points (1);
  run (filter, frame, settings);
  EXPECT_EQ (frame.points (1), squarely);
  int winners[2] = {};
  for (int s = 0; s < filter.cell_slices (); s++)
    for (int c = 0; c < settings.cells.columns; c++)
      if (const int winner = filter.cell_winner (s, c); winner >= 0)
        winners[winner]++;
  EXPECT_GT (winners[1], 100);
  EXPECT_LT (winners[0], winners[1] / 20);
}

/* Wherever memory ends, that is a status; and the next frame finds nothing half done. */
TEST (Limits, memory_that_ends_anywhere_is_a_status_and_the_next_frame_is_as_ever)
{
  const Rig rig = ring_rig (3);
  const Surface two = both (ellipsoid ({-0.15, 0, 0}, {0.07, 0.2, 0.08}),
      ellipsoid ({0.15, 0, 0.05}, {0.07, 0.19, 0.08}));
  Frame expected (rig, two);
  const Frame fresh = expected;
  CylinderFilter whole;
  ASSERT_TRUE (whole.set_rig (rig).ok ());
  run (whole, expected);
  int failures = 0;
  for (bool done = false; !done; failures++) {
    Frame frame = fresh;
    const std::vector<RangeImage> images = frame.images ();
    CylinderFilter filter;
    CylinderResult result;
    allocations_left = failures;
    const Status rig_status = filter.set_rig (rig);
    const Status status = rig_status.ok () ? filter.process (images, {}, result) : rig_status;
    allocations_left = INT_MAX;
    done = status.ok ();
    if (!done) {
      EXPECT_EQ (status.code (), StatusCode::kNoSpace);
      EXPECT_FALSE (status.message ().empty ());
      Frame untouched = fresh;
      ASSERT_TRUE (frame == untouched);
      ASSERT_TRUE (filter.set_rig (rig).ok ());
      run (filter, frame);
    }
    ASSERT_TRUE (frame == expected) << failures;
  }
  EXPECT_GT (failures, 20);
}

TEST (Limits, colours_without_memory_are_a_status_too)
{
  const Rig rig = ring_rig (3);
  const Frame fresh (rig, ellipsoid ({0, 0, 0}, {0.09, 0.2, 0.11}));
  int failures = 0;
  for (bool done = false; !done; failures++) {
    Frame frame = fresh;
    const std::vector<RangeImage> images = frame.images ();
    ColourMatch colours;
    ColourSettings settings;
    settings.blend_width_m = 0.02;
    const auto work = [&] () -> Status {
      if (Status s = colours.set_rig (rig); !s.ok ())
        return s;
      if (Status s = colours.before (images, settings); !s.ok ())
        return s;
      for (int v = 0; v < kHeight; v++)
        std::fill_n (images[0].depth.row (v) + 160, 40, std::uint16_t{0});
      return colours.after (images, settings);
    };
    allocations_left = failures;
    const Status status = work ();
    allocations_left = INT_MAX;
    done = status.ok ();
    if (!done) {
      EXPECT_EQ (status.code (), StatusCode::kNoSpace);
      EXPECT_FALSE (status.message ().empty ());
      EXPECT_TRUE (work ().ok ());
    }
  }
  EXPECT_GT (failures, 10);
}
