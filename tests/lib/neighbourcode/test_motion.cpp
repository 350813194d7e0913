/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Pixels of an earlier frame set between its pixels. */
#include <algorithm>
#include <gtest/gtest.h>
#include <random>
#include <rangecast/base/cpu.hpp>
#include <rangecast/neighbourcode/compact/motion.hpp>

using namespace rangecast;

namespace {

constexpr Roi kRoi = {20, 9, 50, 37}; /* does not begin at a block */
constexpr int kFirstY = 10, kEndY = 44;

/* Two smooth surfaces, one 300 codes nearer, with holes and pixels that were not received. */
class Motion : public testing::Test {
protected:
  void SetUp () override
  {
    SliceHeader header;
    header.profile = Profile::kEntropy;
    header.depth_bits = 16;
    header.colour_bits = 8;
    header.roi = kRoi;
    plane.begin (header);
    std::vector<PixelCode> row (kRoi.width);
    for (int y = 0; y < kRoi.height; y++) {
      for (int x = 0; x < kRoi.width; x++) {
        const auto number = [&] (int range) {
          return static_cast<int> (random () % unsigned (range));
        };
        const int depth = 900 + 7 * x - 5 * y + (x > 30 ? 300 : 0) + number (4);
        const int kind = number (20);
        row[std::size_t (x)] = kind == 0   ? kEmptyPixel
                               : kind == 1 ? kNoPixel
                                           : pack_components (Components{depth, number (256),
                                                 number (511) - 255, number (511) - 255});
      }
      plane.keep (kRoi.x, kRoi.y + y, row);
    }
  }

  /* What docs/formats/bitstream.md says of one pixel. */
  [[nodiscard]] PixelCode expected (int x, int y, const BlockMotion &m) const
  {
    const int a = m.dx & 3, b = m.dy & 3, left = x + (m.dx - a) / 4, top = y + (m.dy - b) / 4;
    if (top < kFirstY || top + (b > 0) >= kEndY)
      return kNoPixel;
    const auto at = [&] (int u, int v) {
      const bool inside =
          u >= kRoi.x && v >= kRoi.y && u < kRoi.x + kRoi.width && v < kRoi.y + kRoi.height;
      return inside ? plane.at (u, v) : kEmptyPixel;
    };
    const PixelCode taps[] = {at (left, top), at (left + (a > 0), top), at (left, top + (b > 0)),
        at (left + (a > 0), top + (b > 0))};
    if (std::ranges::count (taps, kNoPixel))
      return kNoPixel;
    const int weights[] = {(4 - a) * (4 - b), a * (4 - b), (4 - a) * b, a * b};
    const Components first = components_of (taps[0]);
    Components pixel = {8, 8, 8, 8};
    bool mixes = taps[0] != kEmptyPixel;
    for (int i = 1; i < 4; i++) {
      const Components difference = components_of (taps[i]) - first;
      mixes = mixes && taps[i] != kEmptyPixel && std::abs (difference[0]) <= scale.max_gap;
      pixel += weights[i] * difference;
    }
    pixel = first + (pixel >> 4);
    if (!mixes) {
      const PixelCode nearest = taps[(a >= 2) + 2 * (b >= 2)];
      if (nearest == kEmptyPixel)
        return kNoPixel;
      pixel = components_of (nearest);
    }
    const int u = x % kMotionBlock - 7, v = y % kMotionBlock - 7;
    const int offset = ((8 * m.dz + m.slope_x * u + m.slope_y * v) * scale.unit + 4) >> 3;
    pixel[0] = std::clamp (pixel[0] + offset, 0, scale.last_depth);
    return pack_components (pixel);
  }

  BlockMotion any_motion ()
  {
    const auto number = [&] (int most) {
      return static_cast<int> (random () % unsigned (2 * most + 1)) - most;
    };
    return {number (random () % 8 ? 12 : kMaxMotion), number (12),
        number (random () % 8 ? 20 : 500), number (kMaxMotionSlope), number (kMaxMotionSlope)};
  }

  ReferencePlane plane;
  MotionScale scale{13, 1500};
  std::mt19937 random{7};
};

TEST_F (Motion, pixels_are_those_of_the_specification)
{
  for (const CpuLevel level : {CpuLevel::kScalar, cpu_supports ()}) {
    limit_cpu (level);
    std::size_t pixels = 0;
    for (int round = 0; round < 400; round++) {
      const int x = 16 + static_cast<int> (random () % 30), y = kFirstY + round % (kEndY - kFirstY);
      const int columns = 1 + static_cast<int> (random () % 40);
      std::vector<BlockMotion> motions (motion_blocks (x, columns));
      std::ranges::generate (motions, [&] { return any_motion (); });
      std::vector<PixelCode> row (static_cast<std::size_t> (columns));
      fetch_displaced (plane, x, y, motions, scale, kFirstY, kEndY, row);
      for (int i = 0; i < columns; i++) {
        const auto block = static_cast<std::size_t> ((x + i) / kMotionBlock - x / kMotionBlock);
        const PixelCode wanted = expected (x + i, y, motions[block]);
        ASSERT_EQ (row[std::size_t (i)], wanted) << "column " << i << " of round " << round;
        pixels += wanted != kNoPixel;
      }
    }
    EXPECT_GT (pixels, 1000u);
  }
  limit_cpu (cpu_supports ());
}

TEST_F (Motion, nothing_is_known_of_a_frame_set_that_is_not_held)
{
  plane.reset ();
  std::vector<PixelCode> row (16, 0);
  fetch_displaced (plane, 32, 20, std::vector<BlockMotion> (1), scale, kFirstY, kEndY, row);
  EXPECT_EQ (std::ranges::count (row, kNoPixel), 16);
}

TEST (MotionLimits, greater_numbers_than_a_reader_accepts_are_not_sound)
{
  const MotionScale scale (80, 60000); /* 10 codes a unit */
  const BlockMotion good[] = {{127, -127, 6553, 63, -63}, {-127, 127, -6553, -63, 63}};
  for (const BlockMotion &m : good)
    EXPECT_TRUE (is_sound (m, scale));
  for (const auto member : kMotionMembers)
    for (const BlockMotion &m : good) {
      BlockMotion bad = m;
      bad.*member += bad.*member > 0 ? 1 : -1;
      EXPECT_FALSE (is_sound (bad, scale));
    }
}

} // namespace
