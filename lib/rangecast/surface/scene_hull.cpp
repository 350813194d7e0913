/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "scene_hull.hpp"

#include <algorithm>

namespace rangecast {

namespace {

/* Pixels: smaller tiles follow the surface more closely. */
constexpr int kTile = 32;

/* Nearest and farthest valid depth, depth units; farthest = 0 if none is valid. */
struct DepthSpan {
  std::uint16_t nearest, farthest;
};

DepthSpan
depth_span (const ImageView<const std::uint16_t> &depth)
{
  /* one less than each depth: invalid ones are then the largest number, not the smallest */
  std::uint16_t nearest = 0xffff, farthest = 0;
  for (int y = 0; y < depth.height; y++) {
    const std::uint16_t *row = depth.row (y);
    for (int x = 0; x < depth.width; x++) {
      nearest = std::min (nearest, static_cast<std::uint16_t> (row[x] - 1));
      farthest = std::max (farthest, row[x]);
    }
  }
  return {static_cast<std::uint16_t> (nearest + 1), farthest};
}

} // namespace

void
append_hull (const ConstRangeImage &image, const View &view, std::vector<Vec3> &hull)
{
  const Roi &roi = image.roi;
  const auto append = [&] (const Roi &tile) {
    const DepthSpan span = depth_span (image.depth.crop (tile.x, tile.y, tile.width, tile.height));
    if (span.farthest == 0)
      return;
    for (std::uint16_t depth : {span.nearest, span.farthest})
      for (int x : {roi.x + tile.x - 1, roi.x + tile.x + tile.width})
        for (int y : {roi.y + tile.y - 1, roi.y + tile.y + tile.height})
          hull.push_back (
              view.world_from_view * view.intrinsics.unproject (x, y, depth * view.depth_unit_m));
  };
  for (int y = 0; y < roi.height; y += kTile)
    for (int x = 0; x < roi.width; x += kTile)
      append ({x, y, std::min (kTile, roi.width - x), std::min (kTile, roi.height - y)});
}

} // namespace rangecast
