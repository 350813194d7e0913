/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The command line of rtsp-server. */
#pragma once

#include <glib.h>

#include <string>
#include <vector>

struct RtspUser {
  std::string name, password;
};

/** Addresses and ports that multicast viewers are sent to; nothing if `first` is empty. */
struct MulticastRange {
  std::string first, last; /* addresses */
  int first_port = 0, last_port = 0;
  int ttl = 1; /* routers that packets pass, less one */
};

/** What the command line says. */
struct RtspOptions {
  std::string address = "0.0.0.0";
  int port = 8554; /* 0: any that is free */
  std::string mount = "/live";
  std::string realm = "rangecast";
  std::vector<RtspUser> users; /* none: everybody may watch */
  std::string certificate_file, key_file;
  MulticastRange multicast;
  bool udp = true, tcp = true;
  int retransmission_ms = 0; /* 0: none */
  int max_viewers = 64;
  int send_buffer_kb = 256;
  int timeout_s = 30;
  int linger_s = 5;
  bool always = false;
  int stats_s = 0; /* 0: none */
  std::string launch;
};

/** False after saying what is wrong with them. Also takes GStreamer's options, and initialises it.
 *  Passwords are wiped from argv. */
bool parse_arguments (int argc, char **argv, RtspOptions &options);
