/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "key_check.hpp"

#include <algorithm>
#include <tuple>

namespace rangecast {
namespace {

/* Slices that memory is kept for: an access unit of far more is not what an encoder makes. */
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

/* Of the view whose slices begin there; an encoder gives no pixel to two slices.
 * @param[in,out] next  then where those of the next view begin */
bool
KeyCheck::is_whole (std::size_t &next) const
{
  const SliceHeader &first = slices_[next];
  const auto area = [] (int width, int height) {
    return static_cast<std::uint64_t> (width) * static_cast<std::uint64_t> (height);
  };
  std::uint64_t covered = 0;
  bool same_roi = true;
  for (std::size_t begin = next; next < slices_.size () && slices_[next].view_id == first.view_id;
       next++) {
    const SliceHeader &slice = slices_[next];
    same_roi = same_roi && slice.roi == first.roi;
    if (next == begin || order_of (slice) != order_of (slices_[next - 1])) /* no repeated one */
      covered += area (slice.columns, slice.rows);
  }
  return same_roi && covered == area (first.roi.width, first.roi.height);
}

bool
KeyCheck::is_key ()
{
  if (!all_key_)
    return false;
  std::ranges::sort (slices_, {}, order_of);
  bool whole = true;
  views_ = 0;
  for (std::size_t next = 0; next < slices_.size (); views_++)
    whole = is_whole (next) && whole;
  return whole;
}

} // namespace rangecast
