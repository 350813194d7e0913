/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "connected_components.hpp"

#include <algorithm>
#include <cstdlib>
#include <cstring>

namespace rangecast {

void
ConnectedComponents::clear ()
{
  runs_.clear ();
  rows_.assign (1, 0);
}

void
ConnectedComponents::add (int x0, int x1)
{
  runs_.push_back ({x0, x1, static_cast<int> (runs_.size ()), x1 - x0});
}

int
ConnectedComponents::find_root (int run)
{
  const auto root_of = [this] (int i) -> int & { return runs_[static_cast<std::size_t> (i)].root; };
  while (root_of (run) != run)
    run = root_of (run) = root_of (root_of (run));
  return run;
}

void
ConnectedComponents::join (int one, int other)
{
  one = find_root (one);
  other = find_root (other);
  if (one == other)
    return;
  runs_[static_cast<std::size_t> (other)].root = one;
  runs_[static_cast<std::size_t> (one)].size += runs_[static_cast<std::size_t> (other)].size;
}

/* Joins the runs of the last row with those of the row before that have columns in common, or are
 * at most `reach` columns beside, where touch (x0, x1) says so of the common columns. */
template <typename Touch>
void
ConnectedComponents::join_rows (int reach, const Touch &touch)
{
  const std::size_t n = rows_.size ();
  if (n < 3)
    return;
  const std::size_t end = rows_[n - 1];
  std::size_t a = rows_[n - 3], b = rows_[n - 2];
  for (const std::size_t a_end = b; a < a_end && b < end;) {
    const int x0 = std::max (runs_[a].x0, runs_[b].x0), x1 = std::min (runs_[a].x1, runs_[b].x1);
    if (x0 < x1 + reach && touch (x0, x1))
      join (static_cast<int> (a), static_cast<int> (b));
    runs_[a].x1 <= runs_[b].x1 ? a++ : b++;
  }
}

void
ConnectedComponents::add_mask_row (const std::uint8_t *mask, int width)
{
  const std::uint8_t *at = mask, *end = mask + width;
  while (at < end) {
    const auto find = [&] (int value) {
      const void *found = std::memchr (at, value, static_cast<std::size_t> (end - at));
      return found ? static_cast<const std::uint8_t *> (found) : end;
    };
    at = find (255);
    if (at == end)
      break;
    const auto x0 = static_cast<int> (at - mask);
    at = find (0);
    add (x0, static_cast<int> (at - mask));
  }
  add_empty_row (); /* ends it */
  join_rows (1, [] (int, int) { return true; });
}

void
ConnectedComponents::add_level_row (
    const std::int16_t *level, const std::int16_t *above, int x0, int x1, int min, int range)
{
  for (int x = x0; x < x1;) {
    if (level[x] < min) {
      x++;
      continue;
    }
    const int begin = x++;
    while (x < x1 && level[x] >= min && std::abs (level[x] - level[x - 1]) <= range)
      x++;
    add (begin, x);
  }
  add_empty_row ();
  join_rows (0, [&] (int from, int to) {
    for (int x = from; x < to; x++)
      if (std::abs (above[x] - level[x]) <= range)
        return true;
    return false;
  });
}

} // namespace rangecast
