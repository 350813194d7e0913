/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "test-support.hpp"

#include <rangecast/geometry/quantiser.hpp>

using namespace rangecast;

TEST (Quantiser, is_exact_where_the_codes_suffice)
{
  DepthQuantiser q;
  ASSERT_TRUE (q.set (4500, 13000, 16).ok ());
  EXPECT_EQ (q.codes (), 8501);
  EXPECT_EQ (q.max_error (), 0);
  for (int d = 4500; d <= 13000; d++)
    ASSERT_EQ (q.depth (q.code (static_cast<std::uint16_t> (d))), d);
}

TEST (Quantiser, error_is_at_most_half_a_step_and_stated)
{
  for (int bits : {6, 8, 10, 12}) {
    DepthQuantiser q;
    ASSERT_TRUE (q.set (4500, 13000, bits).ok ());
    EXPECT_EQ (q.codes (), 1 << bits);
    int worst = 0;
    for (int d = 4500; d <= 13000; d++)
      worst = std::max (worst, std::abs (q.depth (q.code (static_cast<std::uint16_t> (d))) - d));
    EXPECT_EQ (worst, q.max_error ());
    EXPECT_LE (worst, q.step () / 2 + 1);
  }
}

TEST (Quantiser, ends_are_valid_and_beyond_is_not)
{
  DepthQuantiser q;
  ASSERT_TRUE (q.set (100, 200, 6).ok ());
  EXPECT_EQ (q.depth (q.code (100)), 100);
  EXPECT_EQ (q.depth (q.code (200)), 200);
  EXPECT_FALSE (q.valid (0));
  EXPECT_FALSE (q.valid (99));
  EXPECT_FALSE (q.valid (201));
}

TEST (Quantiser, whole_16_bit_range_is_exact)
{
  DepthQuantiser q;
  ASSERT_TRUE (q.set (1, 65535, 16).ok ());
  EXPECT_EQ (q.max_error (), 0);
  EXPECT_EQ (q.depth (q.code (65535)), 65535);
}

TEST (Quantiser, refuses_absurd_ranges)
{
  DepthQuantiser q;
  EXPECT_FALSE (q.set (0, 10, 8).ok ());
  EXPECT_FALSE (q.set (10, 10, 8).ok ());
  EXPECT_FALSE (q.set (1, 10, 5).ok ());
  EXPECT_FALSE (q.set (1, 10, 17).ok ());
}

TEST (Quantiser, colour_of_8_bits_is_exact_and_of_fewer_keeps_black_and_white)
{
  ColourQuantiser exact (8);
  for (int v = 0; v < 256; v++)
    ASSERT_EQ (exact.value (exact.code (static_cast<std::uint8_t> (v))), v);
  for (int bits = 4; bits < 8; bits++) {
    ColourQuantiser q (bits);
    EXPECT_EQ (q.value (q.code (0)), 0);
    EXPECT_EQ (q.value (q.code (255)), 255);
    const int step = 255 / ((1 << bits) - 1);
    for (int v = 0; v < 256; v++)
      ASSERT_LE (std::abs (q.value (q.code (static_cast<std::uint8_t> (v))) - v), step / 2 + 1);
  }
}
