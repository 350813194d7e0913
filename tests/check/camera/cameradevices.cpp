/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The device provider, with one of Aravis' fake GigE Vision cameras in a network of its own. */
#include "camera-check.hpp"

using namespace rangecast::testing;

namespace {

std::string
text_of (GstDevice *device, const char *field)
{
  GstStructure *properties = gst_device_get_properties (device);
  const gchar *value = gst_structure_get_string (properties, field);
  std::string text = value ? value : "";
  gst_structure_free (properties);
  return text;
}

GST_START_TEST (test_camera_is_listed_with_what_opens_it)
{
  SKIP_WITHOUT_NETWORK ();
  FakeCamera fake ("127.0.0.1", "GIGE1");
  GstDeviceMonitor *monitor = gst_device_monitor_new ();
  ck_assert_int_ne (gst_device_monitor_add_filter (monitor, "Video/Source", nullptr), 0);
  fail_unless (gst_device_monitor_start (monitor));
  GList *devices = gst_device_monitor_get_devices (monitor);
  GstDevice *found = nullptr;
  for (GList *at = devices; at && !found; at = at->next)
    if (text_of (GST_DEVICE (at->data), "camera.serial") == "GIGE1")
      found = GST_DEVICE (at->data);
  fail_unless (found != nullptr);
  fail_unless_equals_string (text_of (found, "camera.protocol").c_str (), "GigEVision");
  fail_unless_equals_string (text_of (found, "camera.address").c_str (), "127.0.0.1");
  fail_unless_equals_string (text_of (found, "camera.problem").c_str (), "");
  if (GstElement *element = gst_device_create_element (found, nullptr)) { // aravissrc is installed
    gchar *name = nullptr;
    gst_object_ref_sink (element);
    g_object_get (element, "camera-name", &name, nullptr);
    fail_unless_equals_string (name, "127.0.0.1");
    g_free (name);
    gst_object_unref (element);
  }
  g_list_free_full (devices, gst_object_unref);
  gst_device_monitor_stop (monitor);
  gst_object_unref (monitor);
}
GST_END_TEST

Suite *
cameradevices_suite ()
{
  has_own_network = enter_own_network ();
  Suite *suite = suite_create ("cameradevices");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_camera_is_listed_with_what_opens_it);
  return suite;
}

} // namespace

GST_CHECK_MAIN (cameradevices);
