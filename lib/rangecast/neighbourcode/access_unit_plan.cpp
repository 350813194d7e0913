/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Finds the views of an access unit and the places of their slices. */
#include "access_unit.hpp"

#include <algorithm>
#include <tuple>
#include <utility>

#include "bitstream/slice_place.hpp"

namespace rangecast {
namespace {

/* An encoder codes no pixel in two slices, and a network repeats packets a few times at most. A few
 * bytes each of more would keep the decoder busy for minutes. */
constexpr std::uint64_t kMaxRepeats = 8;

/* An encoder of profile plain codes at most 8/3 pixels a byte, so a ROI beyond this has lost more
 * than nine tenths; others keep their size from one frame set to the next. In other profiles a ROI
 * may shrink with fewer losses where little moves. */
constexpr std::uint64_t kMaxPixelsPerByte = 32;

/* First the fields in which slices of a view agree, then their place. */
auto
sort_key (const SliceHeader &h)
{
  return std::tuple{h.view_id, h.roi.x, h.roi.y, h.roi.width, h.roi.height, h.depth_bits,
      h.inverse_depth, h.colour_bits, h.frame_number, h.reference, h.profile == Profile::kPlain,
      h.first_column, h.first_row, h.columns, h.rows};
}

bool
agrees (const SliceHeader &a, const SliceHeader &b)
{
  return a.roi == b.roi && a.depth_bits == b.depth_bits && a.inverse_depth == b.inverse_depth &&
         a.colour_bits == b.colour_bits && a.frame_number == b.frame_number &&
         a.reference == b.reference &&
         (a.profile == Profile::kPlain) == (b.profile == Profile::kPlain);
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
    std::span<const std::span<const std::uint8_t>> pieces, DecoderResult &result, bool whole_rois)
{
  slices_.clear ();
  count_ = 0;
  for (const auto piece : pieces)
    if (!read_slices (piece, result)) {
      result.bad_slices++;
      break;
    }
  std::ranges::sort (slices_, {}, [] (const PlannedSlice &s) {
    return std::pair{sort_key (s.header), s.arrival};
  });
  for (std::span<const PlannedSlice> rest = slices_; !rest.empty ();) {
    const auto view = leading (rest, [] (auto &a, auto &b) { return a.view_id == b.view_id; });
    plan_view (view, result);
    if (!whole_rois)
      crop_to_slices (planned_[count_ - 1]);
    find_overlaps (planned_[count_ - 1]);
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
      area_of (header.roi), 0, false};
  limit_pixels (planned_[count_ - 1]);
}

void
AccessUnitDecoder::limit_pixels (const PlannedView &planned)
{
  std::uint64_t pixels = 0;
  for (PlannedSlice &slice : std::span (&slices_[planned.first_slice], planned.slice_count)) {
    if (slice.too_short)
      continue;
    pixels += area_of (place_of (slice.header));
    slice.too_short = pixels > kMaxRepeats * planned.coded_pixels;
  }
}

void
AccessUnitDecoder::crop_to_slices (PlannedView &planned)
{
  const std::span<PlannedSlice> slices (&slices_[planned.first_slice], planned.slice_count);
  int left = planned.roi.width, top = planned.roi.height, right = 0, bottom = 0;
  std::uint64_t bytes = 0;
  for (const PlannedSlice &slice : slices) {
    bytes += slice.unit.size ();
    if (slice.too_short)
      continue;
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

/* Slices are sorted by their columns: one overlaps an earlier one if that reaches beyond its first
 * column in a row of both. */
void
AccessUnitDecoder::find_overlaps (PlannedView &planned)
{
  row_ends_.assign (static_cast<std::size_t> (planned.roi.height), 0);
  const SliceHeader *last = nullptr;
  for (std::size_t i = 0; i < planned.slice_count; i++) {
    const PlannedSlice &slice = slices_[planned.first_slice + i];
    const SliceHeader &h = slice.header;
    if (slice.too_short || (last && same_place (h, *last)))
      continue;
    for (int &end : std::span (row_ends_).subspan (
             static_cast<std::size_t> (h.first_row), static_cast<std::size_t> (h.rows))) {
      planned.overlaps |= end > h.first_column;
      end = h.first_column + h.columns;
    }
    planned.held_pixels += area_of (place_of (h));
    last = &h;
  }
}

std::uint64_t
AccessUnitDecoder::missing_pixels (std::size_t view) const
{
  const PlannedView &planned = planned_[view];
  if (!planned.overlaps || planned.coded_pixels > planned.held_pixels)
    return planned.coded_pixels - planned.held_pixels;
  return 1;
}

} // namespace rangecast
