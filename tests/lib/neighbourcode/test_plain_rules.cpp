/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Profile plain beside the rules of docs/formats/bitstream.md written straight. */
#include <map>
#include <memory>
#include <optional>
#include <rangecast/neighbourcode/bitstream/symbols.hpp>
#include <rangecast/neighbourcode/decoder.hpp>
#include <rangecast/neighbourcode/encoder.hpp>

#include "neighbourcode-support.hpp"

using namespace rangecast;
using namespace rangecast::testing;

namespace {

/* Pixels that end where their memory ends, at no address worth mentioning. */
struct Pixels {
  int width, height, depth_stride, colour_stride; /* strides in bytes */
  std::vector<std::uint16_t> depths;
  std::vector<std::uint8_t> colours;

  Pixels (int w, int h, int padding)
      : width (w), height (h), depth_stride (2 * (w + padding)),
        colour_stride (4 * w + 5 * padding),
        depths (1 + std::size_t (w + padding) * std::size_t (h - 1) + std::size_t (w)),
        colours (1 + std::size_t (colour_stride) * std::size_t (h - 1) + 4 * std::size_t (w))
  {
  }
  RangeImage image ()
  {
    return {0, {0, 0, width, height}, {depths.data () + 1, width, height, depth_stride},
        {reinterpret_cast<Rgbx *> (colours.data () + 1), width, height, colour_stride}, 9};
  }
  std::uint16_t &depth (int x, int y) { return image ().depth.at (x, y); }
  Rgbx &colour (int x, int y) { return image ().colour.at (x, y); }
};

enum class Kind { kNoise, kSmooth, kIslands, kFlat, kEmpty };
constexpr Kind kKinds[] = {Kind::kNoise, Kind::kSmooth, Kind::kIslands, Kind::kFlat, Kind::kEmpty};

Pixels
make_pixels (Kind kind, int width, int height, unsigned seed)
{
  Pixels pixels (width, height, static_cast<int> (seed % 4));
  std::mt19937 random (seed);
  const auto roll = [&] (
                        int n) { return static_cast<int> (random () % static_cast<unsigned> (n)); };
  int left = roll (width), right = left + roll (width);
  for (int y = 0; y < height; y++) {
    left += roll (5) - 2;
    right += roll (5) - 2;
    for (int x = 0; x < width; x++) {
      const int noise = roll (kind == Kind::kNoise ? 12001 : kind == Kind::kFlat ? 1 : 40);
      bool valid = kind != Kind::kEmpty;
      if (kind == Kind::kIslands)
        valid = (x >= left && x < right && roll (20) > 0) || roll (40) == 0;
      if (kind == Kind::kNoise)
        valid = roll (9) > 0;
      /* Outside of 3000 to 15000 is also invalid. */
      pixels.depth (x, y) = static_cast<std::uint16_t> (
          !valid ? (roll (2)      ? 0
                       : roll (2) ? 2999 - roll (9)
                                  : 15001 + roll (50000))
                 : (kind == Kind::kNoise ? 3000 : 5000 + 2 * x + 3 * y) + noise);
      const auto channel = [&] (int base) {
        return static_cast<std::uint8_t> (
            kind == Kind::kNoise ? roll (256) : base + (kind == Kind::kFlat ? 0 : roll (12)));
      };
      pixels.colour (x, y) = {channel (100), channel (240), channel (0), channel (7)};
    }
  }
  return pixels;
}

View
view_of (int width, int height)
{
  return ring_view (0, 0, 0.8, width, height);
}

/* ---- the rules, straight ---- */

struct Quantised {
  bool valid;
  int codes[4]; /* depth, R, G, B */
};

/* Rows first_row to first_row + rows - 1 of some columns, symbols and full pixels. */
class StraightSlice {
public:
  StraightSlice (const DepthQuantiser &depth, const EncoderSettings &settings)
      : depth_ (&depth), colour_ (settings.colour_bits), settings_ (settings)
  {
  }

  /* Codes one more row. */
  void add (Pixels &pixels, int y, int first_column, int columns)
  {
    const std::vector<Quantised> above = row_;
    row_.clear ();
    for (int x = 0; x < columns; x++) {
      Quantised own = quantised (pixels, first_column + x, y);
      const int symbol = choose (own, above, x);
      symbols.push_back (symbol);
      if (symbol == kFull)
        full.push_back (own);
      row_.push_back (own);
    }
  }

  [[nodiscard]] std::size_t size () const
  {
    const auto bits = std::size_t (settings_.depth_bits + 3 * settings_.colour_bits);
    return kSliceHeaderSize + (3 * symbols.size () + 7) / 8 + (bits * full.size () + 7) / 8;
  }

