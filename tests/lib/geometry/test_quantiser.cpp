/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "../test-support.hpp"

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

/* Ranges with fewer units than codes, with more, and with the least and greatest depths there are.
 */
constexpr struct {
  std::uint16_t near, far;
} kRanges[] = {{3000, 15000}, {4500, 13000}, {100, 200}, {1, 65535}, {1, 2}, {65534, 65535}, {1, 3},
    {300, 60000}, {64000, 65535}, {7, 1000}};

TEST (Quantiser, codes_rise_with_depth_and_ends_are_exact)
{
  for (const auto [near, far] : kRanges)
    for (int bits = 6; bits <= 16; bits++) {
      DepthQuantiser q;
      ASSERT_TRUE (q.set (near, far, bits).ok ());
      EXPECT_EQ (q.depth (0), near);
      EXPECT_EQ (q.depth (static_cast<std::uint16_t> (q.codes () - 1)), far);
      EXPECT_EQ (q.depth (q.code (near)), near);
      EXPECT_EQ (q.depth (q.code (far)), far);
      EXPECT_LE (q.codes (), 1 << bits);
      for (int c = 1; c < q.codes (); c++)
        ASSERT_GE (
            q.depth (static_cast<std::uint16_t> (c)), q.depth (static_cast<std::uint16_t> (c - 1)));
      for (int d = near + 1; d <= far; d++)
        ASSERT_GE (
            q.code (static_cast<std::uint16_t> (d)), q.code (static_cast<std::uint16_t> (d - 1)));
    }
}

TEST (Quantiser, decoded_depth_keeps_its_value_when_coded_again)
{
  for (const auto [near, far] : kRanges)
    for (int bits = 6; bits <= 16; bits++) {
      DepthQuantiser q;
      ASSERT_TRUE (q.set (near, far, bits).ok ());
      for (int c = 0; c < q.codes (); c++) {
        const std::uint16_t d = q.depth (static_cast<std::uint16_t> (c));
        ASSERT_EQ (q.depth (q.code (d)), d) << near << " " << far << " " << bits;
      }
    }
}

TEST (Quantiser, error_with_a_threshold_is_that_of_the_worst_pair_of_codes)
{
  for (int bits : {6, 9, 12})
    for (int threshold : {0, 1, 5, 100, 65535}) {
      DepthQuantiser q;
      ASSERT_TRUE (q.set (3000, 4000, bits).ok ());
      int worst = 0;
      for (int d = 3000; d <= 4000; d++)
        for (int c = 0; c < q.codes (); c++)
          if (std::abs (c - q.code (static_cast<std::uint16_t> (d))) <= threshold)
            worst = std::max (worst, std::abs (q.depth (static_cast<std::uint16_t> (c)) - d));
      EXPECT_EQ (q.max_error (threshold), worst);
    }
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
