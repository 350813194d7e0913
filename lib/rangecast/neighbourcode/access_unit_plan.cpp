/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Finds the views of an access unit and the places of their slices. */
#include "access_unit.hpp"

#include <algorithm>
#include <tuple>
#include <utility>

#include "bitstream/slice_place.hpp"

namespace rangecast {
namespace {

/* An encoder of profile plain codes at most 8/3 pixels a byte, so a ROI beyond this has lost more
 * than nine tenths; others keep their size from one frame set to the next. In other profiles a ROI
 * may shrink with fewer losses where little moves. */
constexpr std::uint64_t kMaxPixelsPerByte = 32;

/* First the fields in which slices of a view agree, then the order in which they are taken. */
auto
sort_key (const SliceHeader &h)
{
  return std::tuple{h.view_id, h.roi.x, h.roi.y, h.roi.width, h.roi.height, h.depth_bits,
      h.colour_bits, h.frame_number, h.reference, h.first_row};
}

bool
agrees (const SliceHeader &a, const SliceHeader &b)
{
  return a.roi == b.roi && a.depth_bits == b.depth_bits && a.colour_bits == b.colour_bits &&
         a.frame_number == b.frame_number && a.reference == b.reference;
}

} // namespace

/* @return false at damage after which nothing can be read */
bool
AccessUnitDecoder::read_slices (std::span<const std::uint8_t> bytes, DecoderResult &result)
{
  UnitReader units (bytes);
  UnitHeader unit_header;
  while (const auto unit = units.next (unit_header)) {
    if (unit_header.type != static_cast<std::uint8_t> (UnitType::kSlice))
      continue;
    PlannedSlice slice = {*unit, {}, slices_.size (), false};
    if (slices_.size () == kMaxSlices || !decoder_.read_header (*unit, slice.header).ok ()) {
      result.bad_slices++;
      continue;
    }
    slice.too_short = SliceDecoder::smallest_size (slice.header) > unit->size ();
    slices_.push_back (slice);
  }
  return units.status ().ok ();
}

void
AccessUnitDecoder::plan (
    std::span<const std::uint8_t> bytes, DecoderResult &result, bool whole_rois)
{
  slices_.clear ();
  count_ = 0;
  if (!read_slices (bytes, result))
    result.bad_slices++;
  std::ranges::sort (slices_, {}, [] (const PlannedSlice &s) {
    return std::pair{sort_key (s.header), s.arrival};
  });
  for (std::span<const PlannedSlice> rest = slices_; !rest.empty ();) {
    const auto view = leading (rest, [] (auto &a, auto &b) { return a.view_id == b.view_id; });
    plan_view (view, result);
    drop_overlapping (planned_[count_ - 1], result);
    if (!whole_rois)
      crop_to_slices (planned_[count_ - 1]);
    rest = rest.subspan (view.size ());
  }
}

/* The largest group of slices that agree is right, even if a stray slice of another frame set
 * arrived first. */
void
AccessUnitDecoder::plan_view (std::span<const PlannedSlice> slices, DecoderResult &result)
{
  const auto by_arrival = [] (const PlannedSlice &s) { return s.arrival; };
  std::span<const PlannedSlice> best;
  const PlannedSlice *best_first = nullptr;
  for (auto rest = slices; !rest.empty ();) {
    const auto run = leading (rest, agrees);
    const PlannedSlice *first = &*std::ranges::min_element (run, {}, by_arrival);
    if (run.size () > best.size () ||
        (run.size () == best.size () && first->arrival < best_first->arrival)) {
      best = run;
      best_first = first;
    }
    rest = rest.subspan (run.size ());
  }
  result.bad_slices += slices.size () - best.size ();
  const SliceHeader &header = best_first->header;
  planned_[count_++] = {header.view_id, header.roi, header.capture_time_ns,
      static_cast<std::size_t> (best.data () - slices_.data ()), best.size (), header,
      area_of (header.roi), 0};
}

/* Slices come by their first rows, so one overlaps an earlier one if that ends below its first row
 * in a column of both. */
void
AccessUnitDecoder::drop_overlapping (PlannedView &planned, DecoderResult &result)
{
  const std::span<PlannedSlice> slices (&slices_[planned.first_slice], planned.slice_count);
  column_ends_.assign (static_cast<std::size_t> (planned.roi.width), 0);
  const auto dropped = std::ranges::remove_if (slices, [&] (const PlannedSlice &slice) {
    const SliceHeader &h = slice.header;
    const auto ends = std::span (column_ends_)
                          .subspan (static_cast<std::size_t> (h.first_column),
                              static_cast<std::size_t> (h.columns));
    if (slice.too_short || std::ranges::any_of (ends, [&] (int end) { return end > h.first_row; }))
      return true;
    std::ranges::fill (ends, h.first_row + h.rows);
    planned.held_pixels += area_of (place_of (h));
    return false;
  });
  planned.slice_count -= dropped.size ();
  result.bad_slices += dropped.size ();
}

void
AccessUnitDecoder::crop_to_slices (PlannedView &planned)
{
  const std::span<PlannedSlice> slices (&slices_[planned.first_slice], planned.slice_count);
  int left = planned.roi.width, top = planned.roi.height, right = 0, bottom = 0;
  std::uint64_t bytes = 0;
  for (const PlannedSlice &slice : slices) {
    bytes += slice.unit.size ();
    const Roi place = place_of (slice.header);
    left = std::min (left, place.x);
    top = std::min (top, place.y);
    right = std::max (right, place.x + place.width);
    bottom = std::max (bottom, place.y + place.height);
  }
  if (planned.coded_pixels <= kMaxPixelsPerByte * bytes)
    return;
  planned.roi = right == 0
                    ? Roi{}
                    : Roi{planned.roi.x + left, planned.roi.y + top, right - left, bottom - top};
  for (PlannedSlice &slice : slices) {
    slice.header.roi = planned.roi;
    slice.header.first_column -= left;
    slice.header.first_row -= top;
  }
}

} // namespace rangecast
