/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "usbcameras.hpp"

#include <array>
#include <atomic>
#include <cstdio>
#include <fstream>
#include <system_error>
#include <thread>

#include <libusb.h>

namespace {

constexpr int kControlClass = 0xEF, kControlSubClass = 0x05, kControlProtocol = 0x00;

bool
has_control_interface (const libusb_config_descriptor &config)
{
  for (int i = 0; i < config.bNumInterfaces; ++i)
    for (int k = 0; k < config.interface[i].num_altsetting; ++k) {
      const auto &setting = config.interface[i].altsetting[k];
      if (setting.bInterfaceClass == kControlClass &&
          setting.bInterfaceSubClass == kControlSubClass &&
          setting.bInterfaceProtocol == kControlProtocol)
        return true;
    }
  return false;
}

bool
is_usb3_vision (libusb_device *device, const libusb_device_descriptor &descriptor)
{
  for (int i = 0; i < descriptor.bNumConfigurations; ++i) {
    libusb_config_descriptor *config = nullptr;
    if (libusb_get_config_descriptor (device, std::uint8_t (i), &config) != LIBUSB_SUCCESS)
      continue;
    const bool found = has_control_interface (*config);
    libusb_free_config_descriptor (config);
    if (found)
      return true;
  }
  return false;
}

/** The folder in which the kernel shows the device, e.g. /sys/bus/usb/devices/2-1.4; empty for a
 *  root hub. */
std::string
kernel_folder (libusb_device *device)
{
  std::array<std::uint8_t, 8> ports;
  const int depth = libusb_get_port_numbers (device, ports.data (), int (ports.size ()));
  if (depth <= 0)
    return {};
  auto path = "/sys/bus/usb/devices/" + std::to_string (libusb_get_bus_number (device));
  for (int i = 0; i < depth; ++i)
    path += (i ? "." : "-") + std::to_string (ports[std::size_t (i)]);
  return path;
}

/** A text that the kernel read from the device, else from the device itself. */
std::string
device_text (
    const std::string &folder, const char *name, libusb_device_handle *handle, std::uint8_t index)
{
  std::string line;
  if (!folder.empty ()) {
    std::ifstream file (folder + "/" + name);
    std::getline (file, line);
  }
  if (!line.empty () || !handle || !index)
    return line;
  std::array<unsigned char, 256> text;
  const int size =
      libusb_get_string_descriptor_ascii (handle, index, text.data (), int (text.size ()));
  return size > 0 ? std::string (text.begin (), text.begin () + size) : std::string ();
}

std::string
opening_problem (int error, const std::string &node)
{
  if (error == LIBUSB_SUCCESS)
    return {};
  if (error == LIBUSB_ERROR_ACCESS)
    return permission_problem (node);
  return "cannot open " + node + ": " + libusb_strerror (libusb_error (error));
}

CameraInfo
describe (libusb_device *device, const libusb_device_descriptor &descriptor)
{
  CameraInfo camera;
  camera.protocol = "USB3Vision";
  std::array<char, 32> node;
  std::snprintf (node.data (), node.size (), "/dev/bus/usb/%03d/%03d",
      libusb_get_bus_number (device), libusb_get_device_address (device));
  camera.address = node.data ();
  libusb_device_handle *handle = nullptr;
  camera.problem = opening_problem (libusb_open (device, &handle), camera.address);

  const auto folder = kernel_folder (device);
  camera.vendor = device_text (folder, "manufacturer", handle, descriptor.iManufacturer);
  camera.model = device_text (folder, "product", handle, descriptor.iProduct);
  camera.serial = device_text (folder, "serial", handle, descriptor.iSerialNumber);
  camera.id = camera.vendor + "-" + camera.serial; /* as Aravis names it */
  if (handle)
    libusb_close (handle);
  return camera;
}

} // namespace

struct UsbCameras::Private {
  libusb_context *context = nullptr;
  libusb_hotplug_callback_handle hotplug = 0;
  bool is_watched = false;
  std::atomic<bool> is_over{false};
  std::atomic<bool> has_changed{false};
  std::function<void ()> on_change;
  std::thread thread;
};

UsbCameras::UsbCameras (std::unique_ptr<Private> priv) : priv_ (std::move (priv)) {}

std::unique_ptr<UsbCameras>
UsbCameras::open (std::string &why)
{
  auto priv = std::make_unique<Private> ();
  const int error = libusb_init (&priv->context);
  if (error != LIBUSB_SUCCESS) {
    why = std::string ("cannot initialise libusb: ") + libusb_strerror (libusb_error (error));
    return nullptr;
  }
  return std::unique_ptr<UsbCameras> (new UsbCameras (std::move (priv)));
}

UsbCameras::~UsbCameras ()
{
  if (priv_->is_watched) {
    priv_->is_over = true;
    libusb_hotplug_deregister_callback (priv_->context, priv_->hotplug);
    libusb_interrupt_event_handler (priv_->context);
    priv_->thread.join ();
  }
  libusb_exit (priv_->context);
}

std::vector<CameraInfo>
UsbCameras::list ()
{
  std::vector<CameraInfo> found;
  libusb_device **devices = nullptr;
  const auto count = libusb_get_device_list (priv_->context, &devices);
  for (ssize_t i = 0; i < count; ++i) {
    libusb_device_descriptor descriptor;
    if (libusb_get_device_descriptor (devices[i], &descriptor) == LIBUSB_SUCCESS &&
        is_usb3_vision (devices[i], descriptor))
      found.push_back (describe (devices[i], descriptor));
  }
  if (count >= 0)
    libusb_free_device_list (devices, 1);
  return found;
}

bool
UsbCameras::watch (std::function<void ()> on_change)
{
  if (!libusb_has_capability (LIBUSB_CAP_HAS_HOTPLUG))
    return false;
  constexpr auto both = LIBUSB_HOTPLUG_EVENT_DEVICE_ARRIVED | LIBUSB_HOTPLUG_EVENT_DEVICE_LEFT;
  priv_->on_change = std::move (on_change);
  // devices may not be opened in the callback
  const auto on_hotplug = [] (libusb_context *, libusb_device *, libusb_hotplug_event, void *data) {
    static_cast<std::atomic<bool> *> (data)->store (true);
    return 0;
  };
  if (libusb_hotplug_register_callback (priv_->context, both, LIBUSB_HOTPLUG_NO_FLAGS,
          LIBUSB_HOTPLUG_MATCH_ANY, LIBUSB_HOTPLUG_MATCH_ANY, LIBUSB_HOTPLUG_MATCH_ANY, on_hotplug,
          &priv_->has_changed, &priv_->hotplug) != LIBUSB_SUCCESS)
    return false;
  try {
    priv_->thread = std::thread ([priv = priv_.get ()] {
      while (!priv->is_over) {
        timeval pause{.tv_sec = 1, .tv_usec = 0};
        libusb_handle_events_timeout (priv->context, &pause);
        if (priv->has_changed.exchange (false) && !priv->is_over)
          priv->on_change ();
      }
    });
  } catch (const std::system_error &) {
    libusb_hotplug_deregister_callback (priv_->context, priv_->hotplug);
    return false;
  }
  priv_->is_watched = true;
  return true;
}
