/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The GigE Vision cameras of pipelines/fake-cameras, asked by Aravis and by hand. */
#include <arpa/inet.h>
#include <arv.h>
#include <sys/socket.h>
#include <unistd.h>

#include "simulators/gige-camera.hpp"
#include "simulators/gige-description.hpp"
#include "simulators/gige-listener.hpp"
#include "simulators/scene-pictures.hpp"
#include <algorithm>
#include <string>
#include <vector>

#include <gst/check/gstcheck.h> /* its macros upset headers that come after it */

static constexpr std::int64_t kPeriodNs = 100000000;

/* Addresses that no other test run has, most likely. */
static std::string
address_of (int camera)
{
  const int run = int (getpid ());
  return "127." + std::to_string (100 + run % 100) + "." + std::to_string (run / 100 % 250) + "." +
         std::to_string (camera + 1);
}

/* Cameras whose pictures hold the number of pictures so far, and who fire each other's lines. Their
 * threads look at it: on no test's stack, which a test that fails may leave without destructors. */
struct CamerasOnSockets {
  Moments moments{kPeriodNs};
  std::vector<std::unique_ptr<GigeCamera>> list;
  std::unique_ptr<GigeListener> listener;

  explicit CamerasOnSockets (int count, double loss, bool resend)
  {
    for (int i = 0; i < count; i++) {
      GigeCameraSettings settings;
      settings.address = address_of (i);
      settings.serial = "test" + std::to_string (i);
      settings.width = 64;
      settings.height = 48;
      settings.fps = 50;
      settings.pixel_format = kMono8;
      settings.loss = loss;
      settings.resend = resend;
      GigeCamera::Scenery scenery;
      scenery.moment = [this] (std::int64_t now_ns) { return moments.at (now_ns); };
      scenery.paint = [n = 0] (std::int64_t, std::uint32_t, const SensorRegion &,
                          std::span<std::uint8_t> out) mutable {
        std::ranges::fill (out, std::uint8_t (++n));
      };
      scenery.acquisition = [] (bool) {};
      scenery.exposed = [this, i] (std::uint16_t, std::int64_t) {
        for (std::size_t other = 1; i == 0 && other < list.size (); other++)
          list[other]->line_rises ();
      };
      std::unique_ptr<GigeCamera> camera;
      const rangecast::Status s = GigeCamera::create (settings, std::move (scenery), camera);
      fail_unless (s.ok (), s.message ().c_str ());
      list.push_back (std::move (camera));
    }
    for (const auto &camera : list)
      camera->start ();
    listener = std::make_unique<GigeListener> (list);
    ck_assert_uint_gt (listener->start (), 0);
  }
  ~CamerasOnSockets ()
  {
    listener.reset ();
    list.clear ();
  }
};

/* Those of the test that runs; those of one that failed go before the next begins, or at exit. */
struct Cameras {
  explicit Cameras (int count, double loss = 0, bool resend = true)
      : cameras ((of_this_process ().reset (), new CamerasOnSockets (count, loss, resend))),
        list (cameras->list)
  {
    of_this_process ().reset (cameras);
  }
  ~Cameras () { of_this_process ().reset (); }
  Cameras (const Cameras &) = delete;
  Cameras &operator= (const Cameras &) = delete;

  static std::unique_ptr<CamerasOnSockets> &of_this_process ()
  {
    static std::unique_ptr<CamerasOnSockets> cameras;
    return cameras;
  }
  CamerasOnSockets *cameras;
  std::vector<std::unique_ptr<GigeCamera>> &list;
};

/* One of them, opened by Aravis. */
struct Client {
  ArvCamera *camera;
  ArvStream *stream = nullptr;

