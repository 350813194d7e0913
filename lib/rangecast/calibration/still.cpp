/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "still.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "../opencv/image.hpp"

namespace rangecast {
namespace {

constexpr int kMaxInARow = 4;
constexpr double kMaxTileAspect = 2, kMinTileAspect = 0.01; /* height / width */

/* Hue rotates from row to row. */
cv::Scalar
row_colour (int row)
{
  static constexpr double kColours[][3] = {{255, 60, 60}, {255, 160, 0}, {230, 230, 0},
      {60, 220, 60}, {0, 210, 230}, {90, 120, 255}, {230, 80, 230}};
  const auto &c = kColours[row % std::size (kColours)];
  return {c[0], c[1], c[2], 255};
}

void
draw_corners (const TileContents &contents, double scale, cv::Mat &tile)
{
  const double radius = std::max (2.0, tile.cols / 160.0);
  cv::Point before;
  for (std::size_t i = 0; i < contents.corners.size (); i++) {
    const BoardCorner &c = contents.corners[i];
    const cv::Point at (cvRound ((c.x + 0.5) * scale), cvRound ((c.y + 0.5) * scale));
    const cv::Scalar colour = row_colour (contents.columns > 0 ? c.id / contents.columns : 0);
    if (i > 0)
      cv::line (tile, before, at, colour, 1, cv::LINE_AA);
    cv::circle (tile, at, int (radius), colour, i == 0 ? cv::FILLED : 1, cv::LINE_AA);
    before = at;
  }
}

void
draw_missing_cells (const CameraCoverage &coverage, cv::Size picture, cv::Mat &tile)
{
  const double w = double (picture.width) / CameraCoverage::kColumns;
  const double h = double (picture.height) / CameraCoverage::kRows;
  for (int row = 0; row < CameraCoverage::kRows; row++)
    for (int column = 0; column < CameraCoverage::kColumns; column++)
      if (!coverage.cells[row * CameraCoverage::kColumns + column])
        cv::rectangle (tile, cv::Point (int (column * w) + 3, int (row * h) + 3),
            cv::Point (int ((column + 1) * w) - 4, int ((row + 1) * h) - 4), {255, 120, 60, 255},
            1);
}

} // namespace

TileLayout
lay_out (std::span<const CalibrationCamera> cameras, int tile_width)
{
  TileLayout layout;
  const int count = int (cameras.size ());
  layout.columns = std::min (count, kMaxInARow);
  layout.rows = count ? (count + layout.columns - 1) / layout.columns : 0;
  double aspect = 0; /* height / width, of the tallest */
  for (const CalibrationCamera &camera : cameras)
    if (camera.width > 0)
      aspect = std::max (aspect, double (camera.height) / camera.width);
  aspect = std::min (aspect, kMaxTileAspect);
  const double widest =
      std::sqrt (double (kMaxStillPixels) /
                 (std::max (1, layout.columns * layout.rows) * std::max (aspect, kMinTileAspect)));
  layout.tile_width = std::max (2, std::min (tile_width, int (widest)) & ~1);
  layout.tile_height = std::max (2, (int (std::lround (layout.tile_width * aspect)) + 1) & ~1);
  return layout;
}

void
draw_tile (const TileContents &contents, ImageView<Rgbx> tile)
{
  if (tile.empty ())
    return;
  cv::Mat out = opencv_image (tile);
  out = cv::Scalar (24, 24, 24, 255);
  if (contents.picture.empty ())
    return;
  const double scale = std::min (
      double (tile.width) / contents.picture.width, double (tile.height) / contents.picture.height);
  const cv::Size size (std::clamp (int (contents.picture.width * scale), 1, tile.width),
      std::clamp (int (contents.picture.height * scale), 1, tile.height));
  cv::Mat inner = out (cv::Rect ({0, 0}, size));
  cv::resize (opencv_image (contents.picture), inner, size, 0, 0, cv::INTER_AREA);
  draw_missing_cells (contents.coverage, size, inner);
  draw_corners (contents, scale, inner);
  if (contents.taken)
    cv::rectangle (inner, {{0, 0}, size}, {60, 220, 60, 255}, 3);
}

} // namespace rangecast
