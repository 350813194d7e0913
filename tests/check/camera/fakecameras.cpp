/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The GigE Vision cameras of fake-cameras, asked by hand: what the tests of stereocamsrc rely on.
 */
#include "stereocam-check.hpp"

using namespace rangecast;
using namespace rangecast::testing;

/* Speaks GVCP. */
struct ByHand {
  int fd = socket (AF_INET, SOCK_DGRAM, 0);

  ByHand ()
  {
    const timeval patience = {2, 0};
    setsockopt (fd, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  }
  ~ByHand () { close (fd); }
  void send (const std::vector<std::uint8_t> &bytes) const
  {
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_port = htons (kGvcpPort);
    inet_pton (AF_INET, camera_address (0).c_str (), &to.sin_addr);
    sendto (fd, bytes.data (), bytes.size (), 0, reinterpret_cast<sockaddr *> (&to), sizeof to);
  }
  /* Status and command of the acknowledge; 0 if none came. */
  [[nodiscard]] std::uint32_t write (std::uint32_t address, std::uint32_t value) const
  {
    PacketWriter writer;
    writer.u8 (0x42).u8 (1).u16 (std::uint16_t (Gvcp::kWriteRegister)).u16 (8).u16 (7);
    send (writer.u32 (address).u32 (value).bytes ());
    std::uint8_t packet[1024];
    return recv (fd, packet, sizeof packet, 0) >= 8 ? read_u32 (packet) : 0;
  }
};

static constexpr std::uint32_t kDenied = 0x80060083, kWritten = 0x00000083;

GST_START_TEST (test_one_program_has_control_until_it_falls_silent)
{
  TestCameras cameras (1);
  ByHand one, two;
  fail_unless_equals_uint64 (one.write (kRegisterControl, 2), kWritten);
  fail_unless_equals_uint64 (one.write (kRegisterHeartbeat, 300), kWritten);
  fail_unless_equals_uint64 (two.write (kRegisterControl, 2), kDenied);
  while (two.write (kRegisterControl, 2) != kWritten)
    g_usleep (50000);
}
GST_END_TEST;

GST_START_TEST (test_garbage_does_no_harm)
{
  TestCameras cameras;
  CameraPipeline p ("trigger=software");
  p.play ();
  fail_unless (p.wait_for_pictures (0, 1));
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
    hostile.send (bytes);
  }
  g_rand_free (random);
  const std::size_t before = p.seen (0).size ();
  fail_unless (p.wait_for_pictures (0, before + 10));
}
GST_END_TEST;

GST_START_TEST (test_address_of_another_machine_is_refused)
{
  GigeCameraSettings settings;
  settings.address = "192.0.2.77";
  settings.serial = "far";
  settings.width = settings.height = 16;
  std::unique_ptr<GigeCamera> camera;
  const Status s = GigeCamera::create (settings, {}, camera);
  fail_unless (!s.ok ());
  fail_unless_contains (s.message (), "192.0.2.77");
}
GST_END_TEST;

/* So that a background can be learnt from images at a lower rate than that of the scene, too. */
GST_START_TEST (test_empty_phase_lasts_for_its_frame_periods_and_images)
{
  constexpr std::int64_t kPeriod_ns = 100000000;
  const struct {
    std::int64_t period_ns;
    int empty;
  } cases[] = {{kPeriod_ns, 5}, {3 * kPeriod_ns, 5}, {kPeriod_ns / 2, 10}};
  EmptyPhase phase (kPeriod_ns, 5);
  for (const auto &c : cases) {
    phase.camera_starts ();
    phase.camera_starts ();
    for (int i = 0; i < 20; i++)
      for (int camera = 0; camera < 2; camera++)
        fail_unless_equals_int (phase.at (i * c.period_ns), i < c.empty);
    phase.camera_stops ();
    phase.camera_stops ();
  }
}
GST_END_TEST;

static Suite *
fakecameras_suite ()
{
  Suite *s = suite_create ("fakecameras");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (s, tc);
  tcase_add_test (tc, test_one_program_has_control_until_it_falls_silent);
  tcase_add_test (tc, test_garbage_does_no_harm);
  tcase_add_test (tc, test_address_of_another_machine_is_refused);
  tcase_add_test (tc, test_empty_phase_lasts_for_its_frame_periods_and_images);
  return s;
}

GST_CHECK_MAIN (fakecameras);
