/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The device provider, with USB devices of a umockdev test bed and GigE Vision cameras in process.
 */
#include <filesystem> // before check, which defines fail()

#include "../rangecast-check.hpp"

#include <unistd.h>

#include <functional>
#include <string>

#include <arv.h>
#include <umockdev.h>

#include "camera/devices/knownrigs.hpp"
#include <rangecast/geometry/rig.hpp>
#include <rangecast/rigfile/rig_file.hpp>

using namespace rangecast;

namespace {

constexpr char kUdevRule[] = "docs/70-usb3vision.rules";

/** A root hub: devices hang below one. */
constexpr char kRootHub[] = "P: /devices/usb2\n"
                            "N: bus/usb/002/001\n"
                            "E: SUBSYSTEM=usb\n"
                            "E: DEVTYPE=usb_device\n"
                            "E: DEVNAME=/dev/bus/usb/002/001\n"
                            "E: BUSNUM=002\n"
                            "E: DEVNUM=001\n"
                            "A: busnum=2\n"
                            "A: devnum=1\n"
                            "A: speed=5000\n"
                            "A: bConfigurationValue=1\n"
                            "H: descriptors=1201000309000309"
                            "6B1D0300060103020101"
                            "09021F00010100E000"
                            "0904000001090000"
                            "00"
                            "0705810304000C\n";

/** Device descriptor of class EF/02/01 and one configuration of a function of two interfaces: the
 *  first of class EF, `sub_class`, protocol 0. */
std::string
descriptors (const std::string &sub_class)
{
  return "12010003EF020109"
         "781678560100"
         "01020301" // device
         "09023800020100C032"
         "080B0002EF" +
         sub_class +
         "0000" // configuration, function
         "0904000002EF" +
         sub_class +
         "0000"
         "07058102000200"
         "07050102000200" // control interface
         "0904010001EF" +
         sub_class +
         "0200"
         "07058202000400"; // stream interface
}

std::string
usb_device (int number, const std::string &serial, const std::string &sub_class)
{
  const auto n = std::to_string (number), node = "bus/usb/002/00" + std::to_string (number + 1);
  return "P: /devices/usb2/2-" + n + "\nN: " + node +
         "\nE: SUBSYSTEM=usb\nE: DEVTYPE=usb_device\nE: DEVNAME=/dev/" + node +
         "\nE: BUSNUM=002\nE: DEVNUM=00" + std::to_string (number + 1) +
         "\nA: busnum=2\nA: devnum=" + std::to_string (number + 1) +
         "\nA: speed=5000\nA: bConfigurationValue=1\nA: manufacturer=Acme\nA: product=U3-900c"
         "\nA: serial=" +
         serial + "\nH: descriptors=" + descriptors (sub_class) + "\n";
}

std::string
usb_camera (int number, const std::string &serial)
{
  return usb_device (number, serial, "05");
}

/** A test bed with a root hub. Fake USB devices only exist below the preloaded library. */
struct TestBed {
  UMockdevTestbed *bed = umockdev_testbed_new ();

  TestBed () { add (kRootHub); }
  ~TestBed () { g_object_unref (bed); }

  void add (const std::string &device)
  {
    GError *error = nullptr;
    fail_unless (umockdev_testbed_add_from_string (bed, device.c_str (), &error), "%s",
        error ? error->message : "");
  }
  void plug (int number, const std::string &serial)
  {
    add (usb_camera (number, serial));
    uevent (number, "add");
  }
  void unplug (int number)
  {
    uevent (number, "remove");
    umockdev_testbed_remove_device (bed, path (number).c_str ());
  }
  std::string node (int number)
  {
    gchar *root = umockdev_testbed_get_root_dir (bed);
    auto file = std::string (root) + "/dev/bus/usb/002/00" + std::to_string (number + 1);
    g_free (root);
    return file;
  }

private:
  std::string path (int number) { return "/sys/devices/usb2/2-" + std::to_string (number); }
  void uevent (int number, const char *what)
  {
    umockdev_testbed_uevent (bed, path (number).c_str (), what);
  }
};

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

/** The devices that a monitor of Video/Source shows, while it is started. */
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

