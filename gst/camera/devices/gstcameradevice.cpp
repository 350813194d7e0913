/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "cameradevices.hpp"

#include "camera/aravis/camera.hpp"

#define GST_TYPE_CAMERA_DEVICE (gst_camera_device_get_type ())
G_DECLARE_FINAL_TYPE (GstCameraDevice, gst_camera_device, GST, CAMERA_DEVICE, GstDevice)

/* What the device monitor lists: one camera, or a stereo pair of a known rig. */
struct _GstCameraDevice {
  GstDevice parent;
  gchar *factory;         // name of the element that opens it
  GstStructure *settings; // the properties that element gets
};

G_DEFINE_TYPE (GstCameraDevice, gst_camera_device, GST_TYPE_DEVICE)

namespace {

GstDevice *
new_device (const std::string &name, const gchar *klass, GstStructure *properties,
    const gchar *factory, GstStructure *settings)
{
  GstCaps *caps = camera_caps (); // the camera's own are known only to who opens it
  auto self = GST_CAMERA_DEVICE (g_object_new (GST_TYPE_CAMERA_DEVICE, "display-name",
      name.c_str (), "device-class", klass, "caps", caps, "properties", properties, nullptr));
  gst_caps_unref (caps);
  gst_structure_free (properties);
  self->factory = g_strdup (factory);
  self->settings = settings;
  return GST_DEVICE (self);
}

} // namespace

GstDevice *
new_camera_device (const CameraInfo &camera)
{
  auto properties = gst_structure_new ("camera-properties", "device.api", G_TYPE_STRING, "aravis",
      "device.bus", G_TYPE_STRING, camera.is_gige () ? "ethernet" : "usb", "camera.protocol",
      G_TYPE_STRING, camera.protocol.c_str (), "camera.id", G_TYPE_STRING, camera.id.c_str (),
      "camera.vendor", G_TYPE_STRING, camera.vendor.c_str (), "camera.model", G_TYPE_STRING,
      camera.model.c_str (), "camera.serial", G_TYPE_STRING, camera.serial.c_str (),
      "camera.address", G_TYPE_STRING, camera.address.c_str (), nullptr);
  if (!camera.problem.empty ())
    gst_structure_set (
        properties, "camera.problem", G_TYPE_STRING, camera.problem.c_str (), nullptr);

  auto name = camera.vendor + " " + camera.model + " (" + camera.serial + ")";
  if (!camera.problem.empty ())
    name += ", not usable: " + camera.problem;
  /* by its id, Aravis would use the network that answered first, which may not be the one that
   * images can come by */
  const auto &camera_name = camera.is_gige () ? camera.address : camera.id;
  return new_device (name, "Source/Video", properties, "aravissrc",
      gst_structure_new ("settings", "camera-name", G_TYPE_STRING, camera_name.c_str (), nullptr));
}

GstDevice *
new_pair_device (const KnownPair &pair)
{
  auto properties = gst_structure_new ("stereo-pair-properties", "device.api", G_TYPE_STRING,
      "aravis", "rig.file", G_TYPE_STRING, pair.rig_path.c_str (), "rig.view-id", G_TYPE_INT,
      pair.view_id, "camera.left", G_TYPE_STRING, pair.cameras[0].c_str (), "camera.right",
      G_TYPE_STRING, pair.cameras[1].c_str (), nullptr);
  if (!pair.cameras[2].empty ())
    gst_structure_set (
        properties, "camera.third", G_TYPE_STRING, pair.cameras[2].c_str (), nullptr);
  return new_device (pair.display_name, "Source/Video/Stereo", properties, "stereocamsrc",
      gst_structure_new ("settings", "rig", G_TYPE_STRING, pair.rig_path.c_str (), "view-id",
          G_TYPE_INT, pair.view_id, nullptr));
}

static gboolean
set_field (GQuark field, const GValue *value, gpointer element)
{
  g_object_set_property (G_OBJECT (element), g_quark_to_string (field), value);
  return TRUE;
}

static GstElement *
gst_camera_device_create_element (GstDevice *device, const gchar *name)
{
  auto self = GST_CAMERA_DEVICE (device);
  GstElement *element = gst_element_factory_make (self->factory, name);
  if (element)
    gst_structure_foreach (self->settings, set_field, element);
  return element;
}

static void
gst_camera_device_finalize (GObject *object)
{
  auto self = GST_CAMERA_DEVICE (object);
  g_free (self->factory);
  if (self->settings)
    gst_structure_free (self->settings);
  G_OBJECT_CLASS (gst_camera_device_parent_class)->finalize (object);
}

static void
gst_camera_device_init (GstCameraDevice *)
{
}

static void
gst_camera_device_class_init (GstCameraDeviceClass *klass)
{
  auto device_class = GST_DEVICE_CLASS (klass);
  G_OBJECT_CLASS (klass)->finalize = gst_camera_device_finalize;
  device_class->create_element = gst_camera_device_create_element;
}
