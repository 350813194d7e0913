/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "neighbourcode-support.hpp"

using namespace rangecast;
using namespace rangecast::testing;

namespace {

bool
same (Picture &a, Picture &b)
{
  if (!(a.roi == b.roi))
    return false;
  for (int y = 0; y < a.roi.height; y++)
    for (int x = 0; x < a.roi.width; x++) {
      if (a.depth.view ().at (x, y) != b.depth.view ().at (x, y))
        return false;
      const Rgbx p = a.colour.view ().at (x, y), q = b.colour.view ().at (x, y);
      if (a.depth.view ().at (x, y) && (p.r != q.r || p.g != q.g || p.b != q.b))
        return false;
    }
  return true;
}

EncoderSettings
lossless ()
{
  return {16, 8, 0, 0, 1200, Profile::kPlain};
}

/* A view whose depth codes are depth - 3000 and whose colours are exact. */
Rig
exact_rig (int width = 320, int height = 240)
{
  Rig rig;
  rig.views.push_back (ring_view (0, 0, 0.8, width, height));
  return rig;
}

/* Hand-made pictures of a few pixels. Depth 0 is invalid. */
Picture
tiny (std::vector<std::vector<int>> depth, std::vector<std::vector<int>> grey = {})
{
  const int height = int (depth.size ()), width = int (depth[0].size ());
  Picture picture (0, {0, 0, width, height});
  for (int y = 0; y < height; y++)
    for (int x = 0; x < width; x++) {
      picture.depth.view ().at (x, y) = static_cast<std::uint16_t> (depth[y][x]);
      const auto c = static_cast<std::uint8_t> (grey.empty () ? 100 : grey[y][x]);
      picture.colour.view ().at (x, y) = {c, c, c, 0};
    }
  return picture;
}

std::vector<int>
symbols_of (std::span<const std::uint8_t> unit, int pixels)
{
  std::vector<int> symbols;
  for (int i = 0; i < pixels; i++) {
    int symbol = 0;
    for (int b = 0; b < 3; b++) {
      const int bit = 3 * i + b;
      symbol |= (unit[kSliceHeaderSize + bit / 8] >> bit % 8 & 1) << b;
    }
    symbols.push_back (symbol);
  }
  return symbols;
}

std::vector<int>
symbols_of (Picture picture, EncoderSettings settings)
{
  std::vector<Picture> pictures{std::move (picture)};
  const int pixels = pictures[0].roi.width * pictures[0].roi.height;
  return symbols_of (encode (exact_rig (), pictures, settings), pixels);
}

enum { L, UL, U, UR, F, I };

} // namespace

TEST (NeighbourCode, decoded_frame_set_codes_to_itself_again)
{
  const Rig rig = ring_rig (1);
  const EncoderSettings settings = {10, 6, 3, 2, 1200, Profile::kPlain},
                        exact = {10, 6, 0, 0, 1200, Profile::kPlain};
  std::vector<Picture> pictures;
  pictures.emplace_back (0, Roi{0, 0, 200, 150}, 3, 8);
  AccessUnitDecoder decoder;
  ASSERT_TRUE (decoder.set_rig (rig).ok ());
  Decoded once = decode (decoder, encode (rig, pictures, settings));
  Decoded twice = decode (decoder, encode (rig, once.pictures, exact));
  EXPECT_TRUE (same (once.pictures[0], twice.pictures[0]));
}

TEST (NeighbourCode, left_neighbour_wins_over_upper)
{
  EXPECT_EQ (symbols_of (tiny ({{5000, 5000}, {5000, 5000}}), lossless ()),
      (std::vector<int>{F, L, U, L}));
}

TEST (NeighbourCode, order_is_left_upper_left_upper_upper_right)
{
  EncoderSettings settings = lossless ();
  settings.depth_threshold = 10;
  /* The last pixel is near to all three above and far from its left one. */
  EXPECT_EQ (symbols_of (tiny ({{5000, 5050, 5100}, {6000, 5003, 7000}}), settings)[4], UL);
  EXPECT_EQ (symbols_of (tiny ({{5000, 5050, 5100}, {6000, 5053, 7000}}), settings)[4], U);
  EXPECT_EQ (symbols_of (tiny ({{5000, 5050, 5100}, {6000, 5103, 7000}}), settings)[4], UR);
  EXPECT_EQ (symbols_of (tiny ({{5000, 5050, 5100}, {6000, 5120, 7000}}), settings)[4], F);
}

TEST (NeighbourCode, pixel_is_compared_with_the_replaced_neighbour)
{
  EncoderSettings settings = lossless ();
  settings.depth_threshold = 10;
  /* Each step is 8; after one replacement the next differs by 16 from what is there. */
  EXPECT_EQ (
      symbols_of (tiny ({{5000, 5008, 5016, 5024}}), settings), (std::vector<int>{F, L, F, L}));
}

TEST (NeighbourCode, every_colour_channel_counts)
{
  EncoderSettings settings = lossless ();
  settings.colour_threshold = 5;
  for (int channel = 0; channel < 3; channel++) {
    Picture picture = tiny ({{5000, 5000}});
    (&picture.colour.view ().at (1, 0).r)[channel] = 106;
    EXPECT_EQ (symbols_of (picture, settings)[1], F);
    (&picture.colour.view ().at (1, 0).r)[channel] = 105;
    EXPECT_EQ (symbols_of (picture, settings)[1], L);
  }
}

TEST (NeighbourCode, invalid_pixels_have_a_code_and_are_no_neighbours)
{
  EncoderSettings settings = lossless ();
  settings.depth_threshold = 65535;
  EXPECT_EQ (symbols_of (tiny ({{0, 5000, 0, 5000}}), settings), (std::vector<int>{I, F, I, F}));
}

