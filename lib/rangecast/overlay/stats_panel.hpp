/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <span>
#include <string>
#include <vector>

#include "../geometry/image_view.hpp"

namespace rangecast {

/** A small picture of lines of text, light on dark, to be laid over a larger one. */
class StatsPanel {
public:
  static constexpr int kMaxLines = 8;
  static constexpr int kMaxWidth = 512; ///< pixels; longer lines are cut off

  /** Draws it again. @param lines  ASCII, kMaxLines at most; further ones are skipped */
  void draw (std::span<const std::string> lines);
  /** The last picture drawn, as large as its text; empty before the first one. */
  [[nodiscard]] ImageView<const Rgbx> picture () const { return picture_; }

private:
  std::vector<Rgbx> memory_;
  ImageView<Rgbx> picture_;
};

} // namespace rangecast
