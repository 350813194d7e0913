/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <memory>
#include <queue>
#include <random>
#include <rangecast/neighbourcode/rate/congestion_control.hpp>
#include <vector>

/* Streams of frame sets over one link with a queue, and the feedback that comes back. Times are
 * simulated: nothing waits. */
namespace rangecast::testing {

struct Link {
  double bits_per_s = 5e6;
  double queue_s = 0.3;  /* what does not fit is lost */
  double delay_s = 0.02; /* each way */
  double loss = 0;       /* share, by chance */
  double jitter_s = 0;   /* 0 to this, more */
  bool polices = false;  /* no queue: what is too much is lost (a bucket of 30 ms) */
};

struct StreamResult {
  double sent_bytes = 0, arrived_bytes = 0, packets = 0, lost = 0;
  double queue_sum_s = 0, queue_max_s = 0; /* that packets waited in */

  [[nodiscard]] double loss () const { return packets > 0 ? lost / packets : 0; }
  [[nodiscard]] double queue_s () const { return queue_sum_s / std::max (packets - lost, 1.0); }
};

/* An encoder that makes what it is told, or less. */
struct SimulatedStream {
  CongestionControl control;
  double fps = 15, max_bits_per_s = 20e6, start_s = 0;
  double jitter_share = 0.1;                   /* of the size of frame sets */
  double clock_s = 1000;                       /* the receiver's less the sender's */
  double paused_from_s = -1, paused_to_s = -1; /* its receiver says nothing */
  StreamResult second;                         /* since it was last taken */
  std::uint16_t sequence = 0;
};

class LinkSimulation {
public:
  Link link;
  std::vector<SimulatedStream> streams;
  double now_s = 0;

  explicit LinkSimulation (int n = 1, double max_bits_per_s = 20e6) : streams (std::size_t (n))
  {
    for (std::size_t i = 0; i < streams.size (); i++) {
      streams[i].max_bits_per_s = max_bits_per_s;
      streams[i].control.configure ({100e3, max_bits_per_s});
      streams[i].start_s = 0.013 * double (i);
    }
  }

  void run (double seconds)
  {
    if (now_s == 0)
      for (std::size_t i = 0; i < streams.size (); i++)
        at (streams[i].start_s, [this, i] { send (i); });
    end_s_ = now_s + seconds;
    while (!events_.empty () && events_.top ().time_s < end_s_) {
      const Event event = events_.top ();
      events_.pop ();
      now_s = event.time_s;
      event.what ();
    }
    now_s = end_s_;
  }

  /** Runs, and gives what one stream sent meanwhile. */
  StreamResult measure (double seconds, std::size_t stream = 0)
  {
    for (SimulatedStream &s : streams)
      s.second = {};
    run (seconds);
    return streams[stream].second;
  }

private:
  struct Event {
    double time_s;
    std::uint64_t number;
    std::function<void ()> what;
    bool operator<(const Event &other) const
    {
      return time_s != other.time_s ? time_s > other.time_s : number > other.number;
    }
  };

  void at (double time_s, std::function<void ()> what)
  {
    events_.push ({time_s, number_++, std::move (what)});
  }
  static std::uint64_t ns (double seconds) { return std::uint64_t (seconds * 1e9 + 1e12); }
  double chance () { return std::uniform_real_distribution<double> (0, 1) (random_); }

  /* @return when a packet that is sent now arrives; negative: never */
  double through (double bytes, StreamResult &result)
  {
    const double waits = std::max (0.0, free_s_ - now_s), takes = 8 * bytes / link.bits_per_s;
    if (waits + takes > (link.polices ? 0.03 : link.queue_s))
      return -1;
    free_s_ = now_s + waits + takes;
    if (chance () < link.loss)
      return -1;
    const double queued = link.polices ? 0 : waits;
    result.queue_sum_s += queued;
    result.queue_max_s = std::max (result.queue_max_s, queued);
    return now_s + queued + (link.polices ? 0 : takes) + link.delay_s + link.jitter_s * chance ();
  }

  void send (std::size_t i)
  {
    SimulatedStream &s = streams[i];
    at (now_s + 1 / s.fps, [this, i] { send (i); });
    s.control.tick (s.max_bits_per_s, ns (now_s));
    const double rate = s.control.bits_per_s ();
    const double noise = 1 + s.jitter_share * std::normal_distribution<double> () (random_);
    double bytes = std::min (rate > 0 ? rate : 1e12, s.max_bits_per_s) / 8 / s.fps * noise;
    std::vector<PacketReport> reports;
    double last_arrival = now_s;
    for (; bytes > 0; bytes -= 1200) {
      const double size = std::max (100.0, std::min (bytes, 1200.0));
      const double arrival = through (size, s.second);
      reports.push_back ({s.sequence++, ns (now_s), ns (std::max (0.0, arrival) + s.clock_s),
          std::uint32_t (size), arrival < 0});
      last_arrival = std::max (last_arrival, arrival);
      s.second.packets++;
      s.second.lost += arrival < 0;
      s.second.sent_bytes += size;
      s.second.arrived_bytes += arrival < 0 ? 0 : size;
    }
    if (std::ranges::any_of (reports, &PacketReport::lost)) /* as GStreamer 1.22 reports them */
      for (std::size_t k = 0; k < reports.size (); k++)
        reports[k].arrival_ns -= reports[k].lost ? 0 : 3'000'000 * k;
    if (!is_paused (s))
      at (last_arrival + link.delay_s,
          [this, i, reports] { streams[i].control.packets (reports, ns (now_s)); });
  }

  bool is_paused (const SimulatedStream &s) const
  {
    return now_s >= s.paused_from_s && now_s < s.paused_to_s;
  }

  std::priority_queue<Event> events_;
  std::uint64_t number_ = 0;
  double end_s_ = 0, free_s_ = 0;
  std::mt19937 random_{5};
};

} // namespace rangecast::testing
