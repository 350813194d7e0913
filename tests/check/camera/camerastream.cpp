/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The layer over Aravis streams, triggers, and loses cameras, with fake GigE Vision cameras: real
 * packets over the loopback interface. */
#include "camera/aravis/exposure_sync.hpp"

#include "camera-check.hpp"

using namespace rangecast::testing;

static const void *
data_of (GstBuffer *buffer)
{
  GstMapInfo map;
  fail_unless (gst_buffer_map (buffer, &map, GST_MAP_READ));
  const void *data = map.data;
  gst_buffer_unmap (buffer, &map);
  return data;
}

GST_START_TEST (test_frames_arrive_whole_numbered_and_in_order)
{
  SKIP_WITHOUT_NETWORK ();
  FakeCamera fake;
  const auto camera = open_camera ("127.0.0.1");
  configure (*camera, small_pictures ());
  Listener listener;
  start (*camera, listener);
  std::uint64_t last = 0, last_time = 0;
  for (int i = 0; i < 50; i++) {
    const CameraFrame frame = listener.next ();
    fail_unless_cmp (frame.state, ==, FrameState::kComplete);
    assert_equals_int (gst_buffer_get_size (frame.buffer.get ()), 64 * 48);
    fail_unless (!GST_BUFFER_PTS_IS_VALID (frame.buffer.get ()));
    fail_unless (i == 0 || frame.number == last + 1);
    ck_assert_uint_gt (frame.camera_time_ns, last_time);
    ck_assert_int_le (frame.arrived_us, g_get_monotonic_time ());
    last = frame.number;
    last_time = frame.camera_time_ns;
  }
  const CameraStatistics numbers = camera->statistics ();
  ck_assert_uint_ge (numbers.completed, 50);
  assert_equals_int (numbers.failures, 0);
  assert_equals_int (numbers.underruns, 0);
  camera->stop ();
  fail_unless (camera->statistics ().completed >= 50, "they stay after the end");
}
GST_END_TEST;

/* The fake camera draws one byte value a frame, which grows from frame to frame. */
static void
fill_with_count (ArvBuffer *buffer, void *n_bytes, guint32, guint32, ArvPixelFormat)
{
  static int count = 0;
  std::size_t size = 0; /* what was received, which is nothing here */
  void *data = const_cast<void *> (arv_buffer_get_data (buffer, &size));
  memset (data, ++count & 0xff, GPOINTER_TO_SIZE (n_bytes));
}

static void
draw_count (FakeCamera &fake, gsize n_bytes)
{
  arv_fake_camera_set_fill_pattern (fake.registers (), fill_with_count, GSIZE_TO_POINTER (n_bytes));
}

/** The count in a picture; fails the test where it is not the same all over. */
static int
count_in (const CameraFrame &frame)
{
  GstMapInfo map;
  fail_unless (gst_buffer_map (frame.buffer.get (), &map, GST_MAP_READ));
  fail_unless (memcmp (map.data, map.data + 1, map.size - 1) == 0, "pixels of two pictures in one");
  const int count = map.data[0];
  gst_buffer_unmap (frame.buffer.get (), &map);
  return count;
}

GST_START_TEST (test_pixels_are_those_of_the_frame_as_long_as_it_is_held)
{
  SKIP_WITHOUT_NETWORK ();
  FakeCamera fake;
  draw_count (fake, 64 * 48);
  const auto camera = open_camera ("127.0.0.1");
  CameraSettings settings = small_pictures ();
  settings.n_buffers = 6;
  configure (*camera, settings);
  Listener listener;
  start (*camera, listener);
  const CameraFrame earliest = listener.next_complete ();
  const int count = count_in (earliest);
  std::deque<CameraFrame> held;
  for (int i = 0; i < 60; i++) {
    held.push_back (listener.next_complete ());
    if (held.size () < 3)
      continue;
    assert_equals_int (
        count_in (held.front ()), (count + int (held.front ().number - earliest.number)) & 0xff);
    held.pop_front ();
  }
  assert_equals_int (count_in (earliest), count);
}
GST_END_TEST;

