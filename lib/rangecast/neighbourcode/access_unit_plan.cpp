/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Which views there are in an access unit, and where their slices lie. */
#include "access_unit.hpp"

#include <algorithm>
#include <tuple>
#include <utility>

#include "bitstream/slice_place.hpp"

namespace rangecast {

/* What slices of one view agree in, then where they lie, then when they came. */
static auto
sort_key (const SliceHeader &h)
{
  return std::tuple{h.view_id, h.roi.x, h.roi.y, h.roi.width, h.roi.height, h.depth_bits,
      h.inverse_depth, h.colour_bits, h.frame_number, h.reference, h.profile == Profile::kPlain,
      h.first_column, h.first_row, h.columns, h.rows};
}

static bool
agrees (const SliceHeader &a, const SliceHeader &b)
{
  return a.roi == b.roi && a.depth_bits == b.depth_bits && a.inverse_depth == b.inverse_depth &&
         a.colour_bits == b.colour_bits && a.frame_number == b.frame_number &&
         a.reference == b.reference &&
         (a.profile == Profile::kPlain) == (b.profile == Profile::kPlain);
}

/* @return false if there is damage after which nothing can be read */
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

/* Most slices of a view are right, also where a stray one of another frame set came first. */
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

/* An encoder gives no pixel to two slices, and a network repeats packets a few times at most. Of
 * more than that a few bytes each would keep the decoder busy for minutes. */
constexpr std::uint64_t kMaxRepeats = 8;

void
AccessUnitDecoder::limit_pixels (const PlannedView &planned)
{
  std::uint64_t pixels = 0;
  for (PlannedSlice &slice : std::span (&slices_[planned.first_slice], planned.slice_count)) {
    if (slice.too_short)
      continue;
    pixels += static_cast<std::uint64_t> (slice.header.rows) *
              static_cast<std::uint64_t> (slice.header.columns);
    slice.too_short = pixels > kMaxRepeats * planned.coded_pixels;
  }
}

/* An encoder of profile plain gives at most 8/3 pixels a byte, so this is no ROI of which less than
 * nine tenths are lost: it stays as it is, the same from one frame set to the next. In other
 * profiles it may shrink with fewer losses where little moves. */
static constexpr std::uint64_t kMaxPixelsPerByte = 32;

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

/* The slices lie in the order of their columns: one overlaps another before it if that reaches
 * further in a row of both. */
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

bool
AccessUnitDecoder::is_tiled (const PlannedView &planned)
{
  return !planned.overlaps && planned.held_pixels == area_of (planned.roi);
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
