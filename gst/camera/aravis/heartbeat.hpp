/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <string>

#include "gvcp.hpp"

/** Tells whether a silent GigE camera still answers. Aravis' own heartbeat waits 3 s for each
 *  answer and tries for 5 s; this one asks on its own socket while other calls wait, and never
 *  blocks. Needs no control of the camera. One thread. */
class Heartbeat {
public:
  /** @param address  IP address; empty (USB, whose driver reports a loss at once): always alive
   *  @param now_ns   g_get_monotonic_time */
  void start (const std::string &address, std::int64_t now_ns);

  /** Call about ten times a second: sends a request after 0.4 s of silence, and every 0.4 s.
   *  @param heard_ns  when the last frame came, same clock; 0: none */
  void poll (std::int64_t heard_ns, std::int64_t now_ns);

  /** Nothing came for 3 s, and several requests had no answer. */
  [[nodiscard]] bool is_gone (std::int64_t now_ns) const
  {
    return unanswered_ >= kMinUnanswered && now_ns - alive_ns_ > kMaxSilence_ns;
  }
  /** A request has waited for its answer longer than a camera takes. */
  [[nodiscard]] bool is_overdue () const { return unanswered_ > 1; }
  /** Something came just now: a call to the camera will not take long. */
  [[nodiscard]] bool is_answering () const { return !socket_ || unanswered_ == 0; }

  static constexpr std::int64_t kMaxSilence_ns = 3'000'000'000;

private:
  static constexpr std::int64_t kInterval_ns = 400'000'000;
  static constexpr int kMinUnanswered = 4; ///< of seven in 3 s, unless this host is busy

  SocketPtr socket_;
  std::int64_t alive_ns_ = 0, asked_ns_ = 0;
  std::uint16_t request_ = 0;
  int unanswered_ = 0;
};
