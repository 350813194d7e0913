/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <span>

#include "selection.hpp"

namespace rangecast {

/** Layout of the preview: tiles of equal size, row by row. */
struct TileLayout {
  int columns = 0, rows = 0;
  int tile_width = 0, tile_height = 0; ///< pixels

  [[nodiscard]] int width () const { return columns * tile_width; }
  [[nodiscard]] int height () const { return rows * tile_height; }
};

inline constexpr int kMaxStillPixels = 1 << 25;

/** Places all cameras in order, up to four in a row. A tile is at most twice as high as wide; tiles
 *  shrink so that the preview has at most kMaxStillPixels.
 *  @param tile_width  pixels, rounded to an even number */
[[nodiscard]] TileLayout lay_out (std::span<const CalibrationCamera> cameras, int tile_width);

/** The contents of one tile. */
struct TileContents {
  ImageView<const Rgbx> picture; ///< empty: no image, the tile is dark
  std::span<const BoardCorner> corners;
  int columns = 0;         ///< of the board, for the colours of its rows
  CameraCoverage coverage; ///< cells without a corner are framed
  bool taken = false;      ///< the frame was kept: green border
};

/** Draws a tile, unless it is empty. */
void draw_tile (const TileContents &contents, ImageView<Rgbx> tile);

} // namespace rangecast
