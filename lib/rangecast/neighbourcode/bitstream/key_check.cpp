/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "key_check.hpp"

#include <algorithm>
#include <tuple>

#include "slice_place.hpp"

namespace rangecast {
namespace {

/* Slices that memory is kept for; no encoder makes access units of far more. */
constexpr std::size_t kMaxKept = 4096;

/* By view, then place. */
auto
order_of (const SliceHeader &s)
{
  return std::tuple (s.view_id, s.first_column, s.first_row, s.columns, s.rows);
}

} // namespace

void
KeyCheck::reset ()
{
  all_key_ = true;
  slices_.clear ();
  if (slices_.capacity () > kMaxKept)
    slices_.shrink_to_fit ();
}

void
KeyCheck::add (const SliceHeader &slice)
{
  all_key_ = all_key_ && slice.key && slices_.size () < kMaxSlices;
  if (all_key_)
    slices_.push_back (slice);
}

/* A view is whole if its slices agree in the ROI and cover it; an encoder codes no pixel in two
 * slices. */
bool
KeyCheck::is_key ()
{
  if (!all_key_)
    return false;
  std::ranges::sort (slices_, {}, order_of);
  bool whole = true;
  views_ = 0;
  for (std::size_t next = 0; next < slices_.size (); views_++) {
    const std::size_t begin = next;
    const SliceHeader &first = slices_[begin];
    std::uint64_t covered = 0;
    for (; next < slices_.size () && slices_[next].view_id == first.view_id; next++) {
      const SliceHeader &slice = slices_[next];
      whole = whole && slice.roi == first.roi;
      if (next == begin || order_of (slice) != order_of (slices_[next - 1])) /* not repeated */
        covered += area_of (place_of (slice));
    }
    whole = whole && covered == area_of (first.roi);
  }
  return whole;
}

} // namespace rangecast