  [[nodiscard]] std::vector<std::uint8_t> bytes (const SliceHeader &header) const
  {
    std::vector<std::uint8_t> bytes (size ());
    write_slice_header (header, bytes.size (), bytes.data ());
    std::size_t at = 8 * kSliceHeaderSize;
    const auto put = [&] (int value, int bits) {
      for (int i = 0; i < bits; i++, at++)
        bytes[at / 8] |= static_cast<std::uint8_t> ((value >> i & 1) << at % 8);
    };
    for (int symbol : symbols)
      put (symbol, 3);
    at = (at + 7) / 8 * 8;
    for (const Quantised &pixel : full)
      for (int i = 0; i < 4; i++)
        put (pixel.codes[i], i == 0 ? settings_.depth_bits : settings_.colour_bits);
    return bytes;
  }

  std::vector<int> symbols;
  std::vector<Quantised> full;

private:
  [[nodiscard]] Quantised quantised (Pixels &pixels, int x, int y) const
  {
    const std::uint16_t d = pixels.depth (x, y);
    const Rgbx c = pixels.colour (x, y);
    if (!depth_->valid (d))
      return {false, {}};
    return {true, {depth_->code (d), colour_.code (c.r), colour_.code (c.g), colour_.code (c.b)}};
  }

  int choose (Quantised &own, const std::vector<Quantised> &above, int x) const
  {
    if (!own.valid)
      return kInvalid;
    const auto at = [] (const std::vector<Quantised> &row, int i) {
      return i >= 0 && i < int (row.size ()) ? row[std::size_t (i)] : Quantised{false, {}};
    };
    const Quantised neighbours[] = {
        at (row_, x - 1), at (above, x - 1), at (above, x), at (above, x + 1)};
    for (int i = 0; i < 4; i++) {
      bool near = neighbours[i].valid;
      for (int k = 0; k < 4; k++)
        near &= std::abs (own.codes[k] - neighbours[i].codes[k]) <=
                (k == 0 ? settings_.depth_threshold : settings_.colour_threshold);
      if (near) {
        own = neighbours[i];
        return i;
      }
    }
    return kFull;
  }

