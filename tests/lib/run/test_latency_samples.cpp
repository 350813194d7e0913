/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The latencies that rangecast-run keeps of a long run. */
#include <gtest/gtest.h>

#include "run/latency-samples.hpp"

static LatencySamples
ramp (int count)
{
  LatencySamples samples;
  for (int i = 0; i < count; i++)
    samples.add (i);
  return samples;
}

TEST (LatencySamples, none_is_zero)
{
  EXPECT_EQ (LatencySamples ().percentile (0.5), 0);
  EXPECT_EQ (LatencySamples ().count (), 0u);
}

TEST (LatencySamples, a_short_run_is_exact)
{
  const int count = int (LatencySamples::kMax);
  const LatencySamples samples = ramp (count);
  EXPECT_EQ (samples.count (), LatencySamples::kMax);
  EXPECT_EQ (samples.percentile (0), 0);
  EXPECT_EQ (samples.percentile (0.5), (count - 1) / 2);
  EXPECT_EQ (samples.percentile (1), count - 1);
}

/* Ten times as many as are kept: all of the run counts, not its beginning or its end. */
TEST (LatencySamples, a_long_run_is_known_by_a_fair_share_of_it)
{
  const int count = 10 * int (LatencySamples::kMax);
  const LatencySamples samples = ramp (count);
  EXPECT_EQ (samples.count (), std::uint64_t (count));
  for (const double p : {0.01, 0.25, 0.5, 0.75, 0.99})
    EXPECT_NEAR (samples.percentile (p) / count, p, 0.01) << p;
}
