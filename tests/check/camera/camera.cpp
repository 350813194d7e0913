/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The layer over Aravis finds and configures cameras, with fake GigE Vision cameras: real packets
 * over the loopback interface. */
#include <glib/gstdio.h>

#include "camera-check.hpp"

using namespace rangecast::testing;

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

GST_START_TEST (test_camera_is_found_by_its_mac_address)
{
  SKIP_WITHOUT_NETWORK ();
  FakeCamera fake ("127.0.0.1", "GV01");
  const std::string mac = list_cameras ().front ().physical_id;
  const auto camera = open_camera (mac.c_str ());
  assert_equals_string (camera->info ().serial.c_str (), "GV01");
}
GST_END_TEST;

GST_START_TEST (test_camera_is_found_by_its_user_defined_name)
{
  SKIP_WITHOUT_NETWORK ();
  FakeCamera left ("127.0.0.2", "GV02"), right ("127.0.0.3", "GV03");
  static const char name[16] = "right eye";
  fail_unless (arv_fake_camera_write_memory (right.registers (), 0xe8, sizeof name, name));
  const auto camera = open_camera ("right eye");
  assert_equals_string (camera->info ().serial.c_str (), "GV03");
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
    fail_unless (!camera.physical_id.empty ());
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
  assert_refused (Camera::open ("", camera), CameraFault::kNotFound, "no camera answers");
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

GST_START_TEST (test_abilities_tell_formats_and_sizes)
{
  SKIP_WITHOUT_NETWORK ();
  FakeCamera fake;
  const auto camera = open_camera ("127.0.0.1");
  CameraAbilities a;
  fail_unless_ok (camera->abilities (a));
  const auto has = [] (const std::vector<std::string> &list, const char *name) {
    return std::find (list.begin (), list.end (), name) != list.end ();
  };
  for (const char *name : {"Mono8", "RGB8", "BayerRG8", "BayerBG8", "BayerGB8", "BayerGR8"})
    fail_unless (has (a.pixel_formats, name), "no %s", name);
  fail_unless (has (a.other_formats, "Mono16"));
  assert_equals_int (a.max_width, 2048);
  assert_equals_int (a.max_height, 2048);
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
  fail_unless_cmp (choice ("video/x-raw,format=RGB"), ==, "RGB8Packed");
  fail_unless_cmp (choice ("video/x-raw,format={NV12,GRAY8},width=640"), ==, "Mono8");
  fail_unless_cmp (choice ("video/x-bayer"), ==, "BayerGB8");
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
      "pixel format Mono16 is not supported");
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
      "does not support action commands");
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
      {"GainRaw", "is not a command; give it a value"},
      {"GainRaw=1 =", "features: expected a feature's name"},
      {"PixelFormat=Mono16", "Mono16 are not supported"},
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
  ImagingParameters parameters;
  fail_unless_ok (camera->read_imaging (parameters));
  assert_equals_float (*parameters.gain, 7);
  assert_equals_float (*parameters.exposure_us, 2000);
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
    ck_assert_int_ge (fd, 0);
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
        CameraFault::kUnsupported, "bytes an image; expected 3072 for 64x48 Mono8");
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

static Suite *
camera_suite ()
{
  has_own_network = enter_own_network ();
  Suite *suite = suite_create ("camera");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_camera_is_found_by_address_serial_and_id);
  tcase_add_test (tc, test_camera_is_found_by_its_mac_address);
  tcase_add_test (tc, test_camera_is_found_by_its_user_defined_name);
  tcase_add_test (tc, test_all_cameras_are_listed);
  tcase_add_test (tc, test_unknown_camera_is_refused_with_what_was_found);
  tcase_add_test (tc, test_no_camera_at_all_is_said);
  tcase_add_test (tc, test_unnamed_camera_is_refused_where_several_answer);
  tcase_add_test (tc, test_second_program_is_told_that_the_first_has_control);
  tcase_add_test (tc, test_control_is_given_up_with_the_camera);
  tcase_add_test (tc, test_abilities_tell_formats_and_sizes);
  tcase_add_test (tc, test_each_pixel_format_has_its_caps);
  tcase_add_test (tc, test_caps_choose_the_pixel_format);
  tcase_add_test (tc, test_region_lies_in_the_middle_by_default);
  tcase_add_test (tc, test_refused_settings_say_what_the_camera_accepts);
  tcase_add_test (tc, test_refused_features_name_feature_value_and_range);
  tcase_add_test (tc, test_features_win_over_settings);
  tcase_add_test (tc, test_camera_that_sends_another_size_than_its_pictures_is_refused);
  tcase_add_test (tc, test_camera_without_a_usable_pixel_format_is_refused);
  tcase_add_test (tc, test_camera_without_a_width_is_refused);
  return suite;
}

GST_CHECK_MAIN (camera);
