/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <glib.h>

#include <string>

namespace web {

/** The properties of rangewebsink. */
struct Settings {
  std::string address = "127.0.0.1";
  guint port = 8080; ///< 0: any that is free
  std::string root;  ///< folder of the page; empty: the installed one
  std::string title;
  std::string certificate, private_key; ///< PEM files; empty: no TLS
  std::string token, token_file;
  bool anonymous = false;
  std::string origins; ///< separated by spaces
  guint max_clients = 64;
  guint window = 3; ///< frame sets
  guint64 max_queued_bytes = 4 << 20;
  guint hello_timeout_ms = 5000;
  guint key_unit_interval_ms = 1000;
  bool webrtc = false;
  std::string stun_server, turn_server; ///< as webrtcbin's properties
  std::string stats_address;            ///< udp://HOST:PORT; empty: none
  std::string url;                      ///< read-only: of the page, while the server runs

  /** Whether clients need a token. */
  [[nodiscard]] bool has_token () const { return !token.empty () || !token_file.empty (); }
};

} // namespace web
