/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include <gtest/gtest.h>

#include <rangecast/overlay/stats_panel.hpp>

using namespace rangecast;

TEST (StatsPanel, is_as_large_as_its_text_and_no_larger_than_said)
{
  StatsPanel panel;
  EXPECT_TRUE (panel.picture ().empty ());
  panel.draw (std::vector<std::string>{"a", "longer"});
  const auto two = panel.picture ();
  EXPECT_GT (two.height, 30);
  const auto *memory = two.data;
  panel.draw (std::vector<std::string> (20, std::string (500, 'w')));
  EXPECT_EQ (panel.picture ().width, StatsPanel::kMaxWidth);
  EXPECT_LE (panel.picture ().height, (StatsPanel::kMaxLines + 1) * 20);
  EXPECT_EQ (panel.picture ().data, memory); /* nothing new was allocated */
}

/* Light letters on dark, in red, green, blue order, opaque. */
TEST (StatsPanel, draws_letters_where_there_are_some)
{
  StatsPanel panel;
  panel.draw (std::vector<std::string>{"MMMM", "", "..."});
  const auto picture = panel.picture ();
  int light[3] = {};
  for (int y = 0; y < picture.height; y++)
    for (int x = 0; x < picture.width; x++) {
      const Rgbx pixel = picture.at (x, y);
      EXPECT_EQ (pixel.x, 255);
      EXPECT_GE (pixel.b, pixel.r) << x << ',' << y; /* both colours are bluish */
      light[std::min (y * 3 / picture.height, 2)] += pixel.g > 128;
    }
  EXPECT_GT (light[0], 40);
  EXPECT_EQ (light[1], 0);
  EXPECT_GT (light[2], 0);
  EXPECT_LT (light[2], light[0] / 2);
}
