/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:provider-stereowebcamprovider
 * @title: stereowebcamprovider
 *
 * Lists the webcams that send the images of two lenses side by side, as devices of class
 * Source/Video/Stereo. They are found by their sizes among the cameras of GStreamer's own provider,
 * which lists them, too; they come and go with it.
 *
 * ## Example launch line
 * |[
 * gst-device-monitor-1.0 -f Source/Video/Stereo
 * ]|
 *
 * Since: 0.1
 */
#include <gst/gst.h>

#include <algorithm>
#include <mutex>
#include <vector>

GST_DEBUG_CATEGORY_STATIC (gst_stereo_webcam_provider_debug);
#define GST_CAT_DEFAULT gst_stereo_webcam_provider_debug

/* ---- a webcam ---- */

G_DECLARE_FINAL_TYPE (GstStereoWebcam, gst_stereo_webcam, GST, STEREO_WEBCAM, GstDevice)

struct _GstStereoWebcam {
  GstDevice parent;
  GstDevice *camera;
};

G_DEFINE_TYPE (GstStereoWebcam, gst_stereo_webcam, GST_TYPE_DEVICE)

static GstElement *
gst_stereo_webcam_create_element (GstDevice *device, const gchar *name)
{
  return gst_device_create_element (GST_STEREO_WEBCAM (device)->camera, name);
}

static gboolean
gst_stereo_webcam_reconfigure_element (GstDevice *device, GstElement *element)
{
  return gst_device_reconfigure_element (GST_STEREO_WEBCAM (device)->camera, element);
}

static void
gst_stereo_webcam_finalize (GObject *object)
{
  gst_clear_object (&GST_STEREO_WEBCAM (object)->camera);
  G_OBJECT_CLASS (gst_stereo_webcam_parent_class)->finalize (object);
}

static void
gst_stereo_webcam_init (GstStereoWebcam *)
{
}

static void
gst_stereo_webcam_class_init (GstStereoWebcamClass *klass)
{
  G_OBJECT_CLASS (klass)->finalize = gst_stereo_webcam_finalize;
  GST_DEVICE_CLASS (klass)->create_element = gst_stereo_webcam_create_element;
  GST_DEVICE_CLASS (klass)->reconfigure_element = gst_stereo_webcam_reconfigure_element;
}

/* ---- which cameras are stereo ---- */

/* Two images of 4:3 are 8:3 together; the widest ordinary images are 21:9. */
static gboolean
is_side_by_side (GstCapsFeatures *, GstStructure *structure, gpointer)
{
  gint width, height;
  return gst_structure_get_int (structure, "width", &width) &&
         gst_structure_get_int (structure, "height", &height) &&
         2 * gint64 (width) >= 5 * gint64 (height);
}

/* Returns: (transfer floating) (nullable): null if the camera sends single images */
static GstDevice *
make_stereo_webcam (GstDevice *camera)
{
  GstCaps *caps = gst_device_get_caps (camera);
  if (!caps || !gst_device_has_classes (camera, "Source/Video")) {
    gst_clear_caps (&caps);
    return nullptr;
  }
  caps = gst_caps_make_writable (caps);
  gst_caps_filter_and_map_in_place (caps, is_side_by_side, nullptr);
  if (gst_caps_is_empty (caps)) {
    gst_caps_unref (caps);
    return nullptr;
  }
  GstStructure *properties = gst_device_get_properties (camera);
  if (!properties)
    properties = gst_structure_new_empty ("stereo-webcam-properties");
  gst_structure_set (properties, "stereo.packing", G_TYPE_STRING, "side-by-side", nullptr);
  gchar *camera_name = gst_device_get_display_name (camera);
  gchar *name = g_strdup_printf ("%s (stereo, side by side)", camera_name);
  auto device = static_cast<GstStereoWebcam *> (
      g_object_new (gst_stereo_webcam_get_type (), "display-name", name, "device-class",
          "Source/Video/Stereo", "caps", caps, "properties", properties, nullptr));
  device->camera = GST_DEVICE (gst_object_ref (camera));
  g_free (name);
  g_free (camera_name);
  gst_structure_free (properties);
  gst_caps_unref (caps);
  return GST_DEVICE (device);
}

