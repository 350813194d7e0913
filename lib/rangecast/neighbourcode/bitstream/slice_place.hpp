/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Places of slices in their ROI. */
#pragma once

#include <cstdint>
#include <span>

#include "unit.hpp"

namespace rangecast {

inline Roi
place_of (const SliceHeader &h)
{
  return {h.first_column, h.first_row, h.columns, h.rows};
}

inline std::uint64_t
area_of (const Roi &roi)
{
  return static_cast<std::uint64_t> (roi.width) * static_cast<std::uint64_t> (roi.height);
}

/** The elements at the beginning of `all` for which like (element, first element) holds. */
template <typename T, typename Like>
std::span<const T>
leading (std::span<const T> all, const Like &like)
{
  std::size_t n = 0;
  while (n < all.size () && like (all[n].header, all[0].header))
    n++;
  return all.first (n);
}

} // namespace rangecast
