/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

/* The user-defined name of GigE Vision cameras, which Aravis does not export. Reading it needs no
 * control of the camera. */

static constexpr std::size_t kUserNameSize = 16; ///< bytes, filled up with 0

/** The READMEM_CMD of GVCP that reads it. */
std::array<std::uint8_t, 16> user_name_request (std::uint16_t request_id);
/** The name in a camera's answer; absent if this is no answer to that request. */
std::optional<std::string> user_name_in (
    std::span<const std::uint8_t> answer, std::uint16_t request_id);

/** Asks the camera at that address; empty if it does not answer within 0.3 s, or is no camera. */
std::string read_user_name (const std::string &address);
