/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The layer over Aravis with fake GigE Vision cameras: real packets over the loopback interface. */
#include <camera.hpp>

#include <deque>
#include <glib/gstdio.h>
#include <look_follower.hpp>

#include "camera-check.hpp"

using namespace rangecast::testing;

/** Keeps what a camera's callbacks say, which may come until the camera was stopped. */
class Listener {
public:
  Camera::Arrived arrived () const
  {
    return [heard = heard_] (CameraFrame frame) {
      std::lock_guard guard (heard->lock);
      heard->frames.push_back (std::move (frame));
      heard->changed.notify_all ();
    };
  }
  Camera::Lost lost () const
  {
    return [heard = heard_] (CameraStatus status) {
      std::lock_guard guard (heard->lock);
      heard->losses.push_back (std::move (status));
      heard->changed.notify_all ();
    };
  }
  /** The next frame; fails the test if none comes. */
  CameraFrame next ()
  {
    std::unique_lock guard (heard_->lock);
    const auto some = [this] { return !heard_->frames.empty (); };
    fail_unless (heard_->changed.wait_for (guard, std::chrono::seconds (20), some), "no frame");
    CameraFrame frame = std::move (heard_->frames.front ());
    heard_->frames.pop_front ();
    return frame;
  }
  CameraFrame next_complete ()
  {
    for (;;) {
      CameraFrame frame = next ();
      if (frame.state == FrameState::kComplete)
        return frame;
    }
  }
  CameraStatus wait_for_loss ()
  {
    std::unique_lock guard (heard_->lock);
    const auto some = [this] { return !heard_->losses.empty (); };
    fail_unless (heard_->changed.wait_for (guard, std::chrono::seconds (60), some), "no loss");
    return heard_->losses.front ();
  }
  std::size_t n_losses ()
  {
    std::lock_guard guard (heard_->lock);
    return heard_->losses.size ();
  }
  std::size_t n_frames ()
  {
    std::lock_guard guard (heard_->lock);
    return heard_->frames.size ();
  }

private:
  struct Heard {
    std::mutex lock;
    std::condition_variable changed;
    std::deque<CameraFrame> frames;
    std::vector<CameraStatus> losses;
  };
  std::shared_ptr<Heard> heard_ = std::make_shared<Heard> ();
};

static std::unique_ptr<Camera>
open_camera (const std::string &name)
{
  std::unique_ptr<Camera> camera;
  const CameraStatus status = Camera::open (name, camera);
  fail_unless (status.ok (), "%s", status.message ().c_str ());
  return camera;
}

static CameraSettings
small_pictures (double frame_rate = 100)
{
  CameraSettings settings;
  settings.width = 64;
  settings.height = 48;
  settings.pixel_format = "Mono8";
  settings.frame_rate = frame_rate;
  return settings;
}

static void
configure (Camera &camera, const CameraSettings &settings)
{
  const CameraStatus status = camera.configure (settings);
  fail_unless (status.ok (), "%s", status.message ().c_str ());
}

static void
start (Camera &camera, Listener &listener)
{
  const CameraStatus status = camera.start (listener.arrived (), listener.lost ());
  fail_unless (status.ok (), "%s", status.message ().c_str ());
}

static void
assert_refused (const CameraStatus &status, CameraFault fault, const char *text)
{
  fail_unless (!status.ok ());
  fail_unless (
      status.fault () == fault, "fault %d: %s", int (status.fault ()), status.message ().c_str ());
  fail_unless (status.message ().find (text) != std::string::npos, "'%s' has no '%s'",
      status.message ().c_str (), text);
}

static const void *
data_of (GstBuffer *buffer)
{
  GstMapInfo map;
  fail_unless (gst_buffer_map (buffer, &map, GST_MAP_READ));
  const void *data = map.data;
  gst_buffer_unmap (buffer, &map);
  return data;
}

/* Finding */

GST_START_TEST (test_camera_is_found_by_address_serial_and_id)
{
  SKIP_WITHOUT_NETWORK ();
  FakeCamera fake ("127.0.0.1", "GV01");
  for (const char *name : {"127.0.0.1", "GV01", "Aravis-Fake-GV01", ""}) {
    const auto camera = open_camera (name);
    assert_equals_string (camera->info ().serial.c_str (), "GV01");
    assert_equals_string (camera->info ().address.c_str (), "127.0.0.1");
    assert_equals_string (camera->interface_address ().c_str (), "127.0.0.1");
    fail_unless (camera->is_gige ());
  }
}
GST_END_TEST;

