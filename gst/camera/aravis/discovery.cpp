/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Aravis has one list of devices in the process, which each update changes for all users. So one
 * lock guards the list, and is held while it is used. */
#include "discovery.hpp"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <unistd.h>

#include "control.hpp"
#include "user_name.hpp"

namespace {

std::mutex list_lock;

/* One discovery is enough for the cameras of a rig, which are opened one after the other. */
constexpr std::int64_t kListLifetime_us = 3'000'000;
constexpr guint64 kControlRegister = 0x0a00; /* GigE Vision: control channel privilege */

/* With list_lock, also while the list is used. */
const std::vector<CameraInfo> &
discover (bool afresh)
{
  static auto &list = *new std::vector<CameraInfo>; /* threads may outlive main() */
  static std::int64_t listed_at = G_MININT64 / 2;
  if (!afresh && g_get_monotonic_time () - listed_at < kListLifetime_us)
    return list;
  arv_update_device_list ();
  list.clear ();
  for (guint i = 0; i < arv_get_n_devices (); i++) {
    CameraInfo info;
    info.id = valid_utf8 (arv_get_device_id (i));
    info.vendor = valid_utf8 (arv_get_device_vendor (i));
    info.model = valid_utf8 (arv_get_device_model (i));
    info.serial = valid_utf8 (arv_get_device_serial_nbr (i));
    info.address = valid_utf8 (arv_get_device_address (i));
    info.physical_id = valid_utf8 (arv_get_device_physical_id (i));
    info.protocol = valid_utf8 (arv_get_device_protocol (i));
    if (info.is_gige ())
      info.user_name = valid_utf8 (read_user_name (info.address));
    if (info.protocol != "Fake") /* Aravis' own, which only sends test patterns */
      list.push_back (std::move (info));
  }
  listed_at = g_get_monotonic_time ();
  return list;
}

} // namespace

std::vector<CameraInfo>
list_cameras ()
{
  std::lock_guard guard (list_lock);
  std::vector<CameraInfo> cameras = discover (true);
  std::ranges::move (forbidden_usb_cameras (), std::back_inserter (cameras));
  return cameras;
}

/* ---- USB permissions: Aravis leaves out what it may not open, so sysfs is read ---- */

namespace {

std::string
first_line (const std::filesystem::path &file)
{
  std::ifstream in (file);
  std::string line;
  std::getline (in, line);
  return valid_utf8 (line);
}

/* Class EF (miscellaneous), subclass 05 (USB3 Vision), protocol 00 (control). */
bool
is_usb3_vision (const std::filesystem::path &interface)
{
  return first_line (interface / "bInterfaceClass") == "ef" &&
         first_line (interface / "bInterfaceSubClass") == "05" &&
         first_line (interface / "bInterfaceProtocol") == "00";
}

} // namespace

std::vector<CameraInfo>
forbidden_usb_cameras (const std::string &devices, const std::string &nodes)
{
  std::vector<CameraInfo> found;
  std::error_code error;
  for (std::filesystem::directory_iterator entry (devices, error), end; !error && entry != end;
       entry.increment (error)) { /* devices may go meanwhile */
    const std::string name = entry->path ().filename ();
    const std::size_t colon = name.find (':'); /* "2-1:1.0" is interface 0 of device "2-1" */
    if (colon == std::string::npos || !is_usb3_vision (entry->path ()))
      continue;
    const std::filesystem::path device = std::filesystem::path (devices) / name.substr (0, colon);
    int bus = 0, number = 0;
    if (std::sscanf (first_line (device / "busnum").c_str (), "%d", &bus) != 1 ||
        std::sscanf (first_line (device / "devnum").c_str (), "%d", &number) != 1)
      continue;
    gchar *node = g_strdup_printf ("%s/%03d/%03d", nodes.c_str (), bus, number);
    if (access (node, R_OK | W_OK) != 0) {
      CameraInfo camera;
      camera.model = first_line (device / "product");
      camera.serial = first_line (device / "serial");
      camera.address = node;
      camera.protocol = "USB3Vision";
      camera.problem = "no permission to open " + camera.address + " (" + camera.model + " " +
                       camera.serial +
                       "): copy docs/70-usb3vision.rules to /etc/udev/rules.d, then plug the "
                       "camera in again";
      found.push_back (std::move (camera));
    }
    g_free (node);
  }
  return found;
}

/* ---- opening ---- */

