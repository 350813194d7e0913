/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <functional>
#include <memory>

#include "foundcamera.hpp"

namespace rangecast {

/** USB3 Vision cameras by libusb: a list on demand, and word when one comes or goes.
 *
 *  A camera is a device with an interface of class EF, subclass 05, protocol 00: the control
 *  interface of USB3 Vision (the device itself says class EF, subclass 02, since it groups
 *  interfaces). Names come from what the kernel read when it was plugged in, so that they are known
 *  without permission to open it, too. */
class UsbCameras {
public:
  /** @return nullptr if libusb does not start; `why` then says so */
  static std::unique_ptr<UsbCameras> open (std::string &why);
  ~UsbCameras ();

  /** The cameras that are plugged in now. Any thread. */
  FoundCameras list ();

  /** Calls `on_change` from a thread of its own whenever a USB device comes or goes, until the
   *  object is destroyed.
   *  @return false if this host's libusb has no hotplug */
  bool watch (std::function<void ()> on_change);

private:
  struct Private;
  explicit UsbCameras (std::unique_ptr<Private> priv);
  std::unique_ptr<Private> priv_;
};

} // namespace rangecast