/* ---- the provider ---- */

G_DECLARE_FINAL_TYPE (GstStereoWebcamProvider, gst_stereo_webcam_provider, GST,
    STEREO_WEBCAM_PROVIDER, GstDeviceProvider)

struct _GstStereoWebcamProvider {
  GstDeviceProvider parent;
  GstDeviceProvider *cameras; /* started; null while stopped, or where there is none */
  std::mutex *lock;           /* guards what follows; never held while announcing */
  gboolean is_started;
  std::vector<GstStereoWebcam *> *devices; /* announced; the base class owns them */
};

G_DEFINE_TYPE (GstStereoWebcamProvider, gst_stereo_webcam_provider, GST_TYPE_DEVICE_PROVIDER)
GST_DEVICE_PROVIDER_REGISTER_DEFINE (stereowebcamprovider, "stereowebcamprovider", GST_RANK_PRIMARY,
    gst_stereo_webcam_provider_get_type ())

/* Returns: (transfer full) (nullable) */
static GstDeviceProvider *
find_camera_provider (GstDeviceProvider *self)
{
  GstDeviceProvider *cameras = gst_device_provider_factory_get_by_name ("v4l2deviceprovider");
  if (!cameras)
    GST_INFO_OBJECT (self, "no provider of webcams: v4l2deviceprovider is missing");
  return cameras;
}

static GList *
gst_stereo_webcam_provider_probe (GstDeviceProvider *provider)
{
  GList *devices = nullptr;
  if (GstDeviceProvider *cameras = find_camera_provider (provider)) {
    GList *found = gst_device_provider_get_devices (cameras);
    for (const GList *at = found; at; at = at->next)
      if (GstDevice *device = make_stereo_webcam (GST_DEVICE (at->data)))
        devices = g_list_prepend (devices, gst_object_ref_sink (device));
    g_list_free_full (found, gst_object_unref);
    gst_object_unref (cameras);
  }
  return g_list_reverse (devices);
}

/* A camera that is listed and announced at the same time is added once; one that is announced while
 * the provider stops, not at all. */
static void
add_camera (GstStereoWebcamProvider *self, GstDevice *camera)
{
  GstDevice *device = make_stereo_webcam (camera);
  if (!device)
    return;
  {
    const std::lock_guard guard (*self->lock);
    const auto at = std::ranges::find (*self->devices, camera, &GstStereoWebcam::camera);
    if (!self->is_started || at != self->devices->end ()) {
      gst_object_unref (gst_object_ref_sink (device));
      return;
    }
    self->devices->push_back (GST_STEREO_WEBCAM (device));
  }
  GST_DEBUG_OBJECT (self, "adding %" GST_PTR_FORMAT, device);
  gst_device_provider_device_add (GST_DEVICE_PROVIDER (self), device);
}

static void
remove_camera (GstStereoWebcamProvider *self, GstDevice *camera)
{
  GstStereoWebcam *device = nullptr;
  {
    const std::lock_guard guard (*self->lock);
    const auto at = std::ranges::find (*self->devices, camera, &GstStereoWebcam::camera);
    if (at == self->devices->end ())
      return;
    device = *at;
    self->devices->erase (at);
  }
  GST_DEBUG_OBJECT (self, "removing %" GST_PTR_FORMAT, device);
  gst_device_provider_device_remove (GST_DEVICE_PROVIDER (self), GST_DEVICE (device));
}

