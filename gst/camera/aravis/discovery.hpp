/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <arv.h>

#include "camera.hpp"

/** Finds and opens the device of a name, as Camera::open says. May take seconds.
 *  @param[out] device  transfer full, has control
 *  @param[out] info    all that discovery and the device tell */
CameraStatus open_camera_device (const std::string &name, ArvDevice *&device, CameraInfo &info);

/** A USB3 Vision camera on this host that this process may not open. */
struct ForbiddenCamera {
  std::string node; ///< /dev/bus/usb/BUS/DEVICE
  std::string product, serial;
};
/** @param devices  where the system lists USB devices
 *  @param nodes    where it has their nodes */
std::vector<ForbiddenCamera> forbidden_usb_cameras (
    const std::string &devices = "/sys/bus/usb/devices", const std::string &nodes = "/dev/bus/usb");