  explicit Client (int number, const char *trigger = nullptr)
  {
    GError *error = nullptr;
    camera = arv_camera_new (address_of (number).c_str (), &error);
    fail_unless (camera != nullptr, error ? error->message : "no camera");
    arv_camera_gv_set_stream_options (camera, ARV_GV_STREAM_OPTION_PACKET_SOCKET_DISABLED);
    stream = arv_camera_create_stream (camera, nullptr, nullptr, &error);
    fail_unless (stream != nullptr, error ? error->message : "no stream");
    if (trigger)
      arv_camera_set_trigger (camera, trigger, &error);
    const guint payload = arv_camera_get_payload (camera, &error);
    for (int i = 0; i < 20; i++)
      arv_stream_push_buffer (stream, arv_buffer_new (payload, nullptr));
    arv_camera_start_acquisition (camera, &error);
    fail_unless (error == nullptr, error ? error->message : "");
  }
  ~Client ()
  {
    arv_camera_stop_acquisition (camera, nullptr);
    g_clear_object (&stream);
    g_clear_object (&camera);
  }
  /* The value of the next picture's pixels; 0 if it is not complete, -1 if none came. */
  int next (guint64 wait_ms = 3000)
  {
    ArvBuffer *buffer = arv_stream_timeout_pop_buffer (stream, wait_ms * 1000);
    if (!buffer)
      return -1;
    size_t size = 0;
    const auto *data = static_cast<const std::uint8_t *> (arv_buffer_get_data (buffer, &size));
    const bool whole = arv_buffer_get_status (buffer) == ARV_BUFFER_STATUS_SUCCESS;
    const int value = whole && size == 64 * 48 ? data[size - 1] : 0;
    arv_stream_push_buffer (stream, buffer);
    return value;
  }
  void fire () { arv_camera_software_trigger (camera, nullptr); }
};

/* Speaks GVCP by hand. */
struct ByHand {
  int fd = socket (AF_INET, SOCK_DGRAM, 0);

