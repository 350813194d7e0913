/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The GigE Vision action command: one datagram that triggers all cameras of a group. */
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "gvcp.hpp"
#include "status.hpp"

/** GigE Vision 2.0, ACTION_CMD. A camera reacts if `device_key` is its ActionDeviceKey, `group_key`
 *  its ActionGroupKey, and `group_mask` AND its ActionGroupMask is not 0. */
struct ActionCommand {
  std::uint32_t device_key = 0, group_key = 0, group_mask = 0;
  std::optional<std::uint64_t> time_ns; ///< on the cameras' IEEE 1588 clock; absent: now
  bool acknowledge = false;             ///< cameras answer with an ACTION_ACK
  std::uint16_t request_id = 1; ///< never 0; cameras ignore a second command with the same one
};

/** The bytes on the wire. */
struct ActionCommandBytes {
  std::array<std::uint8_t, 28> bytes{};
  std::size_t size = 0; ///< 20, or 28 with a time

  [[nodiscard]] std::span<const std::uint8_t> span () const { return {bytes.data (), size}; }
};
[[nodiscard]] ActionCommandBytes action_command_bytes (const ActionCommand &command);

/** Sends action commands by broadcast from this host's interfaces. Not thread-safe. */
class ActionSender {
public:
  ActionSender () = default;
  ActionSender (const ActionSender &) = delete;
  ActionSender &operator= (const ActionSender &) = delete;
  ~ActionSender () { close (); }

  /** @param interfaces  addresses of this host (Camera::interface_address); duplicates count once
   *  @param port        another one in tests
   *  @return kFailed: the text names the interface */
  CameraStatus open (std::span<const std::string> interfaces, std::uint16_t port = kGvcpPort);
  void close ();
  /** Sends the command from every interface, with a new request id. Does not wait for answers.
   *  @return kFailed: the text names the interface; the others have sent it */
  CameraStatus send (ActionCommand command);

private:
  struct Route {
    std::string interface;
    GSocket *socket = nullptr;
    GSocketAddress *destination = nullptr;
  };
  std::vector<Route> routes_;
  std::uint16_t last_id_ = 0;
};
