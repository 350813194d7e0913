/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What of the layer over Aravis needs no camera: features strings, action commands, frame numbers,
 * permissions of USB devices. */
#include "camera/aravis/action_command.hpp"
#include "camera/aravis/camera.hpp"
#include "camera/aravis/discovery.hpp"
#include "camera/aravis/features.hpp"
#include "camera/aravis/frame_counter.hpp"
#include "camera/aravis/receive_buffer.hpp"
#include "camera/aravis/teardown_queue.hpp"
#include "camera/aravis/user_name.hpp"
#include <atomic>
#include <cerrno>
#include <dlfcn.h>
#include <filesystem>
#include <fstream>
#include <pthread.h>
#include <sys/socket.h>
#include <unistd.h>

#include "../rangecast-check.hpp"

using namespace rangecast::testing;

/* Features */

static std::vector<CameraFeature>
parsed (const char *text)
{
  std::vector<CameraFeature> features;
  const CameraStatus status = parse_camera_features (text, features);
  fail_unless (status.ok (), "%s", status.message ().c_str ());
  return features;
}

GST_START_TEST (test_features_are_split_at_spaces_commas_and_semicolons)
{
  const std::vector<CameraFeature> expected = {{"Gamma", "0.7", false},
      {"LineSelector", "Line2", false}, {"TimerReset", "", true}, {"_x", "-3", false}};
  for (const char *text : {"Gamma=0.7 LineSelector=Line2 TimerReset _x=-3",
           " Gamma=0.7,LineSelector=Line2;TimerReset\n\t_x=-3 ; ",
           "Gamma='0.7', LineSelector=\"Line2\", TimerReset, _x=-3"})
    fail_unless (parsed (text) == expected, "%s", text);
  fail_unless (parsed ("").empty ());
  fail_unless (parsed (" ,; ").empty ());
}
GST_END_TEST;

GST_START_TEST (test_quotes_keep_spaces_and_empty_values)
{
  const auto features = parsed ("A='two, words=1; ' B=\"it's\" C=''");
  assert_equals_int (features.size (), 3);
  assert_equals_string (features[0].value.c_str (), "two, words=1; ");
  assert_equals_string (features[1].value.c_str (), "it's");
  assert_equals_string (features[2].value.c_str (), "");
  fail_unless (!features[2].command);
}
GST_END_TEST;

GST_START_TEST (test_wrong_features_strings_are_refused_at_the_place)
{
  const struct {
    const char *text, *expected;
  } cases[] = {
      {"=3", "a feature's name (letters, digits, '_') at '=3'"},
      {"Gamma=1 7up=2", "a feature's name (letters, digits, '_') at '7up=2'"},
      {"Gamma=", "a value for 'Gamma' at its end"},
      {"Gamma= 3", "a value for 'Gamma' at ' 3'"},
      {"Gamma:3", "'=' and a value after 'Gamma' at ':3'"},
      {"Gamma='3", "a closing ' at ''3'"},
      {"Gamma='3'x", "a space after the quoted value of 'Gamma' at 'x'"},
      {"A=1=2", "a space before the next feature at '=2'"},
      {"\xff\xfe", "a feature's name"},
  };
  for (const auto &c : cases) {
    std::vector<CameraFeature> features = {{"Old", "1", false}};
    const CameraStatus status = parse_camera_features (c.text, features);
    fail_unless (status.fault () == CameraFault::kBadSetting, "%s", c.text);
    fail_unless (status.message ().find (c.expected) != std::string::npos, "'%s' has no '%s'",
        status.message ().c_str (), c.expected);
    fail_unless (g_utf8_validate (status.message ().c_str (), -1, nullptr));
    fail_unless (features.empty ());
  }
}
GST_END_TEST;

GST_START_TEST (test_any_bytes_are_parsed_or_refused)
{
  static const char letters[] = "Aa0_= '\",;\n\x80:";
  GRand *random = g_rand_new_with_seed (1);
  for (int i = 0; i < 20000; i++) {
    std::string text;
    for (int n = g_rand_int_range (random, 0, 12); n > 0; n--)
      text += letters[g_rand_int_range (random, 0, sizeof letters)]; /* with NUL */
    std::vector<CameraFeature> features;
    const CameraStatus status = parse_camera_features (text, features);
    for (const CameraFeature &feature : features)
      fail_unless (!feature.name.empty () && (!feature.command || feature.value.empty ()));
    fail_unless (status.ok () || features.empty ());
  }
  g_rand_free (random);
}
GST_END_TEST;

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
  ActionCommand command;
  command.device_key = 0x12345678;
  command.group_key = 0x9abcdef0;
  command.group_mask = 0x00000101;
  command.request_id = 0xbeef;
  static const guint8 plain[] = {0x42, 0x00, 0x01, 0x00, 0x00, 0x0c, 0xbe, 0xef, 0x12, 0x34, 0x56,
      0x78, 0x9a, 0xbc, 0xde, 0xf0, 0x00, 0x00, 0x01, 0x01};
  const ActionCommandBytes packet = action_command_bytes (command);
  assert_equals_int (packet.size, sizeof plain);
  ck_assert_int_eq (memcmp (packet.bytes.data (), plain, sizeof plain), 0);
}
GST_END_TEST;

