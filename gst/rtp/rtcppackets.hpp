/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <span>

/** One packet of a compound packet. `body` holds everything that `count` announces. */
struct RtcpPacket {
  guint8 type = 0;              ///< a GstRTCPType, or another one
  guint8 count = 0;             ///< report blocks, chunks, SSRCs; of feedback: its format
  std::span<const guint8> body; ///< without header and padding

  /** The n-th 32-bit word of the body, which must exist. */
  [[nodiscard]] guint32 word (std::size_t n) const
  {
    const auto bytes = body.subspan (4 * n, 4); /* not aligned */
    return guint32 (bytes[0]) << 24 | guint32 (bytes[1]) << 16 | guint32 (bytes[2]) << 8 | bytes[3];
  }
};

/** Reads the packets of a compound packet (RFC 3550, 6.1) or a reduced-size one (RFC 5506) from the
 *  network. Unlike gst_rtcp_buffer_* it trusts neither sizes nor counts: GStreamer 1.22 reads the
 *  SSRC of an SDES chunk beyond the end of the packet. */
class RtcpReader {
public:
  explicit RtcpReader (std::span<const guint8> bytes) : rest_ (bytes) {}

  /** @return false: at the end, or before bytes that are no RTCP */
  bool next (RtcpPacket &packet);
  /** Whether all of the bytes are RTCP. */
  static bool is_sound (std::span<const guint8> bytes);

private:
  std::span<const guint8> rest_;
  bool first_ = true;
};

/** Removes the first chunk of an SDES packet. @return false if there is no complete one */
bool pop_sdes_chunk (std::span<const guint8> &chunks, guint32 &ssrc);

/** A report block: RFC 3550, 6.4.1. */
struct RtcpReportBlock {
  guint32 stream = 0, highest = 0, jitter = 0, last_sr = 0, delay = 0;
  guint8 fraction_lost = 0;
};

/** @return number of report blocks: `count` in SR and RR, else 0 */
guint count_report_blocks (const RtcpPacket &packet);
RtcpReportBlock read_report_block (const RtcpPacket &packet, guint n);