GST_START_TEST (test_buffers_are_used_again_with_all_that_a_frame_wrote_gone)
{
  SKIP_WITHOUT_NETWORK ();
  FakeCamera fake;
  const auto camera = open_camera ("127.0.0.1");
  CameraSettings settings = small_pictures ();
  settings.n_buffers = 3;
  configure (*camera, settings);
  Listener listener;
  start (*camera, listener);
  std::vector<GstBuffer *> buffers;
  std::vector<const void *> pixels;
  const auto note = [] (auto &list, auto what) {
    if (std::find (list.begin (), list.end (), what) == list.end ())
      list.push_back (what);
  };
  for (int i = 0; i < 30; i++) {
    const CameraFrame frame = listener.next_complete ();
    GstBuffer *buffer = frame.buffer.get ();
    note (buffers, buffer);
    note (pixels, data_of (buffer));
    fail_unless (gst_buffer_is_writable (buffer));
    fail_unless (!GST_BUFFER_PTS_IS_VALID (buffer) && !GST_BUFFER_DURATION_IS_VALID (buffer));
    fail_unless (!GST_BUFFER_FLAG_IS_SET (buffer, GST_BUFFER_FLAG_DISCONT));
    assert_equals_int (gst_buffer_get_n_meta (buffer, GST_VIDEO_META_API_TYPE), 1);
    assert_equals_int (gst_buffer_get_n_meta (buffer, GST_REFERENCE_TIMESTAMP_META_API_TYPE), 0);
    GstCaps *reference = gst_caps_new_empty_simple ("timestamp/x-test");
    gst_buffer_add_reference_timestamp_meta (buffer, reference, i, GST_CLOCK_TIME_NONE);
    gst_caps_unref (reference);
    GST_BUFFER_PTS (buffer) = i;
    GST_BUFFER_DURATION (buffer) = 1;
    GST_BUFFER_FLAG_SET (buffer, GST_BUFFER_FLAG_DISCONT);
  }
  fail_unless (pixels.size () <= 3, "%d places for pixels", int (pixels.size ()));
  fail_unless (buffers.size () <= 3, "%d buffers", int (buffers.size ()));
}
GST_END_TEST;

GST_START_TEST (test_memory_kept_without_its_buffer_comes_back_later)
{
  SKIP_WITHOUT_NETWORK ();
  FakeCamera fake;
  const auto camera = open_camera ("127.0.0.1");
  CameraSettings settings = small_pictures ();
  settings.n_buffers = 3;
  configure (*camera, settings);
  Listener listener;
  start (*camera, listener);
  for (int i = 0; i < 30; i++) {
    CameraFrame frame = listener.next_complete ();
    GstBuffer *copy = gst_buffer_copy (frame.buffer.get ()); /* shares the memory */
    const void *data = data_of (frame.buffer.get ());
    frame.buffer.reset ();
    fail_unless (data_of (copy) == data, "gst_buffer_copy() copied pixels");
    gst_buffer_unref (copy);
  }
}
GST_END_TEST;

GST_START_TEST (test_changed_buffers_are_not_used_again)
{
  SKIP_WITHOUT_NETWORK ();
  FakeCamera fake;
  const auto camera = open_camera ("127.0.0.1");
  CameraSettings settings = small_pictures ();
  settings.n_buffers = 3;
  configure (*camera, settings);
  Listener listener;
  start (*camera, listener);
  for (int i = 0; i < 30; i++) {
    CameraFrame frame = listener.next_complete ();
    GstBuffer *buffer = frame.buffer.get ();
    assert_equals_int (gst_buffer_get_size (buffer), 64 * 48);
    assert_equals_int (gst_buffer_n_memory (buffer), 1);
    if (i % 3 == 0)
      gst_buffer_resize (buffer, 64, 64);
    else if (i % 3 == 1)
      gst_buffer_append_memory (buffer, gst_allocator_alloc (nullptr, 16, nullptr));
    else
      gst_buffer_replace_all_memory (buffer, gst_allocator_alloc (nullptr, 16, nullptr));
  }
}
GST_END_TEST;

GST_START_TEST (test_frames_for_which_no_buffer_is_left_are_counted)
{
  SKIP_WITHOUT_NETWORK ();
  FakeCamera fake;
  const auto camera = open_camera ("127.0.0.1");
  CameraSettings settings = small_pictures ();
  settings.n_buffers = 2;
  configure (*camera, settings);
  Listener listener;
  start (*camera, listener);
  CameraFrame first = listener.next_complete (), second = listener.next_complete ();
  while (camera->statistics ().underruns < 1)
    g_usleep (1000);
  assert_equals_int (camera->statistics ().buffers_out, 2);
  first.buffer.reset ();
  const CameraFrame third = listener.next_complete ();
  fail_unless (third.number > second.number + 1, "the gap shows");
}
GST_END_TEST;

GST_START_TEST (test_buffers_outlive_the_camera)
{
  SKIP_WITHOUT_NETWORK ();
  auto fake = std::make_unique<FakeCamera> ();
  draw_count (*fake, 64 * 48);
  auto camera = open_camera ("127.0.0.1");
  configure (*camera, small_pictures ());
  Listener listener;
  start (*camera, listener);
  CameraFrame stopped = listener.next_complete (), closed = listener.next_complete ();
  CameraFrame last = listener.next_complete ();
  const int count = count_in (last);
  camera->stop ();
  stopped.buffer.reset ();
  camera.reset ();
  closed.buffer.reset ();
  fake.reset ();
  assert_equals_int (count_in (last), count);
}
GST_END_TEST;

