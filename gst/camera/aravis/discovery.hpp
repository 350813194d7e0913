/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <arv.h>

#include "camera.hpp"

/** Finds and opens the device of a name, as Camera::open() says. May take seconds.
 *  @param[out] device  transfer full, under control of this process
 *  @param[out] info    all that discovery and the device tell, also if it is busy */
CameraStatus open_camera_device (const std::string &name, ArvDevice *&device, CameraInfo &info);

/** All cameras that answer now, and those on USB that may not be opened, with their problem. Takes
 *  about a second, searches every network interface and USB. Any thread; calls wait for each other
 *  and for Camera::open(). */
std::vector<CameraInfo> list_cameras ();

/** The USB3 Vision cameras on this host that this process may not open, with their problem.
 *  @param devices  where sysfs lists USB devices
 *  @param nodes    folder of their device nodes */
std::vector<CameraInfo> forbidden_usb_cameras (
    const std::string &devices = "/sys/bus/usb/devices", const std::string &nodes = "/dev/bus/usb");
