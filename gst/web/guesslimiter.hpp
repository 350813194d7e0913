/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <glib.h>

#include <map>
#include <string>

namespace web {

/** Limits the rate at which an address can try tokens. A network of IPv6 (64 bits) counts as one
 *  address. One thread. */
class GuessLimiter {
public:
  static constexpr int kBurst = 10; ///< wrong tokens that an address has at once
  static constexpr gint64 kInterval_us = 10 * G_USEC_PER_SEC; ///< for each one after those
  static constexpr gsize kMaxAddresses = 4096;

  /** @return whether a token from the address may be compared. @param now_us  monotonic */
  [[nodiscard]] bool allows (const std::string &address, gint64 now_us) const;
  /** Records a wrong token. Beyond kMaxAddresses the address that is free soonest is dropped. */
  void add_failure (const std::string &address, gint64 now_us);
  [[nodiscard]] gsize addresses () const { return free_us_.size (); } ///< that it knows

private:
  std::map<std::string, gint64> free_us_; /* when all failures of an address are forgotten */
};

} // namespace web
