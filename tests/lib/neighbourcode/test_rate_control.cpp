/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Rate control with encoders that are formulas: bytes follow thresholds with some slope, noise and
 * change of content. What is asserted is bytes over windows of two seconds, and thresholds. */
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>
#include <rangecast/neighbourcode/rate/rate_control.hpp>
#include <vector>

using namespace rangecast;

namespace {

/* bits a point = bits_at_10 * (10.5 / (threshold + 0.5)) ^ slope, of both thresholds' mean. */
struct Encoder {
  double slope = 0.6, bits_at_10 = 2.5, noise = 0.02;
  std::uint64_t points = 40000, pixels = 60000;
  double times = 1; /* of a refresh: more bytes */
  std::mt19937 random{1};

  CodedFrame code (const Thresholds &t)
  {
    const double mean = std::sqrt ((t.depth + 0.5) * (t.colour + 0.5));
    const double any = std::normal_distribution<double> (0, noise) (random);
    const double bits = bits_at_10 * std::pow (10.5 / mean, slope) * std::exp (any) * times;
    return {static_cast<std::uint64_t> (double (points) * bits / 8) + 72, points, pixels, false};
  }
};

struct Sent {
  double time_s;
  double bytes;
  Thresholds thresholds;
};

struct Stream {
  RateControl control;
  RateSettings settings;
  Encoder encoder;
  std::vector<Sent> sent;
  double time_s = 100; /* of the next frame set */
  double interval_s = 1.0 / 30;

  Stream () { settings = {2.5e6, {8, 10}, {48, 48}, 2.5, 1.0 / 30}; }
  void frame (bool refresh = false)
  {
    control.configure (settings);
    const auto ns = static_cast<std::uint64_t> (time_s * 1e9);
    const Thresholds t = control.next (ns, encoder.pixels);
    CodedFrame coded = encoder.code (t);
    coded.refresh = refresh;
    control.coded (coded);
    sent.push_back ({time_s, double (coded.bytes), t});
    time_s += interval_s;
  }
  void play (double seconds)
  {
    for (const double end = time_s + seconds - 1e-6; time_s < end;)
      frame ();
  }
  /* Bits/s from `from` to `to`, of the frame sets whose time lies there. */
  double rate (double from_s, double to_s) const
  {
    double bytes = 0;
    for (const Sent &s : sent)
      bytes += s.time_s >= from_s - 1e-6 && s.time_s < to_s - 1e-6 ? s.bytes : 0;
    return 8 * bytes / (to_s - from_s);
  }
  /* Every window of two seconds from `from` on is within a share of the target. */
  void expect_on_target (double from_s, double share = 0.1) const
  {
    for (double begin = from_s; begin + 2 <= time_s + 1e-6; begin += 0.2)
      ASSERT_NEAR (rate (begin, begin + 2) / settings.bits_per_s, 1, share)
          << "from " << begin << ", slope " << encoder.slope << ", interval " << interval_s;
  }
  /* The most that any threshold changes from one frame set to the next. */
  int greatest_change (double from_s) const
  {
    int most = 0;
    for (std::size_t i = 1; i < sent.size (); i++)
      if (sent[i].time_s >= from_s)
        most = std::max ({most, std::abs (sent[i].thresholds.depth - sent[i - 1].thresholds.depth),
            std::abs (sent[i].thresholds.colour - sent[i - 1].thresholds.colour)});
    return most;
  }
  /* Least and greatest colour threshold. */
  std::pair<int, int> range (double from_s) const
  {
    std::pair<int, int> range = {1000, -1};
    for (const Sent &s : sent)
      if (s.time_s >= from_s)
        range = {std::min (range.first, s.thresholds.colour),
            std::max (range.second, s.thresholds.colour)};
    return range;
  }
};

} // namespace

TEST (RateControl, windows_of_two_seconds_are_on_target_for_any_slope_and_frame_rate)
{
  for (double slope : {0.3, 0.6, 1.0, 1.4})
    for (double fps : {5.0, 15.0, 30.0, 90.0}) {
      Stream stream;
      stream.encoder.slope = slope;
      stream.interval_s = stream.settings.interval_s = 1 / fps;
      stream.settings.bits_per_s = 40000 * fps * 2.5 * std::pow (0.55, slope);
      stream.play (10);
      stream.expect_on_target (101);
    }
}

