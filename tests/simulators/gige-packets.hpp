/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

/* What a GigE Vision camera receives and sends, as the standard lays it out: big-endian, UDP. Only
 * what fake-cameras needs. */

inline constexpr std::uint16_t kGvcpPort = 3956;

enum class Gvcp : std::uint16_t {
  kDiscovery = 0x0002,
  kPacketResend = 0x0040,
  kReadRegister = 0x0080,
  kWriteRegister = 0x0082,
  kReadMemory = 0x0084,
  kWriteMemory = 0x0086,
  kAction = 0x0100,
}; ///< the acknowledge of each is one more

enum class GvcpStatus : std::uint16_t {
  kSuccess = 0,
  kNotImplemented = 0x8001,
  kInvalidParameter = 0x8002,
  kInvalidAddress = 0x8003,
  kAccessDenied = 0x8006,
};

/** Bootstrap registers. */
inline constexpr std::uint32_t kRegisterMacHigh = 0x0008, kRegisterMacLow = 0x000c,
                               kRegisterCurrentIp = 0x0024, kRegisterManufacturer = 0x0048,
                               kRegisterModel = 0x0068, kRegisterUserName = 0x00e8,
                               kRegisterActionSignals = 0x0908, kRegisterActionDeviceKey = 0x090c,
                               kRegisterGvcpCapability = 0x0934, kRegisterHeartbeat = 0x0938,
                               kRegisterTimestampControl = 0x0944, kRegisterTimestampHigh = 0x0948,
                               kRegisterTimestampLow = 0x094c, kRegisterControl = 0x0a00,
                               kRegisterStreamPort = 0x0d00, kRegisterPacketSize = 0x0d04,
                               kRegisterStreamAddress = 0x0d18, kRegisterStreamSourcePort = 0x0d1c,
                               kRegisterActionGroupKey = 0x9800, kRegisterActionGroupMask = 0x9804;

/** Features that Aravis' fake camera lacks: BalanceRatio, a float each of red, green, blue. */
inline constexpr std::uint32_t kRegisterBalanceSelector = 0x430, kRegisterBalanceRatio = 0x434;

inline constexpr std::size_t kDiscoveryBytes = 0xf8;
inline constexpr std::size_t kMaxGvcpBytes = 576; ///< with IP and UDP header; GVCP's own limit
/** IP, UDP and GVSP header: counted in a packet size, besides the picture's bytes. */
inline constexpr std::uint32_t kGvspOverhead = 20 + 8 + 8;

struct GvcpCommand {
  std::uint16_t command = 0, id = 0;
  std::uint8_t flags = 0;
  std::span<const std::uint8_t> data;

  [[nodiscard]] bool wants_ack () const { return (flags & 0x01) != 0; }
};

/** @return false if that is no GVCP command */
bool parse_gvcp (std::span<const std::uint8_t> packet, GvcpCommand &command);

/** The fields of an ACTION_CMD, or those that a camera compares it with. */
struct ActionCommand {
  std::uint32_t device_key = 0, group_key = 0, group_mask = 0;
};

/** @return false if it is too short */
bool parse_action (const GvcpCommand &command, ActionCommand &action);

std::uint16_t read_u16 (const std::uint8_t *bytes);
std::uint32_t read_u32 (const std::uint8_t *bytes);

/** A packet under construction. */
class PacketWriter {
public:
  PacketWriter &u8 (std::uint8_t value);
  PacketWriter &u16 (std::uint16_t value);
  PacketWriter &u32 (std::uint32_t value);
  PacketWriter &u64 (std::uint64_t value);
  PacketWriter &zeros (std::size_t count);
  [[nodiscard]] std::vector<std::uint8_t> &bytes () { return bytes_; }

private:
  std::vector<std::uint8_t> bytes_;
};

/** An acknowledge's header; its data follows. */
PacketWriter gvcp_ack (const GvcpCommand &command, GvcpStatus status, std::size_t data_bytes);

/** What a GVSP leader says of a picture. */
struct GvspPicture {
  std::uint16_t block_id = 1; ///< never 0
  std::uint64_t timestamp_ns = 0;
  std::uint32_t pixel_format = 0;
  std::uint32_t width = 0, height = 0, x = 0, y = 0; ///< pixels
};

/** @name Packets of a picture: 0 = leader, 1 .. n = data (only its header), n + 1 = trailer. @{ */
std::vector<std::uint8_t> gvsp_leader (const GvspPicture &picture);
std::vector<std::uint8_t> gvsp_trailer (const GvspPicture &picture, std::uint32_t packet_id);
inline constexpr std::size_t kGvspHeaderBytes = 8;
void gvsp_data_header (std::uint16_t block_id, std::uint32_t packet_id, std::uint8_t *out);
/** @} */
