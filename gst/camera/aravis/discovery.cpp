/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Aravis has one list of devices for the process: whoever asks for it changes it for all others. So
 * one lock guards the list, and nobody looks at it without. */
#include "discovery.hpp"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <unistd.h>

#include "control.hpp"
#include "user_name.hpp"

static std::mutex list_lock;

/* One discovery is enough for the cameras of a rig, which are opened one after the other. */
static constexpr std::int64_t kListLifetime_us = 3'000'000;
static constexpr guint64 kControlRegister = 0x0a00; /* GigE Vision: control channel privilege */

struct ListedCamera {
  CameraInfo info;
  std::string physical_id;              /* MAC address, or USB GUID */
  std::optional<std::string> user_name; /* once asked for; GigE */
  bool was_asked = false;
};

static std::string
text_of (const char *text)
{
  return text ? valid_utf8 (text) : "";
}

/* list_lock is held, also while the list is used. */
static std::vector<ListedCamera> &
discover (bool afresh)
{
  static auto &list = *new std::vector<ListedCamera>; /* threads may outlive main() */
  static std::int64_t listed_at = G_MININT64 / 2;
  if (!afresh && g_get_monotonic_time () - listed_at < kListLifetime_us)
    return list;
  arv_update_device_list ();
  list.clear ();
  for (guint i = 0; i < arv_get_n_devices (); i++) {
    ListedCamera camera;
    camera.info.id = text_of (arv_get_device_id (i));
    camera.info.vendor = text_of (arv_get_device_vendor (i));
    camera.info.model = text_of (arv_get_device_model (i));
    camera.info.serial = text_of (arv_get_device_serial_nbr (i));
    camera.info.address = text_of (arv_get_device_address (i));
    camera.info.protocol = text_of (arv_get_device_protocol (i));
    camera.info.physical_id = text_of (arv_get_device_physical_id (i));
    if (camera.info.protocol != "Fake") /* Aravis' own, which has no pictures of anything */
      list.push_back (std::move (camera));
  }
  listed_at = g_get_monotonic_time ();
  return list;
}

std::vector<CameraInfo>
list_cameras ()
{
  std::lock_guard guard (list_lock);
  std::vector<CameraInfo> cameras;
  for (const ListedCamera &camera : discover (true))
    cameras.push_back (camera.info);
  return cameras;
}

/* USB permissions. Aravis leaves out what it may not open, so the system's list is read. */

static std::string
first_line (const std::filesystem::path &file)
{
  std::ifstream in (file);
  std::string line;
  std::getline (in, line);
  return valid_utf8 (line);
}

/* Class EF (miscellaneous), subclass 05 (USB3 Vision), protocol 00 (control). */
static bool
is_usb3_vision (const std::filesystem::path &interface)
{
  return first_line (interface / "bInterfaceClass") == "ef" &&
         first_line (interface / "bInterfaceSubClass") == "05" &&
         first_line (interface / "bInterfaceProtocol") == "00";
}

std::vector<ForbiddenCamera>
forbidden_usb_cameras (const std::string &devices, const std::string &nodes)
{
  std::vector<ForbiddenCamera> found;
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
    if (access (node, R_OK | W_OK) != 0)
      found.push_back ({node, first_line (device / "product"), first_line (device / "serial")});
    g_free (node);
  }
  return found;
}

static std::string
permission_text (const ForbiddenCamera &camera)
{
  return "no permission to open " + camera.node + " (" + camera.product + " " + camera.serial +
         "): copy docs/70-usb3vision.rules to /etc/udev/rules.d, then plug the camera in again";
}

/* Names */

static bool
is_called (const ListedCamera &camera, const std::string &name)
{
  return camera.info.id == name || camera.info.serial == name || camera.info.address == name ||
         camera.info.physical_id == name;
}

static std::string
describe (const std::vector<ListedCamera> &list)
{
  std::vector<std::string> words;
  for (const ListedCamera &camera : list)
    words.push_back (
        camera.info.id + " (" + camera.info.address + ", serial " + camera.info.serial + ")");
  return words.empty () ? "no camera answers" : "these answer: " + joined (words);
}

static CameraStatus
not_found (const std::string &name, const std::vector<ListedCamera> &list)
{
  std::string text = name.empty () ? "no camera found: " : "no camera '" + name + "' found: ";
  text += describe (list);
  for (const ForbiddenCamera &camera : forbidden_usb_cameras ()) {
    if (list.empty () || name == camera.serial)
      return {CameraFault::kNoPermission,
          (name.empty () ? "" : "camera '" + name + "': ") + permission_text (camera)};
    text += "; besides, " + permission_text (camera);
  }
  return {CameraFault::kNotFound, text};
}

static CameraStatus
choose (const std::string &name, const std::vector<ListedCamera> &list, const ListedCamera *&chosen)
{
  chosen = nullptr;
  for (const ListedCamera &camera : list) {
    if (!name.empty () && !is_called (camera, name))
      continue;
    if (chosen)
      return {CameraFault::kBadSetting,
          (name.empty () ? "several cameras answer; name one of them"
                         : "several cameras are called '" + name + "'; use their ids") +
              std::string (": ") + describe (list)};
    chosen = &camera;
  }
  return {};
}

