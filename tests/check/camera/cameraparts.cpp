/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What of the layer over Aravis needs no camera: action commands, frame numbers, permissions of USB
 * devices. */
#include "camera/aravis/action_command.hpp"
#include "camera/aravis/discovery.hpp"
#include "camera/aravis/stream.hpp"
#include "camera/aravis/user_name.hpp"
#include <filesystem>
#include <fstream>

#include "../rangecast-check.hpp"

using namespace rangecast::testing;

GST_START_TEST (test_texts_of_devices_are_made_valid)
{
  const CameraStatus status (CameraFault::kFailed, "camera '\xff\xfe': gone");
  fail_unless (g_utf8_validate (status.message ().c_str (), -1, nullptr));
  fail_unless_contains (status.message (), "': gone");
}
GST_END_TEST;

/* Action commands. The expected bytes were written down from the standard's table. */

GST_START_TEST (test_action_command_has_the_bytes_of_the_standard)
{
  static constexpr std::array<guint8, 20> expected = {0x42, 0x00, 0x01, 0x00, 0x00, 0x0c, 0xbe,
      0xef, 0x12, 0x34, 0x56, 0x78, 0x00, 0x00, 0x00, 0x01, 0x00, 0x00, 0x00, 0x01};
  fail_unless (action_command_bytes (0x12345678, 0xbeef) == expected);
}
GST_END_TEST;

GST_START_TEST (test_foreign_interface_is_refused_by_name)
{
  ActionSender sender;
  for (const char *name : {"192.0.2.77", "eth0", ""}) {
    const std::string interfaces[] = {"127.0.0.1", name};
    const CameraStatus status = sender.open (interfaces);
    fail_unless_cmp (status.fault (), ==, CameraFault::kFailed);
    fail_unless (status.message ().find (std::string ("'") + name + "'") != std::string::npos, "%s",
        status.message ().c_str ());
  }
}
GST_END_TEST;

/* Frame numbers */

GST_START_TEST (test_frame_numbers_count_on_over_16_bits)
{
  FrameCounter counter;
  assert_equals_uint64 (counter.number (1), 0);
  assert_equals_uint64 (counter.number (2), 1);
  assert_equals_uint64 (counter.number (40000), 39999);
  assert_equals_uint64 (counter.number (65535), 65534);
  assert_equals_uint64 (counter.number (1), 65535);
  assert_equals_uint64 (counter.number (3), 65537);
  assert_equals_uint64 (counter.number (65534), 131068);
  assert_equals_uint64 (counter.number (2), 131071); /* 65535 and 1 were lost */
}
GST_END_TEST;

GST_START_TEST (test_64_bit_frame_ids_need_no_rounds)
{
  FrameCounter gige, usb (FrameCounter::Ids::kUsb);
  for (const std::uint64_t id : {65534ull, 65535ull, 65536ull, 65537ull, 1ull << 30}) {
    assert_equals_uint64 (gige.number (id), id - 1);
    assert_equals_uint64 (usb.number (id), id);
  }
}
GST_END_TEST;

GST_START_TEST (test_frame_numbers_grow_whatever_the_camera_says)
{
  FrameCounter counter, usb (FrameCounter::Ids::kUsb);
  fail_unless (!counter.is_id (0) && usb.is_id (0));
  std::uint64_t last = counter.number (100);
  for (const std::uint64_t id :
      {100ull, 1ull, 50ull, ~0ull, 5ull, 1ull << 63, 0ull, 65535ull, 65535ull, 2ull, 1ull}) {
    const std::uint64_t number = counter.number (id);
    fail_unless (number > last && number < last + 100000, "%d after %d", int (number), int (last));
    last = number;
  }
  assert_equals_uint64 (usb.number (~0ull), 0);
  assert_equals_uint64 (usb.number (0), 1);
}
GST_END_TEST;

/* User-defined names */

GST_START_TEST (test_user_name_is_asked_for_with_the_bytes_of_the_standard)
{
  static const guint8 expected[] = {
      0x42, 0x01, 0x00, 0x84, 0x00, 0x08, 0x12, 0x34, 0, 0, 0, 0xe8, 0, 0, 0, 16};
  const auto request = user_name_request (0x1234);
  assert_equals_int (request.size (), sizeof expected);
  ck_assert_int_eq (memcmp (request.data (), expected, sizeof expected), 0);
}
GST_END_TEST;

