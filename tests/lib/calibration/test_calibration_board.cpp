/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Boards: what they may be, how they are drawn, and that corners are found where they are. */
#include "../board-renderer.hpp"
#include "../test-support.hpp"

#include <rangecast/calibration/board.hpp>

using namespace rangecast;
using namespace rangecast::testing;

namespace {

/* A board drawn flat, 32 pixels a square. */
struct Drawn {
  static constexpr int kSquare = 32;
  BoardSpec board;
  std::vector<std::uint8_t> pixels;

  explicit Drawn (const BoardSpec &spec) : board (spec)
  {
    EXPECT_TRUE (draw_board (board, kSquare, pixels).ok ());
  }
  [[nodiscard]] ImageView<const std::uint8_t> view () const
  {
    const int width = (board.columns + 3) * kSquare;
    return {pixels.data (), width, (board.rows + 3) * kSquare, width};
  }
  /* Where a corner is. */
  [[nodiscard]] double x (int id) const { return (2 + id % board.columns) * kSquare - 0.5; }
  [[nodiscard]] double y (int id) const { return (2 + id / board.columns) * kSquare - 0.5; }
};

std::vector<BoardCorner>
detect (const BoardSpec &board, ImageView<const std::uint8_t> picture)
{
  BoardDetector detector;
  EXPECT_TRUE (detector.set (board).ok ());
  std::vector<BoardCorner> corners;
  EXPECT_TRUE (detector.detect (picture, corners).ok ());
  return corners;
}

BoardSpec
charuco ()
{
  BoardSpec board;
  board.kind = BoardKind::kCharuco;
  return board;
}

} // namespace

TEST (CalibrationBoard, corners_are_found_where_they_are_drawn)
{
  for (const BoardSpec &board :
      {BoardSpec{}, charuco (), BoardSpec{BoardKind::kChessboard, 4, 7}}) {
    const Drawn drawn (board);
    const auto corners = detect (board, drawn.view ());
    ASSERT_EQ (corners.size (), std::size_t (board.corner_count ()));
    for (int id = 0; id < board.corner_count (); id++) {
      EXPECT_EQ (corners[id].id, id);
      EXPECT_NEAR (corners[id].x, drawn.x (id), 0.05);
      EXPECT_NEAR (corners[id].y, drawn.y (id), 0.05);
    }
  }
}

TEST (CalibrationBoard, corners_keep_their_numbers_when_the_board_is_turned)
{
  for (const BoardSpec &board : {BoardSpec{}, charuco ()}) {
    Drawn drawn (board);
    std::ranges::reverse (drawn.pixels); /* half a turn */
    const auto corners = detect (board, drawn.view ());
    ASSERT_EQ (corners.size (), std::size_t (board.corner_count ()));
    const auto view = drawn.view ();
    for (int id = 0; id < board.corner_count (); id++) {
      EXPECT_NEAR (corners[id].x, view.width - 1 - drawn.x (id), 0.05);
      EXPECT_NEAR (corners[id].y, view.height - 1 - drawn.y (id), 0.05);
    }
  }
}

TEST (CalibrationBoard, part_of_a_charuco_board_will_do)
{
  const Drawn drawn (charuco ());
  const auto whole = drawn.view ();
  const auto part = whole.crop (0, 0, whole.width / 2, whole.height);
  const auto corners = detect (drawn.board, part);
  EXPECT_GE (corners.size (), 12U);
  EXPECT_LT (corners.size (), 54U);
  for (const BoardCorner &c : corners)
    EXPECT_NEAR (c.x, drawn.x (c.id), 0.05);
  EXPECT_TRUE (detect ({}, part).empty ()); /* but not of a chessboard */
}