GST_START_TEST (test_scheduled_action_command_carries_the_time)
{
  ActionCommand command;
  command.device_key = 1;
  command.group_key = 2;
  command.group_mask = 0xffffffff;
  command.request_id = 1;
  command.acknowledge = true;
  command.time_ns = 0x0102030405060708;
  static const guint8 scheduled[] = {0x42, 0x81, 0x01, 0x00, 0x00, 0x14, 0x00, 0x01, 0, 0, 0, 1, 0,
      0, 0, 2, 0xff, 0xff, 0xff, 0xff, 1, 2, 3, 4, 5, 6, 7, 8};
  const ActionCommandBytes packet = action_command_bytes (command);
  assert_equals_int (packet.size, sizeof scheduled);
  ck_assert_int_eq (memcmp (packet.bytes.data (), scheduled, sizeof scheduled), 0);
}
GST_END_TEST;

/** A socket that hears broadcasts on the loopback interface. */
class Ear {
public:
  Ear ()
      : socket_ (g_socket_new (
            G_SOCKET_FAMILY_IPV4, G_SOCKET_TYPE_DATAGRAM, G_SOCKET_PROTOCOL_UDP, nullptr))
  {
    GSocketAddress *any = g_inet_socket_address_new_from_string ("0.0.0.0", 0);
    fail_unless (g_socket_bind (socket_, any, FALSE, nullptr));
    g_object_unref (any);
    g_socket_set_timeout (socket_, 10);
  }
  Ear (const Ear &) = delete;
  Ear &operator= (const Ear &) = delete;
  ~Ear () { g_object_unref (socket_); }

  [[nodiscard]] guint16 port () const
  {
    GSocketAddress *local = g_socket_get_local_address (socket_, nullptr);
    const guint16 port = g_inet_socket_address_get_port (G_INET_SOCKET_ADDRESS (local));
    g_object_unref (local);
    return port;
  }
  std::vector<guint8> hear ()
  {
    guint8 bytes[100];
    const gssize n = g_socket_receive (
        socket_, reinterpret_cast<gchar *> (bytes), sizeof bytes, nullptr, nullptr);
    fail_unless (n > 0, "nothing was heard");
    return {bytes, bytes + n};
  }

  [[nodiscard]] GSocket *socket () const { return socket_; }

private:
  GSocket *socket_;
};

GST_START_TEST (test_action_command_is_heard_once_from_each_interface)
{
  Ear ear;
  ActionSender sender;
  const std::string interfaces[] = {"127.0.0.1", "127.0.0.1"};
  const CameraStatus opened = sender.open (interfaces, ear.port ());
  fail_unless (opened.ok (), "%s", opened.message ().c_str ());
  ActionCommand command;
  command.device_key = 0xcafe;
  command.group_key = 5;
  command.group_mask = 6;
  fail_unless_ok (sender.send (command));
  command.time_ns = 1000;
  fail_unless_ok (sender.send (command));
  for (const std::uint16_t id : {1, 2}) {
    command.request_id = id;
    command.time_ns = id == 1 ? std::nullopt : std::optional<std::uint64_t> (1000);
    const std::vector<guint8> heard = ear.hear ();
    const ActionCommandBytes expected = action_command_bytes (command);
    fail_unless (std::equal (
        heard.begin (), heard.end (), expected.span ().begin (), expected.span ().end ()));
  }
}
GST_END_TEST;

