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
 *  about that pixel it lies. Bits 0-12: column, 13-25: row (both of the ROI), 26-27: horizontal,
 *  28-30: vertical place. */
using StripVertex = std::uint32_t;

/** Offsets from the pixel's centre, in pixels, by the number in the vertex. */
inline constexpr float kStripOffsets[] = {0.f, -0.5f, 0.5f};
enum StripPlace : std::uint32_t { kCentre = 0, kBefore = 1, kAfter = 2 };
/** No image that is drawn is larger, pixels. */
inline constexpr int kMaxStripSide = 8192;

constexpr StripVertex
strip_vertex (int column, int row, StripPlace horizontal, StripPlace vertical)
{
  return static_cast<StripVertex> (column) | static_cast<StripVertex> (row) << 13 |
         static_cast<StripVertex> (horizontal) << 26 | static_cast<StripVertex> (vertical) << 28;
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
 *  bands join and no cracks open when the view turns; else half a pixel below at its own depth. A
 *  pixel whose pair of vertices equals both neighbours' in depth and colour is left out: the piece
 *  becomes longer. A gap of invalid pixels is bridged if its ends are near in depth; a depth step
 *  ends the band; a pixel with nothing beside it becomes a rectangle of its own size.
 *  Bands are joined by degenerate triangles to one triangle strip.
 *  kRectangles: four vertices a pixel, joined likewise. kPoints: one vertex a pixel.
 *  @param image      at most kMaxStripSide wide and high; larger parts are not drawn
 *  @param[out] to    replaced; keeps its memory
 *  Reentrant. */
void build_strips (const ConstRangeImage &image, const StripSettings &settings,
    std::vector<StripVertex> &to, StripResult &result);

} // namespace rangecast
