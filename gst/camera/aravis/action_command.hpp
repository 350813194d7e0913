/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The GigE Vision action command: one datagram that triggers all cameras of a key. */
#pragma once

#include <array>
#include <cstdint>
#include <gio/gio.h>
#include <span>
#include <string>
#include <vector>

#include "types.hpp"

/** UDP port of GVCP, the GigE Vision control protocol. */
inline constexpr std::uint16_t kGvcpPort = 3956;

/** ACTION_CMD of GigE Vision 2.0 on the wire, for cameras with that ActionDeviceKey,
 *  ActionGroupKey 1 and bit 0 in their ActionGroupMask, to be executed immediately.
 *  @param request_id  never 0; cameras ignore a second command with the same one */
[[nodiscard]] std::array<std::uint8_t, 20> action_command_bytes (
    std::uint32_t device_key, std::uint16_t request_id);

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
  CameraStatus send (std::uint32_t device_key);

private:
  struct Route {
    std::string interface;
    GSocket *socket = nullptr;
    GSocketAddress *destination = nullptr;
  };
  std::vector<Route> routes_;
  std::uint16_t last_id_ = 0;
};
