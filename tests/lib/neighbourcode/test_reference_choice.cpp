/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* An encoder that may refer to the frame set before does so where that makes it smaller, and only
 * there. */
#include "neighbourcode-support.hpp"

#include <algorithm>
#include <functional>

using namespace rangecast;
using namespace rangecast::testing;

namespace {

constexpr std::uint64_t kFrameNs = 1'000'000'000 / 30;
constexpr Roi kRoi = {8, 16, 100, 224}; /* four bands of 64 rows */

/* What frame sets of one view came to. */
struct Coded {
  std::vector<std::size_t> bytes;
  std::vector<std::vector<SliceHeader>> slices;

  [[nodiscard]] std::size_t sum (std::size_t from, std::size_t to) const
  {
    std::size_t sum = 0;
    for (std::size_t i = from; i < to; i++)
      sum += bytes[i];
    return sum;
  }
  /* Rows of the ROI whose first column refers to an earlier frame set. */
  [[nodiscard]] int delta_rows (std::size_t frame) const
  {
    int rows = 0;
    for (const SliceHeader &slice : slices[frame])
      if (!slice.key && slice.first_column == 0)
        rows += slice.rows;
    return rows;
  }
};

/* A wall of noise, in depth too: of two seeds no pixel is like that of the other. */
Picture
picture_of (unsigned seed)
{
  Picture picture (0, kRoi);
  std::mt19937 random (seed);
  int depth = 6000;
  for (int y = 0; y < kRoi.height; y++)
    for (int x = 0; x < kRoi.width; x++) {
      depth = std::clamp (depth + int (random () % 201) - 100, 5000, 9000);
      picture.depth.view ().at (x, y) = static_cast<std::uint16_t> (depth);
      const auto level = [&] { return static_cast<std::uint8_t> (random ()); };
      picture.colour.view ().at (x, y) = {level (), level (), level (), 0};
    }
  return picture;
}

/* Codes frame sets, the seed of each as the function says. Each is decoded, and must be whole. */
Coded
code (const EncoderSettings &settings, int frames, const std::function<unsigned (int)> &seed)
{
  const Rig rig = {{ring_view (0, 0, 0.8, 256, 256)}};
  AccessUnitEncoder encoder;
  AccessUnitDecoder decoder;
  EXPECT_TRUE (encoder.configure (rig, settings).ok () && decoder.set_rig (rig).ok ());
  Coded coded;
  for (int i = 0; i < frames; i++) {
    Picture picture = picture_of (seed (i));
    RangeImage image = picture.image ();
    image.capture_time_ns = std::uint64_t (i) * kFrameNs;
    EncoderResult result;
    EXPECT_TRUE (encoder.encode ({&image, 1}, std::uint32_t (i), 1, result).ok ());
    coded.bytes.push_back (encoder.size ());
    const std::vector<std::uint8_t> frame_set = encoder.bytes ();
    coded.slices.emplace_back ();
    std::size_t slices = 0;
    for (const auto &unit : units_of (frame_set)) {
      EXPECT_TRUE (read_slice_header (unit, coded.slices.back ().emplace_back ()).ok ());
      slices++;
    }
    EXPECT_EQ (result.slices, slices);
    const Decoded decoded = decode (decoder, frame_set);
    EXPECT_EQ (
        decoded.result.bad_slices + decoded.result.missing_pixels + decoded.result.unknown_pixels,
        0u)
        << i;
    EXPECT_EQ (decoded.result.points, result.points) << i;
  }
  return coded;
}

EncoderSettings
settings_of (Profile profile, bool temporal)
{
  EncoderSettings settings;
  settings.profile = profile;
  settings.temporal = temporal;
  return settings;
}

struct ReferenceChoices : ::testing::TestWithParam<Profile> {};

std::string
name_of (const ::testing::TestParamInfo<Profile> &info)
{
  const char *names[] = {"plain", "packed", "entropy"};
  return names[int (info.param)];
}

/* The picture of the last one turned into that of the next: nothing of it comes again. */
unsigned
always_another (int i)
{
  return unsigned (i) + 1;
}

} // namespace

INSTANTIATE_TEST_SUITE_P (
    All, ReferenceChoices, ::testing::Values (Profile::kPacked, Profile::kEntropy), name_of);

TEST_P (ReferenceChoices, frame_sets_that_have_nothing_in_common_cost_no_more_than_without)
{
  const EncoderSettings with = settings_of (GetParam (), true);
  const Coded refers = code (with, 20, always_another);
  const Coded alone = code (settings_of (GetParam (), false), 20, always_another);
  /* The first one is made for others to refer to: nobody knows yet. */
  EXPECT_LE (double (refers.sum (1, 20)), 1.02 * double (alone.sum (1, 20)));
  EXPECT_EQ (refers.delta_rows (19), 0);
}

TEST_P (ReferenceChoices, when_the_picture_stands_still_again_references_come_back)
{
  EncoderSettings settings = settings_of (GetParam (), true);
  settings.refresh_period_ns = 0;
  static constexpr int kMoves = 40, kFrames = 80;
  const Coded coded =
      code (settings, kFrames, [] (int i) { return unsigned (std::min (i, kMoves)) + 1; });
  EXPECT_EQ (coded.delta_rows (kMoves), 0);
  EXPECT_EQ (coded.delta_rows (kFrames - 1), kRoi.height);
}

TEST_P (ReferenceChoices, when_all_moves_references_end_within_a_few_frame_sets)
{
  EncoderSettings settings = settings_of (GetParam (), true);
  settings.refresh_period_ns = 0;
  static constexpr int kStill = 40;
  const Coded coded =
      code (settings, kStill + 12, [] (int i) { return unsigned (std::max (i - kStill, 0)) + 1; });
  EXPECT_EQ (coded.delta_rows (kStill - 1), kRoi.height);
  EXPECT_EQ (coded.delta_rows (kStill + 11), 0);
}

TEST_P (ReferenceChoices, each_row_is_coded_again_within_the_refresh_period_whatever_moves)
{
  EncoderSettings settings = settings_of (GetParam (), true);
  constexpr int kPeriod = 10;
  settings.refresh_period_ns = kPeriod * kFrameNs;
  /* Still and moving by turns, for longer and longer. */
  const auto seed = [] (int i) {
    return i / 7 % 3 == 0 ? unsigned (i) + 2 : unsigned (i / 21) + 1;
  };
  const Coded coded = code (settings, 100, seed);
  std::vector<int> latest (kRoi.height, 0);
  int deltas = 0;
  for (int i = 0; i < 100; i++) {
    deltas += coded.delta_rows (std::size_t (i)) > 0;
    for (const SliceHeader &slice : coded.slices[std::size_t (i)])
      if (slice.key && slice.first_column == 0)
        std::fill_n (latest.begin () + slice.first_row, slice.rows, i);
    for (int y = 0; y < kRoi.height; y++)
      ASSERT_LE (i - latest[std::size_t (y)], kPeriod) << "row " << y << " in " << i;
  }
  EXPECT_GT (deltas, 20); /* or this shows nothing */
}
