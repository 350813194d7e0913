/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "gigecameras.hpp"

#include <mutex>

extern "C" {
#include <arv.h>
}

namespace rangecast {

namespace {

std::string
text (const char *maybe)
{
  return maybe ? maybe : "";
}

} // namespace

FoundCameras
find_gige_cameras ()
{
  /* Aravis keeps one list for the process: the strings of one search die with the next. */
  static std::mutex lock;
  const std::lock_guard guard (lock);
  arv_update_device_list ();

  FoundCameras found;
  for (unsigned int i = 0; i < arv_get_n_devices (); ++i) {
    if (text (arv_get_device_protocol (i)) != "GigEVision")
      continue; // USB comes from libusb, which tells about hotplug and permissions
    found.push_back ({.transport = FoundCamera::Transport::kGigEVision,
        .id = text (arv_get_device_id (i)),
        .vendor = text (arv_get_device_vendor (i)),
        .model = text (arv_get_device_model (i)),
        .serial = text (arv_get_device_serial_nbr (i)),
        .address = text (arv_get_device_address (i)),
        .problem = {}});
  }
  return found;
}

} // namespace rangecast
