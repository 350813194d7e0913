/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <vector>

#include "unit.hpp"

namespace rangecast {

/** Finds whether a decoder can begin at an access unit: every slice in it is a key one, and of
 *  every view that has slices none is missing. Of a view that is wholly missing it knows nothing.
 *  Keeps its memory, but for 4096 slices at most. */
class KeyCheck {
public:
  void reset ();
  void add (const SliceHeader &slice);
  /** Of an access unit without slices, too. */
  [[nodiscard]] bool is_key ();
  /** How many views have slices; of an access unit that is_key(). */
  [[nodiscard]] std::size_t views () const { return views_; }

private:
  [[nodiscard]] bool is_whole (std::size_t &next) const;

  bool all_key_ = true;
  std::size_t views_ = 0;
  std::vector<SliceHeader> slices_;
};

} // namespace rangecast
