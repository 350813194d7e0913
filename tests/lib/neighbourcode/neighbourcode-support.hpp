/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include "../test-support.hpp"

#include <cstring>
#include <memory>
#include <random>
#include <rangecast/neighbourcode/access_unit.hpp>

namespace rangecast::testing {

/** One view that owns its pixels: a noisy bump with a hole, in colours that vary. */
struct Picture {
  Image<std::uint16_t> depth;
  Image<Rgbx> colour;
  Roi roi;
  int view_id = 0;

  Picture (int id, Roi r, unsigned seed = 1, double noise = 3)
      : depth (r.width, r.height), colour (r.width, r.height), roi (r), view_id (id)
  {
    std::mt19937 random (seed);
    std::normal_distribution<double> n (0, noise);
    const auto clip = [] (double v) {
      return static_cast<std::uint8_t> (std::clamp (v, 0.0, 255.0));
    };
    for (int y = 0; y < r.height; y++)
      for (int x = 0; x < r.width; x++) {
        const double u = 2.0 * x / r.width - 1, v = 2.0 * y / r.height - 1, d = u * u + v * v;
        const bool valid = d < 0.9 && !(std::abs (u - 0.3) < 0.05 && std::abs (v) < 0.1);
        depth.view ().at (x, y) =
            valid ? static_cast<std::uint16_t> (6000 + 3000 * d + n (random)) : 0;
        colour.view ().at (x, y) = {clip (150 + 60 * u + n (random)),
            clip (120 + 50 * v + n (random)), clip (100 + 40 * u * v + n (random)), 0};
      }
  }
  /** One to decode into. */
  static Picture blank (int id, Roi r, std::uint16_t depth)
  {
    Picture picture (id, {0, 0, 0, 0});
    picture.depth = Image<std::uint16_t> (r.width, r.height);
    picture.colour = Image<Rgbx> (r.width, r.height);
    picture.roi = r;
    picture.fill (depth);
    return picture;
  }
  void fill (std::uint16_t value)
  {
    for (int y = 0; y < roi.height; y++)
      std::fill_n (depth.view ().row (y), roi.width, value);
  }
  RangeImage image () { return {view_id, roi, depth.view (), colour.view (), 77}; }
};

inline std::vector<std::uint8_t>
encode (const Rig &rig, std::vector<Picture> &pictures, const EncoderSettings &settings,
    EncoderResult *result = nullptr, std::uint32_t frame = 5)
{
  AccessUnitEncoder encoder;
  EXPECT_TRUE (encoder.configure (rig, settings).ok ());
  std::vector<RangeImage> images;
  for (Picture &picture : pictures)
    images.push_back (picture.image ());
  EncoderResult own;
  const Status status = encoder.encode (images, frame, 1, result ? *result : own);
  EXPECT_TRUE (status.ok ()) << status.message ();
  return encoder.bytes ();
}

struct Decoded {
  std::vector<Picture> pictures;
  DecoderResult result;
};

inline Decoded
decode (AccessUnitDecoder &decoder, std::span<const std::uint8_t> bytes, bool whole_rois = true)
{
  Decoded decoded;
  decoder.plan (bytes, decoded.result, whole_rois);
  for (const auto &view : decoder.views ())
    decoded.pictures.push_back (Picture::blank (view.view_id, view.roi, 0x5a5a));
  std::vector<RangeImage> images;
  for (Picture &picture : decoded.pictures)
    images.push_back (picture.image ());
  EXPECT_TRUE (decoder.decode (images, 1, decoded.result).ok ());
  return decoded;
}

inline std::vector<std::uint8_t>
joined (const std::vector<std::vector<std::uint8_t>> &units)
{
  std::vector<std::uint8_t> bytes;
  for (const auto &unit : units)
    bytes.insert (bytes.end (), unit.begin (), unit.end ());
  return bytes;
}

/** The units of an access unit, apart. */
inline std::vector<std::vector<std::uint8_t>>
units_of (std::span<const std::uint8_t> bytes)
{
  std::vector<std::vector<std::uint8_t>> units;
  UnitReader reader (bytes);
  UnitHeader header;
  while (const auto unit = reader.next (header))
    units.emplace_back (unit->begin (), unit->end ());
  EXPECT_TRUE (reader.status ().ok ());
  return units;
}

/** The same in a copy of exactly its size, so that one byte too far is seen. */
inline Decoded
decode_exact (AccessUnitDecoder &decoder, std::span<const std::uint8_t> bytes)
{
  const auto copy = std::make_unique<std::uint8_t[]> (bytes.size ());
  if (!bytes.empty ())
    std::memcpy (copy.get (), bytes.data (), bytes.size ());
  return decode (decoder, {copy.get (), bytes.size ()});
}

/** Each prefix of a stream must give all its whole slices, and one bad one for a cut one. */
inline void
expect_prefixes_cost_only_their_last_slice (
    AccessUnitDecoder &decoder, std::span<const std::uint8_t> stream)
{
  const auto units = units_of (stream);
  for (std::size_t size = 0; size < stream.size (); size++) {
    std::size_t whole = 0, end = 0;
    while (whole < units.size () && end + units[whole].size () <= size)
      end += units[whole++].size ();
    const Decoded decoded = decode_exact (decoder, stream.first (size));
    EXPECT_EQ (decoded.result.slices, whole) << size;
    EXPECT_EQ (decoded.result.bad_slices, size == end ? 0u : 1u) << size;
  }
}

} // namespace rangecast::testing
