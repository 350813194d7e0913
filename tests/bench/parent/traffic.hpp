/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Camera hosts and a viewer, as far as a parent host sees them: UDP packets in and out. */
#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>
#include <rangecast/base/status.hpp>
#include <thread>
#include <vector>

#include "recording.hpp"

namespace bench {

/** Takes packets and notes when the slices of which frame set came. */
class Viewer {
public:
  ~Viewer ();
  /** Listens on a free port of 127.0.0.1. */
  rangecast::Status open ();
  [[nodiscard]] int port () const { return port_; }
  void stop ();

  struct Arrival {
    std::uint64_t capture_ns = 0; ///< of its slices
    std::uint64_t arrival_ns = 0; ///< CLOCK_MONOTONIC
    std::uint32_t slices = 0;     ///< in it
  };
  /** Packets since open(), those without slices left out. */
  [[nodiscard]] std::vector<Arrival> arrivals ();
  [[nodiscard]] bool has_any () const { return any_; }

private:
  void run ();
  void take (const std::uint8_t *packet, std::size_t size, std::uint64_t now_ns);

  int socket_ = -1, port_ = 0;
  std::thread thread_;
  std::atomic<bool> stop_ = false, any_ = false;
  std::mutex lock_; /* guards arrivals_ */
  std::vector<Arrival> arrivals_;
};

/** Sends a recording in real time, all views of a frame set at once, over and over. Each slice says
 *  when it was due as its capture time: cameras fire on time, also where a busy machine sends late.
 */
class CameraHosts {
public:
  CameraHosts (Recording &recording, double fps, int first_port);
  ~CameraHosts ();
  rangecast::Status start ();
  void stop ();

  struct Sent {
    std::uint64_t capture_ns = 0, sent_ns = 0; ///< CLOCK_MONOTONIC
    std::uint32_t slices = 0, packets = 0;
  };
  [[nodiscard]] std::vector<Sent> sent ();
  /** How much later than planned a frame set left at most, ms: a busy machine. */
  [[nodiscard]] double worst_delay_ms () const { return worst_delay_ms_; }

private:
  void run ();
  void send_frame (std::uint64_t number, std::uint64_t capture_ns);

  Recording &recording_;
  double fps_;
  int first_port_, socket_ = -1;
  std::thread thread_;
  std::atomic<bool> stop_ = false;
  std::atomic<double> worst_delay_ms_ = 0;
  std::vector<std::uint16_t> sequence_; /* by view */
  std::mutex lock_;                     /* guards sent_ */
  std::vector<Sent> sent_;
};

/** CLOCK_MONOTONIC, ns. */
std::uint64_t now_ns ();

} // namespace bench