GST_START_TEST (test_all_cameras_are_listed)
{
  SKIP_WITHOUT_NETWORK ();
  FakeCamera left ("127.0.0.2", "left"), right ("127.0.0.3", "right");
  const std::vector<CameraInfo> cameras = list_cameras ();
  assert_equals_int (cameras.size (), 2);
  for (const CameraInfo &camera : cameras) {
    fail_unless (camera.serial == "left" || camera.serial == "right");
    assert_equals_string (camera.model.c_str (), "Fake");
    assert_equals_string (camera.protocol.c_str (), "GigEVision");
  }
}
GST_END_TEST;

GST_START_TEST (test_unknown_camera_is_refused_with_what_was_found)
{
  SKIP_WITHOUT_NETWORK ();
  FakeCamera fake ("127.0.0.1", "GV01");
  std::unique_ptr<Camera> camera;
  const CameraStatus status = Camera::open ("left", camera);
  assert_refused (status, CameraFault::kNotFound, "'left'");
  assert_refused (status, CameraFault::kNotFound, "Aravis-Fake-GV01 (127.0.0.1, serial GV01)");
  fail_unless (status.may_recover ());
  fail_unless (!camera);
}
GST_END_TEST;

GST_START_TEST (test_no_camera_at_all_is_said)
{
  SKIP_WITHOUT_NETWORK ();
  std::unique_ptr<Camera> camera;
  assert_refused (Camera::open ("", camera), CameraFault::kNotFound, "no camera at all answers");
}
GST_END_TEST;

GST_START_TEST (test_unnamed_camera_is_refused_where_several_answer)
{
  SKIP_WITHOUT_NETWORK ();
  FakeCamera left ("127.0.0.2", "left"), right ("127.0.0.3", "right");
  std::unique_ptr<Camera> camera;
  const CameraStatus status = Camera::open ("", camera);
  assert_refused (status, CameraFault::kBadSetting, "several cameras answer");
  assert_refused (status, CameraFault::kBadSetting, "Aravis-Fake-right (127.0.0.3");
}
GST_END_TEST;

GST_START_TEST (test_second_program_is_told_that_the_first_has_control)
{
  SKIP_WITHOUT_NETWORK ();
  FakeCamera fake;
  const auto first = open_camera ("127.0.0.1");
  std::unique_ptr<Camera> second;
  const CameraStatus status = Camera::open ("127.0.0.1", second);
  assert_refused (status, CameraFault::kBusy, "another program has control of it");
  fail_unless (status.may_recover ());
}
GST_END_TEST;

GST_START_TEST (test_control_is_given_up_with_the_camera)
{
  SKIP_WITHOUT_NETWORK ();
  FakeCamera fake;
  for (int i = 0; i < 3; i++) {
    Listener listener;
    const auto camera = open_camera ("127.0.0.1");
    configure (*camera, small_pictures ());
    start (*camera, listener);
    (void)listener.next_complete ();
  }
}
GST_END_TEST;

/* Configuring */

GST_START_TEST (test_abilities_tell_formats_sizes_and_triggers)
{
  SKIP_WITHOUT_NETWORK ();
  FakeCamera fake;
  const auto camera = open_camera ("127.0.0.1");
  CameraAbilities a;
  fail_unless (camera->abilities (a).ok ());
  const auto has = [] (const std::vector<std::string> &list, const char *name) {
    return std::find (list.begin (), list.end (), name) != list.end ();
  };
  for (const char *name : {"Mono8", "RGB8", "BayerRG8", "BayerBG8", "BayerGB8", "BayerGR8"})
    fail_unless (has (a.pixel_formats, name), "no %s", name);
  fail_unless (has (a.other_formats, "Mono16"));
  assert_equals_int (a.max_width, 2048);
  assert_equals_int (a.max_height, 2048);
  fail_unless (a.software_trigger && a.line_trigger && !a.action_trigger && !a.ptp);
}
GST_END_TEST;

