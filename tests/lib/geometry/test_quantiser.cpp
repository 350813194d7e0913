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

TEST (Quantiser, says_whether_codes_are_depths_less_a_constant)
{
  for (int bits = 6; bits <= 16; bits++)
    for (const auto scale : {DepthScale::kLinear, DepthScale::kInverse}) {
      DepthQuantiser q;
      ASSERT_TRUE (q.set (1000, 3000, bits, scale).ok ());
      EXPECT_EQ (q.is_offset (), bits >= 11 && scale == DepthScale::kLinear);
      for (int d = 1000; q.is_offset () && d <= 3000; d++)
        ASSERT_EQ (q.code (static_cast<std::uint16_t> (d)), d - q.depth (0));
    }
}

/* Ranges with fewer units than codes, with more, and with the least and greatest depths there are.
 */
constexpr struct {
  std::uint16_t near, far;
} kRanges[] = {{3000, 15000}, {4500, 13000}, {100, 200}, {1, 65535}, {1, 2}, {65534, 65535}, {1, 3},
    {300, 60000}, {64000, 65535}, {7, 1000}};

TEST (Quantiser, inverse_scale_is_what_the_document_says)
{
  for (const auto [near, far] : kRanges)
    for (int bits = 6; bits <= 16; bits++) {
      DepthQuantiser q;
      ASSERT_TRUE (q.set (near, far, bits, DepthScale::kInverse).ok ());
      const std::uint64_t range = far - near, enough = (far * range + near - 1) / near,
                          last = std::min<std::uint64_t> (enough, (1u << bits) - 1);
      ASSERT_EQ (static_cast<std::uint64_t> (q.codes ()), last + 1);
      for (std::uint64_t code = 0; code <= last; code++) {
        const std::uint64_t a = far * last - code * range;
        ASSERT_EQ (q.depth (static_cast<std::uint16_t> (code)), (last * near * far + a / 2) / a);
      }
    }
}

TEST (Quantiser, inverse_steps_grow_with_the_square_of_the_depth)
{
  DepthQuantiser q;
  ASSERT_TRUE (q.set (3000, 15000, 10, DepthScale::kInverse).ok ());
  const auto step_at = [&] (std::uint16_t depth) {
    const int code = q.code (depth), n = 4;
    return (q.depth (static_cast<std::uint16_t> (code + n)) -
               q.depth (static_cast<std::uint16_t> (code - n))) /
           (2.0 * n);
  };
  EXPECT_NEAR (step_at (12000) / step_at (6000), 4, 0.2);
  EXPECT_NEAR (step_at (14000) / step_at (4000), 12.25, 0.8);
  EXPECT_NEAR (q.step (), 15000.0 * 12000 / (3000.0 * 1023), 1e-9);
}

TEST (Quantiser, codes_rise_with_depth_and_ends_are_exact_on_both_scales)
{
  for (const auto [near, far] : kRanges)
    for (DepthScale scale : {DepthScale::kLinear, DepthScale::kInverse})
      for (int bits = 6; bits <= 16; bits++) {
        DepthQuantiser q;
        ASSERT_TRUE (q.set (near, far, bits, scale).ok ());
        EXPECT_EQ (q.depth (0), near);
        EXPECT_EQ (q.depth (static_cast<std::uint16_t> (q.codes () - 1)), far);
        EXPECT_EQ (q.depth (q.code (near)), near);
        EXPECT_EQ (q.depth (q.code (far)), far);
        EXPECT_LE (q.codes (), 1 << bits);
        for (int c = 1; c < q.codes (); c++)
          ASSERT_GE (q.depth (static_cast<std::uint16_t> (c)),
              q.depth (static_cast<std::uint16_t> (c - 1)));
        for (int d = near + 1; d <= far; d++)
          ASSERT_GE (
              q.code (static_cast<std::uint16_t> (d)), q.code (static_cast<std::uint16_t> (d - 1)));
      }
}

TEST (Quantiser, decoded_depth_keeps_its_value_when_coded_again)
{
  for (const auto [near, far] : kRanges)
    for (DepthScale scale : {DepthScale::kLinear, DepthScale::kInverse})
      for (int bits = 6; bits <= 16; bits++) {
        DepthQuantiser q;
        ASSERT_TRUE (q.set (near, far, bits, scale).ok ());
        for (int c = 0; c < q.codes (); c++) {
          const std::uint16_t d = q.depth (static_cast<std::uint16_t> (c));
          ASSERT_EQ (q.depth (q.code (d)), d) << near << " " << far << " " << bits;
        }
      }
}

TEST (Quantiser, inverse_code_is_the_least_of_those_nearest)
{
  for (const auto [near, far] : {kRanges[2], kRanges[9]})
    for (int bits : {6, 8, 12}) {
      DepthQuantiser q;
      ASSERT_TRUE (q.set (near, far, bits, DepthScale::kInverse).ok ());
      for (int d = near; d <= far; d++) {
        const auto distance = [&] (int c) {
          return std::abs (q.depth (static_cast<std::uint16_t> (c)) - d);
        };
        int best = 0;
        for (int c = 1; c < q.codes (); c++)
          if (distance (c) < distance (best))
            best = c;
        ASSERT_EQ (q.code (static_cast<std::uint16_t> (d)), best);
      }
    }
}

TEST (Quantiser, inverse_scale_is_exact_where_the_codes_suffice)
{
  DepthQuantiser q;
  ASSERT_TRUE (q.set (3000, 15000, 16, DepthScale::kInverse).ok ());
  EXPECT_EQ (q.codes (), 60001);
  EXPECT_EQ (q.max_error (), 0);
  ASSERT_TRUE (q.set (3000, 15000, 12, DepthScale::kInverse).ok ());
  EXPECT_GT (q.max_error (), 0);
}

TEST (Quantiser, error_with_a_threshold_is_that_of_the_worst_pair_of_codes)
{
  for (DepthScale scale : {DepthScale::kLinear, DepthScale::kInverse})
    for (int bits : {6, 9, 12})
      for (int threshold : {0, 1, 5, 100, 65535}) {
        DepthQuantiser q;
        ASSERT_TRUE (q.set (3000, 4000, bits, scale).ok ());
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