TEST (RateControl, wrong_guess_costs_less_than_a_second)
{
  for (double wrong : {0.2, 0.5, 2.0, 5.0}) {
    Stream stream;
    stream.settings.bits_per_point = 2.5 * wrong;
    stream.play (8);
    stream.expect_on_target (101);
  }
}

TEST (RateControl, thresholds_hardly_move_in_the_steady_state)
{
  for (double slope : {0.3, 0.6, 1.2}) {
    Stream stream;
    stream.encoder.slope = slope;
    stream.settings.bits_per_s = 40000 * 30 * 2.5 * std::pow (0.55, slope);
    stream.play (20);
    const auto [least, greatest] = stream.range (105);
    EXPECT_LE (stream.greatest_change (105), 1) << slope;
    EXPECT_LE (greatest - least, 3) << slope;
    int changes = 0;
    for (std::size_t i = 151; i < stream.sent.size (); i++)
      changes += !(stream.sent[i].thresholds == stream.sent[i - 1].thresholds);
    EXPECT_LT (changes, int (stream.sent.size ()) / 15) << slope;
  }
}

TEST (RateControl, content_that_doubles_or_halves_is_followed_within_a_second)
{
  for (double factor : {0.6, 1.6, 2.0}) {
    Stream stream;
    stream.settings.worst = {200, 200};
    stream.settings.best = {2, 2};
    stream.play (5);
    stream.encoder.bits_at_10 *= factor;
    stream.play (8);
    stream.expect_on_target (101.5, 0.3);
    stream.expect_on_target (106.2);
  }
}

TEST (RateControl, new_targets_are_reached_within_a_second)
{
  for (double factor : {0.5, 0.7, 1.5, 2.0}) {
    Stream stream;
    stream.settings.best = {1, 1};
    stream.settings.worst = {200, 200};
    stream.play (5);
    stream.settings.bits_per_s *= factor;
    stream.play (7);
    stream.expect_on_target (106);
  }
}

TEST (RateControl, targets_out_of_reach_leave_thresholds_at_their_limits)
{
  for (double target : {1.0, 1e4, 1e9}) {
    Stream stream;
    stream.settings.bits_per_s = target;
    stream.play (5);
    const Thresholds expected = target > 1e6 ? stream.settings.best : stream.settings.worst;
    for (std::size_t i = 10; i < stream.sent.size (); i++)
      ASSERT_EQ (stream.sent[i].thresholds, expected);
  }
}

TEST (RateControl, absence_saves_nothing_up_and_changes_nothing)
{
  Stream stream;
  stream.play (5);
  const Thresholds before = stream.sent.back ().thresholds;
  const Encoder person = stream.encoder;
  stream.encoder.points = stream.encoder.pixels = 0;
  stream.play (10);
  EXPECT_EQ (stream.sent.back ().thresholds, before);
  stream.encoder = person;
  const double back = stream.time_s;
  stream.play (5);
  EXPECT_NEAR (stream.rate (back, back + 0.5) / stream.settings.bits_per_s, 1, 0.15);
  stream.expect_on_target (back);
  EXPECT_LE (stream.greatest_change (back), 2);
}

TEST (RateControl, frame_rate_that_changes_is_followed)
{
  for (double factor : {0.5, 2.0}) {
    Stream stream;
    stream.settings.best = {1, 1};
    stream.settings.worst = {200, 200};
    stream.play (4);
    stream.interval_s *= factor;
    stream.play (8);
    stream.expect_on_target (106);
  }
}

