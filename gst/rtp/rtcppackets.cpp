/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "rtcppackets.hpp"

#include <gst/rtp/rtp.h>

#include <algorithm>
#include <optional>

using Bytes = std::span<const guint8>;

namespace {

/* Bytes: packet header; in front of the report blocks of RR and of SR; report block. */
constexpr std::size_t kHeader = 4, kReporter = 4, kSender = 24, kBlock = 24;

std::size_t
size_before_blocks (const RtcpPacket &packet)
{
  return packet.type == GST_RTCP_TYPE_SR ? kSender : kReporter;
}

bool
has_chunks (const RtcpPacket &packet)
{
  Bytes chunks = packet.body;
  guint32 ssrc = 0;
  for (guint i = 0; i < packet.count; i++)
    if (!pop_sdes_chunk (chunks, ssrc))
      return false;
  return true;
}

/* Whether the body holds everything that the header announces; true for unknown types. */
bool
is_complete (const RtcpPacket &packet)
{
  const std::size_t size = packet.body.size ();
  switch (packet.type) {
    case GST_RTCP_TYPE_SR:
    case GST_RTCP_TYPE_RR:
      return size >= size_before_blocks (packet) + kBlock * packet.count;
    case GST_RTCP_TYPE_SDES:
      return has_chunks (packet);
    case GST_RTCP_TYPE_BYE:
      return size >= 4u * packet.count;
    case GST_RTCP_TYPE_APP:
    case GST_RTCP_TYPE_RTPFB:
    case GST_RTCP_TYPE_PSFB:
      return size >= 8;
    case GST_RTCP_TYPE_XR:
      return size >= 4;
    default:
      return true;
  }
}

/* RFC 3550, A.2: only the last packet may have padding, and not if it is also the first.
 * @return bytes of padding, of which the last one is the number; nothing if it is invalid */
std::optional<std::size_t>
read_padding (Bytes body, bool padded, bool allowed)
{
  if (!padded)
    return 0;
  if (!allowed || body.empty ())
    return std::nullopt;
  const std::size_t padding = body.back ();
  return padding > 0 && padding % 4 == 0 && padding <= body.size () ? std::optional (padding)
                                                                    : std::nullopt;
}

} // namespace

bool
RtcpReader::next (RtcpPacket &packet)
{
  constexpr guint kVersion = 2;
  if (rest_.size () < kHeader || rest_[0] >> 6 != kVersion)
    return false;
  const std::size_t size = kHeader + 4u * (rest_[2] << 8 | rest_[3]);
  if (size > rest_.size () || (first_ && (rest_[1] & 0xf8) != GST_RTCP_TYPE_SR)) /* 200 to 207 */
    return false;
  packet.type = rest_[1];
  packet.count = rest_[0] & 0x1f;
  packet.body = rest_.subspan (kHeader, size - kHeader);
  const bool is_last = size == rest_.size ();
  const auto padding = read_padding (packet.body, rest_[0] & 0x20, is_last && !first_);
  if (!padding)
    return false;
  packet.body = packet.body.first (packet.body.size () - *padding);
  if (!is_complete (packet))
    return false;
  rest_ = rest_.subspan (size);
  first_ = false;
  return true;
}

bool
RtcpReader::is_sound (Bytes bytes)
{
  RtcpReader reader (bytes);
  RtcpPacket packet;
  while (reader.next (packet))
    ;
  return !bytes.empty () && reader.rest_.empty ();
}

/* A chunk is an SSRC and items of type, size and text, with a zero and padding to 32 bits behind
 * them. Some senders omit the zero at the end of the packet. */
bool
pop_sdes_chunk (Bytes &chunks, guint32 &ssrc)
{
  constexpr std::size_t kItem = 2;
  std::size_t at = 4;
  if (chunks.size () < at)
    return false;
  while (at < chunks.size () && chunks[at] != 0) {
    if (chunks.size () - at < kItem || chunks.size () - at - kItem < chunks[at + 1])
      return false;
    at += kItem + chunks[at + 1];
  }
  ssrc = RtcpPacket{.body = chunks}.word (0);
  chunks = chunks.subspan (std::min (at / 4 * 4 + 4, chunks.size ()));
  return true;
}

guint
count_report_blocks (const RtcpPacket &packet)
{
  return packet.type == GST_RTCP_TYPE_SR || packet.type == GST_RTCP_TYPE_RR ? packet.count : 0;
}

RtcpReportBlock
read_report_block (const RtcpPacket &packet, guint n)
{
  const std::size_t at = (size_before_blocks (packet) + kBlock * n) / 4;
  return {.stream = packet.word (at),
      .highest = packet.word (at + 2),
      .jitter = packet.word (at + 3),
      .last_sr = packet.word (at + 4),
      .delay = packet.word (at + 5),
      .fraction_lost = guint8 (packet.word (at + 1) >> 24)};
}