GST_START_TEST (test_each_pixel_format_has_its_caps)
{
  SKIP_WITHOUT_NETWORK ();
  FakeCamera fake;
  const auto camera = open_camera ("127.0.0.1");
  const struct {
    const char *pixel_format, *caps;
    int stride;
  } cases[] = {
      {"Mono8", "video/x-raw,format=GRAY8,width=66,height=48", 66},
      {"RGB8", "video/x-raw,format=RGB,width=66,height=48", 198},
      {"BayerRG8", "video/x-bayer,format=rggb,width=66,height=48", 66},
      {"BayerBG8", "video/x-bayer,format=bggr,width=66,height=48", 66},
      {"BayerGB8", "video/x-bayer,format=gbrg,width=66,height=48", 66},
      {"BayerGR8", "video/x-bayer,format=grbg,width=66,height=48", 66},
  };
  for (const auto &c : cases) {
    CameraSettings settings = small_pictures ();
    settings.width = 66;
    settings.pixel_format = c.pixel_format;
    configure (*camera, settings);
    GstCaps *caps = camera->format ().caps (), *expected = gst_caps_from_string (c.caps);
    fail_unless (gst_caps_is_strictly_equal (caps, expected), "%s", c.pixel_format);
    assert_equals_int (camera->format ().stride, c.stride);
    fail_unless (!camera->format ().stride_is_default ());
    gst_caps_unref (caps);
    gst_caps_unref (expected);
    Listener listener;
    start (*camera, listener);
    assert_equals_int (
        gst_buffer_get_size (listener.next_complete ().buffer.get ()), c.stride * 48);
    camera->stop ();
  }
}
GST_END_TEST;

GST_START_TEST (test_caps_choose_the_pixel_format)
{
  const std::vector<std::string> has = {"Mono16", "Mono8", "RGB8Packed", "BayerGB8"};
  const auto choice = [&] (const char *text) {
    GstCaps *caps = gst_caps_from_string (text);
    const std::string name = pixel_format_for_caps (caps, has);
    gst_caps_unref (caps);
    return name;
  };
  fail_unless (choice ("video/x-raw,format=RGB") == "RGB8Packed");
  fail_unless (choice ("video/x-raw,format={NV12,GRAY8},width=640") == "Mono8");
  fail_unless (choice ("video/x-bayer") == "BayerGB8");
  fail_unless (choice ("video/x-bayer,format=rggb").empty ());
  fail_unless (choice ("video/x-raw,format=I420").empty ());
  GstCaps *all = camera_caps ();
  assert_equals_int (gst_caps_get_size (all), 7);
  gst_caps_unref (all);
}
GST_END_TEST;

GST_START_TEST (test_region_lies_in_the_middle_by_default)
{
  SKIP_WITHOUT_NETWORK ();
  FakeCamera fake;
  const auto camera = open_camera ("127.0.0.1");
  configure (*camera, small_pictures ());
  guint32 x = 0, y = 0;
  arv_fake_camera_read_register (fake.registers (), ARV_FAKE_CAMERA_REGISTER_X_OFFSET, &x);
  arv_fake_camera_read_register (fake.registers (), ARV_FAKE_CAMERA_REGISTER_Y_OFFSET, &y);
  assert_equals_int (x, (2048 - 64) / 2);
  assert_equals_int (y, (2048 - 48) / 2);
  CameraSettings corner = small_pictures ();
  corner.width = corner.height = 0;
  corner.x = 2000;
  corner.y = 2016;
  configure (*camera, corner);
  assert_equals_int (camera->format ().width, 48);
  assert_equals_int (camera->format ().height, 32);
}
GST_END_TEST;

GST_START_TEST (test_refused_settings_say_what_the_camera_accepts)
{
  SKIP_WITHOUT_NETWORK ();
  FakeCamera fake;
  const auto camera = open_camera ("127.0.0.1");
  const auto refusal = [&] (const std::function<void (CameraSettings &)> &change) {
    CameraSettings settings = small_pictures ();
    change (settings);
    return camera->configure (settings);
  };
  const auto bad = CameraFault::kBadSetting;
  assert_refused (refusal ([] (auto &s) { s.width = 4096; }), bad,
      "width of 4096 pixels: the camera accepts 1 to 2048");
  assert_refused (refusal ([] (auto &s) { s.x = 2000; }), bad,
      "width of 64 pixels from 2000: the sensor ends at 2048");
  assert_refused (refusal ([] (auto &s) { s.pixel_format = "Mono16"; }), CameraFault::kUnsupported,
      "pixel format Mono16 cannot be carried");
  assert_refused (refusal ([] (auto &s) { s.pixel_format = "BGR8"; }), bad,
      "has no pixel format BGR8; it has ");
  assert_refused (refusal ([] (auto &s) { s.frame_rate = 5000; }), bad,
      "frame rate of 5000: the camera accepts 0.1 to 1000");
  assert_refused (refusal ([] (auto &s) {
    s.exposure_mode = AutoMode::kManual;
    s.exposure_us = 1;
  }),
      bad, "exposure of 1 us: the camera accepts 10 to 10000000 us");
  assert_refused (refusal ([] (auto &s) { s.exposure_mode = AutoMode::kAuto; }), bad,
      "has no automatic exposure");
  assert_refused (refusal ([] (auto &s) {
    s.gain_mode = AutoMode::kManual;
    s.gain = 99;
  }),
      bad, "gain of 99: the camera accepts 0 to 10");
  assert_refused (refusal ([] (auto &s) { s.packet_size = 100; }), bad, "576 to 16384");
  assert_refused (refusal ([] (auto &s) { s.n_buffers = 1; }), bad, "at least 2");
  assert_refused (refusal ([] (auto &s) {
    s.trigger = TriggerMode::kHardware;
    s.line.source = "Line7";
  }),
      bad, "has no trigger source Line7; it has Line0, Software");
  assert_refused (refusal ([] (auto &s) { s.trigger = TriggerMode::kAction; }), bad,
      "does not know action commands");
  assert_refused (refusal ([] (auto &s) {
    s.trigger = TriggerMode::kHardware;
    s.line.master = true;
  }),
      bad, "LineSelector");
  fail_unless (camera->configure (small_pictures ()).message ().empty (), "still works afterwards");
}
GST_END_TEST;

