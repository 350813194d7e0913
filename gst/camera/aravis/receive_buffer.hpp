/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>

/** Gives this process's UDP socket at that port a receive buffer of that many bytes, or what the
 *  system allows. Aravis does so only after the first packet, which is too late for the first
 *  image, and does not export its socket.
 *  @return whether there is such a socket */
bool enlarge_receive_buffer (std::uint16_t port, int bytes);
