/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <vector>

#include "unit.hpp"

namespace rangecast {

/** Finds whether a decoder can begin at an access unit: all its slices are key slices, and no view
 *  that has slices lacks any. It cannot tell if a whole view is missing. Keeps memory for at most
 *  4096 slices. */
class KeyCheck {
public:
  void reset ();
  void add (const SliceHeader &slice);
  /** True for an access unit without slices, too. */
  [[nodiscard]] bool is_key ();
  /** Number of views that have slices, if the latest is_key() was true. */
  [[nodiscard]] std::size_t views () const { return views_; }

private:
  bool all_key_ = true;
  std::size_t views_ = 0;
  std::vector<SliceHeader> slices_;
};

} // namespace rangecast
