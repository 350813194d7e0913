/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:provider-rangecastdeviceprovider
 * @title: rangecastdeviceprovider
 *
 * Lists the GigE Vision and USB3 Vision cameras that answer when a device monitor is started.
 *
 * ## Example launch line
 * |[
 * gst-device-monitor-1.0 Video/Source
 * ]|
 *
 * Since: 0.1
 */
#include <gst/gst.h>

#include "camera/aravis/camera.hpp"
#include "camera/aravis/discovery.hpp"

#define GST_TYPE_CAMERA_DEVICE (gst_camera_device_get_type ())
G_DECLARE_FINAL_TYPE (GstCameraDevice, gst_camera_device, GST, CAMERA_DEVICE, GstDevice)

struct _GstCameraDevice {
  GstDevice parent;
  gchar *name; // that aravissrc opens it by
};

G_DEFINE_TYPE (GstCameraDevice, gst_camera_device, GST_TYPE_DEVICE)

G_DECLARE_FINAL_TYPE (GstCameraDeviceProvider, gst_camera_device_provider, GST,
    CAMERA_DEVICE_PROVIDER, GstDeviceProvider)

struct _GstCameraDeviceProvider {
  GstDeviceProvider parent;
};

G_DEFINE_TYPE (GstCameraDeviceProvider, gst_camera_device_provider, GST_TYPE_DEVICE_PROVIDER)
GST_DEVICE_PROVIDER_REGISTER_DEFINE (rangecastdeviceprovider, "rangecastdeviceprovider",
    GST_RANK_PRIMARY, gst_camera_device_provider_get_type ())

/* ---- a camera ---- */

/* Returns: (transfer floating) */
static GstDevice *
new_camera_device (const CameraInfo &camera)
{
  /* by its id, Aravis would use the network that answered first, which may not be the one that
   * images can come by */
  const std::string &name = camera.is_gige () ? camera.address : camera.id;
  GstStructure *properties = gst_structure_new ("camera-properties", "device.api", G_TYPE_STRING,
      "aravis", "device.bus", G_TYPE_STRING, camera.is_gige () ? "ethernet" : "usb",
      "camera.protocol", G_TYPE_STRING, camera.protocol.c_str (), "camera.id", G_TYPE_STRING,
      camera.id.c_str (), "camera.vendor", G_TYPE_STRING, camera.vendor.c_str (), "camera.model",
      G_TYPE_STRING, camera.model.c_str (), "camera.serial", G_TYPE_STRING, camera.serial.c_str (),
      "camera.address", G_TYPE_STRING, camera.address.c_str (), nullptr);
  std::string label = camera.vendor + " " + camera.model + " (" + camera.serial + ")";
  if (!camera.problem.empty ()) {
    gst_structure_set (
        properties, "camera.problem", G_TYPE_STRING, camera.problem.c_str (), nullptr);
    label += ", not usable: " + camera.problem;
  }
  GstCaps *caps = camera_caps (); // the camera's own are known only to who opens it
  auto self =
      GST_CAMERA_DEVICE (g_object_new (GST_TYPE_CAMERA_DEVICE, "display-name", label.c_str (),
          "device-class", "Source/Video", "caps", caps, "properties", properties, nullptr));
  gst_caps_unref (caps);
  gst_structure_free (properties);
  self->name = g_strdup (name.c_str ());
  return GST_DEVICE (self);
}

static GstElement *
gst_camera_device_create_element (GstDevice *device, const gchar *name)
{
  GstElement *element = gst_element_factory_make ("aravissrc", name);
  if (element)
    g_object_set (element, "camera-name", GST_CAMERA_DEVICE (device)->name, nullptr);
  return element;
}

static void
gst_camera_device_finalize (GObject *object)
{
  g_free (GST_CAMERA_DEVICE (object)->name);
  G_OBJECT_CLASS (gst_camera_device_parent_class)->finalize (object);
}

static void
gst_camera_device_init (GstCameraDevice *)
{
}

static void
gst_camera_device_class_init (GstCameraDeviceClass *klass)
{
  G_OBJECT_CLASS (klass)->finalize = gst_camera_device_finalize;
  GST_DEVICE_CLASS (klass)->create_element = gst_camera_device_create_element;
}

/* ---- the provider ---- */

static GList *
gst_camera_device_provider_probe (GstDeviceProvider *)
{
  GList *devices = nullptr;
  for (const CameraInfo &camera : list_cameras ())
    devices = g_list_prepend (devices, new_camera_device (camera));
  return g_list_reverse (devices);
}

static void
gst_camera_device_provider_init (GstCameraDeviceProvider *)
{
}

static void
gst_camera_device_provider_class_init (GstCameraDeviceProviderClass *klass)
{
  auto provider_class = GST_DEVICE_PROVIDER_CLASS (klass);
  provider_class->probe = GST_DEBUG_FUNCPTR (gst_camera_device_provider_probe);
  gst_device_provider_class_set_static_metadata (provider_class, "Machine-vision cameras",
      "Source/Video", "Lists GigE Vision and USB3 Vision cameras", "gst-rangecast");
}
