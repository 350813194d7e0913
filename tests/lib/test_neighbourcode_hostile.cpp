/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Damaged and hostile streams: nothing crashes, and nothing is written where it should not. */
#include "neighbourcode-support.hpp"

#include <cstring>
#include <memory>

using namespace rangecast;
using namespace rangecast::testing;

namespace {

const Rig &
rig ()
{
  static const Rig rig = ring_rig (2);
  return rig;
}

std::vector<std::uint8_t>
small_stream ()
{
  std::vector<Picture> pictures;
  pictures.emplace_back (0, Roi{7, 9, 24, 20}, 1, 6);
  pictures.emplace_back (1, Roi{0, 0, 16, 12}, 2, 6);
  return encode (rig (), pictures, {10, 6, 2, 2, 256});
}

/* In a copy of exactly its size, so that one byte too far is seen. */
Decoded
decode_exact (AccessUnitDecoder &decoder, std::span<const std::uint8_t> bytes)
{
  const auto copy = std::make_unique<std::uint8_t[]> (bytes.size ());
  if (!bytes.empty ())
    std::memcpy (copy.get (), bytes.data (), bytes.size ());
  return decode (decoder, {copy.get (), bytes.size ()});
}

struct Hostile : ::testing::Test {
  AccessUnitDecoder decoder;
  void SetUp () override { ASSERT_TRUE (decoder.set_rig (rig ()).ok ()); }
};

} // namespace

TEST_F (Hostile, every_truncated_prefix_costs_only_its_last_slice)
{
  const auto stream = small_stream ();
  const auto units = units_of (stream);
  for (std::size_t size = 0; size < stream.size (); size++) {
    std::size_t whole = 0, end = 0;
    while (whole < units.size () && end + units[whole].size () <= size)
      end += units[whole++].size ();
    const Decoded decoded = decode_exact (decoder, std::span (stream).first (size));
    EXPECT_EQ (decoded.result.slices, whole) << size;
    EXPECT_EQ (decoded.result.bad_slices, size == end ? 0u : 1u) << size;
  }
}

TEST_F (Hostile, no_bit_flip_crashes_and_other_slices_stay)
{
  const auto good = small_stream ();
  const auto n = units_of (good).size ();
  for (std::size_t bit = 0; bit < good.size () * 8; bit++) {
    auto bad = good;
    bad[bit / 8] ^= 1 << bit % 8;
    const Decoded decoded = decode_exact (decoder, bad);
    EXPECT_LE (decoded.result.slices, n + 1);
  }
}

TEST_F (Hostile, random_bytes_decode_to_nothing)
{
  std::mt19937 random (1);
  for (int i = 0; i < 3000; i++) {
    std::vector<std::uint8_t> bytes (random () % 400);
    for (auto &byte : bytes)
      byte = static_cast<std::uint8_t> (random ());
    decode_exact (decoder, bytes);
  }
}

TEST_F (Hostile, random_symbols_under_a_good_header_stay_in_their_rows)
{
  std::mt19937 random (2);
  for (int i = 0; i < 3000; i++) {
    auto unit = units_of (small_stream ())[1];
    SliceHeader header;
    ASSERT_TRUE (read_slice_header (unit, header).ok ());
    for (std::size_t k = kSliceHeaderSize; k < unit.size (); k++)
      unit[k] = static_cast<std::uint8_t> (random ());
    Picture canvas (header.view_id, header.roi);
    for (int y = 0; y < header.roi.height; y++)
      for (int x = 0; x < header.roi.width; x++)
        canvas.depth.view ().at (x, y) = 0xabcd;
    DecoderResult result;
    decoder.plan (unit, result);
    ASSERT_EQ (decoder.views ().size (), 1u);
    const RangeImage image = canvas.image ();
    decoder.decode ({&image, 1}, 1, result);
    for (int y = 0; y < header.roi.height; y++)
      for (int x = 0; x < header.roi.width; x++) {
        const bool own = y >= header.first_row && y < header.first_row + header.rows;
        if (!own) {
          ASSERT_EQ (canvas.depth.view ().at (x, y), 0xabcd);
        }
      }
  }
}

TEST_F (Hostile, shuffled_and_duplicated_slices_decode_to_the_same)
{
  std::vector<Picture> pictures;
  pictures.emplace_back (0, Roi{7, 9, 24, 20}, 1, 6);
  const auto stream = encode (rig (), pictures, {16, 8, 0, 0, 256});
  auto units = units_of (stream);
  units.push_back (units[1]);
  std::shuffle (units.begin (), units.end (), std::mt19937 (3));
  std::vector<std::uint8_t> bytes;
  for (const auto &unit : units)
    bytes.insert (bytes.end (), unit.begin (), unit.end ());
  Decoded decoded = decode_exact (decoder, bytes);
  for (int y = 0; y < 20; y++)
    for (int x = 0; x < 24; x++)
      ASSERT_EQ (decoded.pictures[0].depth.view ().at (x, y), pictures[0].depth.view ().at (x, y));
}

TEST_F (Hostile, slice_with_another_roi_or_frame_number_is_bad)
{
  std::vector<Picture> pictures, others;
  pictures.emplace_back (0, Roi{7, 9, 24, 20}, 1, 6);
  others.emplace_back (0, Roi{8, 9, 24, 20}, 1, 6);
  auto bytes = encode (rig (), pictures, {});
  const auto other = encode (rig (), others, {}), later = encode (rig (), pictures, {}, nullptr, 6);
  const std::size_t good = units_of (bytes).size ();
  bytes.insert (bytes.end (), other.begin (), other.end ());
  Decoded decoded = decode_exact (decoder, bytes);
  EXPECT_EQ (decoded.result.slices, good);
  EXPECT_EQ (decoded.result.bad_slices, units_of (other).size ());
}

