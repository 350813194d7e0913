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

/* Two views in some slices each, one bit of which is wrong. */
struct Flips : Hostile {
  std::vector<std::vector<std::uint8_t>> units = units_of (small_stream ());
  std::vector<SliceHeader> headers;
  Decoded good;

  void SetUp () override
  {
    Hostile::SetUp ();
    good = decode_exact (decoder, joined (units));
    ASSERT_EQ (good.pictures.size (), 2u);
    for (const auto &unit : units)
      ASSERT_TRUE (read_slice_header (unit, headers.emplace_back ()).ok ());
    for (const int view : {0, 1}) /* a stray alone outvotes none of them */
      ASSERT_GT (std::ranges::count (headers, view, &SliceHeader::view_id), 1);
  }
  Decoded decode_flipped (std::size_t k, std::size_t bit)
  {
    auto bad = units;
    bad[k][bit / 8] ^= 1 << bit % 8;
    return decode_exact (decoder, joined (bad));
  }
  static Roi place_of (const SliceHeader &header)
  {
    return {header.first_column, header.first_row, header.columns, header.rows};
  }
  static bool same_pixel (Picture &a, Picture &b, int x, int y)
  {
    const auto depth = a.depth.view ().at (x, y);
    const Rgbx c = a.colour.view ().at (x, y), d = b.colour.view ().at (x, y);
    return depth == b.depth.view ().at (x, y) &&
           (depth == 0 || (c.r == d.r && c.g == d.g && c.b == d.b));
  }
  /* All but a part is the same, in depth and, where there is any, colour. */
  static bool same_outside (Picture &a, Picture &b, const Roi &part)
  {
    if (!(a.roi == b.roi))
      return false;
    for (int y = 0; y < a.roi.height; y++)
      for (int x = 0; x < a.roi.width; x++) {
        const bool inside =
            x >= part.x && x < part.x + part.width && y >= part.y && y < part.y + part.height;
        if (!inside && !same_pixel (a, b, x, y))
          return false;
      }
    return true;
  }
};

} // namespace

TEST_F (Hostile, every_truncated_prefix_costs_only_its_last_slice)
{
  expect_prefixes_cost_only_their_last_slice (decoder, small_stream ());
}

TEST_F (Flips, in_the_symbols_of_a_slice_changes_no_pixel_outside_it)
{
  for (std::size_t k = 0; k < units.size (); k++)
    for (std::size_t bit = 8 * kSliceHeaderSize; bit < 8 * units[k].size (); bit++) {
      Decoded decoded = decode_flipped (k, bit);
      ASSERT_EQ (decoded.pictures.size (), 2u);
      for (std::size_t view = 0; view < 2; view++)
        EXPECT_TRUE (same_outside (decoded.pictures[view], good.pictures[view],
            headers[k].view_id == int (view) ? place_of (headers[k]) : Roi{}))
            << k << " " << bit;
    }
}

/* In its own view a slice may claim another place, or be the one that the others must agree with.
 */
TEST_F (Flips, in_the_header_of_a_slice_changes_no_pixel_of_another_view)
{
  for (std::size_t k = 0; k < units.size (); k++)
    for (std::size_t bit = 0; bit < 8 * kSliceHeaderSize; bit++) {
      Decoded decoded = decode_flipped (k, bit);
      const int other = 1 - headers[k].view_id;
      const bool ends_access_unit = bit < 8 || (bit >= 16 && bit < 32); /* version and size */
      if (other == 1 && ends_access_unit)
        continue; /* it comes behind */
      const auto is = std::ranges::find (decoded.pictures, other, &Picture::view_id);
      ASSERT_TRUE (is != decoded.pictures.end ()) << k << " " << bit;
      EXPECT_TRUE (same_outside (*is, good.pictures[std::size_t (other)], {})) << k << " " << bit;
    }
}

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
    canvas.fill (0xabcd);
    const RangeImage older = canvas.image ();
    Decoded decoded = decode_exact (decoder, unit, {&older, 1});
    ASSERT_EQ (decoded.pictures.size (), 1u);
    for (int y = 0; y < header.roi.height; y++)
      for (int x = 0; x < header.roi.width; x++) {
        const bool own = y >= header.first_row && y < header.first_row + header.rows;
        if (!own) {
          ASSERT_EQ (decoded.pictures[0].depth.view ().at (x, y), 0xabcd);
        }
      }
  }
}

