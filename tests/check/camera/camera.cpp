/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The layer over Aravis finds and configures cameras, with fake GigE Vision cameras: real packets
 * over the loopback interface. */
#include <glib/gstdio.h>

#include "camera/aravis/discovery.hpp"

#include "camera-check.hpp"

using namespace rangecast::testing;

/* Finding */

GST_START_TEST (test_camera_is_found_by_each_of_its_names)
{
  SKIP_WITHOUT_NETWORK ();
  FakeCamera left ("127.0.0.2", "GV02"), right ("127.0.0.3", "GV03");
  static const char name[16] = "right eye";
  fail_unless (arv_fake_camera_write_memory (right.registers (), 0xe8, sizeof name, name));
  arv_fake_camera_write_register (right.registers (), 0x0c, 3); /* MAC address */
  std::vector<std::string> names = {"127.0.0.3", "GV03", "Aravis-Fake-GV03", "right eye"};
  for (const CameraInfo &info : list_cameras ())
    if (info.serial == "GV03")
      names.push_back (info.physical_id);
  assert_equals_int (names.size (), 5);
  for (const std::string &called : names) {
    const auto camera = open_camera (called);
    assert_equals_string (camera->info ().serial.c_str (), "GV03");
    assert_equals_string (camera->info ().address.c_str (), "127.0.0.3");
    /* whichever of the loopback addresses its answer to the search reached first */
    fail_unless (camera->interface_address ().starts_with ("127.0.0."));
    fail_unless (camera->info ().is_gige ());
  }
}
GST_END_TEST;

GST_START_TEST (test_name_that_means_no_single_camera_is_refused_with_what_was_found)
{
  SKIP_WITHOUT_NETWORK ();
  std::unique_ptr<Camera> camera;
  assert_refused (Camera::open ("middle", camera), CameraFault::kNotFound, "no camera answers");
  FakeCamera left ("127.0.0.2", "left"), right ("127.0.0.3", "right");
  const CameraStatus unknown = Camera::open ("middle", camera);
  assert_refused (unknown, CameraFault::kNotFound, "'middle'");
  assert_refused (unknown, CameraFault::kNotFound, "Aravis-Fake-right (127.0.0.3, serial right)");
  fail_unless (unknown.may_recover () && !camera);
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
}
GST_END_TEST;

GST_START_TEST (test_refused_settings_say_which)
{
  SKIP_WITHOUT_NETWORK ();
  FakeCamera fake;
  const auto camera = open_camera ("127.0.0.1");
  const struct {
    std::function<void (CameraSettings &)> change;
    const char *text;
  } rows[] = {
      {[] (auto &s) { s.width = 4096; }, "region of 4096x48"},
      {[] (auto &s) { s.pixel_format = "BGR8"; }, "PixelFormat=BGR8: the camera accepts "},
      {[] (auto &s) { s.frame_rate = 5000; }, "frame rate of 5000: the camera accepts 0.1 to 1000"},
      {[] (auto &s) {
         s.exposure_mode = AutoMode::kManual;
         s.exposure_us = 1;
       },
          "exposure of 1 us: "},
      {[] (auto &s) { s.exposure_mode = AutoMode::kAuto; }, "has no automatic exposure"},
      {[] (auto &s) {
         s.gain_mode = AutoMode::kManual;
         s.gain = 99;
       },
          "gain of 99: "},
      {[] (auto &s) { s.packet_size = 100; }, "576 to 16384"},
      {[] (auto &s) {
         s.trigger = TriggerMode::kHardware;
         s.trigger_line = "Line7";
       },
          "TriggerSource=Line7: the camera accepts Line0, Software"},
      {[] (auto &s) { s.trigger = TriggerMode::kAction; }, "does not support action commands"},
      {[] (auto &s) {
         s.trigger = TriggerMode::kHardware;
         s.output_line = "Line2";
       },
          "LineSelector"},
      {[] (auto &s) { s.features = "GainRaw=11"; }, "feature GainRaw=11: "},
      {[] (auto &s) { s.features = "GainRaw=high"; }, "feature GainRaw=high: it takes a number"},
      {[] (auto &s) { s.features = "ExposureTimeAbs=5"; }, "feature ExposureTimeAbs=5: "},
      {[] (auto &s) { s.features = "ExposureTimeAbs=nan"; }, "it takes a number"},
      {[] (auto &s) { s.features = "AcquisitionMode=Sometimes"; },
          "the camera accepts Continuous, MultiFrame, SingleFrame"},
      {[] (auto &s) { s.features = "TestBoolean=maybe"; }, "feature TestBoolean=maybe: "},
      {[] (auto &s) { s.features = "Gama=1"; }, "has no feature 'Gama'"},
      {[] (auto &s) { s.features = "AcquisitionStart=1"; }, "is a command and takes no value"},
      {[] (auto &s) { s.features = "GainRaw"; }, "has no command 'GainRaw'"},
      {[] (auto &s) { s.features = "GainRaw=1 TestStringReg='two words"; }, "features \"GainRaw=1"},
      {[] (auto &s) { s.features = "=1"; }, "has no feature ''"},
  };
  for (const auto &row : rows) {
    CameraSettings settings = small_pictures ();
    row.change (settings);
    const CameraStatus status = camera->configure (settings);
    fail_if (status.ok (), "'%s' is missing", row.text);
    assert_refused (status, CameraFault::kBadSetting, row.text);
  }
  CameraSettings settings = small_pictures ();
  settings.pixel_format = "Mono16";
  assert_refused (camera->configure (settings), CameraFault::kUnsupported, "pixel format Mono16");
  settings = small_pictures ();
  settings.features = "GainRaw=0x7 TestStringReg='two words' ExposureTimeAbs=2.5e3";
  configure (*camera, settings); /* still works afterwards */
  ImagingParameters parameters;
  fail_unless_ok (camera->read_imaging (parameters));
  assert_equals_float (*parameters.gain, 7);
  assert_equals_float (*parameters.exposure_us, 2500);
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
        CameraFault::kUnsupported, "bytes an image, not the 3072 of 64x48 Mono8");
  }
}
GST_END_TEST;

static Suite *
camera_suite ()
{
  has_own_network = enter_own_network ();
  Suite *suite = suite_create ("camera");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_camera_is_found_by_each_of_its_names);
  tcase_add_test (tc, test_name_that_means_no_single_camera_is_refused_with_what_was_found);
  tcase_add_test (tc, test_second_program_is_told_that_the_first_has_control);
  tcase_add_test (tc, test_abilities_tell_formats_and_sizes);
  tcase_add_test (tc, test_region_lies_in_the_middle_by_default);
  tcase_add_test (tc, test_refused_settings_say_which);
  tcase_add_test (tc, test_camera_that_sends_another_size_than_its_pictures_is_refused);
  return suite;
}

GST_CHECK_MAIN (camera);
