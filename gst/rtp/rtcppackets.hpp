/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <span>

/** One packet of a compound one. What `count` announces lies in `body`. */
struct RtcpPacket {
  guint8 type = 0;              ///< a GstRTCPType, or another one
  guint8 count = 0;             ///< report blocks, chunks, SSRCs; of feedback: its format
  std::span<const guint8> body; ///< without header and padding

  /** The n-th 32 bits of the body, which are there. */
  [[nodiscard]] guint32 word (std::size_t n) const
  {
    const auto bytes = body.subspan (4 * n, 4); /* anywhere in memory */
    return guint32 (bytes[0]) << 24 | guint32 (bytes[1]) << 16 | guint32 (bytes[2]) << 8 | bytes[3];
  }
};

/** Goes through the packets of a compound one (RFC 3550, 6.1) or a reduced one (RFC 5506). Foreign
 *  bytes: unlike GStreamer's reader it takes neither sizes nor counts on trust. In 1.22 that one
 *  reads the SSRC of an SDES chunk which is announced, but not there. */
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

/** Takes the first chunk of an SDES packet off. @return false: there is no whole one */
bool take_sdes_chunk (std::span<const guint8> &chunks, guint32 &ssrc);

/** What a receiver says of a stream: RFC 3550, 6.4.1. */
struct RtcpReportBlock {
  guint32 stream = 0, highest = 0, jitter = 0, last_sr = 0, delay = 0;
  guint8 fraction_lost = 0;
};

/** @return blocks of a report: `count` in SR and RR, else 0 */
guint count_report_blocks (const RtcpPacket &packet);
RtcpReportBlock read_report_block (const RtcpPacket &packet, guint n);
