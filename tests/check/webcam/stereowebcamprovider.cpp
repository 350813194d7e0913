/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* stereowebcamprovider, in front of a provider of cameras that the test plugs in and unplugs. It
 * takes the place of v4l2deviceprovider, which finds none on most machines that run tests. */
#include "../rangecast-check.hpp"

namespace {

/* ---- a provider of cameras ---- */

struct FakeCamera {
  GstDevice parent;
};
struct FakeCameraClass {
  GstDeviceClass parent;
};
G_DEFINE_TYPE (FakeCamera, fake_camera, GST_TYPE_DEVICE)

GstElement *
create_element (GstDevice *, const gchar *name)
{
  return gst_element_factory_make ("videotestsrc", name);
}
void
fake_camera_init (FakeCamera *)
{
}
void
fake_camera_class_init (FakeCameraClass *klass)
{
  GST_DEVICE_CLASS (klass)->create_element = create_element;
}

/* @return transfer floating */
GstDevice *
camera (const char *name, const char *caps_string, const char *klass = "Video/Source")
{
  GstCaps *caps = gst_caps_from_string (caps_string);
  GstStructure *properties =
      gst_structure_new ("v4l2deviceprovider", "device.path", G_TYPE_STRING, name, nullptr);
  auto device = static_cast<GstDevice *> (g_object_new (fake_camera_get_type (), "display-name",
      name, "device-class", klass, "caps", caps, "properties", properties, nullptr));
  gst_structure_free (properties);
  gst_caps_unref (caps);
  return device;
}

bool can_start = true;
struct FakeCameras {
  GstDeviceProvider parent;
};
struct FakeCamerasClass {
  GstDeviceProviderClass parent;
};
G_DEFINE_TYPE (FakeCameras, fake_cameras, GST_TYPE_DEVICE_PROVIDER)

constexpr char kSingle[] = "video/x-raw,width=1280,height=720;video/x-raw,width=2560,height=1080";
constexpr char kPacked[] =
    "video/x-raw,format=YUY2,width=640,height=480;image/jpeg,width=2560,height=720;"
    "image/jpeg,width=[1280,2560],height=480;image/jpeg,width=1280,height=480";

GList *
probe (GstDeviceProvider *)
{
  GList *devices = nullptr;
  devices = g_list_append (devices, gst_object_ref_sink (camera ("single", kSingle)));
  return g_list_append (devices, gst_object_ref_sink (camera ("packed", kPacked)));
}
gboolean
start (GstDeviceProvider *provider)
{
  if (!can_start)
    return FALSE;
  gst_device_provider_device_add (provider, camera ("single", kSingle));
  gst_device_provider_device_add (provider, camera ("packed", kPacked));
  return TRUE;
}
void
stop (GstDeviceProvider *)
{
}
void
fake_cameras_init (FakeCameras *)
{
}
void
fake_cameras_class_init (FakeCamerasClass *klass)
{
  auto provider_class = GST_DEVICE_PROVIDER_CLASS (klass);
  provider_class->probe = probe;
  provider_class->start = start;
  provider_class->stop = stop;
  gst_device_provider_class_set_static_metadata (
      provider_class, "Fake cameras", "Source/Video", "Cameras of a test", "gst-rangecast");
}

GstDeviceProvider *
provider_named (const char *name)
{
  GstDeviceProvider *provider = gst_device_provider_factory_get_by_name (name);
  fail_unless (provider != nullptr, "no provider %s", name);
  return provider;
}

/* The stereo webcams as a monitor lists them, and the fake cameras behind them. */
struct Monitor {
  GstDeviceProvider *cameras = provider_named ("v4l2deviceprovider");
  GstDeviceMonitor *monitor = gst_device_monitor_new ();
  GstBus *bus = gst_device_monitor_get_bus (monitor);