  const DepthQuantiser *depth_;
  ColourQuantiser colour_;
  EncoderSettings settings_;
  std::vector<Quantised> row_;
};

/* All slices of an image. */
std::vector<std::uint8_t>
encode_straight (Pixels &pixels, const EncoderSettings &settings)
{
  DepthQuantiser depth;
  EXPECT_TRUE (depth.set (view_of (pixels.width, pixels.height), settings.depth_bits).ok ());
  const int most = (settings.max_slice_size - int (kSliceHeaderSize) - 2) * 8 /
                   (3 + settings.depth_bits + 3 * settings.colour_bits);
  const int pieces = (pixels.width + most - 1) / most;
  std::vector<std::uint8_t> bytes;
  for (int i = 0; i < pieces; i++) {
    SliceHeader header;
    header.depth_bits = static_cast<std::uint8_t> (settings.depth_bits);
    header.colour_bits = static_cast<std::uint8_t> (settings.colour_bits);
    header.frame_number = 5;
    header.capture_time_ns = 9;
    header.roi = {0, 0, pixels.width, pixels.height};
    header.first_column = pixels.width * i / pieces;
    header.columns = pixels.width * (i + 1) / pieces - header.first_column;
    StraightSlice slice (depth, settings);
    const auto close = [&] {
      const auto coded = slice.bytes (header);
      bytes.insert (bytes.end (), coded.begin (), coded.end ());
    };
    for (int y = 0; y < pixels.height; y++, header.rows++) {
      StraightSlice longer = slice;
      longer.add (pixels, y, header.first_column, header.columns);
      if (header.rows > 0 && longer.size () > std::size_t (settings.max_slice_size)) {
        close ();
        header.first_row = y;
        header.rows = 0;
        longer = StraightSlice (depth, settings);
        longer.add (pixels, y, header.first_column, header.columns);
      }
      slice = std::move (longer);
    }
    close ();
  }
  return bytes;
}

struct Shown {
  std::uint16_t depth;
  Rgbx colour;
};

/* The pixels of a slice, or nothing if it is damaged. */
std::optional<std::vector<Shown>>
decode_straight (
    std::span<const std::uint8_t> body, const SliceHeader &header, const DepthQuantiser &depth)
{
  const ColourQuantiser colour (header.colour_bits);
  const auto columns = std::size_t (header.columns), pixels = std::size_t (header.rows) * columns;
  const auto bit = [&] (std::size_t at) {
    return at / 8 < body.size () && body[at / 8] >> at % 8 & 1;
  };
  std::size_t at = 0, next = symbol_bytes (pixels) * 8;
  const auto take = [&] (std::size_t &from, int bits) {
    unsigned value = 0;
    for (int i = 0; i < bits; i++)
      value |= unsigned (bit (from++)) << i;
    return value;
  };
  const auto zeros_to_byte = [&] (std::size_t from) { /* also: the bytes are there */
    for (; from % 8; from++)
      if (bit (from))
        return std::size_t (0);
    return from / 8;
  };
  std::vector<Shown> shown (pixels, Shown{0, {}});
  for (std::size_t i = 0; i < pixels; i++) {
    const std::size_t x = i % columns;
    const unsigned symbol = take (at, 3);
    constexpr int kAnywhere = 1 << 20;
    const int from = symbol == kLeft         ? (x > 0 ? -1 : kAnywhere)
                     : symbol == kUpperRight ? (x + 1 < columns ? 1 - int (columns) : kAnywhere)
                     : symbol == kUpperLeft  ? (x > 0 ? -1 - int (columns) : kAnywhere)
                     : symbol == kUpper      ? -int (columns)
                                             : kAnywhere;
    if (symbol == kFull) {
      const unsigned code = take (next, header.depth_bits);
      if (next > body.size () * 8 || code >= unsigned (depth.codes ()))
        return {};
      shown[i].depth = depth.depth (std::uint16_t (code));
      for (std::uint8_t *channel : {&shown[i].colour.r, &shown[i].colour.g, &shown[i].colour.b})
        *channel = colour.value (std::uint8_t (take (next, header.colour_bits)));
    } else if (symbol != kInvalid) {
      if (from == kAnywhere || int (i) + from < 0 || !shown[i + std::size_t (from)].depth)
        return {};
      shown[i] = shown[i + std::size_t (from)];
    }
  }
  if (zeros_to_byte (at) != symbol_bytes (pixels) || zeros_to_byte (next) != body.size ())
    return {};
  return shown;
}

/* ---- beside the library ---- */

class PlainRules : public ::testing::Test {
protected:
  /* Codes an image. @return what the rules give */
  static std::vector<std::uint8_t> encode (Pixels &pixels, const EncoderSettings &settings)
  {
    const auto straight = encode_straight (pixels, settings);
    std::uint64_t valid = 0;
    DepthQuantiser depth;
    EXPECT_TRUE (depth.set (view_of (pixels.width, pixels.height), settings.depth_bits).ok ());
    for (int y = 0; y < pixels.height; y++)
      for (int x = 0; x < pixels.width; x++)
        valid += depth.valid (pixels.depth (x, y));
    static ViewEncoder encoder; /* memory is used again */
    static PartitionEncoder partition_encoder;
    EXPECT_TRUE (encoder.configure (view_of (pixels.width, pixels.height), settings).ok ());
    std::vector<std::uint8_t> bytes;
    EXPECT_TRUE (encoder.begin (pixels.image (), 5).ok ());
    encoder.for_open_partitions (
        [&] (ViewEncoder::PartitionId partition) { encoder.code (partition, partition_encoder); });
    EXPECT_TRUE (encoder.finish ());
    encoder.for_coded_partitions (
        [&] (auto piece) { bytes.insert (bytes.end (), piece.begin (), piece.end ()); });
    EXPECT_EQ (bytes, straight) << pixels.width << "x" << pixels.height << ", bits "
                                << settings.depth_bits << " + " << settings.colour_bits;
    EXPECT_EQ (encoder.result ().points, valid);
    return straight;
  }

