/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "reduced_view.hpp"

#include <algorithm>

namespace rangecast {

SurfaceView
ReducedView::reduce (const SurfaceView &from)
{
  const Roi &roi = from.image.roi;
  const int width = (roi.width + 1) / 2, height = (roi.height + 1) / 2;
  const auto size = static_cast<std::size_t> (width) * static_cast<std::size_t> (height);
  depth_.resize (size);
  colour_.resize (size);
  points_ = 0;
  for (int y = 0; y < roi.height; y++) {
    const std::uint16_t *depth = from.image.depth.row (y);
    points_ += static_cast<std::uint64_t> (
        roi.width - std::count (depth, depth + roi.width, kInvalidDepth));
    if (y % 2 != 0)
      continue;
    const Rgbx *colour = from.image.colour.row (y);
    const std::size_t row = static_cast<std::size_t> (y / 2) * static_cast<std::size_t> (width);
    for (int x = 0; x < width; x++) {
      depth_[row + static_cast<std::size_t> (x)] = depth[2 * x];
      colour_[row + static_cast<std::size_t> (x)] = colour[2 * x];
    }
  }
  const Intrinsics &lens = from.view->intrinsics;
  view_.id = from.view->id;
  view_.width = width;
  view_.height = height;
  view_.intrinsics = {lens.fx / 2, lens.fy / 2, (lens.cx - roi.x) / 2, (lens.cy - roi.y) / 2};
  view_.world_from_view = from.view->world_from_view;
  view_.depth_unit_m = from.view->depth_unit_m;
  view_.near_m = from.view->near_m;
  view_.far_m = from.view->far_m;
  SurfaceView to = {from.image, &view_};
  to.image.roi = {0, 0, width, height};
  to.image.depth = {
      depth_.data (), width, height, static_cast<std::ptrdiff_t> (sizeof (std::uint16_t)) * width};
  to.image.colour = {
      colour_.data (), width, height, static_cast<std::ptrdiff_t> (sizeof (Rgbx)) * width};
  return to;
}

} // namespace rangecast
