/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* A recorded stream as the RTP packets that its camera hosts would send. */
#pragma once

#include <cstdint>
#include <rangecast/base/status.hpp>
#include <string>
#include <vector>

namespace bench {

struct Packet {
  std::vector<std::uint8_t> bytes;           ///< RTP header and units
  std::vector<std::uint16_t> capture_fields; ///< offsets of the u64 capture times of its slices
};

struct Recording {
  /** [view][frame set][packet] */
  std::vector<std::vector<std::vector<Packet>>> views;

  [[nodiscard]] std::size_t frames () const { return views.empty () ? 0 : views[0].size (); }
  [[nodiscard]] double packets_per_frame () const;
  [[nodiscard]] double bytes_per_frame () const; ///< of UDP payload
  /** Slices of all views. */
  [[nodiscard]] std::size_t slices (std::size_t frame) const;
};

/** Offsets of the capture times in a packet of whole units. */
std::vector<std::uint16_t> find_capture_fields (const std::uint8_t *packet, std::size_t size);

/** Reads a file that neighbourcodeparse wrote, and packs each view with rtpneighbourcodepay.
 *  @return kNotFound or kBadData, with a message that names the file */
rangecast::Status read_recording (const std::string &path, Recording &recording);

} // namespace bench