GST_START_TEST (test_refused_features_name_feature_value_and_range)
{
  SKIP_WITHOUT_NETWORK ();
  FakeCamera fake;
  const auto camera = open_camera ("127.0.0.1");
  const struct {
    const char *features, *text;
  } cases[] = {
      {"GainRaw=11", "feature GainRaw=11: the camera accepts 0 to 10"},
      {"GainRaw=high", "feature GainRaw=high: expected an integer"},
      {"ExposureTimeAbs=5", "feature ExposureTimeAbs=5: the camera accepts 10 to 10000000"},
      {"ExposureTimeAbs=nan", "expected a number"},
      {"AcquisitionMode=Sometimes",
          "feature AcquisitionMode=Sometimes: the camera accepts Continuous, MultiFrame, "
          "SingleFrame"},
      {"TestBoolean=maybe", "the camera accepts true and false"},
      {"Gama=1", "has no feature 'Gama'"},
      {"SensorWidth=100", "feature 'SensorWidth' can only be read"},
      {"AcquisitionStart=1", "is a command and takes no value"},
      {"GainRaw", "is no command; give it a value"},
      {"GainRaw=1 =", "features: expected a feature's name"},
      {"PixelFormat=Mono16", "Mono16 cannot be carried"},
  };
  for (const auto &c : cases) {
    CameraSettings settings = small_pictures ();
    settings.features = c.features;
    const CameraStatus status = camera->configure (settings);
    fail_unless (!status.ok (), "%s", c.features);
    fail_unless (status.message ().find (c.text) != std::string::npos, "'%s' has no '%s'",
        status.message ().c_str (), c.text);
  }
}
GST_END_TEST;

GST_START_TEST (test_features_win_over_settings)
{
  SKIP_WITHOUT_NETWORK ();
  FakeCamera fake;
  const auto camera = open_camera ("127.0.0.1");
  CameraSettings settings = small_pictures ();
  settings.gain_mode = AutoMode::kManual;
  settings.gain = 3;
  settings.exposure_mode = AutoMode::kManual;
  settings.exposure_us = 2000;
  settings.features = "GainRaw=7 Width=0x20, TestStringReg='two words'";
  configure (*camera, settings);
  CameraLook look;
  fail_unless (camera->read_look (look).ok ());
  assert_equals_float (*look.gain, 7);
  assert_equals_float (*look.exposure_us, 2000);
  assert_equals_int (camera->format ().width, 32);
}
GST_END_TEST;

/** A file with the features of Aravis' fake camera, and one text of them replaced. */
class Features {
public:
  Features (const std::string &from, const std::string &to)
  {
    ArvFakeCamera *fake = arv_fake_camera_new ("any");
    std::size_t size = 0;
    const char *text = arv_fake_camera_get_genicam_xml (fake, &size);
    std::string xml (text, size);
    g_object_unref (fake);
    const std::size_t at = xml.find (from);
    fail_unless (at != std::string::npos, "the fake camera's features have no '%s'", from.c_str ());
    xml.replace (at, from.size (), to);
    gchar *name = nullptr;
    const int fd = g_file_open_tmp ("rangecast-features-XXXXXX.xml", &name, nullptr);
    fail_unless (fd >= 0);
    close (fd);
    path_ = name;
    g_free (name);
    fail_unless (g_file_set_contents (path_.c_str (), xml.c_str (), xml.size (), nullptr));
  }
  Features (const Features &) = delete;
  Features &operator= (const Features &) = delete;
  ~Features () { g_unlink (path_.c_str ()); }
  [[nodiscard]] const std::string &path () const { return path_; }

private:
  std::string path_;
};

