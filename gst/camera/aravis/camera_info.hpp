/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <optional>
#include <string>
#include <vector>

/** What discovery tells about a machine-vision camera without opening it. Strings are empty where
 *  the camera does not tell. */
struct CameraInfo {
  std::string id; ///< Aravis' name for it, as "Aravis-Fake-GV01"; unique on this host
  std::string vendor, model, serial;
  std::string address;     ///< GigE: IP address; USB: device node, or as Aravis says
  std::string physical_id; ///< GigE: MAC address; USB: GUID
  std::string protocol;    ///< "GigEVision", "USB3Vision"
  std::optional<std::string> user_name =
      {};                   ///< GigE: user-defined name; none: not asked, no answer
  std::string problem = {}; ///< why it cannot be opened and what to do; empty if it can

  bool operator== (const CameraInfo &) const = default;

  [[nodiscard]] bool is_gige () const { return protocol == "GigEVision"; }
  /** Whether both are one camera, whatever names they were found by. */
  [[nodiscard]] bool is_same (const CameraInfo &other) const
  {
    const auto same = [] (const std::string &a, const std::string &b) {
      return !a.empty () && a == b;
    };
    return same (id, other.id) || same (address, other.address) ||
           same (physical_id, other.physical_id);
  }
  /** Whether it can be opened under this name without asking it for its user-defined one. */
  [[nodiscard]] bool is_listed_as (const std::string &name) const
  {
    return name == id || name == serial || name == physical_id || name == address;
  }
  /** Whether this camera is meant by a name as in the properties of stereocamsrc and rig files. */
  [[nodiscard]] bool is_called (const std::string &name) const
  {
    return !name.empty () && (name == id || name == serial || name == physical_id ||
                                 name == user_name || (is_gige () && name == address));
  }
};

/** What to tell a user who may not open a USB camera. @param node  its device node */
inline std::string
permission_problem (const std::string &node)
{
  return "no permission to open " + node +
         ": copy docs/70-usb3vision.rules to /etc/udev/rules.d, then plug the camera in again";
}

/** All cameras that answer now. Takes about a second, searches every network interface and USB. Any
 *  thread; calls wait for each other and for Camera::open(). */
std::vector<CameraInfo> list_cameras ();
