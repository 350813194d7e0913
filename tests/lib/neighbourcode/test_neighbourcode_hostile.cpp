/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Damaged and hostile streams: nothing crashes, and nothing is written where it should not. */
#include "neighbourcode-support.hpp"

#include <algorithm>
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
  return encode (rig (), pictures, {10, 6, 2, 2, 256, Profile::kPlain});
}

struct Hostile : ::testing::Test {
  AccessUnitDecoder decoder;
  void SetUp () override { ASSERT_TRUE (decoder.set_rig (rig ()).ok ()); }
};

} // namespace

TEST_F (Hostile, random_bytes_decode_to_nothing)
{
  std::mt19937 random (1);
  for (int i = 0; i < 3000; i++) {
    std::vector<std::uint8_t> bytes (random () % 400);
    for (auto &byte : bytes)
      byte = static_cast<std::uint8_t> (random ());
    const Decoded decoded = decode_exact (decoder, bytes);
    EXPECT_TRUE (decoded.pictures.empty ());
    EXPECT_EQ (decoded.result.slices, 0u);
    EXPECT_EQ (decoded.result.points, 0u);
  }
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
  bad[0] = static_cast<std::uint8_t> ((kBitstreamVersion + 1) << 4 | 1);
  EXPECT_EQ (read_slice_header (bad, header).code (), StatusCode::kUnsupported);
  for (int flag = 8; flag < 256; flag *= 2) {
    bad = unit;
    bad[1] = static_cast<std::uint8_t> (bad[1] | flag);
    EXPECT_EQ (read_slice_header (bad, header).code (), StatusCode::kUnsupported) << flag;
  }
  bad = unit;
  bad[5] = 9;
  EXPECT_EQ (read_slice_header (bad, header).code (), StatusCode::kUnsupported);
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

TEST_F (Hostile, rig_beyond_the_limit_is_refused_and_the_one_before_kept)
{
  RigCollector collector;
  const auto add_all = [&] (const Rig &rig) {
    std::vector<std::uint8_t> bytes;
    write_rig_units ({rig, 30, 1}, bytes);
    Status last;
    for (const auto &unit : units_of (bytes))
      last = collector.add (unit);
    return last;
  };
  EXPECT_TRUE (add_all (ring_rig (3)).ok ());
  Rig large = ring_rig (3);
  for (View &view : large.views)
    view.width = view.height = 8192;
  EXPECT_EQ (add_all (large).code (), StatusCode::kBadSize);
  EXPECT_EQ (collector.generation (), 1u);
  EXPECT_EQ (collector.info ().rig.views[0].width, ring_rig (1).views[0].width);
}

TEST_F (Hostile, images_of_other_views_are_refused)
{
  const auto stream = small_stream ();
  DecoderResult result;
  decoder.plan (stream, result);
  ASSERT_EQ (decoder.views ().size (), 2u);
  Picture first (0, Roi{7, 9, 24, 20}), second (1, Roi{0, 0, 16, 12}), other (1, Roi{0, 0, 12, 16});
  const RangeImage swapped[] = {second.image (), first.image ()};
  const RangeImage too_few[] = {first.image ()};
  const RangeImage of_other_roi[] = {first.image (), other.image ()};
  const RangeImage right[] = {first.image (), second.image ()};
  EXPECT_EQ (decoder.decode (swapped, 1, result).code (), StatusCode::kBadSize);
  EXPECT_EQ (decoder.decode (too_few, 1, result).code (), StatusCode::kBadSize);
  EXPECT_EQ (decoder.decode (of_other_roi, 1, result).code (), StatusCode::kBadSize);
  EXPECT_EQ (result.slices, 0u);
  EXPECT_TRUE (decoder.decode (right, 1, result).ok ());
}

/* What lies outside the smaller ROI is invalid in the whole one. */
TEST_F (Hostile, roi_that_shrinks_to_its_slices_loses_no_pixel)
{
  std::vector<Picture> pictures;
  pictures.emplace_back (0, Roi{7, 9, 200, 160}, 1, 6);
  const auto units = units_of (encode (rig (), pictures, {10, 6, 2, 2, 256, Profile::kPlain}));
  for (std::size_t i = 0; i + 5 < units.size (); i += 7) {
    const auto bytes = joined ({units[i], units[i + 2], units[i + 5]});
    const Decoded whole = decode (decoder, bytes), small = decode (decoder, bytes, false);
    ASSERT_EQ (whole.pictures.size (), small.pictures.size ());
    EXPECT_LT (small.pictures[0].roi.height, 160);
    EXPECT_EQ (whole.result.points, small.result.points);
    EXPECT_EQ (whole.result.missing_pixels, small.result.missing_pixels);
    EXPECT_EQ (whole.result.raw_bits, small.result.raw_bits);
    for (std::size_t i = 0; i < whole.pictures.size (); i++) {
      Picture a = whole.pictures[i], b = small.pictures[i];
      for (int y = 0; y < a.roi.height; y++)
        for (int x = 0; x < a.roi.width; x++) {
          const int column = x + a.roi.x - b.roi.x, row = y + a.roi.y - b.roi.y;
          const bool inside = column >= 0 && row >= 0 && column < b.roi.width && row < b.roi.height;
          EXPECT_EQ (a.depth.view ().at (x, y), inside ? b.depth.view ().at (column, row) : 0);
        }
    }
  }
}

namespace {

/* One view in many slices, and what of it a test compares. */
struct Slices : Hostile {
  std::vector<Picture> pictures;
  std::vector<std::vector<std::uint8_t>> units;
  std::uint64_t points = 0;

  void SetUp () override
  {
    Hostile::SetUp ();
    pictures.emplace_back (0, Roi{7, 9, 24, 20}, 1, 6);
    EncoderResult result;
    units = units_of (encode (rig (), pictures, {16, 8, 0, 0, 256, Profile::kPlain}, &result));
    points = result.points;
    ASSERT_GT (units.size (), 3u);
  }
  SliceHeader header_of (std::size_t i)
  {
    SliceHeader header;
    EXPECT_TRUE (read_slice_header (units[i], header).ok ());
    return header;
  }
  static void put_u16 (std::vector<std::uint8_t> &unit, std::size_t at, int value)
  {
    unit[at] = static_cast<std::uint8_t> (value);
    unit[at + 1] = static_cast<std::uint8_t> (value >> 8);
  }
  /* Rows first to first + n - 1 are those of `of`; n < 0: all. */
  static void expect_rows (Picture &is, Picture &of, int first = 0, int n = -1)
  {
    for (int y = first; y < (n < 0 ? is.roi.height : first + n); y++)
      for (int x = 0; x < is.roi.width; x++)
        ASSERT_EQ (is.depth.view ().at (x, y), of.depth.view ().at (x, y)) << x << " " << y;
  }
};

} // namespace

TEST_F (Slices, of_as_many_strays_as_right_ones_the_first_that_came_stay)
{
  const auto stray =
      units_of (encode (rig (), pictures, {16, 8, 0, 0, 256, Profile::kPlain}, nullptr, 77))[2];
  for (const bool stray_first : {false, true}) {
    const Decoded decoded = decode_exact (
        decoder, joined ({stray_first ? stray : units[0], stray_first ? units[0] : stray}));
    EXPECT_EQ (decoder.views ()[0].reference.frame_number, stray_first ? 77u : 5u);
    EXPECT_EQ (decoded.result.bad_slices, 1u);
  }
}

TEST_F (Slices, one_that_overlaps_another_is_as_if_lost_and_points_count_once)
{
  auto stray = units[0];
  put_u16 (stray, 28, header_of (1).first_row + 1);
  auto sent = units;
  sent.insert (sent.begin (), stray);
  sent.insert (sent.end (), units.begin (), units.end ());
  Decoded decoded = decode_exact (decoder, joined (sent));
  EXPECT_EQ (decoded.result.slices, units.size ());
  EXPECT_EQ (decoded.result.bad_slices, units.size () + 1);
  EXPECT_EQ (decoded.result.points, points);
  EXPECT_EQ (decoded.result.missing_pixels, 0u);
  expect_rows (decoded.pictures[0], pictures[0]);
}

TEST_F (Slices, damaged_and_lost_and_short_slices_are_invalid)
{
  const SliceHeader header = header_of (1);
  auto damaged = units, lost = units, cut = units;
  damaged[1].push_back (0); /* a byte left over: all rows are written when that is found */
  put_u16 (damaged[1], 2, int (damaged[1].size ()));
  lost.erase (lost.begin () + 1);
  cut[1].resize (kSliceHeaderSize + 3);
  put_u16 (cut[1], 2, kSliceHeaderSize + 3);
  Picture expected = pictures[0];
  for (int y = header.first_row; y < header.first_row + header.rows; y++)
    for (int x = 0; x < 24; x++)
      expected.depth.view ().at (x, y) = kInvalidDepth;
  for (const auto &sent : {damaged, lost, cut}) {
    Decoded decoded = decode_exact (decoder, joined (sent));
    EXPECT_EQ (decoded.result.slices, units.size () - 1);
    expect_rows (decoded.pictures[0], expected);
  }
}

TEST_F (Slices, many_short_slices_of_many_rows_take_little_time)
{
  Rig large;
  large.views.push_back (ring_view (0, 0, 0.8, 4096, 4096));
  ASSERT_TRUE (decoder.set_rig (large).ok ());
  std::vector<std::uint8_t> bytes;
  for (int i = 0; i < 100000; i++) {
    SliceHeader header;
    header.depth_bits = 8;
    header.colour_bits = 8;
    header.roi = {0, 0, 4096, 4096};
    header.first_row = i % 4000;
    header.rows = 4096 - header.first_row;
    header.columns = 4096;
    std::uint8_t unit[kSliceHeaderSize];
    write_slice_header (header, sizeof unit, unit);
    bytes.insert (bytes.end (), unit, unit + sizeof unit);
  }
  const Decoded decoded = decode_exact (decoder, bytes); /* else minutes: the test would time out */
  EXPECT_EQ (decoded.result.bad_slices, 100000u);
}
