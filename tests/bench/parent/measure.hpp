/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <rangecast/base/status.hpp>
#include <string>
#include <vector>

#include "recording.hpp"

namespace bench {

struct Settings {
  double fps = 30;
  int seconds = 5;                       ///< that count
  int port = 27100;                      ///< below those that the kernel gives away
  std::string parent = "parent-host.sh"; ///< its path
};

/** What a process that takes packets in and sends them on costs. */
struct Row {
  std::string what;
  int views = 0;
  int viewers = 1;
  double packets_per_set = 0, mbit_per_s = 0;
  double cpu_ms = 0;             ///< a frame set
  double rss_mib = 0;            ///< at the end
  double p50_ms = 0, p99_ms = 0; ///< from sending a frame set to its last packet at the viewer
  double lost = 0;               ///< share of the slices
  double sender_ms = 0;          ///< how late the worst frame set was sent
};

/** What a frame set costs a viewer, ms of CPU, each element alone; 0: not measured. */
struct ViewerRow {
  int views = 0;
  double decode_ms = 0, cylinder_ms = 0, draw_ms = 0;
};

/** parent-host.sh between camera hosts and a viewer. */
rangecast::Status measure_parent (Recording &recording, const Settings &settings, Row &row);
/** As many packets through a udpsrc, a jitter buffer and a udpsink for each view. */
rangecast::Status measure_peer (Recording &recording, const Settings &settings, Row &row);
/** udpsrc ! multiudpsink with that many viewers, for the packets of one parent. */
rangecast::Status measure_relay (
    Recording &recording, int viewers, const Settings &settings, Row &row);
/** Decoding, cylinderfilter and striprender of a recording, as fast as they go. */
rangecast::Status measure_viewer (const std::string &path, bool draw, ViewerRow &row);

} // namespace bench