  Monitor ()
  {
    gst_device_monitor_add_filter (monitor, "Source/Video/Stereo", nullptr);
    fail_unless (gst_device_monitor_start (monitor));
  }
  ~Monitor ()
  {
    gst_device_monitor_stop (monitor);
    gst_object_unref (bus);
    gst_object_unref (monitor);
    gst_object_unref (cameras);
  }
  std::string names ()
  {
    std::string names;
    GList *devices = gst_device_monitor_get_devices (monitor);
    for (GList *at = devices; at; at = at->next) {
      gchar *name = gst_device_get_display_name (GST_DEVICE (at->data));
      names += std::string (names.empty () ? "" : ";") + name;
      g_free (name);
    }
    g_list_free_full (devices, gst_object_unref);
    return names;
  }
};

constexpr char kListed[] = "packed (stereo, side by side)";

void
expect_names (Monitor &m, const std::string &expected)
{
  const std::string names = m.names ();
  fail_unless_equals_string (names.c_str (), expected.c_str ());
}

} // namespace

static void
setup ()
{
  can_start = true;
  fail_unless (gst_device_provider_register (
      nullptr, "v4l2deviceprovider", GST_RANK_PRIMARY, fake_cameras_get_type ()));
}

GST_START_TEST (test_only_cameras_with_packed_sizes_are_listed)
{
  GstDeviceProvider *provider = provider_named ("stereowebcamprovider");
  GList *devices = gst_device_provider_get_devices (provider);
  fail_unless_equals_int (g_list_length (devices), 1);
  auto device = GST_DEVICE (devices->data);
  GstStructure *properties = gst_device_get_properties (device);
  fail_unless_equals_string (
      gst_structure_get_string (properties, "stereo.packing"), "side-by-side");
  fail_unless_equals_string (gst_structure_get_string (properties, "device.path"), "packed");
  gst_structure_free (properties);
  GstCaps *caps = gst_device_get_caps (device);
  GstCaps *expected =
      gst_caps_from_string ("image/jpeg,width=2560,height=720;image/jpeg,width=1280,height=480");
  fail_unless (gst_caps_is_equal (caps, expected), "other sizes");
  gst_caps_unref (expected);
  gst_caps_unref (caps);
  fail_unless (gst_device_has_classes (device, "Source/Video/Stereo"));
  GstElement *element = gst_device_create_element (device, "source");
  fail_unless_equals_string (GST_OBJECT_NAME (gst_element_get_factory (element)), "videotestsrc");
  gst_object_unref (gst_object_ref_sink (element));
  g_list_free_full (devices, gst_object_unref);
  gst_object_unref (provider);
}
GST_END_TEST;

GST_START_TEST (test_webcams_come_and_go_with_their_cameras)
{
  for (int round = 0; round < 2; round++) { /* a monitor may be started again */
    Monitor m;
    expect_names (m, kListed);
    GstDevice *another = camera ("another", "video/x-raw,width=3840,height=1080");
    gst_device_provider_device_add (m.cameras, another);
    gst_device_provider_device_add (
        m.cameras, camera ("microphone", "video/x-raw,width=3840,height=1080", "Audio/Source"));
    expect_names (m, std::string (kListed) + ";another (stereo, side by side)");
    gst_device_provider_device_remove (m.cameras, another);
    expect_names (m, kListed);
  }
}
GST_END_TEST;

GST_START_TEST (test_provider_starts_again_after_that_of_the_cameras_had_failed)
{
  can_start = false;
  GstDeviceProvider *provider = provider_named ("stereowebcamprovider");
  fail_if (gst_device_provider_start (provider));
  can_start = true;
  fail_unless (gst_device_provider_start (provider));
  gst_device_provider_stop (provider);
  gst_object_unref (provider);
}
GST_END_TEST;

static Suite *
stereowebcamprovider_suite ()
{
  Suite *suite = suite_create ("stereowebcamprovider");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_checked_fixture (tc, setup, nullptr);
  tcase_add_test (tc, test_only_cameras_with_packed_sizes_are_listed);
  tcase_add_test (tc, test_webcams_come_and_go_with_their_cameras);
  tcase_add_test (tc, test_provider_starts_again_after_that_of_the_cameras_had_failed);
  return suite;
}

GST_CHECK_MAIN (stereowebcamprovider)
