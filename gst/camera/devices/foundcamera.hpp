/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace rangecast {

/** A machine-vision camera that is there: what a search tells about it without opening it. */
struct FoundCamera {
  enum class Transport { kGigEVision, kUsb3Vision };
  Transport transport = Transport::kGigEVision;
  std::string id;          ///< what Aravis opens it by, e.g. "Vendor-12345"; unique on this host
  std::string vendor;      ///< empty if the camera does not tell
  std::string model;       ///< empty if the camera does not tell
  std::string serial;      ///< empty if the camera does not tell
  std::string address;     ///< IP address, or the device node of a USB camera
  std::string physical_id; ///< MAC address; empty for USB
  std::optional<std::string> user_name; ///< GigE: the user-defined name; none: it did not say
  std::string problem;                  ///< why it cannot be opened and what to do; empty if it can

  bool operator== (const FoundCamera &) const = default;

  /** Whether `name`, as the stereocamsrc properties and rig files take it, means this camera. */
  [[nodiscard]] bool is_called (const std::string &name) const
  {
    const bool has_ip = transport == Transport::kGigEVision;
    return !name.empty () && (name == serial || name == id || name == physical_id ||
                                 name == user_name || (has_ip && name == address));
  }
};

using FoundCameras = std::vector<FoundCamera>;

} // namespace rangecast
