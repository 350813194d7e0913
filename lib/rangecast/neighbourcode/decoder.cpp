/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "decoder.hpp"

#include <algorithm>

#include "symbols.hpp"

namespace rangecast {
namespace {

/* A decoded pixel: depth in bits 0 to 15, R, G, B above it. 0 is an invalid one. */
constexpr std::uint64_t
pack (std::uint16_t depth, std::uint8_t r, std::uint8_t g, std::uint8_t b)
{
  return depth | std::uint64_t{r} << 16 | std::uint64_t{g} << 24 | std::uint64_t{b} << 32;
}

Status
damaged ()
{
  return {StatusCode::kBadData, "slice: its symbols are damaged"};
}

/* Full pixels of one slice. */
struct FullPixels {
  BitReader bits;
  const DepthQuantiser &depth;
  const ColourQuantiser &colour;
  int depth_bits;

  /* 0 if there is no such depth or no such pixel. */
  std::uint64_t next ()
  {
    const std::uint64_t value = bits.get (depth_bits + 3 * colour.bits ());
    const auto code = static_cast<std::uint32_t> (value & ((1u << depth_bits) - 1));
    if (code >= static_cast<std::uint32_t> (depth.codes ()) || bits.exhausted ())
      return 0;
    const unsigned mask = (1u << colour.bits ()) - 1;
    const auto channel = [&] (int i) {
      return colour.value (
          static_cast<std::uint8_t> (value >> (depth_bits + i * colour.bits ()) & mask));
    };
    return pack (
        depth.depth (static_cast<std::uint16_t> (code)), channel (0), channel (1), channel (2));
  }
};

/* Decodes one row into `row` (columns pixels, one invalid pixel before and after). */
bool
decode_row (BitReader &symbols, FullPixels &full, const std::uint64_t *upper, std::uint64_t *row,
    int columns)
{
  for (int x = 0; x < columns; x++) {
    std::uint64_t pixel = 0;
    const auto symbol = symbols.get (kSymbolBits);
    switch (symbol) {
      case kLeft:
        pixel = row[x - 1];
        break;
      case kUpperLeft:
      case kUpper:
      case kUpperRight:
        pixel = upper[x + int (symbol) - kUpper];
        break;
      case kFull:
        pixel = full.next ();
        break;
      case kInvalid:
        row[x] = 0;
        continue;
      default:
        return false;
    }
    if (pixel == 0) /* refers to an invalid pixel, or is not there */
      return false;
    row[x] = pixel;
  }
  return true;
}

std::uint64_t
write_row (const std::uint64_t *row, int columns, std::uint16_t *depth, Rgbx *colour)
{
  std::uint64_t points = 0;
  for (int x = 0; x < columns; x++) {
    const std::uint64_t p = row[x];
    depth[x] = static_cast<std::uint16_t> (p);
    colour[x] = {static_cast<std::uint8_t> (p >> 16), static_cast<std::uint8_t> (p >> 24),
        static_cast<std::uint8_t> (p >> 32), 0};
    points += p != 0;
  }
  return points;
}

} // namespace

Status
SliceDecoder::set_rig (const Rig &rig)
{
  if (Status s = validate (rig); !s.ok ())
    return s;
  rig_ = rig;
  for (auto &view : views_)
    view.reset ();
  return {};
}

Status
SliceDecoder::read_header (std::span<const std::uint8_t> unit, SliceHeader &header) const
{
  if (Status s = read_slice_header (unit, header); !s.ok ())
    return s;
  const View *view = rig_.find (header.view_id);
  if (!view)
    return {StatusCode::kNotFound,
        "slice: view " + std::to_string (header.view_id) + " is not in the rig"};
  if (header.roi.x + header.roi.width > view->width ||
      header.roi.y + header.roi.height > view->height)
    return {StatusCode::kBadData,
        "slice: its ROI does not lie in the image of view " + std::to_string (header.view_id)};
  return {};
}

const DepthQuantiser *
SliceDecoder::depth_of (const SliceHeader &header)
{
  auto &tables = views_[header.view_id];
  if (!tables)
    tables = std::make_unique<ViewTables> ();
  if (tables->depth_bits != header.depth_bits || tables->inverse != header.inverse_depth) {
    const View *view = rig_.find (header.view_id);
    const auto scale = header.inverse_depth ? DepthScale::kInverse : DepthScale::kLinear;
    if (!view || !tables->depth.set (*view, header.depth_bits, scale).ok ())
      return nullptr;
    tables->depth_bits = header.depth_bits;
    tables->inverse = header.inverse_depth;
  }
  return &tables->depth;
}

Status
SliceDecoder::decode (std::span<const std::uint8_t> unit, const SliceHeader &header,
    const DecoderReference &reference, const RangeImage &image, DecodedPixels &decoded)
{
  if (!(image.roi == header.roi) || image.depth.width != header.roi.width ||
      image.depth.height != header.roi.height)
    return {StatusCode::kBadSize, "slice: its ROI is not that of the other slices of the view"};
  const auto pixels =
      static_cast<std::size_t> (header.rows) * static_cast<std::size_t> (header.columns);
  UnitHeader unit_header;
  if (Status s = read_unit_header (unit, unit_header); !s.ok ())
    return s;
  const std::size_t size = unit_header.size, symbols_size = symbol_bytes (pixels);
  if (header.profile != Profile::kPlain && pixels > 0 && size >= header_size_of (header)) {
    const DepthQuantiser *quantiser = depth_of (header);
    const bool serves = reference.before && reference.before->serves (header);
    const bool good =
        quantiser && compact_.decode (unit.first (size).subspan (header_size_of (header)), header,
                         {*quantiser, colours_[header.colour_bits - 4]},
                         {serves ? reference.before : nullptr, reference.now}, image, decoded);
    return good ? Status{} : damaged ();
  }
  if (size < kSliceHeaderSize || symbols_size > size - kSliceHeaderSize)
    return {StatusCode::kTruncated, "slice: shorter than its symbols"};
  if (!header.key)
    return {StatusCode::kUnsupported, "slice: profile plain without key"};
  if (pixels == 0)
    return size == kSliceHeaderSize ? Status{} : damaged ();
  const DepthQuantiser *depth = depth_of (header);
  if (!depth)
    return damaged ();

  const std::uint8_t *data = unit.data () + kSliceHeaderSize;
  BitReader symbols (data, symbols_size);
  FullPixels full = {BitReader (data + symbols_size, size - kSliceHeaderSize - symbols_size),
      *depth, colours_[header.colour_bits - 4], header.depth_bits};
  const auto padded = static_cast<std::size_t> (header.columns) + 2;
  rows_.assign (std::max (rows_.size (), 2 * padded), 0);
  std::uint64_t *row = rows_.data () + 1, *upper = row + padded;
  for (int y = 0; y < header.rows; y++) {
    if (!decode_row (symbols, full, upper, row, header.columns))
      return damaged ();
    const int image_row = header.first_row + y;
    decoded.points +=
        write_row (row, header.columns, image.depth.row (image_row) + header.first_column,
            image.colour.row (image_row) + header.first_column);
    std::swap (row, upper);
  }
  return symbols.at_clean_end () && full.bits.at_clean_end () ? Status{} : damaged ();
}

std::size_t
SliceDecoder::smallest_size (const SliceHeader &header)
{
  const auto rows = static_cast<std::size_t> (header.rows);
  if (rows == 0)
    return kSliceHeaderSize;
  switch (header.profile) {
    case Profile::kPacked:
      return kPackedHeaderSize + !header.key +
             (2 * rows + 7) / 8; /* a row is one run at least: two bits */
    case Profile::kEntropy:
      return kEntropyHeaderSize + !header.key; /* zeros at the end are left out */
    default:
      return kSliceHeaderSize + symbol_bytes (rows * static_cast<std::size_t> (header.columns));
  }
}

} // namespace rangecast
