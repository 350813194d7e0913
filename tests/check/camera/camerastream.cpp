/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The layer over Aravis streams, triggers, and loses cameras, with fake GigE Vision cameras: real
 * packets over the loopback interface. */
#include <set>

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
    fail_unless (frame.buffer != nullptr);
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

GST_START_TEST (test_places_of_pixels_are_used_again)
{
  SKIP_WITHOUT_NETWORK ();
  FakeCamera fake;
  const auto camera = open_camera ("127.0.0.1");
  CameraSettings settings = small_pictures ();
  settings.n_buffers = 3;
  configure (*camera, settings);
  Listener listener;
  start (*camera, listener);
  std::set<const void *> pixels;
  for (int i = 0; i < 30; i++) {
    const CameraFrame frame = listener.next_complete ();
    GstBuffer *buffer = frame.buffer.get ();
    pixels.insert (data_of (buffer));
    fail_unless (gst_buffer_is_writable (buffer) && gst_buffer_is_all_memory_writable (buffer));
    assert_equals_int (gst_buffer_get_n_meta (buffer, GST_VIDEO_META_API_TYPE), 1);
  }
  fail_unless (pixels.size () <= 3, "%d places for pixels", int (pixels.size ()));
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
  for (int width : {64, 128, 32}) {
    CameraSettings settings = small_pictures ();
    settings.width = width;
    configure (*camera, settings);
    Listener fresh;
    start (*camera, fresh);
    assert_equals_int (gst_buffer_get_size (fresh.next_complete ().buffer.get ()), width * 48);
    camera->stop ();
    camera->stop ();
  }
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
  assert_refused (camera->trigger_software (), CameraFault::kLost, "no longer responds");
  camera->stop ();
  assert_refused (
      camera->start (listener.arrived (), listener.lost ()), CameraFault::kLost, "no longer");
  camera.reset ();
  assert_equals_int (listener.n_losses (), 1);
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
  tcase_add_test (tc, test_places_of_pixels_are_used_again);
  tcase_add_test (tc, test_frames_for_which_no_buffer_is_left_are_counted);
  tcase_add_test (tc, test_buffers_outlive_the_camera);
  tcase_add_test (tc, test_camera_starts_again_after_stop_and_new_settings);
  tcase_add_test (tc, test_vanished_camera_is_told_once_and_is_no_hang);
  return suite;
}

GST_CHECK_MAIN (camerastream);