GST_START_TEST (test_camera_that_sends_another_size_than_its_pictures_is_refused)
{
  SKIP_WITHOUT_NETWORK ();
  const char *formula = "<Formula>WIDTH * HEIGHT * ((PIXELFORMAT>>16)&amp;0xFF) / 8</Formula>";
  for (const char *wrong : {"<Formula>4000000000</Formula>", "<Formula>WIDTH</Formula>"}) {
    const Features features (formula, wrong);
    FakeCamera fake ("127.0.0.1", "GV01", features.path ());
    const auto camera = open_camera ("127.0.0.1");
    configure (*camera, small_pictures ());
    Listener listener;
    assert_refused (camera->start (listener.arrived (), listener.lost ()),
        CameraFault::kUnsupported, "bytes a picture; expected 3072 for 64x48 Mono8");
  }
}
GST_END_TEST;

GST_START_TEST (test_camera_without_a_usable_pixel_format_is_refused)
{
  SKIP_WITHOUT_NETWORK ();
  const Features features ("Name=\"PixelFormat\"", "Name=\"OtherFormat\"");
  FakeCamera fake ("127.0.0.1", "GV01", features.path ());
  const auto camera = open_camera ("127.0.0.1");
  const CameraStatus status = camera->configure (small_pictures ());
  fail_unless (!status.ok ());
  fail_unless (
      status.message ().find ("camera '127.0.0.1'") == 0, "%s", status.message ().c_str ());
}
GST_END_TEST;

GST_START_TEST (test_camera_without_a_width_is_refused)
{
  SKIP_WITHOUT_NETWORK ();
  const Features features ("Name=\"Width\"", "Name=\"Breadth\"");
  FakeCamera fake ("127.0.0.1", "GV01", features.path ());
  const auto camera = open_camera ("127.0.0.1");
  fail_unless (!camera->configure (small_pictures ()).ok ());
  Listener listener;
  fail_unless (!camera->start (listener.arrived (), listener.lost ()).ok ());
}
GST_END_TEST;

/* Streaming */

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
    fail_unless (frame.state == FrameState::kComplete);
    assert_equals_int (gst_buffer_get_size (frame.buffer.get ()), 64 * 48);
    fail_unless (!GST_BUFFER_PTS_IS_VALID (frame.buffer.get ()));
    fail_unless (i == 0 || frame.number == last + 1);
    fail_unless (frame.camera_time_ns > last_time);
    fail_unless (frame.began_us <= frame.arrived_us);
    last = frame.number;
    last_time = frame.camera_time_ns;
  }
  const CameraStatistics numbers = camera->statistics ();
  fail_unless (numbers.completed >= 50);
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
  for (gsize at = 0; at < map.size; at++)
    fail_unless (map.data[at] == map.data[0], "pixels of two pictures in one");
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
  fail_unless (n_complete > 50);
  fail_unless (missing >= guint64 (n_incomplete));
  fail_unless (camera->statistics ().failures >= guint64 (n_incomplete));
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
  assert_refused (status, CameraFault::kLost, "does not answer any more");
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
  LookFollower look;
  std::atomic<int> n_refusals{0};
  look.start (leader, {follower}, std::chrono::milliseconds (5),
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
  look.stop ();
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
camera_suite ()
{
  has_own_network = enter_own_network ();
  Suite *suite = suite_create ("camera");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_camera_is_found_by_address_serial_and_id);
  tcase_add_test (tc, test_all_cameras_are_listed);
  tcase_add_test (tc, test_unknown_camera_is_refused_with_what_was_found);
  tcase_add_test (tc, test_no_camera_at_all_is_said);
  tcase_add_test (tc, test_unnamed_camera_is_refused_where_several_answer);
  tcase_add_test (tc, test_second_program_is_told_that_the_first_has_control);
  tcase_add_test (tc, test_control_is_given_up_with_the_camera);
  tcase_add_test (tc, test_abilities_tell_formats_sizes_and_triggers);
  tcase_add_test (tc, test_each_pixel_format_has_its_caps);
  tcase_add_test (tc, test_caps_choose_the_pixel_format);
  tcase_add_test (tc, test_region_lies_in_the_middle_by_default);
  tcase_add_test (tc, test_refused_settings_say_what_the_camera_accepts);
  tcase_add_test (tc, test_refused_features_name_feature_value_and_range);
  tcase_add_test (tc, test_features_win_over_settings);
  tcase_add_test (tc, test_camera_that_sends_another_size_than_its_pictures_is_refused);
  tcase_add_test (tc, test_camera_without_a_usable_pixel_format_is_refused);
  tcase_add_test (tc, test_camera_without_a_width_is_refused);
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

GST_CHECK_MAIN (camera);
