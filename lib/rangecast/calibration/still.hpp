/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <span>

#include "selection.hpp"

namespace rangecast {

/** How the cameras' pictures are laid out in one: tiles of one size, row by row. */
struct TileLayout {
  int columns = 0, rows = 0;
  int tile_width = 0, tile_height = 0; ///< pixels

  [[nodiscard]] int width () const { return columns * tile_width; }
  [[nodiscard]] int height () const { return rows * tile_height; }
};

inline constexpr int kMaxStillPixels = 1 << 25;

/** All cameras side by side, up to four in a row; stereo pairs stay together if they are given
 *  together. A tile is at most twice as high as wide, and all of them together have at most
 *  kMaxStillPixels: tiles become smaller for that.
 *  @param tile_width  pixels, made even */
[[nodiscard]] TileLayout lay_out (std::span<const CalibrationCamera> cameras, int tile_width);

/** What one tile shows. */
struct TileContents {
  ImageView<const Rgbx> picture; ///< empty: none came, the tile is dark
  std::span<const BoardCorner> corners;
  int columns = 0;         ///< of the board: its rows get colours of their own
  CameraCoverage coverage; ///< cells without a corner so far are framed
  bool taken = false;      ///< the tile gets a green frame
};

/** Draws a tile; nothing is drawn if it is empty. */
void draw_tile (const TileContents &contents, ImageView<Rgbx> tile);

} // namespace rangecast
