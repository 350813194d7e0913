/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <json-glib/json-glib.h>

#include <deque>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <tuple>

#include "protocol.hpp"

namespace web {

/** What hosts report (docs/guide/statistics.md): the last report of each element or pad, and the
 *  last warnings. Takes bytes from anybody and stays within its limits. One thread. */
class StatsBoard {
public:
  static constexpr gsize kMaxDatagram = 8192; ///< bytes
  static constexpr gsize kMaxRows = 1000, kMaxWarnings = 20;

  /** @return false if the datagram is no report, or there are too many rows */
  bool add (std::string_view datagram);

  /** A message `stats` of the rows that arrived after a number that an earlier call returned; empty
   *  if there are none. @param[in,out] since  0: all */
  [[nodiscard]] std::string message (guint64 &since) const;

private:
  using Key = std::tuple<std::string, std::string, std::string>; /* host, name, pad */
  struct Row {
    std::shared_ptr<JsonNode> node;
    gint64 arrived_us; /* monotonic */
    guint64 number;
  };

  std::map<Key, Row> rows_;
  std::deque<Row> warnings_;
  guint64 count_ = 0;
};

} // namespace web