GST_START_TEST (test_request_ids_are_never_zero)
{
  Ear ear;
  ActionSender sender;
  const std::string interfaces[] = {"127.0.0.1"};
  fail_unless_ok (sender.open (interfaces, ear.port ()));
  std::uint32_t last = 0;
  for (int i = 0; i < 65540; i++) {
    fail_unless_ok (sender.send ({}));
    const std::vector<guint8> heard = ear.hear ();
    const std::uint32_t id = heard[6] << 8 | heard[7];
    ck_assert_int_ne (id, 0);
    ck_assert_int_eq (id, last % 65535 + 1);
    last = id;
  }
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

GST_START_TEST (test_receive_buffer_of_a_port_is_enlarged)
{
  Ear ear;
  gint before = 0, after = 0;
  fail_unless (g_socket_get_option (ear.socket (), SOL_SOCKET, SO_RCVBUF, &before, nullptr));
  fail_unless (enlarge_receive_buffer (ear.port (), before / 4)); /* the system doubles it */
  fail_unless (g_socket_get_option (ear.socket (), SOL_SOCKET, SO_RCVBUF, &after, nullptr));
  assert_equals_int (after, before / 4 * 2);
  fail_unless (!enlarge_receive_buffer (1, before));
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

/* ---- teardown ---- */

static std::atomic<bool> no_threads = false;

/* In place of the C library's: fails where a test says so. */
extern "C" int
pthread_create (
    pthread_t *thread, const pthread_attr_t *attributes, void *(*start) (void *), void *data)
{
  using Create = decltype (&pthread_create);
  static const auto create = reinterpret_cast<Create> (dlsym (RTLD_NEXT, "pthread_create"));
  return no_threads ? EAGAIN : create (thread, attributes, start, data);
}

static void
allow_threads ()
{
  no_threads = false;
}

GST_START_TEST (test_teardown_runs_in_a_thread_of_its_own)
{
  GThread *here = g_thread_self (), *there = nullptr;
  auto held = std::make_shared<int> (1);
  std::vector<int> ran;
  {
    TeardownQueue queue;
    fail_unless (queue.error () == nullptr);
    queue.run ([&there, held] { there = g_thread_self (); }, true);
    fail_unless (queue.wait (TeardownQueue::kMaxWait));
    fail_unless (there && there != here);
    assert_equals_int (held.use_count (), 1);
    for (const int number : {1, 2, 3})
      queue.run ([&ran, number] { ran.push_back (number); }, false);
    fail_unless (queue.wait (TeardownQueue::kMaxWait));
  }
  fail_unless (ran == std::vector<int> ({1, 2, 3}));
}
GST_END_TEST;

GST_START_TEST (test_camera_without_a_teardown_thread_is_refused)
{
  g_thread_pool_set_max_unused_threads (0);
  g_thread_pool_stop_unused_threads ();
  while (g_thread_pool_get_num_unused_threads () > 0)
    g_usleep (1000);
  no_threads = true;
  std::unique_ptr<Camera> camera;
  const CameraStatus status = Camera::open ("Fake-1", camera);
  fail_unless (!status.ok () && !camera);
  fail_unless (status.message ().find ("the thread that releases the camera") != std::string::npos,
      "%s", status.message ().c_str ());
}
GST_END_TEST;

static Suite *
cameraparts_suite ()
{
  Suite *suite = suite_create ("cameraparts");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_features_are_split_at_spaces_commas_and_semicolons);
  tcase_add_test (tc, test_quotes_keep_spaces_and_empty_values);
  tcase_add_test (tc, test_wrong_features_strings_are_refused_at_the_place);
  tcase_add_test (tc, test_any_bytes_are_parsed_or_refused);
  tcase_add_test (tc, test_texts_of_devices_are_made_valid);
  tcase_add_test (tc, test_action_command_has_the_bytes_of_the_standard);
  tcase_add_test (tc, test_scheduled_action_command_carries_the_time);
  tcase_add_test (tc, test_action_command_is_heard_once_from_each_interface);
  tcase_add_test (tc, test_request_ids_are_never_zero);
  tcase_add_test (tc, test_foreign_interface_is_refused_by_name);
  tcase_add_test (tc, test_receive_buffer_of_a_port_is_enlarged);
  tcase_add_test (tc, test_frame_numbers_count_on_over_16_bits);
  tcase_add_test (tc, test_64_bit_frame_ids_need_no_rounds);
  tcase_add_test (tc, test_frame_numbers_grow_whatever_the_camera_says);
  tcase_add_test (tc, test_user_name_is_asked_for_with_the_bytes_of_the_standard);
  tcase_add_test (tc, test_user_name_is_taken_from_answers_of_the_standard_alone);
  tcase_add_test (tc, test_usb_camera_without_permission_is_found_once);
  tcase_add_test (tc, test_teardown_runs_in_a_thread_of_its_own);

  TCase *no_thread = tcase_create ("without threads");
  tcase_add_checked_fixture (no_thread, nullptr, allow_threads);
  suite_add_tcase (suite, no_thread);
  tcase_add_test (no_thread, test_camera_without_a_teardown_thread_is_refused);
  return suite;
}

GST_CHECK_MAIN (cameraparts);
