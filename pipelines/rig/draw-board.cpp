/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Draws a calibration board for printing: an SVG at true scale.
 * usage: draw-board FILE.svg [board=chessboard|charuco] [columns=9] [rows=6] [square-size=0.025]
 *        [marker-size=M] [dictionary=4x4-50]; names and units are those of rigcalibrate's
 *        properties */
#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <rangecast/calibration/board.hpp>
#include <string>
#include <vector>

namespace {

using rangecast::BoardKind;
using rangecast::BoardSpec;

constexpr int kSquarePx = 256;

/* @return whether the whole text is a number */
template <typename Number>
bool
read_number (const std::string &text, Number &value)
{
  const auto [end, error] = std::from_chars (text.data (), text.data () + text.size (), value);
  return error == std::errc () && end == text.data () + text.size () &&
         std::isfinite (double (value));
}

/* @return what is wrong with the value, or nullptr */
const char *
set (BoardSpec &board, const std::string &name, const std::string &value)
{
  if (name == "board") {
    board.kind = value == "charuco" ? BoardKind::kCharuco : BoardKind::kChessboard;
    return value == "charuco" || value == "chessboard" ? nullptr
                                                       : "is neither chessboard nor charuco";
  }
  if (name == "columns" || name == "rows")
    return read_number (value, name == "rows" ? board.rows : board.columns)
               ? nullptr
               : "is not a whole number of inner corners";
  if (name == "square-size" || name == "marker-size")
    return read_number (value, name == "square-size" ? board.square_m : board.marker_m)
               ? nullptr
               : "is not a number of metres";
  if (name == "dictionary") {
    const auto &dictionaries = rangecast::board_dictionaries ();
    const auto dictionary = std::ranges::find (dictionaries, value);
    board.dictionary = int (dictionary - dictionaries.begin ());
    return dictionary != dictionaries.end () ? nullptr
                                             : "is no dictionary of rigcalibrate, such as 4x4-50";
  }
  return "unknown property; see --help";
}

/* Reads the words after the file name. @return false after printing an error for a wrong one */
bool
read_properties (const std::vector<std::string> &words, BoardSpec &board)
{
  for (const std::string &word : words) {
    const std::size_t equals = word.find ('=');
    const char *const wrong = equals == std::string::npos
                                  ? "is not NAME=VALUE; see --help"
                                  : set (board, word.substr (0, equals), word.substr (equals + 1));
    if (wrong) {
      std::fprintf (stderr, "draw-board: '%s': %s\n", word.c_str (), wrong);
      return false;
    }
  }
  return true;
}

/* The black pixels as rectangles: runs of a row, extended over equal rows below it. */
bool
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

constexpr char kUsage[] =
    "usage: draw-board FILE.svg [board=chessboard|charuco] [columns=9] [rows=6] "
    "[square-size=0.025] [marker-size=M] [dictionary=4x4-50]\n";

} // namespace

int
main (int argc, char **argv)
{
  const std::vector<std::string> words (argv + 1, argv + argc);
  if (std::ranges::find (words, "--help") != words.end () ||
      std::ranges::find (words, "-h") != words.end ()) {
    std::fputs (kUsage, stdout);
    return 0;
  }
  if (words.empty ()) {
    std::fputs (kUsage, stderr);
    return 2;
  }
  if (!words[0].ends_with (".svg") && !words[0].ends_with (".SVG")) {
    std::fprintf (stderr, "draw-board: '%s' does not end in .svg\n", words[0].c_str ());
    return 2;
  }
  BoardSpec board;
  if (!read_properties ({words.begin () + 1, words.end ()}, board))
    return 2;
  std::vector<std::uint8_t> pixels;
  const rangecast::Status status = rangecast::draw_board (board, kSquarePx, pixels);
  if (!status.ok ()) {
    std::fprintf (stderr, "draw-board: %s\n", status.message ().c_str ());
    return 2;
  }
  if (!write_svg (argv[1], board, pixels)) {
    std::fprintf (stderr, "draw-board: %s: cannot be written\n", argv[1]);
    return 1;
  }
  return 0;
}