GST_START_TEST (test_user_name_is_taken_from_answers_of_the_standard_alone)
{
  const std::vector<guint8> answer = {0x00, 0x00, 0x00, 0x85, 0x00, 0x14, 0x12, 0x34, 0, 0, 0, 0xe8,
      'l', 'e', 'f', 't', 0, 'x', 'x', 'x', 'x', 'x', 'x', 'x', 'x', 'x', 'x', 'x'};
  fail_unless_cmp (user_name_in (answer, 0x1234), ==, "left");
  fail_unless (!user_name_in (answer, 0x1235));
  for (std::size_t size = 0; size < answer.size (); size++)
    fail_unless (
        !user_name_in (std::vector<guint8> (answer.begin (), answer.begin () + size), 0x1234));
  std::vector<guint8> refused = answer, longer = answer, full = answer;
  refused[0] = 0x80;
  fail_unless (!user_name_in (refused, 0x1234));
  longer.push_back (0);
  fail_unless (!user_name_in (longer, 0x1234));
  full[16] = '-';
  fail_unless_cmp (user_name_in (full, 0x1234), ==, "left-xxxxxxxxxxx");
}
GST_END_TEST;

/* USB permissions, on a made-up list of devices */

namespace fs = std::filesystem;

static void
write_file (const fs::path &path, const char *text)
{
  fs::create_directories (path.parent_path ());
  std::ofstream (path) << text << '\n';
}

static void
make_usb_device (const fs::path &root, const char *name, const char *interface_class, int number)
{
  const fs::path devices = root / "devices", device = devices / name;
  write_file (device / "busnum", "2");
  write_file (device / "devnum", std::to_string (number).c_str ());
  write_file (device / "product", "Eye 5");
  write_file (device / "serial", "777");
  for (const char *protocol : {"00", "02"}) { /* control and stream interface */
    const fs::path interface = devices / (std::string (name) + ":1." + protocol);
    write_file (interface / "bInterfaceClass", interface_class);
    write_file (interface / "bInterfaceSubClass", "05");
    write_file (interface / "bInterfaceProtocol", protocol);
  }
}

GST_START_TEST (test_usb_camera_without_permission_is_found_once)
{
  gchar *root = g_dir_make_tmp ("rangecast-usb-XXXXXX", nullptr);
  make_usb_device (root, "2-1", "ef", 4);
  make_usb_device (root, "2-2", "ef", 5); /* this one may be opened */
  make_usb_device (root, "2-3", "08", 6); /* this one is a disk */
  write_file (fs::path (root) / "nodes/002/005", "");
  const std::string nodes = std::string (root) + "/nodes";
  const auto found = forbidden_usb_cameras (std::string (root) + "/devices", nodes);
  assert_equals_int (found.size (), 1); /* root may open everything: 004 is not there at all */
  fail_unless (found[0].address == nodes + "/002/004", "%s", found[0].address.c_str ());
  assert_equals_string (found[0].model.c_str (), "Eye 5");
  assert_equals_string (found[0].serial.c_str (), "777");
  fail_unless (forbidden_usb_cameras (std::string (root) + "/none", nodes).empty ());
  fs::remove_all (root);
  g_free (root);
}
GST_END_TEST;

static Suite *
cameraparts_suite ()
{
  Suite *suite = suite_create ("cameraparts");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_texts_of_devices_are_made_valid);
  tcase_add_test (tc, test_action_command_has_the_bytes_of_the_standard);
  tcase_add_test (tc, test_foreign_interface_is_refused_by_name);
  tcase_add_test (tc, test_frame_numbers_count_on_over_16_bits);
  tcase_add_test (tc, test_64_bit_frame_ids_need_no_rounds);
  tcase_add_test (tc, test_frame_numbers_grow_whatever_the_camera_says);
  tcase_add_test (tc, test_user_name_is_asked_for_with_the_bytes_of_the_standard);
  tcase_add_test (tc, test_user_name_is_taken_from_answers_of_the_standard_alone);
  tcase_add_test (tc, test_usb_camera_without_permission_is_found_once);
  return suite;
}

GST_CHECK_MAIN (cameraparts);