/* 32 times as large they take two thirds of the bytes at 15 frames a second. */
TEST (RateControl, key_frame_sets_every_second_are_on_target_however_large_they_are)
{
  for (double fps : {15.0, 30.0})
    for (double key : {2.0, 4.0, 8.0, 16.0, 32.0})
      for (double slope : {0.3, 0.6, 1.0}) {
        Stream stream;
        stream.interval_s = stream.settings.interval_s = 1 / fps;
        stream.encoder.slope = slope;
        stream.settings.best = {2, 2};
        stream.settings.worst = {200, 200};
        const double mean = (key + fps - 1) / fps;
        stream.settings.bits_per_s = 40000 * fps * 2.5 * mean * std::pow (0.7, slope);
        for (int i = 0; i < 30 * int (fps); i++) {
          const bool refresh = i % int (fps) == 0;
          stream.encoder.times = refresh ? key : 1;
          stream.frame (refresh && i > 0);
        }
        stream.expect_on_target (106);
        const auto [least, greatest] = stream.range (106);
        EXPECT_LE (greatest, (key > 16 ? 3.5 : 1.6) * least) << key << ", slope " << slope;
        EXPECT_LE (stream.greatest_change (106), key > 16 ? 3 : 2);
      }
}

TEST (RateControl, limits_that_change_hold_at_once_and_thresholds_go_on)
{
  Stream stream;
  stream.play (5);
  const Thresholds before = stream.sent.back ().thresholds;
  stream.settings.worst = {60, 100};
  stream.play (3);
  EXPECT_LE (stream.greatest_change (105), 2) << "within them, none is far off";
  stream.settings.best = {before.depth + 5, before.colour + 9};
  stream.frame ();
  EXPECT_GE (stream.sent.back ().thresholds.depth, before.depth + 5);
  EXPECT_GE (stream.sent.back ().thresholds.colour, before.colour + 9);
  stream.settings.best = {0, 0};
  stream.settings.worst = {3, 4};
  stream.frame ();
  EXPECT_LE (stream.sent.back ().thresholds.depth, 3);
  EXPECT_LE (stream.sent.back ().thresholds.colour, 4);
}

TEST (RateControl, thresholds_stay_within_limits_whatever_comes)
{
  std::mt19937_64 random (5);
  for (int round = 0; round < 50; round++) {
    RateControl control;
    RateSettings settings = {1, {int (random () % 20), int (random () % 20)},
        {int (random () % 65536), int (random () % 256)}, 3, 0.03};
    std::uint64_t time = random ();
    for (int i = 0; i < 300; i++) {
      if (random () % 20 == 0)
        settings.bits_per_s = 1 + double (random () % 4294967295u);
      control.configure (settings);
      time += random () % 10 == 0 ? random () : random () % 100'000'000;
      const auto some = [&] { return random () >> (random () % 64); };
      const Thresholds t = control.next (time, some ());
      ASSERT_GE (t.depth, settings.best.depth);
      ASSERT_LE (t.depth, std::max (settings.best.depth, settings.worst.depth));
      ASSERT_GE (t.colour, settings.best.colour);
      ASSERT_LE (t.colour, std::max (settings.best.colour, settings.worst.colour));
      ASSERT_TRUE (std::isfinite (control.coarseness ()));
      control.coded ({some (), some (), some (), random () % 4 == 0});
    }
  }
}

TEST (RateMeter, is_the_mean_of_the_last_two_seconds)
{
  RateMeter meter;
  EXPECT_EQ (meter.bits_per_s (), 0);
  std::uint64_t time = 77;
  meter.add (time, 1'000'000);
  EXPECT_EQ (meter.bits_per_s (), 0) << "one frame set has no rate";
  for (int i = 0; i < 100; i++)
    meter.add (time += 40'000'000, 5000);
  EXPECT_NEAR (meter.bits_per_s (), 1e6, 1);
  for (int i = 0; i < 51; i++)
    meter.add (time += 40'000'000, 10000);
  EXPECT_NEAR (meter.bits_per_s (), 2e6, 1);
}

TEST (RateMeter, starts_over_where_time_goes_back)
{
  RateMeter meter;
  meter.add (1'000'000'000, 100);
  meter.add (1'100'000'000, 100);
  meter.add (5, 100);
  EXPECT_EQ (meter.bits_per_s (), 0);
  meter.add (100'000'005, 1900);
  EXPECT_NEAR (meter.bits_per_s (), 80'000, 1);
}
