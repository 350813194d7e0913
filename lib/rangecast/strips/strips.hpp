/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <vector>

#include "../geometry/range_image.hpp"

namespace rangecast {

enum class StripMode {
  kStrips,     ///< bands of triangles along the rows
  kRectangles, ///< one rectangle a pixel
  kPoints,     ///< one point a pixel
};

struct StripSettings {
  StripMode mode = StripMode::kStrips;
  double depth_step = 0.02; ///< neighbours that differ by more than this share of their depth do
                            ///< not belong to one surface
  int max_gap = 3;   ///< invalid pixels that a strip bridges if its two ends are near in depth
  bool merge = true; ///< equal successive pixels become one longer piece
};

/** A vertex that the GPU unprojects itself: the pixel whose depth and colour it has, and where
 *  about that pixel it lies. Bits 0-12: column, 13-25: row (both of the ROI), 26-28: horizontal,
 *  29-31: vertical StripPlace. */
using StripVertex = std::uint32_t;

/** Where a vertex lies about its pixel, on the surface that the pixel and its neighbours make. */
enum StripPlace : std::uint32_t {
  kCentre = 0,
  kBefore = 1,    ///< half a pixel left or up: the edge of the pixel
  kAfter = 2,     ///< half a pixel right or down
  kFarBefore = 3, ///< three quarters: an end of a band, so that it meets what another camera saw
  kFarAfter = 4,
  kFullAfter = 5, ///< a whole pixel: behind a nearer surface that begins there
};
/** Offsets in pixels, by StripPlace. */
inline constexpr float kStripOffsets[] = {0.f, -0.5f, 0.5f, -0.75f, 0.75f, 1.f};
/** No image that is drawn is larger, pixels. */
inline constexpr int kMaxStripSide = 8192;

constexpr StripVertex
strip_vertex (int column, int row, StripPlace horizontal, StripPlace vertical)
{
  return static_cast<StripVertex> (column) | static_cast<StripVertex> (row) << 13 |
         static_cast<StripVertex> (horizontal) << 26 | static_cast<StripVertex> (vertical) << 29;
}

struct StripResult {
  std::uint64_t points = 0;    ///< valid pixels
  std::uint64_t strips = 0;    ///< bands
  std::uint64_t isolated = 0;  ///< pixels drawn as rectangles because nothing is beside them
  std::uint64_t triangles = 0; ///< without degenerate ones
};

/** Makes the vertices of one view.
 *
 *  kStrips: successive valid pixels of a row form a band, one triangle strip with two vertices a
 *  pixel: its own place, and that of the pixel below if that is valid and near in depth, so that
 *  bands join and no cracks open when the view turns; else a little below on its own surface. A
 *  band that no other one comes down to begins at the upper edge of its pixels. Both ends of a band
 *  reach a little beyond their pixels. No triangle's three pixels are further apart in depth than
 *  depth_step allows. A pixel whose pair of vertices equals both neighbours' in depth and colour is
 *  left out: the piece becomes longer. A gap of invalid pixels is bridged if its ends are near in
 *  depth; a depth step ends the band; a pixel with nothing beside it becomes a rectangle of its own
 *  size. Bands are joined by degenerate triangles to one triangle strip. kRectangles: four vertices
 *  a pixel, joined likewise. kPoints: one vertex a pixel.
 *  @param image      at most kMaxStripSide wide and high; larger parts are not drawn
 *  @param[out] to    replaced; keeps its memory
 *  Reentrant. */
void build_strips (const ConstRangeImage &image, const StripSettings &settings,
    std::vector<StripVertex> &to, StripResult &result);

} // namespace rangecast
