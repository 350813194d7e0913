/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "guesslimiter.hpp"

#include <gio/gio.h>

#include <algorithm>
#include <cstring>

namespace web {

/* The bytes that identify who has the address: those of IPv4, also where IPv6 maps it; the network
 * of IPv6, of which a host can have any address. */
static std::string
network_of (const std::string &address)
{
  static constexpr guint8 kMapped[12] = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xff, 0xff};
  g_autoptr (GInetAddress) parsed = g_inet_address_new_from_string (address.c_str ());
  if (!parsed)
    return address;
  const auto bytes = reinterpret_cast<const char *> (g_inet_address_to_bytes (parsed));
  if (g_inet_address_get_family (parsed) == G_SOCKET_FAMILY_IPV4)
    return {bytes, 4};
  if (std::memcmp (bytes, kMapped, sizeof kMapped) == 0)
    return {bytes + sizeof kMapped, 4};
  return {bytes, 8};
}

bool
GuessLimiter::allows (const std::string &address, gint64 now_us) const
{
  const auto found = free_us_.find (network_of (address));
  return found == free_us_.end () || found->second - now_us <= (kBurst - 1) * kInterval_us;
}

void
GuessLimiter::add_failure (const std::string &address, gint64 now_us)
{
  const std::string network = network_of (address);
  if (free_us_.size () >= kMaxAddresses && !free_us_.contains (network)) {
    std::erase_if (free_us_, [&] (const auto &entry) { return entry.second <= now_us; });
    if (free_us_.size () >= kMaxAddresses)
      free_us_.erase (
          std::ranges::min_element (free_us_, {}, [] (const auto &entry) { return entry.second; }));
  }
  gint64 &free_us = free_us_[network];
  free_us = std::max (free_us, now_us) + kInterval_us;
}

} // namespace web
