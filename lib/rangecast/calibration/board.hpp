/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "../base/status.hpp"
#include "../geometry/camera.hpp"
#include "../geometry/image_view.hpp"

namespace rangecast {

enum class BoardKind {
  kChessboard, ///< all corners must be visible
  kCharuco,    ///< with ArUco markers in its white squares; may be partly visible
};

/** A flat calibration board. Corner `id` is at column id % columns, row id / columns. */
struct BoardSpec {
  BoardKind kind = BoardKind::kChessboard;
  int columns = 9;         ///< inner corners, 3 .. 32 (one less than squares)
  int rows = 6;            ///< inner corners, 3 .. 32
  double square_m = 0.025; ///< side of a square, metres, 1e-4 .. 10
  double marker_m = 0;     ///< ChArUco: side of a marker, metres, < square_m; 0: 3/4 of a square
  int dictionary = 0;      ///< ChArUco: index into board_dictionaries()

  [[nodiscard]] int corner_count () const { return columns * rows; }
  /** Whether a chessboard is symmetric under rotation by 180 degrees. Two cameras may then number
   * its corners from opposite ends. */
  [[nodiscard]] bool is_ambiguous () const
  {
    return kind == BoardKind::kChessboard && (columns + rows) % 2 == 0;
  }
  /** Position of a corner on the board: metres from corner 0, z = 0. */
  [[nodiscard]] Vec3 corner (int id) const
  {
    return {square_m * (id % columns), square_m * (id / columns), 0};
  }
};

/** Names of the ArUco dictionaries, e.g. "4x4-50": 4x4 bits, 50 markers. */
[[nodiscard]] const std::vector<std::string_view> &board_dictionaries ();

/** @return kBadValue that names the field */
Status validate (const BoardSpec &board);

/** A corner of the board in an image. */
struct BoardCorner {
  int id = 0;          ///< 0 .. corner_count() - 1
  double x = 0, y = 0; ///< pixels; (0, 0) is the centre of the top-left pixel
};

/** Finds a board in images. Not reentrant. Methods: cv::findChessboardCorners and
 *  cv::cornerSubPix; for ChArUco cv::aruco::detectMarkers and interpolateCornersCharuco. */
class BoardDetector {
public:
  BoardDetector ();
  ~BoardDetector ();
  BoardDetector (const BoardDetector &) = delete;
  BoardDetector &operator= (const BoardDetector &) = delete;

  /** @param thorough  try again with a slower method if no chessboard is found; not for live video
   */
  Status set (const BoardSpec &board, bool thorough = false);
  [[nodiscard]] const BoardSpec &board () const { return board_; }

  /** @param image  grey levels
   *  @param[out] corners  sorted by id, in the same order for any rotation of the board; empty if
   *  there is no board. A chessboard gives all corners or none, ChArUco at least 6. */
  Status detect (ImageView<const std::uint8_t> picture, std::vector<BoardCorner> &corners);

  /** The same for a colour image, and edge_width_px() of the corners. */
  Status detect (
      ImageView<const Rgbx> picture, std::vector<BoardCorner> &corners, double &edge_width);

  /** Whether all boards so far were mirrored. ChArUco only: a mirrored chessboard is a chessboard.
   */
  [[nodiscard]] bool is_mirrored () const { return mirrored_; }

private:
  struct Charuco;

  BoardSpec board_;
  bool thorough_ = false;
  bool found_ = false, mirrored_ = false;
  std::unique_ptr<Charuco> charuco_;
  std::vector<std::uint8_t> grey_;
};

/** Median edge width at the corners, pixels: contrast divided by the steepest slope, about 2 in a
 *  sharp image. 0 without corners. */
double edge_width_px (
    ImageView<const std::uint8_t> picture, const std::vector<BoardCorner> &corners);

/** Draws the board for printing or rendering, with a white margin of one square.
 *  @param square_px  side of a square in pixels, 8 .. 512
 *  @param[out] pixels  (columns + 3) * square_px by (rows + 3) * square_px grey levels, row by row.
 *  Corner 0 is 2 * square_px - 0.5 pixels from the left and the top. */
Status draw_board (const BoardSpec &board, int square_px, std::vector<std::uint8_t> &pixels);

} // namespace rangecast
