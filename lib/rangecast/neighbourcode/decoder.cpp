/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "decoder.hpp"

#include "symbols.hpp"

namespace rangecast {
namespace {

Status
damaged ()
{
  return {StatusCode::kBadData, "slice: its symbols are damaged"};
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
  const bool good = plain_.decode (unit.first (size).subspan (kSliceHeaderSize), header, *depth,
      colours_[header.colour_bits - 4], image, decoded.points);
  return good ? Status{} : damaged ();
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
