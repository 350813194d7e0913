/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "stats_panel.hpp"

#include <algorithm>
#include <opencv2/imgproc.hpp>

namespace rangecast {
namespace {

constexpr int kLineHeight = 18, kBorder = 6; /* pixels */
constexpr double kScale = 0.45;              /* of the font, which is 22 pixels high at 1 */
constexpr Rgbx kDark{16, 18, 21, 255};
constexpr int kFont = cv::FONT_HERSHEY_SIMPLEX;

} // namespace

void
StatsPanel::draw (std::span<const std::string> lines)
{
  const int count = std::min (int (lines.size ()), kMaxLines);
  int width = 0;
  for (int i = 0; i < count; i++)
    width = std::max (width, cv::getTextSize (lines[i], kFont, kScale, 1, nullptr).width);
  width = std::min (width + 2 * kBorder, kMaxWidth);
  const int height = count * kLineHeight + kBorder;
  memory_.reserve (std::size_t (kMaxWidth) * (kMaxLines * kLineHeight + kBorder));
  memory_.assign (std::size_t (width) * std::size_t (height), kDark);
  picture_ = {memory_.data (), width, height, std::ptrdiff_t (width * sizeof (Rgbx))};
  cv::Mat canvas (height, width, CV_8UC4, memory_.data ());
  for (int i = 0; i < count; i++)
    cv::putText (canvas, lines[i], {kBorder, (i + 1) * kLineHeight - 3}, kFont, kScale,
        {236, 240, 244, 255}, 1, cv::LINE_AA);
}

} // namespace rangecast