namespace {

std::string
describe (const std::vector<CameraInfo> &list)
{
  std::vector<std::string> words;
  for (const CameraInfo &info : list)
    words.push_back (info.id + " (" + info.address + ", serial " + info.serial + ")");
  return words.empty () ? "no camera answers" : "these answer: " + joined (words);
}

CameraStatus
not_found (const std::string &name, const std::vector<CameraInfo> &list)
{
  std::string text = "no camera '" + name + "' found: " + describe (list);
  for (const CameraInfo &camera : forbidden_usb_cameras ()) {
    if (list.empty () || name == camera.serial)
      return {CameraFault::kNoPermission, "camera '" + name + "': " + camera.problem};
    text += "; besides, " + camera.problem;
  }
  return {CameraFault::kNotFound, text};
}

CameraStatus
open_failed (const std::string &name, const GError *error)
{
  const std::string label = "camera '" + name + "': ";
  const std::string text = error->message;
  if (text.find ("ERROR_BUSY") != std::string::npos)
    return {CameraFault::kBusy, label + "another program uses it (" + text + ")"};
  if (text.find ("ERROR_ACCESS") != std::string::npos) {
    const std::vector<CameraInfo> forbidden = forbidden_usb_cameras ();
    return {CameraFault::kNoPermission,
        label + (forbidden.empty () ? text : forbidden.front ().problem)};
  }
  return {fault_of (error, CameraFault::kFailed), label + text};
}

/* GigE: Aravis also opens devices that another program controls, and reports that only later. */
CameraStatus
check_control (const std::string &name, ArvDevice *device)
{
  if (!ARV_IS_GV_DEVICE (device) || arv_gv_device_is_controller (ARV_GV_DEVICE (device)))
    return {};
  guint32 privilege = 0;
  GError *error = nullptr;
  if (arv_device_read_register (device, kControlRegister, &privilege, &error) && privilege == 0)
    arv_gv_device_take_control (ARV_GV_DEVICE (device), &error); /* it was let go just now */
  if (error) {
    CameraStatus status = open_failed (name, error);
    g_error_free (error);
    return status;
  }
  if (privilege == 0)
    return {};
  return {CameraFault::kBusy,
      "camera '" + name +
          "': another program has control of it (GigE Vision gives it to one at a time; it is free "
          "again 3 s after that one is gone)"};
}

CameraStatus
open_by_id (const std::string &name, const std::string &id, ArvDevice *&device)
{
  GError *error = nullptr;
  device = arv_open_device (id.c_str (), &error);
  CameraStatus status;
  if (device)
    status = check_control (name, device);
  else if (error)
    status = open_failed (name, error);
  else
    status = {CameraFault::kNotFound, "camera '" + name + "' no longer responds"};
  g_clear_error (&error);
  if (!status.ok ())
    g_clear_object (&device);
  return status;
}

/* Opens the camera of that name in the list.
 * @return kNotFound: nothing in the list is called so */
CameraStatus
open_listed (const std::string &name, const std::vector<CameraInfo> &list, ArvDevice *&device,
    CameraInfo &info)
{
  const CameraInfo *chosen = nullptr;
  for (const CameraInfo &camera : list) {
    if (!camera.is_called (name))
      continue;
    if (chosen)
      return {CameraFault::kBadSetting,
          "several cameras are called '" + name + "'; use their ids: " + describe (list)};
    chosen = &camera;
  }
  if (!chosen)
    return not_found (name, list);
  info = *chosen;
  return open_by_id (name, info.id, device);
}

} // namespace

CameraStatus
open_camera_device (const std::string &name, ArvDevice *&device, CameraInfo &info)
{
  std::lock_guard guard (list_lock);
  device = nullptr;
  info = {};
  /* A recent list need not be made again, but its cameras may be gone. */
  CameraStatus status = open_listed (name, discover (false), device, info);
  if (status.ok () || status.fault () == CameraFault::kBusy)
    return status;
  const bool is_address = g_hostname_is_ip_address (name.c_str ()); /* perhaps behind a router */
  if (!is_address)
    status = open_listed (name, discover (true), device, info);
  /* Host names have a dot: others would cost a DNS query for each camera that is not there. */
  if (status.fault () != CameraFault::kNotFound || name.find ('.') == std::string::npos ||
      name.find (' ') != std::string::npos)
    return status;
  info = {};
  status = open_by_id (name, name, device);
  if (is_address)
    info.address = name;
  info.protocol = !device || ARV_IS_GV_DEVICE (device) ? "GigEVision" : "USB3Vision";
  return status.fault () == CameraFault::kNotFound ? not_found (name, discover (false)) : status;
}
