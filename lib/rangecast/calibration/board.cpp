/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "board.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
/* OpenCV 4.7 moved ArUco from the contributed modules to objdetect, with another interface. */
#if CV_VERSION_MAJOR == 4 && CV_VERSION_MINOR < 7
#define RANGECAST_CONTRIBUTED_ARUCO 1
#include <opencv2/aruco/charuco.hpp>
#else
#include <opencv2/objdetect/charuco_detector.hpp>
#endif

namespace rangecast {
namespace {

constexpr int kMinCharucoCorners = 6;
/* Chessboards are searched in images scaled down to this size, pixels; corners are refined at full
 * size. */
constexpr int kSearchSide = 1024;

struct NamedDictionary {
  std::string_view name;
  int opencv;
};
constexpr NamedDictionary kDictionaries[] = {
    {"4x4-50", cv::aruco::DICT_4X4_50},
    {"4x4-100", cv::aruco::DICT_4X4_100},
    {"4x4-250", cv::aruco::DICT_4X4_250},
    {"4x4-1000", cv::aruco::DICT_4X4_1000},
    {"5x5-50", cv::aruco::DICT_5X5_50},
    {"5x5-100", cv::aruco::DICT_5X5_100},
    {"5x5-250", cv::aruco::DICT_5X5_250},
    {"5x5-1000", cv::aruco::DICT_5X5_1000},
    {"6x6-50", cv::aruco::DICT_6X6_50},
    {"6x6-100", cv::aruco::DICT_6X6_100},
    {"6x6-250", cv::aruco::DICT_6X6_250},
    {"6x6-1000", cv::aruco::DICT_6X6_1000},
    {"aruco-original", cv::aruco::DICT_ARUCO_ORIGINAL},
    {"apriltag-16h5", cv::aruco::DICT_APRILTAG_16h5},
    {"apriltag-25h9", cv::aruco::DICT_APRILTAG_25h9},
    {"apriltag-36h11", cv::aruco::DICT_APRILTAG_36h11},
};

Status
bad_board (const std::string &what)
{
  return {StatusCode::kBadValue, "board: " + what};
}

double
marker_of (const BoardSpec &board)
{
  return board.marker_m > 0 ? board.marker_m : 0.75 * board.square_m;
}

using Board = cv::Ptr<cv::aruco::CharucoBoard>;
using Markers = std::vector<std::vector<cv::Point2f>>;

#ifdef RANGECAST_CONTRIBUTED_ARUCO
auto
dictionary_of (const BoardSpec &board)
{
  return cv::aruco::getPredefinedDictionary (kDictionaries[board.dictionary].opencv);
}

Board
charuco_board (const BoardSpec &board)
{
  return cv::aruco::CharucoBoard::create (board.columns + 1, board.rows + 1, float (board.square_m),
      float (marker_of (board)), dictionary_of (board));
}

void
draw_charuco (const Board &board, cv::Size size, cv::Mat &to)
{
  board->draw (size, to);
}

void
detect_charuco (
    const cv::Mat &picture, const Board &board, Markers &markers, cv::Mat &points, cv::Mat &ids)
{
  std::vector<int> marker_ids;
  cv::aruco::detectMarkers (picture, board->dictionary, markers, marker_ids);
  if (!marker_ids.empty ())
    cv::aruco::interpolateCornersCharuco (markers, marker_ids, picture, board, points, ids);
}
#else
auto
dictionary_of (const BoardSpec &board)
{
  return cv::makePtr<cv::aruco::Dictionary> (
      cv::aruco::getPredefinedDictionary (kDictionaries[board.dictionary].opencv));
}

Board
charuco_board (const BoardSpec &board)
{
  auto made = cv::makePtr<cv::aruco::CharucoBoard> (cv::Size (board.columns + 1, board.rows + 1),
      float (board.square_m), float (marker_of (board)), *dictionary_of (board));
  made->setLegacyPattern (true); /* with the markers where earlier versions have them */
  return made;
}

void
draw_charuco (const Board &board, cv::Size size, cv::Mat &to)
{
  board->generateImage (size, to);
}

void
detect_charuco (
    const cv::Mat &picture, const Board &board, Markers &markers, cv::Mat &points, cv::Mat &ids)
{
  std::vector<int> marker_ids;
  cv::aruco::CharucoDetector (*board).detectBoard (picture, points, ids, markers, marker_ids);
}
#endif

cv::Mat
as_mat (ImageView<const std::uint8_t> picture)
{
  return {picture.height, picture.width, CV_8U, const_cast<std::uint8_t *> (picture.data),
      std::size_t (picture.stride)};
}

/* Minimum distance of neighbouring corners. */
double
spacing (const std::vector<cv::Point2f> &corners, int columns)
{
  double smallest = 1e9;
  for (std::size_t i = 0; i < corners.size (); i++) {
    if ((i + 1) % columns != 0 && i + 1 < corners.size ())
      smallest = std::min (smallest, cv::norm (corners[i + 1] - corners[i]));
    if (i + columns < corners.size ())
      smallest = std::min (smallest, cv::norm (corners[i + columns] - corners[i]));
  }
  return smallest;
}

/* Mean grey level of the squares with even column + row, minus that of the others. */
double
even_minus_odd (const cv::Mat &picture, const std::vector<cv::Point2f> &c, int columns, int rows)
{
  double sum[2] = {0, 0};
  int count[2] = {0, 0};
  for (int j = 0; j + 1 < rows; j++)
    for (int i = 0; i + 1 < columns; i++) {
      const int k = j * columns + i;
      const cv::Point2f middle = (c[k] + c[k + 1] + c[k + columns] + c[k + columns + 1]) / 4;
      const int x = std::clamp (cvRound (middle.x), 0, picture.cols - 1);
      const int y = std::clamp (cvRound (middle.y), 0, picture.rows - 1);
      sum[(i + j) % 2] += picture.at<std::uint8_t> (y, x);
      count[(i + j) % 2]++;
    }
  return sum[0] / std::max (count[0], 1) - sum[1] / std::max (count[1], 1);
}

/* OpenCV may start at any corner. Columns to the right, rows down, and a black square next to
 * corner 0 give the same numbers in all cameras. */
void
bring_into_order (const cv::Mat &picture, std::vector<cv::Point2f> &c, int columns, int rows)
{
  double turn = 0; /* twice the area of the cells; negative: mirrored */
  for (int j = 0; j + 1 < rows; j++)
    for (int i = 0; i + 1 < columns; i++) {
      const int k = j * columns + i;
      turn += (c[k + 1] - c[k]).cross (c[k + columns] - c[k]);
    }
  if (turn < 0)
    for (int j = 0; j < rows; j++)
      std::reverse (c.begin () + j * columns, c.begin () + (j + 1) * columns);
  if (even_minus_odd (picture, c, columns, rows) > 0)
    std::ranges::reverse (c);
}

bool
search (const cv::Mat &picture, const BoardSpec &board, bool thorough,
    std::vector<cv::Point2f> &corners)
{
  const cv::Size size (board.columns, board.rows);
  const int flags = cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_FAST_CHECK;
  if (cv::findChessboardCorners (picture, size, corners, flags))
    return true;
  /* Adaptive thresholds help in uneven light, but take up to a second when half a board is visible.
   */
  return thorough &&
         cv::findChessboardCorners (picture, size, corners, flags | cv::CALIB_CB_ADAPTIVE_THRESH);
}

bool
find_chessboard (const cv::Mat &picture, const BoardSpec &board, bool thorough,
    std::vector<cv::Point2f> &corners)
{
  const double scale = double (kSearchSide) / std::max (picture.cols, picture.rows);
  bool found = false;
  if (scale < 1) {
    cv::Mat small;
    cv::resize (picture, small, {}, scale, scale, cv::INTER_AREA);
    found = search (small, board, thorough, corners);
    for (cv::Point2f &c : corners)
      c = (c + cv::Point2f (0.5F, 0.5F)) / float (scale) - cv::Point2f (0.5F, 0.5F);
  }
  if (!found && !search (picture, board, thorough, corners))
    return false;
  if (corners.size () != std::size_t (board.corner_count ()))
    return false;
  /* The window must not reach the next corner. */
  const int half = std::clamp (int (0.25 * spacing (corners, board.columns)), 2, 11);
  cv::cornerSubPix (picture, corners, {half, half}, {-1, -1},
      {cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 40, 0.001});
  bring_into_order (picture, corners, board.columns, board.rows);
  return true;
}

/* The board's pose needs two rows with two corners each. */
bool
spans_a_plane (const std::vector<BoardCorner> &corners, int columns)
{
  int full_rows = 0;
  for (std::size_t i = 0, j; i < corners.size (); i = j) {
    for (j = i; j < corners.size () && corners[j].id / columns == corners[i].id / columns;)
      j++;
    full_rows += j - i >= 2;
  }
  return full_rows >= 2;
}

} // namespace

const std::vector<std::string_view> &
board_dictionaries ()
{
  static const std::vector<std::string_view> names = [] {
    std::vector<std::string_view> list;
    for (const NamedDictionary &d : kDictionaries)
      list.push_back (d.name);
    return list;
  }();
  return names;
}

Status
validate (const BoardSpec &board)
{
  for (const auto &[name, value] :
      {std::pair ("columns", board.columns), std::pair ("rows", board.rows)})
    if (value < 3 || value > 32)
      return bad_board (
          std::string (name) + " is " + std::to_string (value) + "; use 3 to 32 inner corners");
  if (!(board.square_m >= 1e-4 && board.square_m <= 10))
    return bad_board (
        "square size is " + std::to_string (board.square_m) + " m; use 0.0001 to 10 m");
  if (board.kind == BoardKind::kChessboard)
    return {};
  if (!(board.marker_m >= 0 && board.marker_m < board.square_m))
    return bad_board ("marker size is " + std::to_string (board.marker_m) +
                      " m; use less than a square, " + std::to_string (board.square_m));
  if (board.dictionary < 0 || board.dictionary >= int (std::size (kDictionaries)))
    return bad_board ("dictionary " + std::to_string (board.dictionary) + " does not exist");
  const int have = dictionary_of (board)->bytesList.rows;
  const int want = (board.columns + 1) * (board.rows + 1) / 2;
  if (have < want)
    return bad_board ("dictionary " + std::string (kDictionaries[board.dictionary].name) + " has " +
                      std::to_string (have) + " markers; use one with at least " +
                      std::to_string (want) + " for a board of this size");
  return {};
}

struct BoardDetector::Charuco {
  Board board;
  double marker_share = 0.75; /* marker by square */

