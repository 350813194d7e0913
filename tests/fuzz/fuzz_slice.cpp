/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Any bytes as one slice of any profile, under a header that is sound: decoded into an image of
 * exactly the ROI's size, with or without an earlier frame set. The first bytes say what header and
 * what earlier frame set there are (struct Ask), so that the others are read as pixels. */
#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <rangecast/base/cpu.hpp>
#include <rangecast/neighbourcode/access_unit.hpp>
#include <rangecast/neighbourcode/bitstream/symbols.hpp>

using namespace rangecast;

static constexpr int kWidth = 80, kHeight = 64;
static constexpr std::uint16_t kUntouched = 0xabcd;
static constexpr Rgbx kUntouchedColour = {1, 2, 3, 4};
static constexpr std::uint8_t kRightSize = 1, kLongest = 255; /* Ask::length */

/* The first bytes; others take the nearest that makes sense. */
struct Ask {
  std::uint8_t profile; /* bits 0-1; 4: no key; 8: reference; 32: once */
  std::uint8_t earlier; /* bits 0-1: none, same ROI, other ROI, does not serve; from 2: how known */
  std::uint8_t depth;   /* bits - 6 */
  std::uint8_t colour;  /* bits - 4 */
  std::uint8_t width, height, x, y;        /* of the ROI, less 1 where it cannot be 0 */
  std::uint8_t columns, rows, column, row; /* of the slice */
  std::uint8_t distance;
  std::uint8_t length; /* kRightSize: cut or filled for plain; kLongest: repeated */
};

/* A view for each number of depth bits: tables are kept by view. */
static Rig
views_of_all_depths ()
{
  Rig rig;
  for (int id = 0; id < 11; id++) {
    View view;
    view.id = id;
    view.width = kWidth;
    view.height = kHeight;
    view.intrinsics = {60, 60, 39.5, 31.5};
    rig.views.push_back (view);
  }
  return rig;
}

struct Decoder : SliceDecoder {
  SliceMemory memory;
};

static Decoder *
make_decoder ()
{
  auto made = new Decoder;
  if (!made->set_rig (views_of_all_depths ()).ok ())
    std::abort ();
  return made;
}

static void
expect (bool fact)
{
  if (!fact)
    std::abort ();
}

/* Bytes of a plain slice with as many full pixels as its symbols ask for. */
static std::size_t
size_of_slice (const SliceHeader &header, std::span<const std::uint8_t> body)
{
  const auto pixels = std::size_t (header.rows) * std::size_t (header.columns);
  const LittleEndianBits symbols (body.first (std::min (body.size (), symbol_bytes (pixels))));
  std::size_t full = 0;
  for (std::size_t i = 0; i < pixels && i * kSymbolBits < 8 * body.size (); i++)
    full += (symbols.from (i * kSymbolBits) & 7) == kFull;
  const auto bits = std::size_t (header.depth_bits + 3 * header.colour_bits);
  return std::min (
      header_size_of (header) + symbol_bytes (pixels) + (full * bits + 7) / 8, kMaxUnitSize);
}

static SliceHeader
make_header (const Ask &ask)
{
  const auto at_most = [] (int value, int most) { return value % (most + 1); };
  SliceHeader header;
  header.profile = Profile{static_cast<std::uint8_t> (at_most (ask.profile & 3, 2))};
  const bool plain = header.profile == Profile::kPlain;
  header.key = plain || !(ask.profile & 4);
  header.reference = !plain && ask.profile & 8;
  header.depth_bits = static_cast<std::uint8_t> (6 + at_most (ask.depth & 127, 10));
  header.colour_bits = static_cast<std::uint8_t> (4 + at_most (ask.colour, 4));
  header.view_id = static_cast<std::uint8_t> (header.depth_bits - 6);
  header.frame_number = 100;
  header.reference_distance =
      header.key ? std::uint8_t{0} : std::max (ask.distance, std::uint8_t{1});
  header.roi.width = 1 + at_most (ask.width, kWidth - 1);
  header.roi.height = 1 + at_most (ask.height, kHeight - 1);
  header.roi.x = at_most (ask.x, kWidth - header.roi.width);
  header.roi.y = at_most (ask.y, kHeight - header.roi.height);
  header.columns = 1 + at_most (ask.columns, header.roi.width - 1);
  header.rows = 1 + at_most (ask.rows, header.roi.height - 1);
  header.first_column = at_most (ask.column, header.roi.width - header.columns);
  header.first_row = at_most (ask.row, header.roi.height - header.rows);
  return header;
}

