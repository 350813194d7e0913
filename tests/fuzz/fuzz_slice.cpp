/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Any bytes as one slice, under the header fields that they say: decoded into an image of exactly
 * the ROI's size, of which nothing beyond the slice's rows and columns may change. */
#include <algorithm>
#include <cstdlib>
#include <rangecast/neighbourcode/access_unit.hpp>
#include <rangecast/neighbourcode/symbols.hpp>

using namespace rangecast;

static constexpr int kWidth = 80, kHeight = 60;
static constexpr std::uint16_t kUntouched = 0xabcd;

static Rig
one_view ()
{
  View view;
  view.width = kWidth;
  view.height = kHeight;
  view.intrinsics = {60, 60, 39.5, 29.5};
  return {{view}};
}

/* Bytes of a slice with as many full pixels as its symbols ask for. */
static std::size_t
size_of_slice (const SliceHeader &header, std::span<const std::uint8_t> body)
{
  const auto pixels = std::size_t (header.rows) * std::size_t (header.columns);
  BitReader symbols (body.data (), std::min (body.size (), symbol_bytes (pixels)));
  std::size_t full = 0;
  for (std::size_t i = 0; i < pixels; i++)
    full += symbols.get (kSymbolBits) == kFull;
  const auto bits = std::size_t (header.depth_bits + 3 * header.colour_bits);
  return std::min (kSliceHeaderSize + symbol_bytes (pixels) + (full * bits + 7) / 8, kMaxUnitSize);
}

/* Makes a header that is sound of the first bytes, so that the others are read as symbols. */
static std::vector<std::uint8_t>
make_slice (std::span<const std::uint8_t> data)
{
  const auto at_most = [&] (
                           std::size_t i, int most) { return most > 0 ? data[i] % (most + 1) : 0; };
  SliceHeader header;
  header.depth_bits = static_cast<std::uint8_t> (6 + at_most (0, 10));
  header.colour_bits = static_cast<std::uint8_t> (4 + at_most (1, 4));
  header.inverse_depth = data[1] & 0x80;
  header.roi.width = 1 + at_most (2, kWidth - 1);
  header.roi.height = 1 + at_most (3, kHeight - 1);
  header.roi.x = at_most (4, kWidth - header.roi.width);
  header.roi.y = at_most (5, kHeight - header.roi.height);
  header.columns = 1 + at_most (6, header.roi.width - 1);
  header.rows = 1 + at_most (7, header.roi.height - 1);
  header.first_column = at_most (8, header.roi.width - header.columns);
  header.first_row = at_most (9, header.roi.height - header.rows);
  const auto body = data.subspan (10);
  const bool right_size = data[0] & 0x80;
  std::vector<std::uint8_t> unit (kSliceHeaderSize);
  unit.insert (unit.end (), body.begin (), body.end ());
  if (right_size)
    unit.resize (size_of_slice (header, body));
  write_slice_header (header, unit.size (), unit.data ());
  return unit;
}

static void
check_untouched (const SliceHeader &header, ImageView<const std::uint16_t> depth)
{
  for (int y = 0; y < header.roi.height; y++)
    for (int x = 0; x < header.roi.width; x++) {
      const bool own = y >= header.first_row && y < header.first_row + header.rows &&
                       x >= header.first_column && x < header.first_column + header.columns;
      if (!own && depth.row (y)[x] != kUntouched)
        std::abort ();
    }
}

extern "C" int
LLVMFuzzerTestOneInput (const std::uint8_t *data, std::size_t size)
{
  static SliceDecoder &decoder = *[] {
    auto made = new SliceDecoder;
    if (!made->set_rig (one_view ()).ok ())
      std::abort ();
    return made;
  }();
  if (size < 10 || size > kMaxUnitSize - kSliceHeaderSize)
    return 0;
  const auto unit = make_slice ({data, size});
  SliceHeader header;
  if (!decoder.read_header (unit, header).ok ())
    std::abort ();
  const int width = header.roi.width, height = header.roi.height;
  std::vector<std::uint16_t> depth (std::size_t (width) * std::size_t (height), kUntouched);
  std::vector<Rgbx> colour (depth.size ());
  const RangeImage image = {0, header.roi, {depth.data (), width, height, width * 2},
      {colour.data (), width, height, width * 4}, 0};
  DecodedPixels decoded;
  const bool good = decoder.decode (unit, header, {}, image, decoded).ok ();
  check_untouched (header, {depth.data (), width, height, width * 2});
  if (good && decoded.points > static_cast<std::uint64_t> (header.rows) *
                           static_cast<std::uint64_t> (header.columns))
    std::abort ();
  return 0;
}