TEST (CalibrationBoard, charuco_board_in_a_mirror_is_told)
{
  Drawn drawn (charuco ());
  BoardDetector detector;
  ASSERT_TRUE (detector.set (drawn.board).ok ());
  std::vector<BoardCorner> corners;
  const auto view = drawn.view ();
  const auto mirror = [&] {
    for (int y = 0; y < view.height; y++)
      std::reverse (drawn.pixels.begin () + std::ptrdiff_t (y) * view.width,
          drawn.pixels.begin () + std::ptrdiff_t (y + 1) * view.width);
  };
  mirror ();
  ASSERT_TRUE (detector.detect (view, corners).ok ());
  EXPECT_TRUE (corners.empty ());
  EXPECT_TRUE (detector.is_mirrored ());
  mirror ();
  ASSERT_TRUE (detector.detect (view, corners).ok ());
  EXPECT_FALSE (corners.empty ());
  EXPECT_FALSE (detector.is_mirrored ());
}

TEST (CalibrationBoard, pictures_without_a_board_have_no_corners)
{
  std::vector<std::uint8_t> noise (320 * 240);
  std::mt19937 random (1);
  for (auto &pixel : noise)
    pixel = std::uint8_t (random ());
  for (const BoardSpec &board : {BoardSpec{}, charuco ()}) {
    EXPECT_TRUE (detect (board, {noise.data (), 320, 240, 320}).empty ());
    EXPECT_TRUE (detect (board, {noise.data (), 1, 1, 1}).empty ());
    EXPECT_TRUE (detect (board, {nullptr, 0, 0, 0}).empty ());
    const std::vector<std::uint8_t> black (320 * 240);
    EXPECT_TRUE (detect (board, {black.data (), 320, 240, 320}).empty ());
  }
}

TEST (CalibrationBoard, blur_widens_edges)
{
  TrueCamera t;
  t.camera = {"camera", 0, CameraRole::kLeft, 640, 480};
  t.lens = {600, 600, 319.5, 239.5};
  std::mt19937 random (2);
  BoardRenderer renderer (t, {});
  auto picture = renderer.render (random_board (t, {}, 0.4, 0, 0, random), 0, random);
  const auto corners = detect ({}, {picture.data (), 640, 480, 640});
  ASSERT_EQ (corners.size (), 54U);
  const double sharp = edge_width_px ({picture.data (), 640, 480, 640}, corners);
  EXPECT_LT (sharp, 3);
  const auto before = picture;
  for (int y = 0; y < 480; y++) /* as by a movement of 11 pixels */
    for (int x = 5; x < 635; x++) {
      int sum = 0;
      for (int i = -5; i <= 5; i++)
        sum += before[y * 640 + x + i];
      picture[y * 640 + x] = std::uint8_t (sum / 11);
    }
  for (int y = 5; y < 475; y++)
    for (int x = 0; x < 640; x++)
      picture[y * 640 + x] = std::uint8_t ((picture[y * 640 + x] + picture[(y - 5) * 640 + x]) / 2);
  EXPECT_GT (edge_width_px ({picture.data (), 640, 480, 640}, corners), 1.5 * sharp);
  EXPECT_EQ (edge_width_px ({picture.data (), 640, 480, 640}, {}), 0);
}

TEST (CalibrationBoard, impossible_boards_are_refused_by_name)
{
  const auto refused = [] (auto change, const char *text) {
    BoardSpec board = charuco ();
    change (board);
    const Status status = validate (board);
    EXPECT_EQ (status.code (), StatusCode::kBadValue);
    EXPECT_NE (status.message ().find (text), std::string::npos) << status.message ();
    BoardDetector detector;
    EXPECT_FALSE (detector.set (board).ok ());
  };
  EXPECT_TRUE (validate (charuco ()).ok ());
  refused ([] (BoardSpec &b) { b.columns = 2; }, "columns is 2");
  refused ([] (BoardSpec &b) { b.rows = 33; }, "rows is 33");
  refused ([] (BoardSpec &b) { b.square_m = 0; }, "square size");
  refused ([] (BoardSpec &b) { b.square_m = NAN; }, "square size");
  refused ([] (BoardSpec &b) { b.marker_m = 0.025; }, "marker size");
  refused ([] (BoardSpec &b) { b.dictionary = 99; }, "dictionary 99");
  refused ([] (BoardSpec &b) { b.columns = b.rows = 20; },
      "4x4-50 has 50 markers; use one with at least 220");
}
