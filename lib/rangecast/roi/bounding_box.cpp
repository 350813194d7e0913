/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "bounding_box.hpp"

#include <algorithm>

namespace rangecast {

Roi
bounding_box (const ConstRangeImage &image, int margin)
{
  const int width = image.depth.width, height = image.depth.height;
  int left = width, right = -1, top = height, bottom = -1;
  const auto valid = [] (std::uint16_t depth) { return depth != kInvalidDepth; };
  for (int y = 0; y < height; y++) {
    const std::uint16_t *row = image.depth.row (y);
    const auto first = static_cast<int> (std::find_if (row, row + width, valid) - row);
    if (first == width)
      continue;
    int last = width - 1;
    while (!valid (row[last]))
      last--;
    left = std::min (left, first);
    right = std::max (right, last);
    top = std::min (top, y);
    bottom = y;
  }
  if (right < 0)
    return {};
  left = std::max (0, left - margin);
  top = std::max (0, top - margin);
  right = std::min (width - 1, right + margin);
  bottom = std::min (height - 1, bottom + margin);
  return {image.roi.x + left, image.roi.y + top, right - left + 1, bottom - top + 1};
}

} // namespace rangecast