  /** Waits for the message that a device with this property came or went. */
  void wait_for (GstMessageType type, const char *field, const std::string &value)
  {
    while (true) {
      GstMessage *message = gst_bus_timed_pop (bus, 60 * GST_SECOND);
      fail_unless (message != nullptr, "no message about %s", value.c_str ());
      GstDevice *device = nullptr;
      if (GST_MESSAGE_TYPE (message) == GST_MESSAGE_DEVICE_ADDED)
        gst_message_parse_device_added (message, &device);
      else
        gst_message_parse_device_removed (message, &device);
      const bool is_it = GST_MESSAGE_TYPE (message) == type && text_of (device, field) == value;
      gst_object_unref (device);
      gst_message_unref (message);
      if (is_it)
        return;
    }
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

GST_START_TEST (test_usb_camera_is_listed_with_names_and_what_opens_it)
{
  TestBed bed;
  bed.add (usb_camera (1, "SN1"));
  Monitor monitor;
  GstDevice *device = monitor.find ("camera.serial", "SN1");
  fail_unless (device != nullptr);
  expect_text (device, "camera.vendor", "Acme");
  expect_text (device, "camera.model", "U3-900c");
  expect_text (device, "camera.protocol", "USB3Vision");
  expect_text (device, "camera.problem", "");
  expect_text (device, "launch", "aravissrc camera-name=Acme-SN1");
  gchar *name = gst_device_get_display_name (device);
  fail_unless_equals_string (name, "Acme U3-900c (SN1)");
  g_free (name);
  gst_object_unref (device);
}
GST_END_TEST

GST_START_TEST (test_device_makes_the_element_that_opens_it)
{
  TestBed bed;
  bed.add (usb_camera (1, "SN1"));
  Monitor monitor;
  GstDevice *device = monitor.find ("camera.serial", "SN1");
  GstElement *element = gst_device_create_element (device, nullptr);
  if (!element) {
    gst_object_unref (device);
    RANGECAST_SKIP ("no aravissrc: the plugin of Aravis is not installed");
  }
  expect_property (element, "camera-name", "Acme-SN1");
  g_object_set (element, "camera-name", "another", nullptr);
  fail_unless (gst_device_reconfigure_element (device, element));
  expect_property (element, "camera-name", "Acme-SN1");
  gst_object_ref_sink (element);
  gst_object_unref (element);
  GstElement *other = gst_element_factory_make ("fakesrc", nullptr);
  gst_object_ref_sink (other);
  fail_if (gst_device_reconfigure_element (device, other));
  gst_object_unref (other);
  gst_object_unref (device);
}
GST_END_TEST

GST_START_TEST (test_other_usb_devices_are_not_listed)
{
  TestBed bed;
  bed.add (usb_device (1, "NOCAMERA", "04"));
  bed.add (usb_camera (2, "SN2"));
  Monitor monitor;
  GstDevice *camera = monitor.find ("camera.serial", "SN2");
  fail_unless (camera != nullptr);
  gst_object_unref (camera);
  fail_unless (monitor.find ("camera.serial", "NOCAMERA") == nullptr);
}
GST_END_TEST

GST_START_TEST (test_camera_appears_when_plugged_in_and_goes_when_pulled_out)
{
  TestBed bed;
  Monitor monitor;
  fail_unless (monitor.find ("camera.serial", "SN3") == nullptr);
  for (int i = 0; i < 2; ++i) {
    bed.plug (3, "SN3");
    monitor.wait_for (GST_MESSAGE_DEVICE_ADDED, "camera.serial", "SN3");
    bed.unplug (3);
    monitor.wait_for (GST_MESSAGE_DEVICE_REMOVED, "camera.serial", "SN3");
    fail_unless (monitor.find ("camera.serial", "SN3") == nullptr);
  }
}
GST_END_TEST

GST_START_TEST (test_missing_permission_is_told_with_the_rule_to_add)
{
  // Root may open everything; the test has a process of its own.
  if (geteuid () == 0 && setuid (65534) != 0)
    RANGECAST_SKIP ("this container does not let root become another user");
  TestBed bed;
  bed.add (usb_camera (1, "SN1"));
  std::filesystem::permissions (bed.node (1), std::filesystem::perms::none);
  Monitor monitor;
  GstDevice *device = monitor.find ("camera.serial", "SN1");
  fail_unless (device != nullptr);
  const auto problem = text_of (device, "camera.problem");
  fail_unless_contains (problem, "/dev/bus/usb/002/002");
  fail_unless_contains (problem, kUdevRule);
  const gchar *source = g_getenv ("RANGECAST_SOURCE");
  fail_unless (std::filesystem::exists (std::filesystem::path (source) / kUdevRule));
  gst_object_unref (device);
}
GST_END_TEST

GST_START_TEST (test_hostile_descriptors_are_no_camera_and_no_crash)
{
  TestBed bed;
  const auto whole = descriptors ("05");
  int number = 1;
  for (const std::size_t bytes : {1u, 17u, 18u, 20u, 27u, 40u, 55u}) {
    auto device = usb_device (number, "CUT" + std::to_string (bytes), "05");
    device.replace (device.find (whole), whole.size (), whole.substr (0, 2 * bytes));
    bed.add (device);
    ++number;
  }
  bed.add (usb_camera (8, "SN8"));
  Monitor monitor;
  GstDevice *camera = monitor.find ("camera.serial", "SN8");
  fail_unless (camera != nullptr);
  gst_object_unref (camera);
}
GST_END_TEST

/** A GigE Vision camera on loopback that answers Aravis' discovery. */
struct GigeCamera {
  ArvGvFakeCamera *camera;

  explicit GigeCamera (const char *serial) : camera (arv_gv_fake_camera_new ("127.0.0.1", serial))
  {
  }
  ~GigeCamera ()
  {
    if (camera)
      g_object_unref (camera);
  }
  [[nodiscard]] bool is_running () const
  {
    return camera && arv_gv_fake_camera_is_running (camera);
  }
};

GST_START_TEST (test_gige_camera_is_listed_and_goes)
{
  auto camera = std::make_unique<GigeCamera> ("GIGE1");
  if (!camera->is_running ())
    RANGECAST_SKIP ("something else holds the port of GigE Vision");
  Monitor monitor;
  GstDevice *device = monitor.find ("camera.serial", "GIGE1");
  fail_unless (device != nullptr);
  expect_text (device, "camera.protocol", "GigEVision");
  expect_text (device, "camera.address", "127.0.0.1");
  expect_text (device, "launch", "aravissrc camera-name=127.0.0.1");
  gst_object_unref (device);
  camera.reset ();
  monitor.wait_for (GST_MESSAGE_DEVICE_REMOVED, "camera.serial", "GIGE1");
}
GST_END_TEST

GST_START_TEST (test_pair_of_a_known_rig_is_there_while_both_cameras_are)
{
  gchar *folder = g_dir_make_tmp ("rangecast-rigs-XXXXXX", nullptr);
  const auto file = std::string (folder) + "/studio.yaml";
  Rig rig;
  View view = testing::ring_rig (1).views[0];
  view.id = 5;
  view.name = "front";
  view.right = PartnerCamera{view.intrinsics, {}, {kIdentity3, {-0.06, 0, 0}}};
  view.camera = "SN1";
  view.right->camera = "SN2";
  rig.views.push_back (view);
  fail_unless_ok (save_rig (file, rig));
  g_setenv ("RANGECAST_RIG_PATH", folder, TRUE);

  TestBed bed;
  bed.add (usb_camera (1, "SN1"));
  Monitor monitor ("Video/Source/Stereo"); // pairs only
  fail_unless (monitor.find ("rig.file", file) == nullptr);
  fail_unless (monitor.find ("camera.serial", "SN1") == nullptr);
  bed.plug (2, "SN2");
  monitor.wait_for (GST_MESSAGE_DEVICE_ADDED, "rig.file", file);
  GstDevice *device = monitor.find ("rig.file", file);
  expect_text (device, "launch", ("stereocamsrc rig=" + file + " view-id=5"));
  GstElement *element = gst_device_create_element (device, nullptr);
  fail_unless (element != nullptr);
  expect_property (element, "rig", file);
  gint view_id = 0;
  g_object_get (element, "view-id", &view_id, nullptr);
  fail_unless_equals_int (view_id, 5);
  gst_object_ref_sink (element);
  gst_object_unref (element);
  gst_object_unref (device);
  bed.unplug (1);
  monitor.wait_for (GST_MESSAGE_DEVICE_REMOVED, "rig.file", file);
  std::filesystem::remove_all (folder);
  g_free (folder);
}
GST_END_TEST

/* Written by the camera's owner, and kept in it. */
static void
name_camera (GigeCamera &camera, const char *name)
{
  char text[16] = {};
  g_strlcpy (text, name, sizeof text);
  fail_unless (arv_fake_camera_write_memory (
      arv_gv_fake_camera_get_fake_camera (camera.camera), 0xe8, sizeof text, text));
}

GST_START_TEST (test_pair_is_found_by_user_defined_name)
{
  GigeCamera camera ("GIGE1");
  if (!camera.is_running ())
    RANGECAST_SKIP ("something else holds the port of GigE Vision");
  name_camera (camera, "studio-left");
  gchar *folder = g_dir_make_tmp ("rangecast-rigs-XXXXXX", nullptr);
  const auto file = std::string (folder) + "/studio.yaml";
  Rig rig;
  View view = testing::ring_rig (1).views[0];
  view.right = PartnerCamera{view.intrinsics, {}, {kIdentity3, {-0.06, 0, 0}}};
  view.camera = "studio-left";
  view.right->camera = "SN2";
  rig.views.push_back (view);
  fail_unless_ok (save_rig (file, rig));
  g_setenv ("RANGECAST_RIG_PATH", folder, TRUE);
  TestBed bed;
  bed.add (usb_camera (2, "SN2"));
  Monitor monitor;
  GstDevice *pair = monitor.find ("rig.file", file);
  if (!pair) { /* the search took longer than the monitor waits */
    monitor.wait_for (GST_MESSAGE_DEVICE_ADDED, "rig.file", file);
    pair = monitor.find ("rig.file", file);
  }
  expect_text (pair, "camera.left", "studio-left");
  gst_object_unref (pair);
  std::filesystem::remove_all (folder);
  g_free (folder);
}
GST_END_TEST

GST_START_TEST (test_camera_is_called_by_all_its_names)
{
  CameraInfo camera;
  camera.protocol = "GigEVision";
  camera.id = "Maker-7";
  camera.serial = "7";
  camera.address = "10.0.0.7";
  camera.physical_id = "00:11:22:33:44:55";
  for (const char *name : {"Maker-7", "7", "10.0.0.7", "00:11:22:33:44:55"})
    fail_unless (camera.is_called (name), "%s", name);
  fail_if (camera.is_called ("")); /* it has no user-defined name */
  camera.user_name = "left";
  fail_unless (camera.is_called ("left"));
}
GST_END_TEST

GST_START_TEST (test_rig_files_are_read_again_only_when_they_have_changed)
{
  gchar *folder = g_dir_make_tmp ("rangecast-rigs-XXXXXX", nullptr);
  const auto file = std::string (folder) + "/studio.yaml";
  Rig rig;
  View view = testing::ring_rig (1).views[0];
  view.right = PartnerCamera{view.intrinsics, {}, {kIdentity3, {-0.06, 0, 0}}};
  view.camera = "SN1";
  view.right->camera = "SN2";
  rig.views.push_back (view);
  fail_unless_ok (save_rig (file, rig));
  CameraInfo left, right;
  left.serial = "SN1";
  right.serial = "SN2";
  KnownRigs rigs;
  std::vector<std::string> problems;
  for (int i = 0; i < 5; i++)
    fail_unless_equals_int (int (rigs.pairs ({file}, {left, right}, problems).size ()), 1);
  fail_unless_equals_int (int (rigs.reads ()), 1);
  rig.views[0].camera = "another"; /* another length, too: clocks of file systems are coarse */
  fail_unless_ok (save_rig (file, rig));
  fail_unless_equals_int (int (rigs.pairs ({file}, {left, right}, problems).size ()), 0);
  fail_unless_equals_int (int (rigs.reads ()), 2);
  fail_unless (problems.empty ());
  std::filesystem::remove_all (folder);
  g_free (folder);
}
GST_END_TEST

GST_START_TEST (test_unreadable_rig_files_and_folders_do_no_harm)
{
  gchar *folder = g_dir_make_tmp ("rangecast-rigs-XXXXXX", nullptr);
  const auto file = std::string (folder) + "/broken.yaml";
  fail_unless (g_file_set_contents (file.c_str (), "%YAML:1.0\nrig: [", -1, nullptr));
  g_setenv ("RANGECAST_RIG_PATH", (std::string ("/does/not/exist::") + folder).c_str (), TRUE);
  TestBed bed;
  bed.add (usb_camera (1, "SN1"));
  Monitor monitor;
  GstDevice *camera = monitor.find ("camera.serial", "SN1");
  fail_unless (camera != nullptr);
  gst_object_unref (camera);
  std::filesystem::remove_all (folder);
  g_free (folder);
}
GST_END_TEST

GST_START_TEST (test_probe_lists_without_starting)
{
  TestBed bed;
  bed.add (usb_camera (1, "SN1"));
  GstDeviceProvider *provider = gst_device_provider_factory_get_by_name ("rangecastdeviceprovider");
  fail_unless (provider != nullptr);
  for (int i = 0; i < 2; ++i) {
    GList *devices = gst_device_provider_get_devices (provider);
    bool is_there = false;
    for (GList *at = devices; at; at = at->next)
      is_there |= text_of (GST_DEVICE (at->data), "camera.serial") == "SN1";
    fail_unless (is_there);
    g_list_free_full (devices, gst_object_unref);
    fail_unless (gst_device_provider_start (provider));
    gst_device_provider_stop (provider);
  }
  gst_object_unref (provider);
}
GST_END_TEST

Suite *
cameradevices_suite ()
{
  Suite *suite = suite_create ("cameradevices");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_usb_camera_is_listed_with_names_and_what_opens_it);
  tcase_add_test (tc, test_device_makes_the_element_that_opens_it);
  tcase_add_test (tc, test_other_usb_devices_are_not_listed);
  tcase_add_test (tc, test_camera_appears_when_plugged_in_and_goes_when_pulled_out);
  tcase_add_test (tc, test_missing_permission_is_told_with_the_rule_to_add);
  tcase_add_test (tc, test_hostile_descriptors_are_no_camera_and_no_crash);
  tcase_add_test (tc, test_gige_camera_is_listed_and_goes);
  tcase_add_test (tc, test_pair_of_a_known_rig_is_there_while_both_cameras_are);
  tcase_add_test (tc, test_pair_is_found_by_user_defined_name);
  tcase_add_test (tc, test_camera_is_called_by_all_its_names);
  tcase_add_test (tc, test_rig_files_are_read_again_only_when_they_have_changed);
  tcase_add_test (tc, test_unreadable_rig_files_and_folders_do_no_harm);
  tcase_add_test (tc, test_probe_lists_without_starting);
  return suite;
}

} // namespace

GST_CHECK_MAIN (cameradevices);