static std::vector<std::uint8_t>
make_slice (const SliceHeader &header, std::uint8_t length, std::span<const std::uint8_t> body)
{
  std::vector<std::uint8_t> unit (header_size_of (header));
  unit.insert (unit.end (), body.begin (), body.end ());
  if (length == kRightSize && header.profile == Profile::kPlain)
    unit.resize (size_of_slice (header, body));
  if (length == kLongest && !body.empty ()) {
    const std::size_t short_size = unit.size ();
    unit.resize (kMaxUnitSize);
    std::size_t filled = short_size;
    for (std::size_t period = body.size (); filled < unit.size (); period *= 2) {
      const std::size_t count = std::min (period, unit.size () - filled);
      std::memcpy (unit.data () + filled, unit.data () + filled - period, count);
      filled += count;
    }
  }
  unit.shrink_to_fit (); /* or reading too far would not be seen */
  write_slice_header (header, unit.size (), unit.data ());
  return unit;
}

/* A pixel as a decoder could have kept it. */
static std::uint64_t
earlier_pixel (const SliceHeader &header, std::uint32_t random)
{
  const std::int32_t most = (1 << header.colour_bits) - 1;
  const auto chroma = [&] (int shift) {
    return static_cast<std::int32_t> (random >> shift & 0x1ff) % (2 * most + 1) - most;
  };
  const auto depth = static_cast<std::int32_t> (random % 64); /* of all bits */
  return pack_components (Components{depth,
      static_cast<std::int32_t> (random >> 6 & 0xff) % (most + 1), chroma (14), chroma (23)});
}

/* An earlier frame set that the slice may refer to, of made-up pixels. */
static void
fill_earlier (const Ask &ask, SliceHeader header, ReferencePlane &plane)
{
  const int kind = ask.earlier & 3;
  header.frame_number -= header.reference_distance;
  header.colour_bits =
      kind == 3 ? static_cast<std::uint8_t> (12 - header.colour_bits) : header.colour_bits;
  if (kind == 2)
    header.roi = {kWidth / 4, kHeight / 4, kWidth / 2, kHeight / 2};
  plane.begin (header);
  std::uint32_t random = 12345u + ask.earlier;
  for (int y = 0; y < header.roi.height; y++)
    for (int x = 0; x < header.roi.width; x++) {
      random = random * 1664525u + 1013904223u;
      const bool empty = (random >> 8 & 15) == 0;
      const std::uint64_t pixel =
          empty ? kEmptyPixel : earlier_pixel (header, random >> 3 ^ random << 13);
      if (random >> 26 >= static_cast<std::uint32_t> (ask.earlier >> 2)) /* else unknown */
        plane.keep (header.roi.x + x, header.roi.y + y, {&pixel, 1});
    }
}

/* What a slice is decoded into. */
struct Picture {
  std::vector<std::uint16_t> depth;
  std::vector<Rgbx> colour;
  ReferencePlane kept;
  DecodedPixels decoded;
  bool good = false;

  void decode (Decoder &decoder, std::span<const std::uint8_t> unit, const SliceHeader &header,
      const ReferencePlane *before)
  {
    const int width = header.roi.width, height = header.roi.height;
    depth.assign (std::size_t (width) * std::size_t (height), kUntouched);
    colour.assign (depth.size (), kUntouchedColour);
    const RangeImage image = {header.view_id, header.roi, {depth.data (), width, height, width * 2},
        {colour.data (), width, height, width * 4}, 0};
    if (header.reference)
      kept.begin (header);
    decoder.prepare (header);
    good = decoder
               .decode (unit, header, {before, header.reference ? &kept : nullptr}, image, decoded,
                   decoder.memory)
               .ok ();
  }
};

