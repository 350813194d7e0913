/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "../geometry/range_image.hpp"

namespace rangecast {

/** A map from pairs of views to T, which has the members `first` and `second`, the view-ids, the
 *  smaller one first. Keeps its memory. */
template <typename T> class ViewPairs {
public:
  ViewPairs () { clear (); }
  void clear ()
  {
    all_.clear ();
    slots_.fill (-1);
  }
  /** The pair, added if it is new. @param a, b  view-ids, different
   *  @param[out] added  set to true if it was added, else untouched */
  T &get (int a, int b, bool *added = nullptr)
  {
    std::int16_t &slot = slots_[place (a, b)];
    if (slot < 0) {
      T pair{};
      pair.first = a < b ? a : b;
      pair.second = a < b ? b : a;
      all_.push_back (pair);
      slot = static_cast<std::int16_t> (all_.size () - 1);
      if (added)
        *added = true;
    }
    return all_[static_cast<std::size_t> (slot)];
  }
  /** The pair, or nullptr. */
  [[nodiscard]] const T *find (int a, int b) const
  {
    const std::int16_t slot = slots_[place (a, b)];
    return slot < 0 ? nullptr : &all_[static_cast<std::size_t> (slot)];
  }
  /** Bit i: view-id i is in a pair. */
  [[nodiscard]] std::uint64_t views () const
  {
    std::uint64_t ids = 0;
    for (const T &pair : all_)
      ids |= std::uint64_t{1} << pair.first | std::uint64_t{1} << pair.second;
    return ids;
  }
  auto begin () { return all_.begin (); }
  auto end () { return all_.end (); }
  auto begin () const { return all_.begin (); }
  auto end () const { return all_.end (); }

private:
  static std::size_t place (int a, int b)
  {
    const auto low = static_cast<std::size_t> (a < b ? a : b),
               high = static_cast<std::size_t> (a < b ? b : a);
    return high * (high - 1) / 2 + low;
  }

  std::vector<T> all_;
  std::array<std::int16_t, kMaxViews *(kMaxViews - 1) / 2> slots_;
};

/** Index of a view among a set of views (bit i: view-id i). */
inline std::size_t
number_among (std::uint64_t views, int view_id)
{
  return static_cast<std::size_t> (std::popcount (views & ((std::uint64_t{1} << view_id) - 1)));
}

} // namespace rangecast
