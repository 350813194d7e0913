/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "decoder.hpp"

#include "bitstream/symbols.hpp"

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

void
SliceDecoder::prepare (const SliceHeader &header)
{
  auto &tables = views_[header.view_id];
  if (depth_of (header))
    return;
  if (!tables)
    tables = std::make_unique<ViewTables> ();
  const View *view = rig_.find (header.view_id);
  const bool good = view && tables->depth.set (*view, header.depth_bits).ok ();
  tables->depth_bits = good ? header.depth_bits : 0;
}

/* @return nullptr if there is no such table */
const DepthQuantiser *
SliceDecoder::depth_of (const SliceHeader &header) const
{
  const auto &tables = views_[header.view_id];
  return tables && tables->depth_bits == header.depth_bits ? &tables->depth : nullptr;
}

Status
SliceDecoder::decode (std::span<const std::uint8_t> unit, const SliceHeader &header,
    const CodingReference &reference, const RangeImage &image, DecodedPixels &decoded,
    SliceMemory &memory) const
{
  if (!(image.roi == header.roi) || image.depth.width != header.roi.width ||
      image.depth.height != header.roi.height)
    return {StatusCode::kBadSize, "slice: its ROI is not that of the other slices of the view"};
  UnitHeader unit_header;
  if (Status s = read_unit_header (unit, unit_header); !s.ok ())
    return s;
  if (unit_header.size < smallest_size (header))
    return {StatusCode::kTruncated, "slice: shorter than its symbols"};
  const auto body = unit.first (unit_header.size).subspan (header_size_of (header));
  if (header.rows == 0)
    return body.empty () ? Status{} : damaged ();
  const DepthQuantiser *depth = depth_of (header);
  const ColourQuantiser &colour = colours_[header.colour_bits - 4];
  CodingReference usable = reference;
  if (!reference.before || !reference.before->serves (header))
    usable.before = nullptr;
  bool good = depth;
  if (depth && header.profile != Profile::kPlain)
    good = memory.compact.decode (body, header, {*depth, colour}, usable, image, decoded);
  else if (depth)
    good = memory.plain.decode (body, header, *depth, colour, image, decoded.points);
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
      return kEntropyHeaderSize + kRansHeaderSize + !header.key;
    default:
      return kSliceHeaderSize + symbol_bytes (rows * static_cast<std::size_t> (header.columns));
  }
}

} // namespace rangecast