  /* Decodes a slice, which must give what the rules say. */
  static void decode (std::span<const std::uint8_t> slice, const DepthQuantiser &depth)
  {
    const auto fresh = std::make_unique<std::uint8_t[]> (slice.size ());
    std::ranges::copy (slice, fresh.get ());
    const std::span<const std::uint8_t> unit (fresh.get (), slice.size ());
    SliceHeader header;
    ASSERT_TRUE (read_slice_header (unit, header).ok ());
    std::optional<std::vector<Shown>> expected;
    const auto pixels = std::size_t (header.rows) * std::size_t (header.columns);
    if (unit.size () >= kSliceHeaderSize + symbol_bytes (pixels))
      expected = decode_straight (unit.subspan (kSliceHeaderSize), header, depth);
    decode_and_compare (unit, header, expected);
  }

private:
  static void decode_and_compare (std::span<const std::uint8_t> unit, const SliceHeader &header,
      const std::optional<std::vector<Shown>> &expected)
  {
    static std::map<std::pair<int, int>, SliceDecoder> decoders;
    SliceDecoder &decoder = decoders[{header.roi.width, header.roi.height}];
    if (decoder.rig ().views.empty ()) {
      ASSERT_TRUE (decoder.set_rig ({{view_of (header.roi.width, header.roi.height)}}).ok ());
    }
    Pixels decoded (header.roi.width, header.roi.height, 1);
    std::ranges::fill (decoded.depths, std::uint16_t{0xabcd});
    std::ranges::fill (decoded.colours, std::uint8_t{0xef});
    DecodedPixels counted;
    std::uint64_t valid = 0;
    const bool good = decoder.decode (unit, header, {}, decoded.image (), counted).ok ();
    ASSERT_EQ (good, expected.has_value ());
    for (int y = 0; y < header.roi.height; y++)
      for (int x = 0; x < header.roi.width; x++) {
        const int column = x - header.first_column, row = y - header.first_row;
        const bool own = column >= 0 && column < header.columns && row >= 0 && row < header.rows;
        const std::uint16_t d = decoded.depth (x, y);
        const Rgbx c = decoded.colour (x, y);
        if (!own) {
          ASSERT_EQ (d, 0xabcd) << x << ", " << y;
          ASSERT_EQ (c.r, 0xef) << x << ", " << y;
          ASSERT_EQ (c.x, 0xef) << x << ", " << y;
        } else if (good) {
          const Shown &e = (*expected)[std::size_t (row * header.columns + column)];
          ASSERT_EQ (d, e.depth) << x << ", " << y;
          ASSERT_EQ (c.r, e.colour.r) << x << ", " << y;
          ASSERT_EQ (c.g, e.colour.g) << x << ", " << y;
          ASSERT_EQ (c.b, e.colour.b) << x << ", " << y;
          valid += d != 0;
        }
      }
    if (good) {
      ASSERT_EQ (counted.points, valid);
    }
  }
};

/* The slice with other bytes behind its header. */
std::vector<std::uint8_t>
with_size (std::vector<std::uint8_t> slice, std::size_t size, std::uint8_t fill = 0)
{
  slice.resize (size, fill);
  slice[2] = static_cast<std::uint8_t> (size);
  slice[3] = static_cast<std::uint8_t> (size >> 8);
  return slice;
}

constexpr EncoderSettings
plain (int depth_bits, int colour_bits, int depth_threshold, int colour_threshold, int size = 1200)
{
  return {depth_bits, colour_bits, depth_threshold, colour_threshold, size, Profile::kPlain};
}

constexpr EncoderSettings kSettings[] = {plain (12, 8, 8, 10), plain (16, 8, 0, 0),
    plain (6, 4, 1, 0), plain (14, 5, 65535, 255), plain (9, 6, 255, 3, 300),
    plain (15, 7, 1, 1, 256), plain (10, 8, 0, 255, 65535)};

} // namespace

TEST_F (PlainRules, code_pictures_of_1_to_70_columns_as_the_rules_say)
{
  for (int width = 1; width <= 70; width++)
    for (Kind kind : kKinds) {
      const auto i = static_cast<unsigned> (width) + 5 * static_cast<unsigned> (kind);
      Pixels pixels = make_pixels (kind, width, 1 + int (i % 11), i);
      encode (pixels, kSettings[i % std::size (kSettings)]);
      ASSERT_FALSE (HasFailure ());
    }
}

TEST_F (PlainRules, code_with_all_bits_and_thresholds_as_the_rules_say)
{
  unsigned seed = 0;
  for (int depth_bits = 6; depth_bits <= 16; depth_bits++)
    for (int colour_bits = 4; colour_bits <= 8; colour_bits++)
      for (auto [depth, colour] : {std::pair{0, 0}, {1, 1}, {8, 255}, {255, 8}, {65535, 2}}) {
        Pixels pixels = make_pixels (kKinds[seed % 3], 37, 9, seed);
        seed++;
        encode (pixels, plain (depth_bits, colour_bits, depth, colour, 400));
        ASSERT_FALSE (HasFailure ());
      }
}

TEST_F (PlainRules, cut_large_pictures_into_the_same_slices)
{
  for (const EncoderSettings &settings : kSettings)
    for (Kind kind : kKinds) {
      Pixels pixels = make_pixels (kind, 320, 61, 3);
      encode (pixels, settings);
      ASSERT_FALSE (HasFailure ());
    }
}

