/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Draws a calibration board to print: an SVG in its true size.
 * usage: draw-board FILE.svg [board=chessboard|charuco] [columns=9] [rows=6] [square-size=0.025]
 *        [marker-size=M] [dictionary=4x4-50]; names and units as rigcalibrate's properties have
 * them */
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <rangecast/calibration/board.hpp>
#include <string>

using rangecast::BoardKind;
using rangecast::BoardSpec;

static constexpr int kSquarePx = 256;

static bool
set (BoardSpec &board, const std::string &name, const std::string &value)
{
  const auto &dictionaries = rangecast::board_dictionaries ();
  const auto dictionary = std::ranges::find (dictionaries, value);
  if (name == "board" && (value == "chessboard" || value == "charuco"))
    board.kind = value == "charuco" ? BoardKind::kCharuco : BoardKind::kChessboard;
  else if (name == "columns")
    board.columns = std::atoi (value.c_str ());
  else if (name == "rows")
    board.rows = std::atoi (value.c_str ());
  else if (name == "square-size")
    board.square_m = std::atof (value.c_str ());
  else if (name == "marker-size")
    board.marker_m = std::atof (value.c_str ());
  else if (name == "dictionary" && dictionary != dictionaries.end ())
    board.dictionary = int (dictionary - dictionaries.begin ());
  else
    return false;
  return true;
}

/* The black pixels as rectangles: runs of a row, as high as the rows that are like it. */
static bool
write_svg (const char *path, const BoardSpec &board, const std::vector<std::uint8_t> &pixels)
{
  std::FILE *file = std::fopen (path, "w");
  if (!file)
    return false;
  const int width = (board.columns + 3) * kSquarePx, height = (board.rows + 3) * kSquarePx;
  const double mm = 1000 * board.square_m / kSquarePx;
  std::fprintf (file,
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%.4fmm\" height=\"%.4fmm\" "
      "viewBox=\"0 0 %d %d\" shape-rendering=\"crispEdges\">\n"
      "<rect width=\"%d\" height=\"%d\" fill=\"white\"/>\n",
      width * mm, height * mm, width, height, width, height);
  for (int y = 0, below; y < height; y = below) {
    const auto row = pixels.begin () + std::ptrdiff_t (y) * width;
    for (below = y + 1; below < height;)
      if (std::equal (row, row + width, row + std::ptrdiff_t (below - y) * width))
        below++;
      else
        break;
    for (int x = 0, end; x < width; x = end) {
      for (end = x + 1; end < width && row[end] == row[x];)
        end++;
      if (row[x] < 128)
        std::fprintf (file, "<rect x=\"%d\" y=\"%d\" width=\"%d\" height=\"%d\"/>\n", x, y, end - x,
            below - y);
    }
  }
  std::fprintf (file, "</svg>\n");
  return std::fclose (file) == 0;
}

int
main (int argc, char **argv)
{
  BoardSpec board;
  for (int i = 2; i < argc; i++) {
    const std::string word = argv[i];
    const std::size_t equals = word.find ('=');
    if (equals == std::string::npos ||
        !set (board, word.substr (0, equals), word.substr (equals + 1))) {
      std::fprintf (
          stderr, "draw-board: '%s': expected a property of rigcalibrate's board\n", argv[i]);
      return 2;
    }
  }
  if (argc < 2) {
    std::fprintf (stderr, "usage: draw-board FILE.svg [board=chessboard|charuco] [columns=9] "
                          "[rows=6] [square-size=0.025] [marker-size=M] [dictionary=4x4-50]\n");
    return 2;
  }
  std::vector<std::uint8_t> pixels;
  const rangecast::Status status = rangecast::draw_board (board, kSquarePx, pixels);
  if (!status.ok ()) {
    std::fprintf (stderr, "draw-board: %s\n", status.message ().c_str ());
    return 2;
  }
  if (!write_svg (argv[1], board, pixels)) {
    std::fprintf (stderr, "draw-board: cannot write %s\n", argv[1]);
    return 1;
  }
  return 0;
}