GST_START_TEST (test_camera_starts_again_after_stop_and_new_settings)
{
  SKIP_WITHOUT_NETWORK ();
  FakeCamera fake;
  const auto camera = open_camera ("127.0.0.1");
  Listener listener;
  assert_refused (camera->start (listener.arrived (), listener.lost ()), CameraFault::kBadSetting,
      "before it was configured");
  for (int width : {64, 128, 32}) {
    CameraSettings settings = small_pictures ();
    settings.width = width;
    configure (*camera, settings);
    Listener fresh;
    start (*camera, fresh);
    assert_equals_int (gst_buffer_get_size (fresh.next_complete ().buffer.get ()), width * 48);
    camera->stop ();
    const std::size_t n = fresh.n_frames ();
    g_usleep (30000);
    assert_equals_int (fresh.n_frames (), n); /* no callback after stop() */
    camera->stop ();
  }
}
GST_END_TEST;

GST_START_TEST (test_lost_packets_make_incomplete_frames_or_gaps_never_pictures)
{
  SKIP_WITHOUT_NETWORK ();
  FakeCamera fake;
  draw_count (fake, 128 * 128);
  const auto camera = open_camera ("127.0.0.1");
  CameraSettings settings = small_pictures ();
  settings.width = settings.height = 128; /* some 12 packets a picture */
  settings.packet_resend = false;
  configure (*camera, settings);
  fake.lose_packets (0.02);
  Listener listener;
  start (*camera, listener);
  int n_incomplete = 0, n_gaps = 0, n_complete = 0;
  std::uint64_t last = 0, missing = 0;
  for (int i = 0; n_incomplete < 3 || i < 100; i++) {
    fail_unless (i < 2000, "of 2000 frames less than three lacked packets");
    const CameraFrame frame = listener.next ();
    fail_unless (i == 0 || frame.number > last, "%d after %d", int (frame.number), int (last));
    n_gaps += i > 0 && frame.number > last + 1;
    last = frame.number;
    missing += frame.missing_packets;
    if (frame.state == FrameState::kMissing) {
      n_incomplete++;
      fail_unless (!frame.buffer);
      continue;
    }
    n_complete++;
    (void)count_in (frame);
  }
  ck_assert_int_gt (n_complete, 50);
  ck_assert_uint_ge (missing, guint64 (n_incomplete));
  ck_assert_uint_ge (camera->statistics ().failures, guint64 (n_incomplete));
}
GST_END_TEST;

GST_START_TEST (test_vanished_camera_is_told_once_and_is_no_hang)
{
  SKIP_WITHOUT_NETWORK ();
  FakeCamera fake;
  auto camera = open_camera ("127.0.0.1");
  configure (*camera, small_pictures ());
  Listener listener;
  start (*camera, listener);
  (void)listener.next_complete ();
  fake.unplug ();
  const CameraStatus status = listener.wait_for_loss ();
  assert_refused (status, CameraFault::kLost, "no longer responds");
  assert_refused (status, CameraFault::kLost, "camera '127.0.0.1'");
  fail_unless (camera->is_lost ());
  assert_refused (camera->trigger_software (), CameraFault::kLost, "lost");
  camera->stop ();
  assert_refused (
      camera->start (listener.arrived (), listener.lost ()), CameraFault::kLost, "opened again");
  camera.reset ();
  assert_equals_int (listener.n_losses (), 1);
}
GST_END_TEST;

GST_START_TEST (test_camera_that_came_back_opens_again)
{
  SKIP_WITHOUT_NETWORK ();
  auto fake = std::make_unique<FakeCamera> ();
  auto camera = open_camera ("127.0.0.1");
  configure (*camera, small_pictures ());
  Listener listener;
  start (*camera, listener);
  (void)listener.next_complete ();
  fake.reset ();
  camera.reset (); /* before its loss is known */
  std::unique_ptr<Camera> none;
  const CameraStatus status = Camera::open ("127.0.0.1", none);
  fail_unless (!status.ok () && status.may_recover (), "%s", status.message ().c_str ());
  fake = std::make_unique<FakeCamera> ();
  camera = open_camera ("127.0.0.1");
  configure (*camera, small_pictures ());
  Listener again;
  start (*camera, again);
  (void)again.next_complete ();
}
GST_END_TEST;

GST_START_TEST (test_software_trigger_takes_one_picture_a_call)
{
  SKIP_WITHOUT_NETWORK ();
  FakeCamera fake;
  const auto camera = open_camera ("127.0.0.1");
  CameraSettings settings = small_pictures ();
  settings.trigger = TriggerMode::kSoftware;
  configure (*camera, settings);
  assert_equals_float (camera->format ().frame_rate, 0);
  Listener listener;
  start (*camera, listener);
  std::uint64_t last = 0;
  for (int i = 0; i < 5; i++) {
    const CameraStatus status = camera->trigger_software ();
    fail_unless (status.ok (), "%s", status.message ().c_str ());
    const CameraFrame frame = listener.next_complete ();
    fail_unless (i == 0 || frame.number == last + 1);
    last = frame.number;
  }
  g_usleep (200000);
  assert_equals_int (listener.n_frames (), 0);
}
GST_END_TEST;

