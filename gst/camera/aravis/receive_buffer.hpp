/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>

/** Gives this process's UDP socket at that port a receive buffer of that many bytes, or what the
 * system allows. Aravis does so only when the first packet has come, which is too late for the rest
 * of the first picture, and shows nobody its socket.
 *  @return whether there is such a socket */
bool enlarge_receive_buffer (std::uint16_t port, int bytes);