TEST (NeighbourCode, depth_beyond_near_and_far_is_invalid)
{
  EXPECT_EQ (symbols_of (tiny ({{2999, 3000, 15000, 15001}}), lossless ()),
      (std::vector<int>{I, F, F, I}));
}

TEST (NeighbourCode, header_carries_frame_number_capture_time_and_roi)
{
  const Rig rig = ring_rig (3);
  std::vector<Picture> pictures;
  pictures.emplace_back (2, Roi{11, 22, 33, 44});
  const auto units = units_of (encode (rig, pictures, {}, nullptr, 0xfedcba98));
  SliceHeader header;
  ASSERT_TRUE (read_slice_header (units[0], header).ok ());
  EXPECT_EQ (header.view_id, 2);
  EXPECT_EQ (header.frame_number, 0xfedcba98u);
  EXPECT_EQ (header.capture_time_ns, 77u);
  EXPECT_EQ (header.roi, (Roi{11, 22, 33, 44}));
  EXPECT_TRUE (header.key);
}

TEST (NeighbourCode, bad_settings_and_rois_are_refused)
{
  AccessUnitEncoder encoder;
  EXPECT_FALSE (encoder.configure (ring_rig (1), {5, 8, 0, 0, 1200}).ok ());
  EXPECT_FALSE (encoder.configure (ring_rig (1), {12, 9, 0, 0, 1200}).ok ());
  EXPECT_FALSE (encoder.configure (ring_rig (1), {12, 8, 0, 0, 255}).ok ());
  ASSERT_TRUE (encoder.configure (ring_rig (1), {}).ok ());
  EncoderResult result;
  Picture outside (0, {300, 0, 100, 10});
  const RangeImage image = outside.image ();
  EXPECT_EQ (encoder.encode ({&image, 1}, 0, 1, result).code (), StatusCode::kBadSize);
  Picture unknown (7, {0, 0, 10, 10});
  RangeImage other = unknown.image ();
  EXPECT_EQ (encoder.encode ({&other, 1}, 0, 1, result).code (), StatusCode::kNotFound);
  other.view_id = 0;
  const RangeImage twice[] = {other, other};
  EXPECT_EQ (encoder.encode (twice, 0, 2, result).code (), StatusCode::kBadData);
}

TEST (Units, rig_of_64_views_travels_in_small_units_in_any_order)
{
  const StreamInfo info = {ring_rig (64), 15, 1};
  std::vector<std::uint8_t> bytes;
  write_rig_units (info, bytes);
  auto units = units_of (bytes);
  ASSERT_EQ (units.size (), 64u);
  std::shuffle (units.begin (), units.end (), std::mt19937 (1));
  RigCollector collector;
  for (std::size_t i = 0; i < units.size (); i++) {
    EXPECT_LE (units[i].size (), 500u);
    EXPECT_EQ (collector.generation (), 0u);
    ASSERT_TRUE (collector.add (units[i]).ok ());
  }
  EXPECT_EQ (collector.generation (), 1u);
  EXPECT_EQ (encode_rig (collector.info ().rig), encode_rig (info.rig));
  EXPECT_EQ (collector.info ().fps_n, 15);
  for (const auto &unit : units)
    ASSERT_TRUE (collector.add (unit).ok ());
  EXPECT_EQ (collector.generation (), 1u) << "the same rig again is no news";
}

TEST (Units, frame_rate_is_news_if_its_value_changes)
{
  RigCollector collector;
  unsigned generation = 0;
  for (const auto &[fps_n, fps_d, is_news] : {std::tuple{15, 1, true}, {30, 2, false},
           {30, 1, true}, {0, 1, true}, {30, 1, true}, {60, 2, false}}) {
    std::vector<std::uint8_t> bytes;
    write_rig_units ({ring_rig (2), fps_n, fps_d}, bytes);
    for (const auto &unit : units_of (bytes))
      ASSERT_TRUE (collector.add (unit).ok ());
    generation += is_news;
    EXPECT_EQ (collector.generation (), generation) << fps_n << "/" << fps_d;
  }
}

TEST (Units, changed_rig_is_news_once_it_is_complete)
{
  StreamInfo info = {ring_rig (2), 15, 1};
  RigCollector collector;
  std::vector<std::uint8_t> bytes;
  write_rig_units (info, bytes);
  for (const auto &unit : units_of (bytes))
    ASSERT_TRUE (collector.add (unit).ok ());
  info.rig = ring_rig (3);
  bytes.clear ();
  write_rig_units (info, bytes);
  const auto units = units_of (bytes);
  ASSERT_TRUE (collector.add (units[0]).ok ());
  ASSERT_TRUE (collector.add (units[1]).ok ());
  EXPECT_EQ (collector.info ().rig.views.size (), 2u);
  ASSERT_TRUE (collector.add (units[2]).ok ());
  EXPECT_EQ (collector.info ().rig.views.size (), 3u);
  EXPECT_EQ (collector.generation (), 2u);
}

TEST (Units, access_unit_header_round_trips)
{
  std::uint8_t bytes[kAccessUnitHeaderSize];
  write_access_unit_header ({1234567, 5, 1ull << 60, false}, bytes);
  AccessUnitHeader header;
  ASSERT_TRUE (read_access_unit_header (bytes, header).ok ());
  EXPECT_EQ (header.size, 1234567u);
  EXPECT_EQ (header.pts_ns, 5u);
  EXPECT_EQ (header.capture_time_ns, 1ull << 60);
  EXPECT_FALSE (header.key);
}