  ByHand ()
  {
    const int yes = 1;
    const timeval patience = {1, 0};
    setsockopt (fd, SOL_SOCKET, SO_BROADCAST, &yes, sizeof yes);
    setsockopt (fd, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  }
  ~ByHand () { close (fd); }
  void send (const std::string &address, std::vector<std::uint8_t> bytes) const
  {
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_port = htons (kGvcpPort);
    inet_pton (AF_INET, address.c_str (), &to.sin_addr);
    sendto (fd, bytes.data (), bytes.size (), 0, reinterpret_cast<sockaddr *> (&to), sizeof to);
  }
  /* The next acknowledge's status and command; 0 if none came. */
  [[nodiscard]] std::uint32_t receive () const
  {
    std::uint8_t packet[1024];
    const ssize_t got = recv (fd, packet, sizeof packet, 0);
    return got >= 8 ? read_u32 (packet) : 0;
  }
};

static PacketWriter
gvcp (std::uint8_t flags, Gvcp command, std::size_t bytes)
{
  PacketWriter writer;
  writer.u8 (0x42).u8 (flags).u16 (std::uint16_t (command)).u16 (std::uint16_t (bytes)).u16 (7);
  return writer;
}

static std::vector<std::uint8_t>
write_register (std::uint32_t address, std::uint32_t value)
{
  return gvcp (1, Gvcp::kWriteRegister, 8).u32 (address).u32 (value).bytes ();
}

static std::vector<std::uint8_t>
action (std::uint32_t device_key, std::uint32_t mask, std::int64_t at_ns = 0)
{
  PacketWriter writer = gvcp (at_ns ? 0x81 : 0x01, Gvcp::kAction, at_ns ? 20 : 12);
  writer.u32 (device_key).u32 (2).u32 (mask);
  if (at_ns)
    writer.u64 (std::uint64_t (at_ns));
  return writer.bytes ();
}

static constexpr std::uint32_t kDenied = 0x80060083, kWritten = 0x00000083, kObeyed = 0x00000101;

GST_START_TEST (test_each_software_trigger_gives_one_picture)
{
  Cameras cameras (1);
  Client client (0, "Software");
  for (int i = 1; i <= 20; i++) {
    client.fire ();
    fail_unless_equals_int (client.next (), i);
  }
  fail_unless_equals_int (client.next (200), -1);
}
GST_END_TEST;

GST_START_TEST (test_free_running_camera_skips_no_number)
{
  Cameras cameras (1);
  Client client (0);
  for (int i = 1; i <= 30; i++)
    fail_unless_equals_int (client.next (), i);
}
GST_END_TEST;

GST_START_TEST (test_lost_packets_are_sent_again)
{
  Cameras cameras (1, 0.1);
  Client client (0, "Software");
  int whole = 0;
  for (int i = 0; i < 30; i++) {
    client.fire ();
    whole += client.next () > 0;
  }
  fail_unless (whole >= 26, "%d of 30 pictures are whole", whole);
}
GST_END_TEST;

GST_START_TEST (test_without_resend_they_stay_lost)
{
  Cameras cameras (1, 0.1, false);
  Client client (0, "Software");
  int whole = 0;
  for (int i = 0; i < 30; i++) {
    client.fire ();
    whole += client.next () > 0;
  }
  fail_unless (whole <= 24, "%d of 30 pictures are whole", whole);
}
GST_END_TEST;

GST_START_TEST (test_second_program_may_not_control)
{
  Cameras cameras (1);
  Client client (0, "Software");
  ByHand other;
  other.send (address_of (0), write_register (kRegisterControl, 2));
  fail_unless_equals_uint64 (other.receive (), kDenied);
  client.fire ();
  fail_unless_equals_int (client.next (), 1);
}
GST_END_TEST;

GST_START_TEST (test_program_that_falls_silent_loses_control)
{
  Cameras cameras (1);
  ByHand one, two;
  one.send (address_of (0), write_register (kRegisterControl, 2));
  fail_unless_equals_uint64 (one.receive (), kWritten);
  one.send (address_of (0), write_register (kRegisterHeartbeat, 500));
  fail_unless_equals_uint64 (one.receive (), kWritten);
  two.send (address_of (0), write_register (kRegisterControl, 2));
  fail_unless_equals_uint64 (two.receive (), kDenied);
  usleep (900000);
  two.send (address_of (0), write_register (kRegisterControl, 2));
  fail_unless_equals_uint64 (two.receive (), kWritten);
}
GST_END_TEST;

GST_START_TEST (test_broadcast_action_fires_the_cameras_of_its_keys)
{
  Cameras cameras (3);
  Client one (0, "Action1"), two (1, "Action1"), three (2, "Action1");
  for (Client *client : {&one, &two, &three}) {
    arv_camera_set_integer (client->camera, "ActionDeviceKey", client == &three ? 6 : 5, nullptr);
    arv_camera_set_integer (client->camera, "ActionGroupKey", 2, nullptr);
    arv_camera_set_integer (client->camera, "ActionGroupMask", 3, nullptr);
  }
  ByHand sender;
  sender.send ("127.255.255.255", action (5, 1));
  fail_unless_equals_int (one.next (), 1);
  fail_unless_equals_int (two.next (), 1);
  fail_unless_equals_int (three.next (200), -1);
  fail_unless_equals_uint64 (sender.receive (), kObeyed);
  sender.send ("127.255.255.255", action (5, 4)); /* the masks have nothing in common */
  fail_unless_equals_int (one.next (200), -1);
}
GST_END_TEST;

GST_START_TEST (test_scheduled_action_waits_for_its_time)
{
  Cameras cameras (1);
  Client client (0, "Action1");
  arv_camera_set_integer (client.camera, "ActionDeviceKey", 5, nullptr);
  arv_camera_set_integer (client.camera, "ActionGroupKey", 2, nullptr);
  arv_camera_set_integer (client.camera, "ActionGroupMask", 1, nullptr);
  arv_camera_set_boolean (client.camera, "PtpEnable", TRUE, nullptr);
  const std::int64_t at = g_get_monotonic_time () * 1000 + 500000000;
  ByHand sender;
  sender.send (address_of (0), action (5, 1, at));
  fail_unless_equals_uint64 (sender.receive (), kObeyed);
  ArvBuffer *buffer = arv_stream_timeout_pop_buffer (client.stream, 5000000);
  fail_unless (buffer != nullptr);
  ck_assert_int_ge (std::int64_t (arv_buffer_get_timestamp (buffer)), at);
  arv_stream_push_buffer (client.stream, buffer);
}
GST_END_TEST;

GST_START_TEST (test_action_at_an_absurd_time_is_refused)
{
  Cameras cameras (1);
  ByHand sender;
  sender.send (address_of (0), action (5, 1, G_MAXINT64));
  fail_unless_equals_uint64 (sender.receive (), 0x80020101);
}
GST_END_TEST;

GST_START_TEST (test_output_line_fires_the_wired_camera)
{
  Cameras cameras (2);
  Client master (0, "Software"), slave (1, "Line0");
  for (int i = 1; i <= 5; i++) {
    master.fire ();
    fail_unless_equals_int (master.next (), i);
    fail_unless_equals_int (slave.next (), i);
  }
}
GST_END_TEST;

GST_START_TEST (test_broadcast_discovery_is_answered_by_each)
{
  Cameras cameras (3);
  ByHand asker;
  asker.send ("127.255.255.255", gvcp (1, Gvcp::kDiscovery, 0).bytes ());
  for (int i = 0; i < 3; i++)
    fail_unless_equals_uint64 (asker.receive (), 0x00000003);
}
GST_END_TEST;

GST_START_TEST (test_nonsense_does_no_harm)
{
  Cameras cameras (1);
  Client client (0, "Software");
  ByHand hostile;
  GRand *random = g_rand_new_with_seed (7);
  for (int i = 0; i < 3000; i++) {
    std::vector<std::uint8_t> bytes (std::size_t (g_rand_int_range (random, 0, 64)));
    for (auto &byte : bytes)
      byte = std::uint8_t (g_rand_int_range (random, 0, 256));
    if (i % 2 && bytes.size () >= 8) { /* almost right */
      bytes[0] = 0x42;
      bytes[2] = 0;
      bytes[3] = std::uint8_t (0x80 + i % 8);
      bytes[4] = 0;
      bytes[5] = std::uint8_t (bytes.size () - 8);
    }
    hostile.send (address_of (0), bytes);
  }
  g_rand_free (random);
  client.fire ();
  fail_unless_equals_int (client.next (), 1);
}
GST_END_TEST;

GST_START_TEST (test_absurd_region_gives_no_picture)
{
  Cameras cameras (1);
  Client client (0, "Software");
  arv_device_write_register (
      arv_camera_get_device (client.camera), ARV_FAKE_CAMERA_REGISTER_X_OFFSET, 1000, nullptr);
  client.fire ();
  fail_unless_equals_int (client.next (300), -1);
  arv_device_write_register (
      arv_camera_get_device (client.camera), ARV_FAKE_CAMERA_REGISTER_X_OFFSET, 0, nullptr);
  client.fire ();
  fail_unless_equals_int (client.next (), 1);
}
GST_END_TEST;

GST_START_TEST (test_address_of_another_machine_is_refused)
{
  GigeCameraSettings settings;
  settings.address = "192.0.2.77";
  settings.serial = "far";
  settings.width = settings.height = 16;
  std::unique_ptr<GigeCamera> camera;
  const rangecast::Status s = GigeCamera::create (settings, {}, camera);
  fail_unless (
      !s.ok () && s.message ().find ("192.0.2.77") != std::string::npos, s.message ().c_str ());
}
GST_END_TEST;

/* So that a background can be learnt from pictures at a lower rate than that of the scene, too. */
GST_START_TEST (test_empty_phase_lasts_for_its_frame_periods_and_pictures)
{
  const struct {
    std::int64_t period_ns;
    int empty;
  } cases[] = {{kPeriodNs, 5}, {3 * kPeriodNs, 5}, {kPeriodNs / 2, 10}};
  EmptyPhase phase (kPeriodNs, 5);
  for (const auto &c : cases) {
    phase.camera_starts ();
    phase.camera_starts ();
    for (int i = 0; i < 20; i++)
      for (int camera = 0; camera < 2; camera++)
        fail_unless_equals_int (phase.at (i * c.period_ns), i < c.empty);
    phase.camera_stops ();
    phase.camera_stops ();
  }
  EmptyPhase none (kPeriodNs, 0);
  none.camera_starts ();
  fail_if (none.at (0));
}
GST_END_TEST;

static Suite *
fakecameras_suite ()
{
  Suite *s = suite_create ("fakecameras");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (s, tc);
  tcase_add_test (tc, test_each_software_trigger_gives_one_picture);
  tcase_add_test (tc, test_free_running_camera_skips_no_number);
  tcase_add_test (tc, test_lost_packets_are_sent_again);
  tcase_add_test (tc, test_without_resend_they_stay_lost);
  tcase_add_test (tc, test_second_program_may_not_control);
  tcase_add_test (tc, test_program_that_falls_silent_loses_control);
  tcase_add_test (tc, test_broadcast_action_fires_the_cameras_of_its_keys);
  tcase_add_test (tc, test_scheduled_action_waits_for_its_time);
  tcase_add_test (tc, test_action_at_an_absurd_time_is_refused);
  tcase_add_test (tc, test_output_line_fires_the_wired_camera);
  tcase_add_test (tc, test_broadcast_discovery_is_answered_by_each);
  tcase_add_test (tc, test_nonsense_does_no_harm);
  tcase_add_test (tc, test_absurd_region_gives_no_picture);
  tcase_add_test (tc, test_address_of_another_machine_is_refused);
  tcase_add_test (tc, test_empty_phase_lasts_for_its_frame_periods_and_pictures);
  return s;
}

GST_CHECK_MAIN (fakecameras);