GST_START_TEST (test_followers_take_over_the_look_of_the_leader)
{
  SKIP_WITHOUT_NETWORK ();
  FakeCamera left ("127.0.0.2", "left"), right ("127.0.0.3", "right");
  const std::shared_ptr<Camera> leader = open_camera ("127.0.0.2"),
                                follower = open_camera ("127.0.0.3");
  CameraSettings settings = small_pictures ();
  settings.exposure_mode = settings.gain_mode = AutoMode::kManual;
  settings.exposure_us = 1000;
  settings.gain = 1;
  configure (*leader, settings);
  settings.gain = 2;
  configure (*follower, settings);
  Listener from_leader, from_follower;
  start (*leader, from_leader);
  start (*follower, from_follower);
  ExposureSync sync;
  std::atomic<int> n_refusals{0};
  sync.start (leader, {follower}, std::chrono::milliseconds (5),
      [&] (const CameraStatus &) { n_refusals++; });
  for (const guint32 exposure : {3000u, 700u, 12000u}) {
    /* as the camera's own regulator would */
    arv_fake_camera_write_register (
        left.registers (), ARV_FAKE_CAMERA_REGISTER_EXPOSURE_TIME_US, exposure);
    arv_fake_camera_write_register (
        left.registers (), ARV_FAKE_CAMERA_REGISTER_GAIN_RAW, exposure % 7);
    guint32 got_exposure = 0, got_gain = 0;
    for (int i = 0; i < 2000 && (got_exposure != exposure || got_gain != exposure % 7); i++) {
      g_usleep (5000);
      arv_fake_camera_read_register (
          right.registers (), ARV_FAKE_CAMERA_REGISTER_EXPOSURE_TIME_US, &got_exposure);
      arv_fake_camera_read_register (
          right.registers (), ARV_FAKE_CAMERA_REGISTER_GAIN_RAW, &got_gain);
    }
    assert_equals_int (got_exposure, exposure);
    assert_equals_int (got_gain, exposure % 7);
  }
  assert_equals_int (n_refusals, 0);
  (void)from_follower.next_complete ();
  sync.stop ();
}
GST_END_TEST;

GST_START_TEST (test_eight_cameras_stream_at_once)
{
  SKIP_WITHOUT_NETWORK ();
  std::vector<std::unique_ptr<FakeCamera>> fakes;
  std::vector<std::unique_ptr<Camera>> cameras;
  std::deque<Listener> listeners (8);
  for (int i = 1; i <= 8; i++) {
    const std::string number = std::to_string (i);
    fakes.push_back (std::make_unique<FakeCamera> ("127.0.0." + number, number.c_str ()));
  }
  for (int i = 0; i < 8; i++) {
    cameras.push_back (open_camera (fakes[i]->address ()));
    configure (*cameras.back (), small_pictures (30));
    start (*cameras.back (), listeners[i]);
  }
  for (int n = 0; n < 20; n++)
    for (Listener &listener : listeners)
      (void)listener.next_complete ();
}
GST_END_TEST;

static Suite *
camerastream_suite ()
{
  has_own_network = enter_own_network ();
  Suite *suite = suite_create ("camerastream");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_frames_arrive_whole_numbered_and_in_order);
  tcase_add_test (tc, test_pixels_are_those_of_the_frame_as_long_as_it_is_held);
  tcase_add_test (tc, test_buffers_are_used_again_with_all_that_a_frame_wrote_gone);
  tcase_add_test (tc, test_memory_kept_without_its_buffer_comes_back_later);
  tcase_add_test (tc, test_changed_buffers_are_not_used_again);
  tcase_add_test (tc, test_frames_for_which_no_buffer_is_left_are_counted);
  tcase_add_test (tc, test_buffers_outlive_the_camera);
  tcase_add_test (tc, test_camera_starts_again_after_stop_and_new_settings);
  tcase_add_test (tc, test_lost_packets_make_incomplete_frames_or_gaps_never_pictures);
  tcase_add_test (tc, test_vanished_camera_is_told_once_and_is_no_hang);
  tcase_add_test (tc, test_camera_that_came_back_opens_again);
  tcase_add_test (tc, test_software_trigger_takes_one_picture_a_call);
  tcase_add_test (tc, test_followers_take_over_the_look_of_the_leader);
  tcase_add_test (tc, test_eight_cameras_stream_at_once);
  return suite;
}

GST_CHECK_MAIN (camerastream);
