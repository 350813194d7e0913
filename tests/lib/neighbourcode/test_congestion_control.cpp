/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Streams over simulated links: what they send, how long packets wait, what is lost. Rates are
 * means over many seconds, from when the stream has found its rate. */
#include <gtest/gtest.h>

#include <cstdio>

#include "link-simulation.hpp"

using namespace rangecast;
using namespace rangecast::testing;

static double
rate_of (const StreamResult &result, double seconds)
{
  return 8 * result.arrived_bytes / seconds;
}

TEST (CongestionControl, stays_below_the_capacity_of_links_of_1_to_20_Mbit_per_s)
{
  for (const double capacity : {1e6, 3e6, 5e6, 20e6})
    for (const double fps : {5.0, 15.0, 30.0}) {
      LinkSimulation sim (1, 30e6);
      sim.link.bits_per_s = capacity;
      sim.streams[0].fps = fps;
      sim.run (8);
      const StreamResult result = sim.measure (60);
      EXPECT_GT (rate_of (result, 60), 0.75 * capacity) << capacity << " at " << fps;
      EXPECT_LT (rate_of (result, 60), 1.0 * capacity) << capacity << " at " << fps;
      EXPECT_LT (result.loss (), 0.02) << capacity << " at " << fps;
      /* Half of a frame set waits for the other half, whatever the rate. */
      EXPECT_LT (result.queue_s (), 0.5 / fps + 0.04) << capacity << " at " << fps;
    }
}

TEST (CongestionControl, far_too_much_is_over_within_two_seconds)
{
  LinkSimulation sim (1, 30e6);
  sim.link.bits_per_s = 2e6;
  sim.run (2);
  const StreamResult result = sim.measure (5);
  EXPECT_LT (result.loss (), 0.02);
  EXPECT_GT (rate_of (result, 5), 0.6 * 2e6);
}

TEST (CongestionControl, what_the_link_bears_is_sent_untouched)
{
  LinkSimulation sim (1, 3e6);
  sim.run (5);
  EXPECT_EQ (sim.streams[0].control.bits_per_s (), 3e6);
  EXPECT_EQ (sim.measure (30).lost, 0);
  EXPECT_EQ (sim.streams[0].control.bits_per_s (), 3e6);
}

TEST (CongestionControl, loss_by_chance_of_1_to_5_percent_does_not_starve_it)
{
  for (const auto &[loss, least] : {std::pair{0.01, 0.7}, {0.03, 0.6}, {0.05, 0.5}}) {
    LinkSimulation sim;
    sim.link.loss = loss;
    sim.run (10);
    EXPECT_GT (rate_of (sim.measure (90), 90), least * 5e6) << loss;
  }
}

TEST (CongestionControl, loss_by_chance_on_a_link_that_is_wide_enough_costs_no_rate_for_long)
{
  LinkSimulation sim (1, 3e6);
  sim.link.bits_per_s = 50e6;
  sim.link.loss = 0.05;
  sim.run (10);
  EXPECT_GT (rate_of (sim.measure (90), 90), 0.8 * 3e6 * 0.95);
}

TEST (CongestionControl, links_that_drop_instead_of_queueing_are_not_overrun)
{
  LinkSimulation sim;
  sim.link.polices = true; /* of a burst at 15 frame sets a second it passes 40 % of its rate */
  sim.run (5);
  const StreamResult result = sim.measure (60);
  EXPECT_LT (result.loss (), 0.03);
  EXPECT_GT (rate_of (result, 60), 1.5e6);
}

TEST (CongestionControl, jitter_is_no_queue)
{
  for (const double jitter : {0.01, 0.03, 0.05}) {
    LinkSimulation sim;
    sim.link.jitter_s = jitter;
    sim.run (8);
    EXPECT_GT (rate_of (sim.measure (60), 60), 0.6 * 5e6) << jitter;
  }
}

