/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gio/gio.h>
#include <gst/gst.h>

#include <memory>
#include <string>

/** Sends the elements' `rangecast-stats` messages on, for the page /rig: a JSON object a
 *  datagram. Never waits: what the network does not take is lost. */
class StatsSender {
public:
  /** @param address  udp://HOST:PORT
   *  @param host     what these messages are called in the table
   *  @param[out] error  what is wrong with the address
   *  @return null after an error */
  static std::unique_ptr<StatsSender> open (
      const std::string &address, std::string host, std::string &error);
  ~StatsSender ();
  StatsSender (const StatsSender &) = delete;
  StatsSender &operator= (const StatsSender &) = delete;

  /** Sends it if it is a rangecast-stats message. */
  void take (GstMessage *message);
  /** Sends the text of a warning or an error of the message's source. */
  void take_warning (GstMessage *message, const char *text);

private:
  StatsSender () = default;
  [[nodiscard]] std::string begin_line (GstMessage *message) const;
  void send (std::string line);

  GSocket *socket_ = nullptr;
  GSocketAddress *to_ = nullptr;
  std::string host_;
};