TEST_F (PlainRules, quantise_every_colour_the_same)
{
  for (int colour_bits = 4; colour_bits <= 8; colour_bits++) {
    Pixels pixels = make_pixels (Kind::kFlat, 256, 1, 1);
    for (int x = 0; x < 256; x++) {
      const auto c = static_cast<std::uint8_t> (x);
      pixels.colour (x, 0) = {
          c, static_cast<std::uint8_t> (255 - c), static_cast<std::uint8_t> (c * 7), 1};
    }
    encode (pixels, plain (12, colour_bits, 0, 0));
  }
}

TEST_F (PlainRules, decode_what_was_coded)
{
  for (int width = 1; width <= 70; width++)
    for (Kind kind : kKinds) {
      const auto i = static_cast<unsigned> (width) + 3 * static_cast<unsigned> (kind);
      const EncoderSettings &settings = kSettings[i % std::size (kSettings)];
      Pixels pixels = make_pixels (kind, width, 1 + int (i % 13), i);
      DepthQuantiser depth;
      ASSERT_TRUE (depth.set (view_of (pixels.width, pixels.height), settings.depth_bits).ok ());
      for (const auto &slice : units_of (encode_straight (pixels, settings)))
        ASSERT_NO_FATAL_FAILURE (decode (slice, depth));
    }
}

class PlainDamage : public PlainRules {
protected:
  /* One slice of islands, some rows and columns of its ROI. */
  std::vector<std::uint8_t> slice (const EncoderSettings &settings, int width)
  {
    Pixels pixels = make_pixels (Kind::kIslands, width, 30, 8);
    EXPECT_TRUE (depth_.set (view_of (width, 30), settings.depth_bits).ok ());
    return units_of (encode_straight (pixels, settings))[1];
  }
  DepthQuantiser depth_;
};

TEST_F (PlainDamage, of_every_single_bit_is_judged_as_the_rules_say)
{
  for (const EncoderSettings &settings :
      {plain (14, 8, 8, 10, 256), plain (6, 4, 1, 0, 256), plain (16, 7, 0, 3, 256)}) {
    const auto sound = slice (settings, 45);
    for (std::size_t bit = 8 * kSliceHeaderSize; bit < 8 * sound.size (); bit++) {
      auto damaged = sound;
      damaged[bit / 8] ^= static_cast<std::uint8_t> (1 << bit % 8);
      ASSERT_NO_FATAL_FAILURE (decode (damaged, depth_)) << "bit " << bit;
    }
  }
}

TEST_F (PlainDamage, by_every_other_size_is_judged_as_the_rules_say)
{
  const auto sound = slice (plain (13, 6, 8, 10, 256), 33);
  for (std::size_t size = kSliceHeaderSize; size <= sound.size () + 20; size++)
    for (std::uint8_t fill : {0, 1, 255})
      ASSERT_NO_FATAL_FAILURE (decode (with_size (sound, size, fill), depth_)) << size;
}

TEST_F (PlainDamage, of_random_symbols_is_judged_as_the_rules_say)
{
  std::mt19937 random (4);
  int good = 0;
  for (int round = 0; round < 3000; round++) {
    auto damaged = slice (plain (6 + round % 11, 8 - round % 5, 2, 2, 300), 20 + round % 30);
    SliceHeader header;
    ASSERT_TRUE (read_slice_header (damaged, header).ok ());
    const auto pixels = std::size_t (header.rows) * std::size_t (header.columns);
    /* Runs of symbols, most of them harmless. */
    std::vector<std::uint8_t> body (symbol_bytes (pixels) + 8);
    BitWriter symbols (body.data ());
    std::size_t full = 0;
    for (std::size_t i = 0; i < pixels;) {
      const unsigned kind = random () % 100;
      unsigned symbol = random () % 6;
      if (i == 0 || kind < 20)
        symbol = kFull;
      else if (kind >= 95)
        symbol = 6 + random () % 2;
      for (auto n = 1 + random () % 40; n > 0 && i < pixels; n--, i++) {
        symbols.put (symbol, kSymbolBits);
        full += symbol == kFull;
      }
    }
    body.resize (symbol_bytes (pixels));
    damaged.resize (kSliceHeaderSize);
    damaged.insert (damaged.end (), body.begin (), body.end ());
    const auto bits = full * std::size_t (header.depth_bits + 3 * header.colour_bits);
    damaged =
        with_size (damaged, damaged.size () + (bits + 7) / 8, std::uint8_t (round % 3 ? 0 : 0x31));
    ASSERT_NO_FATAL_FAILURE (decode (damaged, depth_)) << "round " << round;
    good += decode_straight (std::span (damaged).subspan (kSliceHeaderSize), header, depth_)
                .has_value ();
  }
  EXPECT_GT (good, 10);
}