TEST (CongestionControl, follows_steps_of_capacity_down_and_up)
{
  LinkSimulation sim;
  sim.run (20);
  sim.link.bits_per_s = 1.5e6;
  sim.run (4);
  const StreamResult narrow = sim.measure (16);
  EXPECT_LT (narrow.loss (), 0.02);
  EXPECT_GT (rate_of (narrow, 16), 0.75 * 1.5e6);
  sim.link.bits_per_s = 10e6;
  sim.run (20);
  const StreamResult wide = sim.measure (20);
  EXPECT_GT (rate_of (wide, 20), 0.75 * 10e6);
  EXPECT_LT (wide.loss (), 0.02);
}

TEST (CongestionControl, streams_that_share_a_link_all_get_some_and_fill_it)
{
  LinkSimulation sim (4);
  sim.run (30);
  double sum = 0, waits = 0;
  for (SimulatedStream &stream : sim.streams)
    stream.second = {};
  sim.run (60);
  for (const SimulatedStream &stream : sim.streams) {
    const double rate = rate_of (stream.second, 60);
    EXPECT_GT (rate, 0.35 * 5e6 / 4);
    EXPECT_LT (stream.second.loss (), 0.03);
    sum += rate;
    waits = std::max (waits, stream.second.queue_s ());
  }
  EXPECT_GT (sum, 0.75 * 5e6);
  EXPECT_LT (waits, 0.08);
}

TEST (CongestionControl, stream_that_comes_later_finds_room)
{
  LinkSimulation sim (2);
  sim.streams[1].start_s = 20;
  sim.run (60);
  for (SimulatedStream &stream : sim.streams)
    stream.second = {};
  sim.run (60);
  for (const SimulatedStream &stream : sim.streams)
    EXPECT_GT (rate_of (stream.second, 60), 0.15 * 5e6);
}

TEST (CongestionControl, silence_lowers_the_rate_and_its_end_brings_back_half)
{
  LinkSimulation sim;
  sim.streams[0].paused_from_s = 20;
  sim.streams[0].paused_to_s = 40;
  sim.run (20);
  const double before = sim.streams[0].control.bits_per_s ();
  sim.run (19);
  EXPECT_LT (sim.streams[0].control.bits_per_s (), 0.1 * before);
  sim.run (2);
  EXPECT_GT (sim.streams[0].control.bits_per_s (), 0.4 * before);
  EXPECT_LT (sim.streams[0].control.bits_per_s (), 1.01 * before);
  EXPECT_GT (rate_of (sim.measure (20), 20), 0.7 * 5e6);
}

TEST (CongestionControl, receiver_with_another_clock_is_a_new_beginning)
{
  LinkSimulation sim;
  sim.run (20);
  sim.streams[0].clock_s = 5000;
  sim.run (2);
  const StreamResult result = sim.measure (20);
  EXPECT_GT (rate_of (result, 20), 0.75 * 5e6);
  EXPECT_LT (result.loss (), 0.02);
}

TEST (CongestionControl, limits_hold_whatever_is_reported)
{
  CongestionControl control;
  control.configure ({300e3, 2e6});
  EXPECT_EQ (control.bits_per_s (), 2e6);
  std::mt19937 random (3);
  std::uint64_t now = 1;
  std::vector<PacketReport> packets;
  for (int i = 0; i < 20000; i++) {
    packets.clear ();
    for (unsigned k = random () % 40; k > 0; k--)
      packets.push_back ({std::uint16_t (random ()), std::uint64_t (random ()) << (random () % 32),
          std::uint64_t (random ()) << (random () % 32), std::uint32_t (random ()),
          random () % 3 == 0});
    now += random () % 1'000'000'000;
    control.packets (packets, now);
    control.tick (double (random () % 9'000'000), now);
    ASSERT_GE (control.bits_per_s (), 300e3);
    ASSERT_LE (control.bits_per_s (), 2e6);
  }
}
