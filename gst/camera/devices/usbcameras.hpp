/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <functional>
#include <memory>

#include "camera/aravis/camera_info.hpp"

/** USB3 Vision cameras by libusb: a list on demand, and a callback when one comes or goes.
 *
 *  A camera is a device with an interface of class EF, subclass 05, protocol 00: the control
 *  interface of USB3 Vision (the device itself says class EF, subclass 02, since it groups
 *  interfaces). Names are what the kernel read when the camera was plugged in, which needs no
 *  permission to open it. */
class UsbCameras {
public:
  /** @return null if libusb does not start; `why` says why */
  static std::unique_ptr<UsbCameras> open (std::string &why);
  ~UsbCameras ();

  /** The cameras that are plugged in now. Any thread. */
  std::vector<CameraInfo> list ();

  /** Calls `on_change` from a thread of libusb events whenever a USB device comes or goes, until
   *  the object is destroyed.
   *  @return false if this host's libusb has no hotplug */
  bool watch (std::function<void ()> on_change);

private:
  struct Private;
  explicit UsbCameras (std::unique_ptr<Private> priv);
  std::unique_ptr<Private> priv_;
};
