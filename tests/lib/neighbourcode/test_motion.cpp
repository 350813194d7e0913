/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Pixels of an earlier frame set between its pixels. */
#include "../test-support.hpp"

#include <algorithm>
#include <gtest/gtest.h>
#include <random>
#include <rangecast/base/cpu.hpp>
#include <rangecast/neighbourcode/compact/decoder.hpp>
#include <rangecast/neighbourcode/compact/packed_code.hpp>

using namespace rangecast;
using namespace rangecast::testing;

namespace {

constexpr Roi kRoi = {20, 9, 50, 37}; /* does not begin at a block */
constexpr int kFirstY = 10, kEndY = 44;

/* Two smooth surfaces, one 300 codes nearer, with holes and pixels that were not received. */
class Motion : public ::testing::Test {
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

TEST_F (Motion, depths_at_both_ends_of_the_range_are_not_mixed)
{
  SliceHeader header;
  header.profile = Profile::kEntropy;
  header.roi = {0, 0, 2, 1};
  for (const CpuLevel level : {CpuLevel::kScalar, cpu_supports ()}) {
    limit_cpu (level);
    for (const auto &[left, right] : {std::pair{65500, 100}, {100, 65500}}) {
      plane.begin (header);
      const PixelCode row[] = {pack_components (Components{left, 10, 0, 0}),
          pack_components (Components{right, 20, 0, 0})};
      plane.keep (0, 0, row);
      PixelCode pixel = 0;
      const BlockMotion half = {2, 0, 0, 0, 0};
      fetch_displaced (plane, 0, 0, {&half, 1}, MotionScale (300, 65535), 0, 1, {&pixel, 1});
      EXPECT_EQ (pixel, row[1]) << left << " " << right;
    }
  }
  limit_cpu (cpu_supports ());
}

TEST_F (Motion, rows_and_columns_outside_of_the_earlier_ROI_are_empty_not_missing)
{
  SliceHeader header;
  header.profile = Profile::kEntropy;
  header.roi = {0, 0, 1, 1};
  plane.begin (header);
  const PixelCode one = pack_components (Components{900, 10, -20, 30});
  plane.keep (0, 0, {&one, 1});
  for (const CpuLevel level : {CpuLevel::kScalar, cpu_supports ()}) {
    limit_cpu (level);
    for (int dy = -3; dy <= 3; dy++)
      for (int dx = -3; dx <= 3; dx++) {
        const BlockMotion m = {dx, dy, 0, 0, 0};
        PixelCode pixel = 0;
        fetch_displaced (
            plane, 0, 0, {&m, 1}, scale, -kMaxImageSide, 2 * kMaxImageSide, {&pixel, 1});
        const auto nearest_is_inside = [] (int d) { return d >= -2 && d < 2; };
        EXPECT_EQ (pixel, nearest_is_inside (dx) && nearest_is_inside (dy) ? one : kNoPixel)
            << dx << " " << dy;
      }
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

/* A slice without key whose pixels are all invalid, of one row in one block. */
std::vector<std::uint8_t>
body_with (Profile profile, int depth_step, const BlockMotion &m)
{
  const bool packed = profile == Profile::kPacked;
  std::vector<std::uint8_t> body = {
      static_cast<std::uint8_t> (depth_step), static_cast<std::uint8_t> (depth_step >> 8), 1, 1};
  body.resize (packed ? 6 : 4);
  std::vector<std::uint8_t> data (200);
  if (packed) {
    PackedWriter writer (data.data (), {{}, false});
    writer.motion ({}, m);
    writer.run (false, 0);
    data.resize (writer.finish ());
  } else {
    std::vector<std::uint32_t> entries (EntropyWriter::max_entries (8));
    EntropyModel model;
    EntropyWriter writer (
        entries.data (), model, initial_model (false, Components{depth_step, 1, 1, 1}));
    writer.motion ({}, m);
    writer.run (false, 0);
    data.resize (writer.finish (data.data ()));
  }
  body.insert (body.end (), data.begin (), data.end ());
  body.shrink_to_fit ();
  return body;
}

TEST (MotionLimits, a_slice_with_a_motion_that_is_not_sound_is_damaged)
{
  View view;
  view.width = 8;
  view.height = 1;
  DepthQuantiser depth;
  ASSERT_TRUE (depth.set (view, 16).ok ());
  const ColourQuantiser colour (8);
  SliceHeader header;
  header.key = false;
  header.reference_distance = 1;
  header.depth_bits = 16;
  header.colour_bits = 8;
  header.roi = {0, 0, 8, 1};
  header.rows = 1;
  header.columns = 8;
  Image<std::uint16_t> depths (8, 1);
  Image<Rgbx> colours (8, 1);
  const RangeImage image = {0, header.roi, depths.view (), colours.view (), 0};
  const MotionScale scale (80, depth.codes () - 1);
  CompactDecoder decoder;
  for (const Profile profile : {Profile::kPacked, Profile::kEntropy}) {
    header.profile = profile;
    const auto is_good = [&] (const BlockMotion &m) {
      DecodedPixels decoded;
      return decoder.decode (
          body_with (profile, 80, m), header, {depth, colour}, {}, image, decoded);
    };
    EXPECT_TRUE (is_good ({}));
    const BlockMotion good[] = {{127, -127, 6553, 63, -63}, {-127, 127, -6553, -63, 63}};
    for (const BlockMotion &m : good) {
      ASSERT_TRUE (is_sound (m, scale));
      EXPECT_TRUE (is_good (m));
      for (const auto member : kMotionMembers) {
        BlockMotion bad = m;
        bad.*member += bad.*member > 0 ? 1 : -1;
        EXPECT_FALSE (is_good (bad)) << "profile " << int (profile);
        bad.*member *= 16;
        EXPECT_FALSE (is_good (bad)) << "profile " << int (profile);
      }
    }
  }
}

} // namespace

TEST (CpuLevel, is_limited_by_limit_cpu_and_by_the_machine)
{
  EXPECT_LE (cpu_level (), cpu_supports ());
  limit_cpu (CpuLevel::kScalar);
  EXPECT_EQ (cpu_level (), CpuLevel::kScalar);
  limit_cpu (kCpuLevels[std::size (kCpuLevels) - 1]);
}
