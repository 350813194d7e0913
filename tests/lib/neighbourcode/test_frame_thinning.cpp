/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include <gtest/gtest.h>

#include <rangecast/neighbourcode/rate/frame_thinning.hpp>
#include <vector>

using namespace rangecast;

static constexpr std::uint64_t kInterval = 1'000'000'000 / 30;

/* Which of n frame sets are kept, from frame set `first` on. */
static std::vector<int>
kept (FrameThinning &thinning, int first, int n, double bits_per_s, double min_bits,
    double min_fps = 1)
{
  std::vector<int> numbers;
  for (int i = first; i < first + n; i++)
    if (thinning.keep (
            {std::uint64_t (i) * kInterval + 3000, kInterval, bits_per_s, min_bits, min_fps}))
      numbers.push_back (i);
  return numbers;
}

TEST (FrameThinning, keeps_all_where_there_is_enough)
{
  FrameThinning thinning;
  EXPECT_EQ (kept (thinning, 0, 100, 3e6, 0.99e5).size (), 100u);
  EXPECT_EQ (kept (thinning, 100, 100, 0, 1e9).size (), 100u) << "no limit";
  EXPECT_EQ (kept (thinning, 200, 100, 3e6, 0).size (), 100u) << "not known";
}

TEST (FrameThinning, keeps_every_second_or_third_evenly)
{
  for (const auto &[min_bits, n] : {std::pair{1.5e5, 2}, {2.5e5, 3}, {9.5e5, 10}}) {
    FrameThinning thinning;
    kept (thinning, 0, 30, 3e6, min_bits);
    const auto numbers = kept (thinning, 30, 120, 3e6, min_bits);
    ASSERT_GE (numbers.size (), 120u / unsigned (n) - 1);
    for (std::size_t i = 1; i < numbers.size (); i++)
      EXPECT_EQ (numbers[i] - numbers[i - 1], n);
  }
}

TEST (FrameThinning, encoders_that_began_at_other_times_keep_the_same_ones)
{
  FrameThinning a, b;
  kept (a, 0, 60, 3e6, 2.5e5);
  kept (b, 17, 43, 3e6, 2.5e5);
  EXPECT_EQ (kept (a, 60, 60, 3e6, 2.5e5), kept (b, 60, 60, 3e6, 2.5e5));
}

TEST (FrameThinning, returns_to_all_where_there_is_a_fifth_more_for_two_seconds)
{
  FrameThinning thinning;
  kept (thinning, 0, 30, 3e6, 1.5e5);
  EXPECT_EQ (kept (thinning, 30, 300, 3e6, 0.95e5).size (), 150u) << "too little more";
  EXPECT_EQ (kept (thinning, 330, 50, 3e6, 0.8e5).size (), 25u) << "too soon";
  kept (thinning, 380, 20, 3e6, 0.8e5);
  EXPECT_EQ (kept (thinning, 400, 20, 3e6, 0.8e5).size (), 20u);
}

TEST (FrameThinning, never_fewer_than_the_least_frame_rate)
{
  FrameThinning thinning;
  kept (thinning, 0, 60, 1e3, 1e6, 5);
  EXPECT_EQ (kept (thinning, 60, 300, 1e3, 1e6, 5).size (), 50u);
  EXPECT_EQ (kept (thinning, 360, 30, 1e3, 1e6, 30).size (), 30u) << "a new minimum rate";
}

TEST (FrameThinning, interval_of_0_keeps_all)
{
  FrameThinning thinning;
  EXPECT_TRUE (thinning.keep ({0, 0, 1, 1e9, 1}));
}

/* A stream of which nobody says how fast it is, or something wrong. */
TEST (FrameThinning, rate_at_which_frame_sets_come_counts_where_the_stream_says_another)
{
  for (const int fps : {5, 15, 60}) {
    FrameThinning thinning;
    int kept = 0;
    for (int i = 0; i < 20 * fps; i++) /* 1.5 times as many bits as there are */
      kept += thinning.keep ({std::uint64_t (i) * 1'000'000'000 / unsigned (fps) + 3000, kInterval,
                  1e5 * fps, 1.5e5, 1}) &&
              i >= 10 * fps;
    EXPECT_NEAR (kept, 5 * fps, 1) << fps;
  }
}