static bool
same_colour (const Rgbx &a, const Rgbx &b)
{
  return std::memcmp (&a, &b, sizeof a) == 0;
}

static std::uint64_t
kept_at (const SliceHeader &header, const Picture &picture, int x, int y)
{
  return picture.kept.at (header.roi.x + x, header.roi.y + y);
}

/* Nothing outside the slice may have changed, and what is inside is what was counted. */
static void
check_picture (const SliceHeader &header, Picture &picture)
{
  const auto width = static_cast<std::size_t> (header.roi.width);
  std::uint64_t valid = 0, kept = 0;
  for (int y = 0; y < header.roi.height; y++)
    for (int x = 0; x < header.roi.width; x++) {
      const std::size_t i = std::size_t (y) * width + std::size_t (x);
      const std::uint64_t at = header.reference ? kept_at (header, picture, x, y) : kNoPixel;
      const bool is_empty = header.profile != Profile::kPlain && at == kEmptyPixel;
      if (y >= header.first_row && y < header.first_row + header.rows && x >= header.first_column &&
          x < header.first_column + header.columns) {
        valid += picture.depth[i] != kInvalidDepth;
        kept += at != kNoPixel && !is_empty;
      } else {
        expect (picture.depth[i] == kUntouched && at == kNoPixel &&
                same_colour (picture.colour[i], kUntouchedColour));
      }
    }
  const DecodedPixels &decoded = picture.decoded;
  const auto pixels =
      static_cast<std::uint64_t> (header.rows) * static_cast<std::uint64_t> (header.columns);
  expect (decoded.points + decoded.unknown <= pixels && !(header.key && decoded.unknown));
  if (!picture.good)
    return;
  expect (valid == decoded.points);
  expect (!header.reference || kept == decoded.points);
}

/* The same by another decoder, which has code for every CPU and another history. */
static void
check_same (const SliceHeader &header, Picture &a, Picture &b)
{
  expect (a.good == b.good);
  if (!a.good)
    return;
  expect (a.depth == b.depth && a.decoded.points == b.decoded.points &&
          a.decoded.unknown == b.decoded.unknown);
  for (std::size_t i = 0; i < a.colour.size (); i++)
    expect (a.depth[i] == kInvalidDepth || same_colour (a.colour[i], b.colour[i]));
  for (int y = 0; header.reference && y < header.roi.height; y++)
    for (int x = 0; x < header.roi.width; x++)
      expect (kept_at (header, a, x, y) == kept_at (header, b, x, y));
}

extern "C" int
LLVMFuzzerTestOneInput (const std::uint8_t *data, std::size_t size)
{
  static Decoder &decoder = *make_decoder (), &other = *make_decoder ();
  Ask ask;
  if (size < sizeof ask || size > kMaxUnitSize - kSliceHeaderSize)
    return 0;
  std::memcpy (&ask, data, sizeof ask);
  const SliceHeader wanted = make_header (ask);
  const auto unit = make_slice (wanted, ask.length, {data + sizeof ask, size - sizeof ask});
  SliceHeader header;
  expect (decoder.read_header (unit, header).ok ());
  ReferencePlane before;
  const bool has_before = !header.key && ask.earlier & 3;
  if (has_before)
    fill_earlier (ask, header, before);
  Picture picture, again;
  picture.decode (decoder, unit, header, has_before ? &before : nullptr);
  check_picture (header, picture);
  if (ask.profile & 32) /* the other decoder's history becomes another one */
    return 0;
  limit_cpu (CpuLevel::kScalar);
  again.decode (other, unit, header, has_before ? &before : nullptr);
  limit_cpu (kCpuLevels[std::size (kCpuLevels) - 1]);
  check_same (header, picture, again);
  return 0;
}