TEST_F (Hostile, shuffled_and_duplicated_slices_decode_to_the_same)
{
  std::vector<Picture> pictures;
  pictures.emplace_back (0, Roi{7, 9, 24, 20}, 1, 6);
  const auto stream = encode (rig (), pictures, {16, 8, 0, 0, 256, Profile::kPlain});
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

TEST_F (Hostile, slice_of_another_depth_scale_than_the_others_is_bad)
{
  const auto units = units_of (small_stream ());
  for (std::size_t k = 0; k < units.size (); k++) {
    auto one = units;
    one[k][1] ^= 2;
    EXPECT_EQ (decode_exact (decoder, joined (one)).result.bad_slices, 1u) << k;
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
  auto bytes = std::vector<std::uint8_t>{kBitstreamVersion << 4 | 9, 0, 6, 0, 1, 2};
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
    const Decoded whole = decode (decoder, bytes), small = decode (decoder, bytes, {}, false);
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

TEST_F (Hostile, duplicate_of_one_slice_does_not_hide_the_loss_of_another)
{
  std::vector<Picture> pictures;
  pictures.emplace_back (0, Roi{7, 9, 24, 20}, 1, 6);
  auto units = units_of (encode (rig (), pictures, {16, 8, 0, 0, 256, Profile::kPlain}));
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
  auto bytes = encode (rig (), pictures, {16, 8, 0, 0, 256, Profile::kPlain});
  const auto stray = encode (rig (), pictures, {16, 8, 0, 0, 256, Profile::kPlain}, nullptr, 77);
  bytes.insert (bytes.end (), stray.begin (), stray.end ());
  Decoded decoded = decode_exact (decoder, bytes);
  EXPECT_EQ (decoded.result.missing_pixels, 0u);
  for (int y = 0; y < 20; y++)
    for (int x = 0; x < 24; x++)
      ASSERT_EQ (decoded.pictures[0].depth.view ().at (x, y), pictures[0].depth.view ().at (x, y));
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

TEST_F (Slices, strays_of_another_frame_that_come_first_cost_nothing_but_themselves)
{
  const auto strays =
      units_of (encode (rig (), pictures, {16, 8, 0, 0, 256, Profile::kPlain}, nullptr, 77));
  auto sent = units;
  sent.insert (sent.begin (), strays.begin (), strays.begin () + 2);
  Decoded decoded = decode_exact (decoder, joined (sent));
  EXPECT_EQ (decoded.result.slices, units.size ());
  EXPECT_EQ (decoded.result.bad_slices, 2u);
  EXPECT_EQ (decoded.result.points, points);
  EXPECT_EQ (decoded.result.missing_pixels, 0u);
  expect_rows (decoded.pictures[0], pictures[0]);
}

TEST_F (Slices, stray_with_another_roi_that_comes_first_costs_nothing_but_itself)
{
  std::vector<Picture> others;
  others.emplace_back (0, Roi{30, 2, 50, 60}, 2, 6);
  auto sent = units;
  sent.insert (
      sent.begin (), units_of (encode (rig (), others, {16, 8, 0, 0, 256, Profile::kPlain}))[1]);
  Decoded decoded = decode_exact (decoder, joined (sent));
  EXPECT_EQ (decoded.result.slices, units.size ());
  EXPECT_EQ (decoded.result.bad_slices, 1u);
  ASSERT_EQ (decoded.pictures[0].roi, pictures[0].roi);
  expect_rows (decoded.pictures[0], pictures[0]);
}

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

TEST_F (Slices, stray_with_wrong_rows_leaves_all_others_right)
{
  const SliceHeader first = header_of (0), second = header_of (1);
  auto stray = units[0];
  put_u16 (stray, 28, second.first_row + 1);
  auto sent = units;
  sent.insert (sent.begin (), stray);
  Decoded decoded = decode_exact (decoder, joined (sent));
  EXPECT_EQ (decoded.result.slices, units.size () + 1);
  EXPECT_EQ (decoded.result.bad_slices, 0u);
  const int wrong_end = second.first_row + 1 + first.rows;
  expect_rows (decoded.pictures[0], pictures[0], 0, second.first_row);
  for (std::size_t i = 2; i < units.size (); i++)
    expect_rows (decoded.pictures[0], pictures[0], std::max (wrong_end, header_of (i).first_row),
        header_of (i).rows - 1);
}

TEST_F (Slices, points_of_overlapping_slices_are_those_that_can_be_seen)
{
  auto stray = units[0];
  put_u16 (stray, 28, header_of (1).first_row + 1);
  auto sent = units;
  sent.push_back (stray);
  Decoded decoded = decode_exact (decoder, joined (sent));
  std::uint64_t seen = 0;
  for (int y = 0; y < 20; y++)
    for (int x = 0; x < 24; x++)
      seen += decoded.pictures[0].depth.view ().at (x, y) != 0;
  EXPECT_EQ (decoded.result.points, seen);
  EXPECT_EQ (decoded.result.missing_pixels, 0u);
}

TEST_F (Slices, repeated_slices_count_once)
{
  auto sent = units;
  sent.insert (sent.end (), units.begin (), units.end ());
  sent.insert (sent.end (), units.begin (), units.end ());
  const Decoded decoded = decode_exact (decoder, joined (sent));
  EXPECT_EQ (decoded.result.slices, units.size ());
  EXPECT_EQ (decoded.result.bad_slices, 0u);
  EXPECT_EQ (decoded.result.points, points);
  EXPECT_EQ (decoded.result.raw_bits, points * 40 + 24 * 20);
}

TEST_F (Slices, sound_copy_stands_in_for_a_damaged_slice)
{
  for (const bool damaged_first : {false, true}) {
    auto sent = units;
    sent.insert (sent.begin () + 1, units[1]);
    sent[damaged_first ? 1 : 2][kSliceHeaderSize] = 0xff;
    Decoded decoded = decode_exact (decoder, joined (sent));
    EXPECT_EQ (decoded.result.slices, units.size ());
    EXPECT_EQ (decoded.result.points, points);
    expect_rows (decoded.pictures[0], pictures[0]);
  }
}

TEST_F (Slices, damaged_and_lost_and_short_slices_show_the_older_picture)
{
  Picture older (0, {0, 0, 60, 40}, 9, 6);
  const RangeImage older_image = older.image ();
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
      expected.depth.view ().at (x, y) = older.depth.view ().at (x + 7, y + 9);
  for (const auto &sent : {damaged, lost, cut}) {
    Decoded decoded = decode_exact (decoder, joined (sent), {&older_image, 1});
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
