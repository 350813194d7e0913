/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Frame sets through a bad network, and every pixel that comes out compared with the sender's. */
#pragma once

#include <string>
#include <vector>

#include "simulators/network-faults.hpp"

/** One run. */
struct NetworkCase {
  std::string name;     ///< of the fault, for tables
  FaultSettings faults; ///< both ways; after kQuietFrames, until kRecoveryFrames before the end
  std::string encoder;  ///< properties of neighbourcodeenc
  int fec_percent = 0;
  bool rtx = false;
  bool feedback = false; ///< the receiver may ask for key frame sets (and does for rtx)
  int views = 4, width = 320, height = 240, fps = 15, frames = 100;
  int jitter_buffer_ms = 60;
  int delay_ms = 5; ///< of the network, each way, always
};

struct NetworkResult {
  int sent = 0, received = 0; ///< frame sets while the network was bad
  double points_share = 0;    ///< points that came of those sent
  double whole_share = 0;     ///< frame sets that came with all their points, of those sent
  long long wrong_points =
      0;                  ///< points where the sender has none, or another one; of the whole run
  double freeze_ms = 0;   ///< longest time without a frame set
  double recovery_ms = 0; ///< from the end of the faults until all frame sets are whole; -1: never
  double latency_p50_ms = 0, latency_p99_ms = 0; ///< sender's encoder to receiver's decoder
  double media_kbit = 0;                         ///< per second
  double extra_share = 0; ///< bytes of FEC and retransmissions, of those of media
  FaultCounters network;  ///< what happened to packets from the sender
};

inline constexpr int kQuietFrames = 12;    ///< before the faults
inline constexpr int kRecoveryFrames = 20; ///< and after them: longer than a refresh at 15/s

/** @return nothing and says why on stderr if the pipelines cannot be made */
bool run_network_case (const NetworkCase &settings, NetworkResult &result);
