/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "paste.hpp"

#include <algorithm>

namespace rangecast {
namespace {

/* Calls copy_row (y, begin, end, to) for each row of the ROI with the columns that lie in the full
 * picture, and clears everything else. */
template <typename T, typename CopyRow>
void
paste (const Roi &roi, ImageView<T> full, CopyRow copy_row)
{
  const int left = std::clamp (roi.x, 0, full.width);
  const int right = std::clamp (roi.x + roi.width, left, full.width);
  for (int y = 0; y < full.height; y++) {
    T *row = full.row (y);
    if (roi.empty () || y < roi.y || y >= roi.y + roi.height) {
      std::fill_n (row, full.width, T{});
      continue;
    }
    std::fill (row, row + left, T{});
    copy_row (y - roi.y, left - roi.x, right - roi.x, row + left);
    std::fill (row + right, row + full.width, T{});
  }
}

} // namespace

void
paste_depth (const ConstRangeImage &image, ImageView<std::uint16_t> full)
{
  paste (image.roi, full, [&] (int y, int begin, int end, std::uint16_t *to) {
    const std::uint16_t *from = image.depth.row (y);
    std::copy (from + begin, from + end, to);
  });
}

void
paste_colour (const ConstRangeImage &image, bool only_valid, ImageView<Rgbx> full)
{
  paste (image.roi, full, [&] (int y, int begin, int end, Rgbx *to) {
    const Rgbx *from = image.colour.row (y);
    const std::uint16_t *depth = image.depth.row (y);
    for (int x = begin; x < end; x++) {
      *to = only_valid && depth[x] == kInvalidDepth ? Rgbx{} : from[x];
      (to++)->x = 255; /* opaque for those who take x for alpha */
    }
  });
}

} // namespace rangecast