TEST_F (Hostile, slice_of_a_view_that_the_rig_lacks_is_bad)
{
  std::vector<Picture> pictures;
  pictures.emplace_back (3, Roi{7, 9, 24, 20}, 1, 6);
  const auto bytes = encode (ring_rig (4), pictures, {});
  const Decoded decoded = decode_exact (decoder, bytes);
  EXPECT_TRUE (decoded.pictures.empty ());
  EXPECT_EQ (decoded.result.bad_slices, units_of (bytes).size ());
}

TEST_F (Hostile, roi_beyond_the_view_is_bad)
{
  std::vector<Picture> pictures;
  pictures.emplace_back (0, Roi{600, 400, 24, 20}, 1, 6);
  Rig large;
  large.views.push_back (ring_view (0, 0, 0.8, 640, 480));
  const Decoded decoded = decode_exact (decoder, encode (large, pictures, {}));
  EXPECT_TRUE (decoded.pictures.empty ());
}

TEST_F (Hostile, future_version_reserved_flag_and_unknown_profile_are_refused)
{
  auto unit = units_of (small_stream ())[0];
  SliceHeader header;
  auto bad = unit;
  bad[0] = static_cast<std::uint8_t> (2 << 4 | 1);
  EXPECT_EQ (read_slice_header (bad, header).code (), StatusCode::kUnsupported);
  bad = unit;
  bad[1] |= 0x80;
  EXPECT_EQ (read_slice_header (bad, header).code (), StatusCode::kUnsupported);
  bad = unit;
  bad[5] = 9;
  EXPECT_EQ (read_slice_header (bad, header).code (), StatusCode::kUnsupported);
}

TEST_F (Hostile, trailing_bytes_in_a_slice_are_damage)
{
  auto unit = units_of (small_stream ())[0];
  unit.push_back (0);
  unit[2]++;
  const Decoded decoded = decode_exact (decoder, unit);
  EXPECT_EQ (decoded.result.slices, 0u);
  EXPECT_EQ (decoded.result.bad_slices, 1u);
}

TEST_F (Hostile, unknown_unit_types_are_skipped)
{
  auto bytes = std::vector<std::uint8_t>{1 << 4 | 9, 0, 6, 0, 1, 2};
  const auto stream = small_stream ();
  bytes.insert (bytes.end (), stream.begin (), stream.end ());
  const Decoded decoded = decode_exact (decoder, bytes);
  EXPECT_EQ (decoded.result.bad_slices, 0u);
  EXPECT_EQ (decoded.result.slices, units_of (stream).size ());
}

TEST_F (Hostile, damaged_rig_units_are_refused)
{
  std::vector<std::uint8_t> bytes;
  write_rig_units ({rig (), 15, 1}, bytes);
  const auto good = units_of (bytes)[0];
  for (std::size_t size = 0; size < good.size (); size++) {
    RigCollector collector;
    const auto copy = std::make_unique<std::uint8_t[]> (size);
    std::memcpy (copy.get (), good.data (), size);
    EXPECT_FALSE (collector.add ({copy.get (), size}).ok ());
  }
  for (std::size_t bit = 0; bit < good.size () * 8; bit++) {
    auto bad = good;
    bad[bit / 8] ^= 1 << bit % 8;
    RigCollector collector;
    if (collector.add (bad).ok () && collector.generation () > 0) {
      EXPECT_TRUE (validate (collector.info ().rig).ok ());
    }
  }
}

TEST_F (Hostile, duplicate_of_one_slice_does_not_hide_the_loss_of_another)
{
  std::vector<Picture> pictures;
  pictures.emplace_back (0, Roi{7, 9, 24, 20}, 1, 6);
  auto units = units_of (encode (rig (), pictures, {16, 8, 0, 0, 256}));
  ASSERT_GT (units.size (), 3u);
  for (std::size_t lost = 0; lost < units.size (); lost++)
    for (std::size_t twice = 0; twice < units.size (); twice++) {
      auto sent = units;
      sent[lost] = units[twice];
      std::vector<std::uint8_t> bytes;
      for (const auto &unit : sent)
        bytes.insert (bytes.end (), unit.begin (), unit.end ());
      DecoderResult result;
      decoder.plan (bytes, result);
      ASSERT_EQ (decoder.views ().size (), 1u);
      EXPECT_EQ (decoder.missing_pixels (0) > 0, lost != twice) << lost << " " << twice;
    }
}

TEST_F (Hostile, stray_slice_of_another_frame_clears_nothing)
{
  std::vector<Picture> pictures;
  pictures.emplace_back (0, Roi{7, 9, 24, 20}, 1, 6);
  auto bytes = encode (rig (), pictures, {16, 8, 0, 0, 256});
  const auto stray = encode (rig (), pictures, {16, 8, 0, 0, 256}, nullptr, 77);
  bytes.insert (bytes.end (), stray.begin (), stray.end ());
  Decoded decoded = decode_exact (decoder, bytes);
  EXPECT_EQ (decoded.result.missing_pixels, 0u);
  for (int y = 0; y < 20; y++)
    for (int x = 0; x < 24; x++)
      ASSERT_EQ (decoded.pictures[0].depth.view ().at (x, y), pictures[0].depth.view ().at (x, y));
}
