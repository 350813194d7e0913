/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "gige-packets.hpp"

namespace {

constexpr std::uint8_t kGvcpMagic = 0x42;
constexpr std::size_t kGvcpHeaderBytes = 8;
constexpr std::uint8_t kLeader = 1, kTrailer = 2, kData = 3;
constexpr std::uint16_t kImage = 1;

} // namespace

std::uint16_t
read_u16 (const std::uint8_t *bytes)
{
  return std::uint16_t (bytes[0] << 8 | bytes[1]);
}

std::uint32_t
read_u32 (const std::uint8_t *bytes)
{
  return std::uint32_t (read_u16 (bytes)) << 16 | read_u16 (bytes + 2);
}

bool
parse_gvcp (std::span<const std::uint8_t> packet, GvcpCommand &command)
{
  if (packet.size () < kGvcpHeaderBytes || packet[0] != kGvcpMagic)
    return false;
  const std::size_t length = read_u16 (&packet[4]);
  if (length > packet.size () - kGvcpHeaderBytes)
    return false;
  command.flags = packet[1];
  command.command = read_u16 (&packet[2]);
  command.id = read_u16 (&packet[6]);
  command.data = packet.subspan (kGvcpHeaderBytes, length);
  return true;
}

bool
parse_action (const GvcpCommand &command, ActionCommand &action)
{
  if (command.data.size () < 12)
    return false;
  action.device_key = read_u32 (&command.data[0]);
  action.group_key = read_u32 (&command.data[4]);
  action.group_mask = read_u32 (&command.data[8]);
  return true;
}

PacketWriter &
PacketWriter::u8 (std::uint8_t value)
{
  bytes_.push_back (value);
  return *this;
}

PacketWriter &
PacketWriter::u16 (std::uint16_t value)
{
  return u8 (std::uint8_t (value >> 8)).u8 (std::uint8_t (value));
}

PacketWriter &
PacketWriter::u32 (std::uint32_t value)
{
  return u16 (std::uint16_t (value >> 16)).u16 (std::uint16_t (value));
}

PacketWriter &
PacketWriter::u64 (std::uint64_t value)
{
  return u32 (std::uint32_t (value >> 32)).u32 (std::uint32_t (value));
}

PacketWriter &
PacketWriter::zeros (std::size_t count)
{
  bytes_.resize (bytes_.size () + count);
  return *this;
}

PacketWriter
gvcp_ack (const GvcpCommand &command, GvcpStatus status, std::size_t data_bytes)
{
  PacketWriter writer;
  writer.u16 (std::uint16_t (status))
      .u16 (std::uint16_t (command.command + 1))
      .u16 (std::uint16_t (data_bytes))
      .u16 (command.id);
  return writer;
}

namespace {

PacketWriter
gvsp_header (std::uint16_t block_id, std::uint8_t format, std::uint32_t packet_id)
{
  PacketWriter writer;
  writer.u16 (0).u16 (block_id).u32 (std::uint32_t (format) << 24 | (packet_id & 0xffffff));
  return writer;
}

} // namespace

std::vector<std::uint8_t>
gvsp_leader (const GvspPicture &picture)
{
  PacketWriter writer = gvsp_header (picture.block_id, kLeader, 0);
  writer.u16 (0).u16 (kImage).u64 (picture.timestamp_ns).u32 (picture.pixel_format);
  writer.u32 (picture.width).u32 (picture.height).u32 (picture.x).u32 (picture.y).u32 (0);
  return std::move (writer.bytes ());
}

std::vector<std::uint8_t>
gvsp_trailer (const GvspPicture &picture, std::uint32_t packet_id)
{
  PacketWriter writer = gvsp_header (picture.block_id, kTrailer, packet_id);
  writer.u16 (0).u16 (kImage).u32 (picture.height);
  return std::move (writer.bytes ());
}

void
gvsp_data_header (std::uint16_t block_id, std::uint32_t packet_id, std::uint8_t *out)
{
  out[0] = out[1] = 0;
  out[2] = std::uint8_t (block_id >> 8);
  out[3] = std::uint8_t (block_id);
  out[4] = kData;
  out[5] = std::uint8_t (packet_id >> 16);
  out[6] = std::uint8_t (packet_id >> 8);
  out[7] = std::uint8_t (packet_id);
}