/* On the thread of the cameras' provider. */
static void
on_camera_message (GstBus *, GstMessage *message, gpointer data)
{
  auto self = GST_STEREO_WEBCAM_PROVIDER (data);
  GstDevice *camera = nullptr;
  if (GST_MESSAGE_TYPE (message) == GST_MESSAGE_DEVICE_ADDED) {
    gst_message_parse_device_added (message, &camera);
    add_camera (self, camera);
  } else if (GST_MESSAGE_TYPE (message) == GST_MESSAGE_DEVICE_REMOVED) {
    gst_message_parse_device_removed (message, &camera);
    remove_camera (self, camera);
  }
  gst_clear_object (&camera);
}

static void
set_started (GstStereoWebcamProvider *self, gboolean is_started)
{
  const std::lock_guard guard (*self->lock);
  self->is_started = is_started;
  self->devices->clear ();
}

static void
disconnect_cameras (GstStereoWebcamProvider *self)
{
  GstBus *bus = gst_device_provider_get_bus (self->cameras);
  g_signal_handlers_disconnect_by_data (bus, self);
  gst_bus_disable_sync_message_emission (bus);
  gst_object_unref (bus);
}

static gboolean
gst_stereo_webcam_provider_start (GstDeviceProvider *provider)
{
  auto self = GST_STEREO_WEBCAM_PROVIDER (provider);
  self->cameras = find_camera_provider (provider);
  if (!self->cameras)
    return TRUE;
  set_started (self, TRUE);
  GstBus *bus = gst_device_provider_get_bus (self->cameras);
  gst_bus_enable_sync_message_emission (bus);
  g_signal_connect (bus, "sync-message", G_CALLBACK (on_camera_message), self);
  gst_object_unref (bus);
  if (gst_device_provider_can_monitor (self->cameras) &&
      !gst_device_provider_start (self->cameras)) {
    GST_WARNING_OBJECT (self, "could not start %" GST_PTR_FORMAT, self->cameras);
    set_started (self, FALSE);
    disconnect_cameras (self);
    gst_clear_object (&self->cameras);
    return FALSE;
  }
  GList *found = gst_device_provider_get_devices (self->cameras);
  for (const GList *at = found; at; at = at->next)
    add_camera (self, GST_DEVICE (at->data));
  g_list_free_full (found, gst_object_unref);
  return TRUE;
}

/* The base class forgets the devices itself. */
static void
gst_stereo_webcam_provider_stop (GstDeviceProvider *provider)
{
  auto self = GST_STEREO_WEBCAM_PROVIDER (provider);
  set_started (self, FALSE);
  if (self->cameras) {
    disconnect_cameras (self);
    if (gst_device_provider_can_monitor (self->cameras))
      gst_device_provider_stop (self->cameras);
    gst_clear_object (&self->cameras);
  }
}

static void
gst_stereo_webcam_provider_finalize (GObject *object)
{
  auto self = GST_STEREO_WEBCAM_PROVIDER (object);
  delete self->devices;
  delete self->lock;
  G_OBJECT_CLASS (gst_stereo_webcam_provider_parent_class)->finalize (object);
}

static void
gst_stereo_webcam_provider_init (GstStereoWebcamProvider *self)
{
  self->lock = new std::mutex;
  self->devices = new std::vector<GstStereoWebcam *>;
}

static void
gst_stereo_webcam_provider_class_init (GstStereoWebcamProviderClass *klass)
{
  GST_DEBUG_CATEGORY_INIT (
      gst_stereo_webcam_provider_debug, "stereowebcamprovider", 0, "stereo webcams");
  G_OBJECT_CLASS (klass)->finalize = gst_stereo_webcam_provider_finalize;
  auto provider_class = GST_DEVICE_PROVIDER_CLASS (klass);
  provider_class->probe = GST_DEBUG_FUNCPTR (gst_stereo_webcam_provider_probe);
  provider_class->start = GST_DEBUG_FUNCPTR (gst_stereo_webcam_provider_start);
  provider_class->stop = GST_DEBUG_FUNCPTR (gst_stereo_webcam_provider_stop);
  gst_device_provider_class_set_static_metadata (provider_class, "Stereo webcams",
      "Source/Video/Stereo", "Lists webcams that send the images of two lenses side by side",
      "gst-rangecast");
}
