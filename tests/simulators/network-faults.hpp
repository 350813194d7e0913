/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What a bad network does to packets: loses them alone or in bursts, repeats, reorders and delays
 * them. Deterministic: one seed and the same packets at the same times come to the same. */
#pragma once

#include <cstdint>
#include <optional>
#include <random>
#include <span>
#include <string>
#include <vector>

struct FaultSettings {
  double loss = 0;          ///< share of packets lost, 0 to 1
  int burst = 1;            ///< packets that are lost in a row where a loss begins
  double duplicate = 0;     ///< share of packets that come twice
  double reorder = 0;       ///< share of packets that are held back
  int reorder_by = 10;      ///< until this number of later ones have passed (or kHoldNs)
  int64_t delay_ns = 0;     ///< of every packet
  int64_t jitter_ns = 0;    ///< more delay, evenly from 0 to this; later packets may overtake
  double bandwidth_bps = 0; ///< bits per second; 0: no limit
  uint64_t seed = 1;
};

struct FaultCounters {
  uint64_t in = 0, out = 0, lost = 0, duplicated = 0, held_back = 0;
  uint64_t congested = 0; ///< lost because more than kQueueNs of packets waited for the bandwidth
};

/** One direction of a bad network. Times are ns of any clock that never goes back. */
class NetworkFaults {
public:
  explicit NetworkFaults (const FaultSettings &settings);

  /** Takes over other settings; packets that are on their way stay there. */
  void set (const FaultSettings &settings);
  /** A packet enters. */
  void offer (std::span<const uint8_t> packet, int64_t now_ns);
  /** The next packet that leaves, valid until the next call; nothing if none is due yet. */
  std::optional<std::span<const uint8_t>> take (int64_t now_ns);
  /** When take() has something to give, if nothing else enters. */
  [[nodiscard]] std::optional<int64_t> due_ns () const;
  [[nodiscard]] const FaultCounters &counters () const { return counters_; }

  static constexpr int64_t kHoldNs = 100'000'000;
  static constexpr int64_t kQueueNs = 200'000'000;

private:
  struct Packet {
    int64_t due_ns = 0;
    uint64_t order = 0;       /* of entering */
    uint64_t after_order = 0; /* leaves when this one has passed, whatever due_ns; 0: by time */
    std::vector<uint8_t> bytes;
  };

  bool chance (double share);
  bool is_lost ();
  void enter (std::span<const uint8_t> bytes, int64_t due_ns, bool held_back);
  [[nodiscard]] std::size_t first () const;

  FaultSettings settings_;
  FaultCounters counters_;
  std::mt19937_64 random_;
  int burst_left_ = 0;
  int64_t line_free_ns_ = 0; /* when the bandwidth has room again */
  uint64_t entered_ = 0;
  std::vector<Packet> waiting_; /* few: those of some ten ms */
  std::vector<Packet> spare_;   /* whose memory is used again */
  Packet leaving_;
};

/** Reads one option of those below. @return whether `name` is one of them; `problem` is what was
 *  expected where the value is wrong, else empty. */
bool read_fault_option (const std::string &name, const std::string &value, FaultSettings &settings,
    std::string &problem);
extern const char *const kFaultOptions; ///< for --help
