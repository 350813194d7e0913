/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "reference.hpp"

#include <algorithm>
#include <atomic>

namespace rangecast {

void
ReferencePlane::begin (const SliceHeader &header)
{
  for (std::size_t line = 0; line < written_.size (); line++)
    if (written_[line])
      std::fill_n (row (static_cast<int> (line)), header_.roi.width, std::uint64_t{0});
  header_ = header;
  const auto height = static_cast<std::size_t> (header.roi.height);
  const std::size_t need = static_cast<std::size_t> (header.roi.width) * height;
  if (need > capacity_) {
    pixels_.reset (static_cast<std::uint64_t *> (std::calloc (need, sizeof (std::uint64_t))));
    capacity_ = pixels_ ? need : 0;
  }
  held_ = need <= capacity_;
  written_.assign (held_ ? height : 0, 0);
}

bool
ReferencePlane::serves (const SliceHeader &header) const
{
  return held_ && !header.key &&
         header.frame_number - header.reference_distance == header_.frame_number &&
         header.depth_bits == header_.depth_bits && header.colour_bits == header_.colour_bits;
}

void
ReferencePlane::keep (int x, int y, std::span<const std::uint64_t> pixels)
{
  const int line = y - header_.roi.y, column = x - header_.roi.x;
  if (!held_ || line < 0 || line >= header_.roi.height || column < 0 ||
      column + static_cast<int> (pixels.size ()) > header_.roi.width)
    return;
  std::atomic_ref (written_[static_cast<std::size_t> (line)]).store (1, std::memory_order_relaxed);
  std::ranges::transform (pixels, row (line) + column, [] (std::uint64_t p) { return ~p; });
}

void
ReferencePlane::fetch (int x, int y, std::span<std::uint64_t> to, std::uint64_t outside) const
{
  const Roi &roi = header_.roi;
  const int end = x + static_cast<int> (to.size ());
  const int left = std::clamp (roi.x, x, end), right = std::clamp (roi.x + roi.width, left, end);
  if (!held_) {
    std::ranges::fill (to, kNone);
    return;
  }
  if (y < roi.y || y >= roi.y + roi.height || left == right) {
    std::ranges::fill (to, outside);
    return;
  }
  const std::uint64_t *from = row (y - roi.y) + (left - roi.x);
  std::fill_n (to.begin (), left - x, outside);
  std::transform (
      from, from + (right - left), to.begin () + (left - x), [] (std::uint64_t p) { return ~p; });
  std::fill (to.begin () + (right - x), to.end (), outside);
}

void
ReferencePlane::clear (const SliceHeader &slice)
{
  const int line = slice.roi.y + slice.first_row - header_.roi.y;
  const int column = slice.roi.x + slice.first_column - header_.roi.x;
  if (!held_ || line < 0 || line + slice.rows > header_.roi.height || column < 0 ||
      column + slice.columns > header_.roi.width)
    return;
  for (int i = line; i < line + slice.rows; i++) /* slices side by side share rows */
    if (std::atomic_ref (written_[static_cast<std::size_t> (i)]).load (std::memory_order_relaxed))
      std::fill_n (row (i) + column, slice.columns, std::uint64_t{0});
}

void
ReferencePair::begin (const SliceHeader &header)
{
  /* Later frame sets do not refer to one that arrives late or again. When an encoder restarts, its
   * numbers jump by more than that. */
  constexpr std::uint32_t kOld = 255;
  keeps_ = !now ().held () || now ().frame_number () - header.frame_number > kOld;
  if (!keeps_)
    return;
  now_ = 1 - now_;
  planes_[now_].begin (header);
}

void
ReferencePair::reset ()
{
  for (ReferencePlane &plane : planes_)
    plane.reset ();
}

} // namespace rangecast
