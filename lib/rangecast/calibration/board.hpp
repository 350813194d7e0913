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
  kChessboard, ///< all corners must be in the picture
  kCharuco,    ///< a chessboard with ArUco markers in its white squares: parts of it will do
};

/** A flat calibration board. Its corner `id` lies at column id % columns, row id / columns. */
struct BoardSpec {
  BoardKind kind = BoardKind::kChessboard;
  int columns = 9;         ///< inner corners, 3 .. 32 (one less than squares)
  int rows = 6;            ///< inner corners, 3 .. 32
  double square_m = 0.025; ///< side of a square, metres, 1e-4 .. 10
  double marker_m = 0;     ///< ChArUco: side of a marker, metres, < square_m; 0: 3/4 of a square
  int dictionary = 0;      ///< ChArUco: index into board_dictionaries()

  [[nodiscard]] int corner_count () const { return columns * rows; }
  /** Whether a chessboard looks the same when it is turned by half a turn. Two cameras may then
   *  number its corners from opposite ends. */
  [[nodiscard]] bool is_ambiguous () const
  {
    return kind == BoardKind::kChessboard && (columns + rows) % 2 == 0;
  }
  /** Where a corner lies on the board: metres from corner 0, z = 0. */
  [[nodiscard]] Vec3 corner (int id) const
  {
    return {square_m * (id % columns), square_m * (id / columns), 0};
  }
};

/** The ArUco dictionaries by name, e.g. "4x4-50": 4x4 bits, 50 markers. */
[[nodiscard]] const std::vector<std::string_view> &board_dictionaries ();

/** @return kBadValue that names the field */
Status validate (const BoardSpec &board);

/** One corner of a board in a picture. */
struct BoardCorner {
  int id = 0;          ///< 0 .. corner_count() - 1
  double x = 0, y = 0; ///< pixels; (0, 0) is the centre of the top-left pixel
};

/** Finds a board in pictures. Not reentrant. Methods: cv::findChessboardCorners and
 *  cv::cornerSubPix; for ChArUco cv::aruco::detectMarkers and interpolateCornersCharuco. */
class BoardDetector {
public:
  BoardDetector ();
  ~BoardDetector ();
  BoardDetector (const BoardDetector &) = delete;
  BoardDetector &operator= (const BoardDetector &) = delete;

  /** @param thorough  look again, more slowly, where no chessboard is found: for pictures that are
   *  few, not for live ones */
  Status set (const BoardSpec &board, bool thorough = false);
  [[nodiscard]] const BoardSpec &board () const { return board_; }

  /** @param picture  grey levels
   *  @param[out] corners  sorted by id, in the same order whatever way up the board is held; empty
   *  if there is no board. A chessboard gives all or none, ChArUco at least 6. */
  Status detect (ImageView<const std::uint8_t> picture, std::vector<BoardCorner> &corners);

  /** The same for a colour picture, with edge_width_px() of what was found. */
  Status detect (
      ImageView<const Rgbx> picture, std::vector<BoardCorner> &corners, double &edge_width);

  /** Whether pictures showed a board only in a mirror so far. ChArUco only: a chessboard's mirror
   *  image is a chessboard. */
  [[nodiscard]] bool is_mirrored () const { return mirrored_; }

private:
  struct Charuco;

  BoardSpec board_;
  bool thorough_ = false;
  bool found_ = false, mirrored_ = false;
  std::unique_ptr<Charuco> charuco_;
  std::vector<std::uint8_t> grey_;
};

/** Width of the edges at the corners, pixels: about 2 in a sharp picture; contrast over steepest
 *  slope, the median of all corners. 0 without corners. */
double edge_width_px (
    ImageView<const std::uint8_t> picture, const std::vector<BoardCorner> &corners);

/** A picture of the board to print or to render: white margin of one square all round.
 *  @param square_px  pixels of a square, 8 .. 512
 *  @param[out] pixels  (columns + 3) * square_px by (rows + 3) * square_px grey levels, row by row.
 *  Corner 0 lies 2 * square_px - 0.5 pixels from the left and the top. */
Status draw_board (const BoardSpec &board, int square_px, std::vector<std::uint8_t> &pixels);

} // namespace rangecast
