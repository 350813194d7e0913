/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The device provider, with Aravis' fake GigE Vision cameras in a network of their own. */
#include <filesystem> // before check, which defines fail()

#include "camera-check.hpp"

#include "camera/devices/knownrigs.hpp"
#include <rangecast/rigfile/rig_file.hpp>

using namespace rangecast;
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

void
expect_text (GstDevice *device, const char *field, const std::string &expected)
{
  const auto text = text_of (device, field);
  fail_unless_equals_string (text.c_str (), expected.c_str ());
}

/** The devices that a monitor shows, while it is started. */
struct Monitor {
  GstDeviceMonitor *monitor = gst_device_monitor_new ();
  GstBus *bus = gst_device_monitor_get_bus (monitor);

  explicit Monitor (const char *classes = "Video/Source")
  {
    ck_assert_int_ne (gst_device_monitor_add_filter (monitor, classes, nullptr), 0);
    fail_unless (gst_device_monitor_start (monitor));
  }
  ~Monitor ()
  {
    gst_device_monitor_stop (monitor);
    gst_object_unref (bus);
    gst_object_unref (monitor);
  }

  /** The device whose property has this value, or null. (transfer full) */
  GstDevice *find (const char *field, const std::string &value)
  {
    GList *devices = gst_device_monitor_get_devices (monitor);
    GstDevice *found = nullptr;
    for (GList *at = devices; at && !found; at = at->next)
      if (text_of (GST_DEVICE (at->data), field) == value)
        found = GST_DEVICE (gst_object_ref (at->data));
    g_list_free_full (devices, gst_object_unref);
    return found;
  }
  /** The same, waiting for it: a search may take longer than a monitor's start. */
  GstDevice *await (const char *field, const std::string &value)
  {
    for (;;)
      if (GstDevice *found = find (field, value))
        return found;
      else
        gst_message_unref (next_message ());
  }
  /** Waits until the device is gone. */
  void await_end (const char *field, const std::string &value)
  {
    while (GstDevice *found = find (field, value)) {
      gst_object_unref (found);
      gst_message_unref (next_message ());
    }
  }

private:
  GstMessage *next_message ()
  {
    GstMessage *message = gst_bus_timed_pop (bus, 60 * GST_SECOND);
    fail_unless (message != nullptr, "no device came or went");
    return message;
  }
};

/** A folder of known rigs with one rig, whose cameras are these. */
struct RigFolder {
  gchar *folder = g_dir_make_tmp ("rangecast-rigs-XXXXXX", nullptr);
  std::string file = std::string (folder) + "/studio.yaml";

  RigFolder (const std::string &left, const std::string &right)
  {
    Rig rig;
    View view = ring_rig (1).views[0];
    view.id = 5;
    view.right = PartnerCamera{view.intrinsics, {}, {kIdentity3, {-0.06, 0, 0}}};
    view.camera = left;
    view.right->camera = right;
    rig.views.push_back (view);
    fail_unless_ok (save_rig (file, rig));
    g_setenv ("RANGECAST_RIG_PATH", (std::string ("/does/not/exist:") + folder).c_str (), TRUE);
  }
  ~RigFolder ()
  {
    std::filesystem::remove_all (folder);
    g_free (folder);
  }
};

void
expect_property (GstElement *element, const char *name, const std::string &expected)
{
  gchar *value = nullptr;
  g_object_get (element, name, &value, nullptr);
  fail_unless_equals_string (value, expected.c_str ());
  g_free (value);
}

GST_START_TEST (test_camera_is_listed_with_what_opens_it_and_goes)
{
  SKIP_WITHOUT_NETWORK ();
  FakeCamera fake ("127.0.0.1", "GIGE1");
  Monitor monitor;
  GstDevice *device = monitor.await ("camera.serial", "GIGE1");
  expect_text (device, "camera.protocol", "GigEVision");
  expect_text (device, "camera.address", "127.0.0.1");
  expect_text (device, "camera.problem", "");
  gst_object_unref (device);
  fake.unplug ();
  monitor.await_end ("camera.serial", "GIGE1");
}
GST_END_TEST

/* One of the cameras is called by its user-defined name, which its owner wrote into it. */
GST_START_TEST (test_pair_of_a_known_rig_is_there_while_both_cameras_are)
{
  SKIP_WITHOUT_NETWORK ();
  const RigFolder rigs ("studio-left", "GIGE2");
  FakeCamera left ("127.0.0.1", "GIGE1");
  static const char name[16] = "studio-left";
  fail_unless (arv_fake_camera_write_memory (left.registers (), 0xe8, sizeof name, name));
  Monitor monitor ("Video/Source/Stereo"); // pairs only
  fail_unless (monitor.find ("rig.file", rigs.file) == nullptr);
  FakeCamera right ("127.0.0.2", "GIGE2");
  GstDevice *device = monitor.await ("rig.file", rigs.file);
  fail_unless (monitor.find ("camera.serial", "GIGE1") == nullptr);
  expect_text (device, "camera.left", "studio-left");
  GstElement *element = gst_device_create_element (device, nullptr);
  fail_unless (element != nullptr);
  expect_property (element, "rig", rigs.file);
  gst_object_ref_sink (element);
  gst_object_unref (element);
  gst_object_unref (device);
  right.unplug ();
  monitor.await_end ("rig.file", rigs.file);
}
GST_END_TEST

GST_START_TEST (test_unreadable_rig_files_do_no_harm)
{
  const RigFolder rigs ("1", "2");
  CameraInfo left, right;
  left.serial = "1";
  right.serial = "2";
  std::vector<std::string> problems;
  const auto pairs = [&] {
    return find_known_pairs (known_rig_files (), {left, right}, problems).size ();
  };
  fail_unless_equals_int (int (pairs ()), 1);
  fail_unless (problems.empty ());
  fail_unless (g_file_set_contents (rigs.file.c_str (), "%YAML:1.0\nrig: [", -1, nullptr));
  fail_unless_equals_int (int (pairs ()), 0);
  fail_unless_equals_int (int (problems.size ()), 1);
}
GST_END_TEST

Suite *
cameradevices_suite ()
{
  has_own_network = enter_own_network ();
  Suite *suite = suite_create ("cameradevices");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_camera_is_listed_with_what_opens_it_and_goes);
  tcase_add_test (tc, test_pair_of_a_known_rig_is_there_while_both_cameras_are);
  tcase_add_test (tc, test_unreadable_rig_files_do_no_harm);
  return suite;
}

} // namespace

GST_CHECK_MAIN (cameradevices);
