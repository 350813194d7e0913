/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <gio/gio.h>
#include <memory>
#include <string>

/** Whether a GigE camera that says nothing is still there. Aravis asks for itself, but waits 3 s
 * for each answer and tries for 5 s; this asks on a socket of its own, whatever calls are waiting,
 * and never waits. Needs no control of the camera. One thread. */
class Heartbeat {
public:
  /** @param address  IP address; empty (USB, whose driver tells at once): always alive
   *  @param now_ns   g_get_monotonic_time */
  void start (const std::string &address, std::int64_t now_ns);

  /** To be called about ten times a second: asks after a silence of 0.4 s, and again each 0.4 s.
   *  @param heard_ns  when a picture came last, same clock; 0: none */
  void poll (std::int64_t heard_ns, std::int64_t now_ns);

  /** Nothing was heard for 3 s, and several questions had no answer. */
  [[nodiscard]] bool is_gone (std::int64_t now_ns) const
  {
    return unanswered_ >= kMinUnanswered && now_ns - alive_ns_ > kPatience_ns;
  }
  /** A question waits for its answer, and for longer than a camera takes. */
  [[nodiscard]] bool is_overdue () const { return unanswered_ > 1; }
  /** Something was heard just now: a call of the camera will not have to wait for long. */
  [[nodiscard]] bool is_answering () const { return !socket_ || unanswered_ == 0; }

  static constexpr std::int64_t kPatience_ns = 3'000'000'000;

private:
  struct Unref {
    void operator() (GSocket *socket) const { g_object_unref (socket); }
  };
  static constexpr std::int64_t kQuestion_ns = 400'000'000;
  static constexpr int kMinUnanswered = 4; ///< in 3 s there are seven if this host has the time

  std::unique_ptr<GSocket, Unref> socket_;
  std::int64_t alive_ns_ = 0, asked_ns_ = 0;
  std::uint16_t request_ = 0;
  int unanswered_ = 0;
};
