/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "reference.hpp"

#include <algorithm>

namespace rangecast {

void
ReferencePlane::begin (const SliceHeader &header)
{
  header_ = header;
  held_ = true;
  pixels_.assign (
      static_cast<std::size_t> (header.roi.width) * static_cast<std::size_t> (header.roi.height),
      kNone);
}

bool
ReferencePlane::serves (const SliceHeader &header) const
{
  const bool plain = header.profile == Profile::kPlain;
  return held_ && !header.key &&
         header.frame_number - header.reference_distance == header_.frame_number &&
         header.depth_bits == header_.depth_bits && header.inverse_depth == header_.inverse_depth &&
         header.colour_bits == header_.colour_bits && plain == (header_.profile == Profile::kPlain);
}

void
ReferencePlane::fetch (int x, int y, std::span<std::uint64_t> to) const
{
  const Roi &roi = header_.roi;
  const int end = x + static_cast<int> (to.size ());
  const int left = std::clamp (roi.x, x, end), right = std::clamp (roi.x + roi.width, left, end);
  if (y < roi.y || y >= roi.y + roi.height || left == right) {
    std::ranges::fill (to, kNone);
    return;
  }
  const std::uint64_t *from =
      pixels_.data () +
      static_cast<std::size_t> (y - roi.y) * static_cast<std::size_t> (roi.width) + (left - roi.x);
  std::fill_n (to.begin (), left - x, kNone);
  std::copy_n (from, right - left, to.begin () + (left - x));
  std::fill (to.begin () + (right - x), to.end (), kNone);
}

void
ReferencePlane::clear (const SliceHeader &slice)
{
  for (int y = slice.first_row; y < slice.first_row + slice.rows; y++)
    std::fill_n (row (y) + slice.first_column, slice.columns, kNone);
}

void
ReferencePair::begin (const SliceHeader &header)
{
  if (!now ().held () || now ().frame_number () != header.frame_number)
    now_ = 1 - now_;
  now ().begin (header);
}

void
ReferencePair::forget ()
{
  for (ReferencePlane &plane : planes_)
    plane.forget ();
}

void
show_older (const DecoderReference &reference, const RangeImage &image, int x, int y)
{
  if (!reference.older)
    return;
  const ConstRangeImage &older = *reference.older;
  const int column = image.roi.x + x - older.roi.x, line = image.roi.y + y - older.roi.y;
  if (column < 0 || line < 0 || column >= older.roi.width || line >= older.roi.height)
    return;
  image.depth.row (y)[x] = older.depth.row (line)[column];
  image.colour.row (y)[x] = older.colour.row (line)[column];
}

} // namespace rangecast
