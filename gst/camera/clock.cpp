/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "clock.hpp"

#include <gst/net/net.h>

#include "common/realtimepriority.hpp"

using rangecast::Status;
using rangecast::StatusCode;

/* A net clock starts at 0, before any other, so that it only jumps forward when it is synchronised.
 * The clock stays until another one is wanted: it is synchronised already then, and GStreamer 1.22
 * must not release it at the moment when that happens. */
Status
NetworkClock::open (const std::string &text)
{
  if (clock_ && text == server_)
    return {};
  gst_clear_object (&clock_);
  server_ = text;
  if (text.empty ())
    return {};
  const Status bad = {StatusCode::kBadValue,
      "clock-server " + text + " is neither HOST:PORT (port 1 to 65535) nor ptp:DOMAIN (0 to 255)"};
  if (text.starts_with ("ptp:")) {
    guint64 domain = 0;
    if (!g_ascii_string_to_unsigned (text.c_str () + 4, 10, 0, 255, &domain, nullptr))
      return bad;
    if (!gst_ptp_init (GST_PTP_CLOCK_ID_NONE, nullptr))
      return {StatusCode::kNotFound, "clock-server " + text +
                                         ": PTP is not available: gst-ptp-helper needs the "
                                         "right to bind ports 319 and 320"};
    clock_ = gst_ptp_clock_new ("stereocamsrc-clock", guint (domain));
  } else {
    g_autoptr (GSocketConnectable) parsed = g_network_address_parse (text.c_str (), 0, nullptr);
    auto server = parsed ? G_NETWORK_ADDRESS (parsed) : nullptr;
    if (!server || g_network_address_get_port (server) == 0)
      return bad;
    const ScopedRealtimePriority priority; /* its thread inherits it; delays are clock error */
    clock_ = gst_net_client_clock_new ("stereocamsrc-clock",
        g_network_address_get_hostname (server), g_network_address_get_port (server), 0);
  }
  if (!clock_)
    return {StatusCode::kNotFound, "clock-server " + text + ": no such clock"};
  return {};
}