  /* Side of the smallest square, derived from its marker. */
  [[nodiscard]] double square_px (const Markers &markers) const
  {
    double smallest = 1e9;
    for (const auto &m : markers)
      for (int i = 0; i < 4; i++)
        smallest = std::min (smallest, cv::norm (m[i] - m[(i + 1) % 4]));
    return smallest / marker_share;
  }

  /* All corners if they determine the board's pose, else none. */
  void detect (const cv::Mat &picture, std::vector<BoardCorner> &corners) const
  {
    find_corners (picture, corners);
    if (corners.size () < kMinCharucoCorners ||
        !spans_a_plane (corners, board->getChessboardSize ().width - 1))
      corners.clear ();
  }

  void find_corners (const cv::Mat &picture, std::vector<BoardCorner> &corners) const
  {
    Markers markers;
    cv::Mat points, ids;
    detect_charuco (picture, board, markers, points, ids);
    if (points.rows == 0)
      return;
    /* OpenCV's own refinement stops at 0.1 pixels. The window must not reach the markers. */
    const double margin = 0.4 * (1 - marker_share);
    const int half = std::clamp (int (margin * square_px (markers)), 2, 11);
    cv::cornerSubPix (picture, points, {half, half}, {-1, -1},
        {cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 40, 0.001});
    for (int i = 0; i < points.rows; i++) {
      const cv::Point2f p = points.at<cv::Point2f> (i);
      corners.push_back ({ids.at<int> (i), p.x, p.y});
    }
    std::ranges::sort (corners, {}, &BoardCorner::id);
  }
};

BoardDetector::BoardDetector () = default;
BoardDetector::~BoardDetector () = default;

Status
BoardDetector::set (const BoardSpec &board, bool thorough)
{
  if (Status s = validate (board); !s.ok ())
    return s;
  board_ = board;
  thorough_ = thorough;
  found_ = mirrored_ = false;
  charuco_.reset ();
  if (board.kind == BoardKind::kCharuco) {
    charuco_ = std::make_unique<Charuco> ();
    charuco_->board = charuco_board (board);
    charuco_->marker_share = marker_of (board) / board.square_m;
  }
  return {};
}

Status
BoardDetector::detect (ImageView<const std::uint8_t> picture, std::vector<BoardCorner> &corners)
{
  corners.clear ();
  if (picture.width < 16 || picture.height < 16)
    return {};
  try {
    if (charuco_) {
      charuco_->detect (as_mat (picture), corners);
      found_ |= !corners.empty ();
      mirrored_ &= !found_;
      if (!found_ && !mirrored_) {
        cv::Mat flipped;
        std::vector<BoardCorner> seen;
        cv::flip (as_mat (picture), flipped, 1);
        charuco_->detect (flipped, seen);
        mirrored_ = !seen.empty ();
      }
      return {};
    }
    std::vector<cv::Point2f> found;
    if (find_chessboard (as_mat (picture), board_, thorough_, found))
      for (std::size_t i = 0; i < found.size (); i++)
        corners.push_back ({int (i), found[i].x, found[i].y});
  } catch (const std::exception &e) {
    corners.clear ();
    return {StatusCode::kUnsupported, std::string ("looking for a board: ") + e.what ()};
  }
  return {};
}

Status
BoardDetector::detect (
    ImageView<const Rgbx> picture, std::vector<BoardCorner> &corners, double &edge_width)
{
  grey_.resize (std::size_t (picture.width) * picture.height);
  for (int y = 0; y < picture.height; y++)
    for (int x = 0; x < picture.width; x++) {
      const Rgbx &p = picture.at (x, y);
      grey_[std::size_t (y) * picture.width + x] =
          std::uint8_t ((77 * p.r + 150 * p.g + 29 * p.b + 128) >> 8); /* BT.601 */
    }
  const ImageView<const std::uint8_t> grey{
      grey_.data (), picture.width, picture.height, picture.width};
  Status s = detect (grey, corners);
  edge_width = edge_width_px (grey, corners);
  return s;
}

double
edge_width_px (ImageView<const std::uint8_t> picture, const std::vector<BoardCorner> &corners)
{
  std::vector<double> widths;
  if (corners.size () < 2)
    return 0;
  for (std::size_t i = 0; i < corners.size (); i++) {
    const BoardCorner &c = corners[i];
    const BoardCorner &next = corners[i + 1 < corners.size () ? i + 1 : i - 1];
    const int radius = std::clamp (int (0.3 * std::hypot (next.x - c.x, next.y - c.y)), 3, 20);
    const int x0 = std::max (1, int (c.x) - radius),
              x1 = std::min (picture.width - 2, int (c.x) + radius);
    const int y0 = std::max (1, int (c.y) - radius),
              y1 = std::min (picture.height - 2, int (c.y) + radius);
    int darkest = 255, brightest = 0;
    double steepest = 0;
    for (int y = y0; y <= y1; y++)
      for (int x = x0; x <= x1; x++) {
        darkest = std::min<int> (darkest, picture.at (x, y));
        brightest = std::max<int> (brightest, picture.at (x, y));
        steepest = std::max (steepest, std::hypot (picture.at (x + 1, y) - picture.at (x - 1, y),
                                           picture.at (x, y + 1) - picture.at (x, y - 1)));
      }
    if (steepest > 0)
      widths.push_back (2 * (brightest - darkest) / steepest);
  }
  if (widths.empty ())
    return 0;
  std::ranges::nth_element (widths, widths.begin () + widths.size () / 2);
  return widths[widths.size () / 2];
}

Status
draw_board (const BoardSpec &board, int square_px, std::vector<std::uint8_t> &pixels)
{
  if (Status s = validate (board); !s.ok ())
    return s;
  if (square_px < 8 || square_px > 512)
    return bad_board ("a square of " + std::to_string (square_px) + " pixels; use 8 to 512");
  const int width = (board.columns + 3) * square_px, height = (board.rows + 3) * square_px;
  pixels.assign (std::size_t (width) * height, 255);
  cv::Mat picture (height, width, CV_8U, pixels.data ());
  const cv::Rect inner (square_px, square_px, width - 2 * square_px, height - 2 * square_px);
  if (board.kind == BoardKind::kCharuco) {
    try {
      cv::Mat drawn;
      draw_charuco (charuco_board (board), inner.size (), drawn);
      drawn.copyTo (picture (inner));
    } catch (const std::exception &e) {
      return bad_board (e.what ());
    }
    return {};
  }
  for (int j = 0; j <= board.rows; j++)
    for (int i = 0; i <= board.columns; i++)
      if ((i + j) % 2 == 0)
        picture ({inner.x + i * square_px, inner.y + j * square_px, square_px, square_px}) = 0;
  return {};
}

} // namespace rangecast
