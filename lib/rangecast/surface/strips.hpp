/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "../geometry/range_image.hpp"
#include "blend_planes.hpp"

namespace rangecast {

enum class StripMode {
  kBlend,      ///< as kStrips; colours of all views of a surface are blended
  kStrips,     ///< bands of triangles along the rows
  kRectangles, ///< one rectangle a pixel
  kPoints,     ///< one point a pixel
};

struct StripSettings {
  StripMode mode = StripMode::kBlend;
  double depth_step = 0.03; ///< neighbours that differ by more than this share of their depth do
                            ///< not belong to one surface
  bool operator== (const StripSettings &) const = default;
};

/** Invalid pixels, in a row or a column, that a strip bridges if its two ends are near in depth.
 *  roiextract fills larger holes; with 6, strips bridge what cylinderfilter has cleared. */
inline constexpr int kMaxStripGap = 2;

/** Successive pixels on a straight line become one longer piece. Depth may be off the line by
 *  kMergeDepth and R, G, B by kMergeColour; where a pixel equals the one before it, by
 *  kMergeCopyDepth and kMergeCopyColour: it may be a copy that the neighbour code put there for
 *  something near. 40 % of the triangles remain with exact depth, 0.3 dB worse; 44 % with stereo
 *  depth, 0.3 dB better. */
inline constexpr double kMergeDepth = 0.0007;     ///< share of the depth
inline constexpr double kMergeDepthBlend = 0.001; ///< mode kBlend: other views average it
inline constexpr double kMergeColour = 1.5;       ///< levels
inline constexpr double kMergeCopyDepth = 0.004;
inline constexpr double kMergeCopyColour = 12;

/** A vertex by the pixel that it belongs to, and by where about that pixel it lies. Bits
 *  0-12: column, 13-25: row (both of the ROI), 26-28: horizontal, 29-31: vertical StripPlace. */
using StripVertex = std::uint32_t;

/** Offset of a vertex from its pixel, at the pixel's depth: quarters of a pixel, counted from 3. */
enum StripPlace : std::uint32_t {
  kFarBefore = 0, ///< three quarters: an end of a band, so that it meets what another camera saw
  kBefore = 1,    ///< half a pixel left or up: the edge of the pixel
  kCentre = 3,
  kAfter = 5, ///< half a pixel right or down
  kFarAfter = 6,
  kFullAfter = 7, ///< a whole pixel: behind a nearer surface that begins there
};
/** Greatest number of pixels in a row that one piece replaces. */
inline constexpr int kMaxPieceLength = 32;
/** Greatest side of an image that is drawn, pixels. */
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
 *  pixel: its own place, and that of the next valid pixel below, at most kMaxStripGap rows away and
 * near in depth, so that bands join and no cracks open when the view turns; else a little below on
 * its own surface. A band that no other one comes down to begins at the upper edge of its pixels.
 * Both ends of a band reach a little beyond their pixels. A gap of invalid pixels is bridged if its
 *  ends are near in depth; a depth step ends the band; a pixel with nothing beside it becomes a
 *  rectangle of its own size. Bands are joined by degenerate triangles to one triangle strip, whose
 *  triangles are all counter-clockwise in the picture (y down).
 *
 *  Of the pixels inside a band those are left out that lie on straight lines, in depth and colour,
 *  between others of their row; a line has at most kMaxPieceLength pixels, all near its first one.
 *  The bands above and below a row leave out the same ones, so that no crack opens there. Between
 *  pixels that stay no step is larger than depth_step allows.
 *
 *  kBlend: as kStrips, with the planes' colours, and surfaces that end where the planes say.
 *
 *  kRectangles: four vertices a pixel, joined likewise. kPoints: one vertex a pixel.
 *  @param image      at most kMaxStripSide wide and high; larger parts are not drawn
 *  @param[out] to    replaced; keeps its memory
 *  @param planes     mode kBlend: of the image
 *  Reentrant. */
void build_strips (const ConstRangeImage &image, const StripSettings &settings,
    std::vector<StripVertex> &to, StripResult &result, const BlendPlanes *planes = nullptr);

/** A vertex with all its attributes. */
struct SurfaceVertex {
  std::int16_t x, y;    ///< quarters of a pixel; (0, 0) is the centre of the ROI's first pixel
  std::uint16_t depth;  ///< depth units
  std::uint16_t unused; ///< 0
  Rgbx colour;          ///< x is the square root of the weight, 255 = 1
};

/** Makes vertices of those that build_strips() made.
 *
 *  With planes, a depth is the mean with those of both neighbours in its row and its column, where
 *  they are of one surface with it: slopes and steps stay, noise lessens.
 *  @param planes   of the image, or nullptr: all weights are 1
 *  @param reach    quarters of a pixel that a vertex may lie beside its own, at most
 *  @param[out] to  replaced; keeps its memory */
void make_vertices (const ConstRangeImage &image, const BlendPlanes *planes,
    std::span<const StripVertex> strips, int reach, std::vector<SurfaceVertex> &to);

} // namespace rangecast