/* Opening */

static CameraStatus
open_failed (const std::string &name, const GError *error)
{
  const std::string label = "camera '" + name + "': ";
  const std::string text = error->message;
  if (text.find ("ERROR_BUSY") != std::string::npos)
    return {CameraFault::kBusy, label + "another program uses it (" + text + ")"};
  if (text.find ("ERROR_ACCESS") != std::string::npos) {
    const std::vector<ForbiddenCamera> forbidden = forbidden_usb_cameras ();
    return {CameraFault::kNoPermission,
        label + (forbidden.empty () ? text : permission_text (forbidden.front ()))};
  }
  return {fault_of (error, CameraFault::kFailed), label + text};
}

/* GigE: Aravis opens devices that another program controls, too, and says so only later. */
static CameraStatus
check_control (const std::string &name, ArvDevice *device)
{
  if (!ARV_IS_GV_DEVICE (device) || arv_gv_device_is_controller (ARV_GV_DEVICE (device)))
    return {};
  guint32 privilege = 0;
  GError *error = nullptr;
  arv_device_read_register (device, kControlRegister, &privilege, &error);
  if (error) {
    CameraStatus status = open_failed (name, error);
    g_error_free (error);
    return status;
  }
  return {CameraFault::kBusy,
      "camera '" + name + "': " +
          (privilege ? "another program has control of it"
                     : "it refuses control, although no other program has it") +
          " (GigE Vision gives it to one at a time; it is free again 3 s after that one is gone)"};
}

static CameraStatus
open_by_id (
    const std::string &name, const std::string &id, ArvDevice *&device, const char *&protocol)
{
  GError *error = nullptr;
  device = arv_open_device (id.c_str (), &error);
  if (!device) {
    CameraStatus status = error ? open_failed (name, error)
                                : CameraStatus (CameraFault::kNotFound,
                                      "camera '" + name + "' does not answer any more");
    g_clear_error (&error);
    return status;
  }
  g_clear_error (&error);
  protocol = ARV_IS_GV_DEVICE (device) ? "GigEVision" : "USB3Vision";
  CameraStatus status = check_control (name, device);
  if (!status.ok ())
    g_clear_object (&device);
  return status;
}

/* Asks each GigE camera of the list for its user-defined name, once. */
static const ListedCamera *
find_by_user_name (const std::string &name, std::vector<ListedCamera> &list)
{
  for (ListedCamera &camera : list) {
    if (!camera.was_asked && camera.info.protocol == "GigEVision")
      camera.user_name = read_user_name (camera.info.address);
    camera.was_asked = true;
    if (camera.user_name == name)
      return &camera;
  }
  return nullptr;
}

/* A host's name has a dot: others would cost a DNS query for each that is just not there. */
static CameraStatus
open_by_other_name (
    const std::string &name, std::vector<ListedCamera> &list, ArvDevice *&device, CameraInfo &info)
{
  const char *protocol = "GigEVision";
  info = {};
  if (const ListedCamera *camera = find_by_user_name (name, list)) {
    info = camera->info;
    return open_by_id (name, info.id, device, protocol);
  }
  if (name.find ('.') == std::string::npos || name.find (' ') != std::string::npos)
    return not_found (name, list);
  const CameraStatus status = open_by_id (name, name, device, protocol);
  if (g_hostname_is_ip_address (name.c_str ()))
    info.address = name;
  info.protocol = protocol;
  return status.fault () == CameraFault::kNotFound ? not_found (name, list) : status;
}

/* From the list as it is, or afresh. kNotFound: nothing in the list is called so. */
static CameraStatus
open_listed (const std::string &name, bool afresh, ArvDevice *&device, CameraInfo &info)
{
  const ListedCamera *chosen = nullptr;
  CameraStatus status = choose (name, discover (afresh), chosen);
  if (!status.ok ())
    return status;
  if (!chosen)
    return {CameraFault::kNotFound, ""};
  info = chosen->info;
  const char *protocol = "";
  return open_by_id (name.empty () ? info.id : name, info.id, device, protocol);
}

CameraStatus
open_camera_device (const std::string &name, ArvDevice *&device, CameraInfo &info)
{
  std::lock_guard guard (list_lock);
  device = nullptr;
  info = {};
  /* What was just listed need not be listed again, but may be gone. */
  CameraStatus status (CameraFault::kNotFound, "");
  if (!name.empty ())
    status = open_listed (name, false, device, info);
  if (status.ok () || status.fault () == CameraFault::kBusy)
    return status;
  if (!g_hostname_is_ip_address (name.c_str ())) { /* an address may lie behind a router */
    status = open_listed (name, true, device, info);
    if (status.fault () != CameraFault::kNotFound)
      return status;
    if (name.empty ())
      return not_found (name, discover (false));
  }
  return open_by_other_name (name, discover (false), device, info);
}
