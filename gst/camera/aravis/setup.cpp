/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Order: pixel format before region (bytes a pixel limit the width of some cameras), trigger before
 * frame rate (which is locked while triggered), features last. */
#include "setup.hpp"

#include <algorithm>
#include <cmath>

#include "features.hpp"
#include "format.hpp"

/* What a camera says decides how much memory is taken: 512 MiB a picture are enough. */
static constexpr std::uint64_t kLargestPicture = 512 << 20;
static constexpr int kLongestSide = 65535;     /* pixels */
static constexpr int kGigEMinimumPacket = 576; /* bytes; GigE Vision */

/* An error that only says that the camera lacks something is no reason to fail. */
static void
forget (GError *&error)
{
  g_clear_error (&error);
}

static void
read_sizes (CameraControl &control, CameraAbilities &abilities)
{
  const auto guard = control.lock ();
  ArvCamera *camera = control.camera ();
  gint low = 0, high = 0;
  arv_camera_get_sensor_size (camera, &abilities.max_width, &abilities.max_height, nullptr);
  arv_camera_get_width_bounds (camera, &low, &high, nullptr);
  abilities.min_width = low;
  abilities.max_width = std::max (abilities.max_width, high);
  arv_camera_get_height_bounds (camera, &low, &high, nullptr);
  abilities.min_height = low;
  abilities.max_height = std::max (abilities.max_height, high);
  std::int64_t whole = 0; /* with binning, less than the sensor has */
  if (control.read ("WidthMax", whole) && whole > 0 && whole <= G_MAXINT)
    abilities.max_width = int (whole);
  if (control.read ("HeightMax", whole) && whole > 0 && whole <= G_MAXINT)
    abilities.max_height = int (whole);
  abilities.width_step = std::max (1, arv_camera_get_width_increment (camera, nullptr));
  abilities.height_step = std::max (1, arv_camera_get_height_increment (camera, nullptr));
  for (int *side : {&abilities.max_width, &abilities.max_height, &abilities.min_width,
           &abilities.min_height, &abilities.width_step, &abilities.height_step})
    *side = std::clamp (*side, 0, kLongestSide);
  if (arv_camera_is_frame_rate_available (camera, nullptr))
    arv_camera_get_frame_rate_bounds (
        camera, &abilities.min_frame_rate, &abilities.max_frame_rate, nullptr);
}

CameraStatus
read_abilities (CameraControl &control, CameraAbilities &abilities)
{
  abilities = {};
  const auto guard = control.lock ();
  guint count = 0;
  GError *error = nullptr;
  const char **names =
      arv_camera_dup_available_pixel_formats_as_strings (control.camera (), &count, &error);
  for (guint i = 0; names && i < count; i++)
    (find_pixel_format (names[i]) ? abilities.pixel_formats : abilities.other_formats)
        .emplace_back (names[i]);
  g_free (names);
  CameraStatus status = control.status ("list of pixel formats", error, CameraFault::kFailed);
  if (!status.ok ())
    return status;
  const char *current = arv_camera_get_pixel_format_as_string (control.camera (), nullptr);
  std::stable_partition (abilities.pixel_formats.begin (), abilities.pixel_formats.end (),
      [&] (const std::string &name) { return current && name == current; });
  read_sizes (control, abilities);
  for (const std::string &source : control.entries ("TriggerSource")) {
    abilities.software_trigger |= source == "Software";
    abilities.line_trigger |= source.starts_with ("Line");
    abilities.action_trigger |= source.starts_with ("Action");
  }
  abilities.ptp = control.has ("PtpEnable") || control.has ("GevIEEE1588");
  return {};
}

/* Image */

static CameraStatus
choose_pixel_format (CameraControl &control, const std::string &wanted, const PixelFormat *&format,
    std::string &name)
{
  CameraAbilities abilities;
  CameraStatus status = read_abilities (control, abilities);
  if (!status.ok ())
    return status;
  const std::vector<std::string> &fit = abilities.pixel_formats;
  std::vector<std::string> all = fit;
  all.insert (all.end (), abilities.other_formats.begin (), abilities.other_formats.end ());
  if (fit.empty ())
    return control.refuse (CameraFault::kUnsupported,
        "none of its pixel formats is supported: it has " + joined (all) +
            "; expected Mono8, RGB8, BGR8 or an 8-bit Bayer format");
  name = wanted;
  if (wanted.empty () && (!control.read ("PixelFormat", name) || !find_pixel_format (name)))
    name = fit.front ();
  const auto same = [&] (const std::string &other) {
    return find_pixel_format (other) == find_pixel_format (name);
  };
  const auto found = std::find_if (fit.begin (), fit.end (), same);
  if (!find_pixel_format (name))
    return control.refuse (CameraFault::kUnsupported,
        "pixel format " + name +
            " is not supported; supported formats of this camera: " + joined (fit));
  if (found == fit.end ())
    return control.refuse (
        CameraFault::kBadSetting, "has no pixel format " + name + "; it has " + joined (all));
  name = *found; /* as this camera writes it */
  format = find_pixel_format (name);
  return {};
}

/* One side of the region. Steps and limits are checked here because cameras round silently. */
static CameraStatus
check_side (CameraControl &control, const char *what, int sensor, int smallest, int step, int begin,
    int &size, int &offset)
{
  const std::string side = what;
  if (size <= 0) {
    size = sensor - std::max (begin, 0);
    size -= size % step;
  }
  if (size < smallest || size > sensor || size % step != 0)
    return control.refuse (CameraFault::kBadSetting,
        side + " of " + std::to_string (size) + " pixels: the camera accepts " +
            std::to_string (smallest) + " to " + std::to_string (sensor) +
            (step > 1 ? " in steps of " + std::to_string (step) : ""));
  offset = begin >= 0 ? begin : (sensor - size) / 2;
  if (offset + size > sensor)
    return control.refuse (CameraFault::kBadSetting,
        side + " of " + std::to_string (size) + " pixels from " + std::to_string (offset) +
            ": the sensor ends at " + std::to_string (sensor));
  return {};
}

static CameraStatus
set_region (CameraControl &control, const CameraSettings &settings)
{
  CameraAbilities a;
  const auto guard = control.lock ();
  ArvCamera *camera = control.camera ();
  read_sizes (control, a);
  int x = 0, y = 0, width = settings.width, height = settings.height;
  CameraStatus status =
      check_side (control, "width", a.max_width, a.min_width, a.width_step, settings.x, width, x);
  if (status.ok ())
    status = check_side (
        control, "height", a.max_height, a.min_height, a.height_step, settings.y, height, y);
  if (!status.ok ())
    return status;
  GError *error = nullptr;
  if (settings.x < 0) /* the middle, where the camera can begin there */
    x -= x % std::max (1, arv_camera_get_x_offset_increment (camera, nullptr));
  if (settings.y < 0)
    y -= y % std::max (1, arv_camera_get_y_offset_increment (camera, nullptr));
  arv_camera_set_region (camera, x, y, width, height, &error);
  const std::string what = "region of " + std::to_string (width) + "x" + std::to_string (height) +
                           " at " + std::to_string (x) + "," + std::to_string (y);
  status = control.status (what, error);
  if (!status.ok ())
    return status;
  gint got_x = 0, got_y = 0, got_width = 0, got_height = 0;
  error = nullptr;
  arv_camera_get_region (camera, &got_x, &got_y, &got_width, &got_height, &error);
  status = control.status ("region", error, CameraFault::kFailed);
  if (status.ok () && (got_width != width || got_height != height))
    return control.refuse (CameraFault::kBadSetting, what + ": the camera made it " +
                                                         std::to_string (got_width) + "x" +
                                                         std::to_string (got_height));
  return status;
}

CameraStatus
set_image (CameraControl &control, const CameraSettings &settings)
{
  const PixelFormat *pixel = nullptr;
  std::string name;
  CameraStatus status = choose_pixel_format (control, settings.pixel_format, pixel, name);
  if (status.ok ())
    status = control.assign ("PixelFormat", name);
  if (status.ok ())
    status = set_region (control, settings);
  return status;
}

CameraStatus
read_format (CameraControl &control, CameraFormat &format)
{
  const auto guard = control.lock ();
  format = {};
  GError *error = nullptr;
  gint x = 0, y = 0;
  arv_camera_get_region (control.camera (), &x, &y, &format.width, &format.height, &error);
  CameraStatus status = control.status ("region", error, CameraFault::kFailed);
  if (!status.ok ())
    return status;
  if (!control.read ("PixelFormat", format.pixel_format))
    return control.refuse (CameraFault::kFailed, "does not report its pixel format");
  const PixelFormat *pixel = find_pixel_format (format.pixel_format);
  if (!pixel || format.width < 1 || format.height < 1 || format.width > kLongestSide ||
      format.height > kLongestSide)
    return control.refuse (CameraFault::kUnsupported,
        "pictures of " + std::to_string (format.width) + "x" + std::to_string (format.height) +
            " " + format.pixel_format + " is not supported");
  format.video_format = pixel->video_format;
  format.bayer = pixel->bayer;
  if (std::uint64_t (format.width) * format.height * pixel->bytes > kLargestPicture)
    return control.refuse (CameraFault::kUnsupported,
        "pictures of " + std::to_string (format.width) + "x" + std::to_string (format.height) +
            " are too large: expected at most " + std::to_string (kLargestPicture) + " bytes");
  format.stride = format.width * pixel->bytes;
  return {};
}

/* Trigger */

static CameraStatus
switch_trigger_on (CameraControl &control, const std::string &source)
{
  const std::vector<std::string> sources = control.entries ("TriggerSource");
  if (std::find (sources.begin (), sources.end (), source) == sources.end ())
    return control.refuse (
        CameraFault::kBadSetting, "has no trigger source " + source + "; it has " +
                                      (sources.empty () ? "none at all" : joined (sources)));
  CameraStatus status = control.assign_if_there ({"AcquisitionFrameRateEnable"}, "false");
  if (status.ok () && control.has ("TriggerSelector"))
    status = control.assign ("TriggerSelector",
        control.has_entry ("TriggerSelector", "FrameStart") ? "FrameStart" : "AcquisitionStart");
  if (status.ok ())
    status = control.assign ("TriggerSource", source);
  if (status.ok ())
    status = control.assign ("TriggerMode", "On");
  return status;
}

static CameraStatus
show_exposure_on_line (CameraControl &control, const LineTrigger &line)
{
  if (!control.has ("LineSelector") || !control.has ("LineSource"))
    return control.refuse (CameraFault::kBadSetting,
        "cannot be the master of a line trigger: it has no feature LineSelector or LineSource");
  CameraStatus status = control.assign ("LineSelector", line.output_line);
  if (status.ok ())
    status = control.assign_if_there ({"LineMode"}, "Output");
  if (status.ok ())
    status = control.assign ("LineSource", line.output_source);
  return status;
}

static CameraStatus
follow_actions (CameraControl &control, const ActionTrigger &action)
{
  std::string source;
  for (const std::string &entry : control.entries ("TriggerSource"))
    if (source.empty () && entry.starts_with ("Action"))
      source = entry;
  if (source.empty ())
    return control.refuse (
        CameraFault::kBadSetting, "does not support action commands: none of its trigger sources "
                                  "begins with Action; it has " +
                                      joined (control.entries ("TriggerSource")));
  CameraStatus status;
  if (control.has ("ActionSelector")) /* "Action1" goes by the number, 0 or 1 for the first */
    status = control.assign ("ActionSelector", source.substr (std::string ("Action").size ()));
  if (status.ok ())
    status = control.assign ("ActionDeviceKey", std::to_string (action.device_key));
  if (status.ok ())
    status = control.assign ("ActionGroupKey", std::to_string (action.group_key));
  if (status.ok ())
    status = control.assign ("ActionGroupMask", std::to_string (action.group_mask));
  if (status.ok () && action.ptp && !control.has ("PtpEnable") && !control.has ("GevIEEE1588"))
    return control.refuse (CameraFault::kBadSetting,
        "does not support IEEE 1588, which scheduled action commands require");
  if (status.ok () && action.ptp)
    status = control.assign_if_there ({"PtpEnable", "GevIEEE1588"}, "true");
  if (status.ok ())
    status = switch_trigger_on (control, source);
  return status;
}

CameraStatus
set_trigger (CameraControl &control, const CameraSettings &settings)
{
  const auto guard = control.lock ();
  GError *error = nullptr;
  arv_camera_clear_triggers (control.camera (), &error);
  if (error && fault_of (error, CameraFault::kNone) != CameraFault::kNone)
    return control.status ("trigger off", error);
  forget (error); /* a camera without triggers */
  arv_camera_set_acquisition_mode (control.camera (), ARV_ACQUISITION_MODE_CONTINUOUS, &error);
  CameraStatus status = control.status ("continuous acquisition", error);
  if (!status.ok ())
    return status;
  switch (settings.trigger) {
    case TriggerMode::kFreeRun:
      return {};
    case TriggerMode::kSoftware:
      return switch_trigger_on (control, "Software");
    case TriggerMode::kAction:
      return follow_actions (control, settings.action);
    case TriggerMode::kHardware:
      break;
  }
  if (settings.line.master)
    return show_exposure_on_line (control, settings.line);
  status = switch_trigger_on (control, settings.line.source);
  if (status.ok ())
    status = control.assign_if_there ({"TriggerActivation"}, settings.line.activation);
  return status;
}

/* Look. ArvCamera knows under which of several names a camera has these. */

static CameraStatus
set_exposure (CameraControl &control, const CameraSettings &settings)
{
  if (settings.exposure_mode == AutoMode::kUnchanged)
    return {};
  ArvCamera *camera = control.camera ();
  const bool automatic = settings.exposure_mode == AutoMode::kAuto;
  GError *error = nullptr;
  if (arv_camera_is_exposure_auto_available (camera, nullptr))
    arv_camera_set_exposure_time_auto (
        camera, automatic ? ARV_AUTO_CONTINUOUS : ARV_AUTO_OFF, &error);
  else if (automatic)
    return control.refuse (CameraFault::kBadSetting, "has no automatic exposure");
  CameraStatus status = control.status ("automatic exposure", error);
  if (!status.ok () || automatic || !settings.exposure_us)
    return status;
  double low = 0, high = 0;
  const std::string what = "exposure of " + number_text (*settings.exposure_us) + " us";
  arv_camera_get_exposure_time_bounds (camera, &low, &high, &error);
  if (!error && low < high && (*settings.exposure_us < low || *settings.exposure_us > high))
    return control.refuse (CameraFault::kBadSetting,
        what + ": the camera accepts " + number_text (low) + " to " + number_text (high) + " us");
  forget (error);
  arv_camera_set_exposure_time (camera, *settings.exposure_us, &error);
  return control.status (what, error);
}

static CameraStatus
set_gain (CameraControl &control, const CameraSettings &settings)
{
  if (settings.gain_mode == AutoMode::kUnchanged)
    return {};
  ArvCamera *camera = control.camera ();
  const bool automatic = settings.gain_mode == AutoMode::kAuto;
  GError *error = nullptr;
  if (arv_camera_is_gain_auto_available (camera, nullptr))
    arv_camera_set_gain_auto (camera, automatic ? ARV_AUTO_CONTINUOUS : ARV_AUTO_OFF, &error);
  else if (automatic)
    return control.refuse (CameraFault::kBadSetting, "has no automatic gain");
  CameraStatus status = control.status ("automatic gain", error);
  if (!status.ok () || automatic || !settings.gain)
    return status;
  double low = 0, high = 0;
  const std::string what = "gain of " + number_text (*settings.gain);
  arv_camera_get_gain_bounds (camera, &low, &high, &error);
  if (!error && low < high && (*settings.gain < low || *settings.gain > high))
    return control.refuse (CameraFault::kBadSetting,
        what + ": the camera accepts " + number_text (low) + " to " + number_text (high));
  forget (error);
  arv_camera_set_gain (camera, *settings.gain, &error);
  return control.status (what, error);
}

static CameraStatus
set_white_balance (CameraControl &control, AutoMode mode)
{
  if (mode == AutoMode::kUnchanged)
    return {};
  if (!control.has ("BalanceWhiteAuto"))
    return mode == AutoMode::kManual
               ? CameraStatus ()
               : control.refuse (CameraFault::kBadSetting, "has no automatic white balance");
  return control.assign ("BalanceWhiteAuto", mode == AutoMode::kAuto ? "Continuous" : "Off");
}

static CameraStatus
set_frame_rate (CameraControl &control, const CameraSettings &settings)
{
  const bool own_pace = settings.trigger == TriggerMode::kFreeRun ||
                        (settings.trigger == TriggerMode::kHardware && settings.line.master);
  if (settings.frame_rate <= 0 || !own_pace)
    return {};
  ArvCamera *camera = control.camera ();
  const std::string what = "frame rate of " + number_text (settings.frame_rate);
  if (!arv_camera_is_frame_rate_available (camera, nullptr))
    return control.refuse (CameraFault::kBadSetting, what + ": its frame rate cannot be set");
  GError *error = nullptr;
  arv_camera_set_frame_rate (camera, settings.frame_rate, &error);
  CameraStatus status = control.status (what, error);
  double low = 0, high = 0;
  if (!status.ok () && status.fault () != CameraFault::kBadSetting)
    return status;
  arv_camera_get_frame_rate_bounds (camera, &low, &high, &error);
  const bool known = !error && low < high;
  forget (error);
  if (known && (settings.frame_rate < low * 0.999 || settings.frame_rate > high * 1.001))
    return control.refuse (
        CameraFault::kBadSetting, what + ": the camera accepts " + number_text (low) + " to " +
                                      number_text (high) + " at this size and exposure");
  return status;
}

CameraStatus
set_imaging (CameraControl &control, const CameraSettings &settings, double &frame_rate)
{
  const auto guard = control.lock ();
  /* A long exposure limits the rate, and a high rate the exposure, of some cameras: whichever is
   * refused first is tried again after the other. */
  CameraStatus rate = set_frame_rate (control, settings);
  CameraStatus status = set_exposure (control, settings);
  if (!rate.ok () && status.ok ())
    rate = set_frame_rate (control, settings);
  if (status.ok ())
    status = rate;
  if (status.ok ())
    status = set_gain (control, settings);
  if (status.ok ())
    status = set_white_balance (control, settings.white_balance_mode);
  const bool triggered = settings.trigger != TriggerMode::kFreeRun &&
                         !(settings.trigger == TriggerMode::kHardware && settings.line.master);
  frame_rate = 0;
  if (status.ok () && !triggered && arv_camera_is_frame_rate_available (control.camera (), nullptr))
    frame_rate = std::max (0.0, arv_camera_get_frame_rate (control.camera (), nullptr));
  return status;
}

/* Transport and the rest */

CameraStatus
set_transport (CameraControl &control, const CameraSettings &settings)
{
  ArvCamera *camera = control.camera ();
  const auto guard = control.lock ();
  if (!arv_camera_is_gv_device (camera))
    return {};
  GError *error = nullptr;
  arv_camera_gv_set_stream_options (camera, settings.packet_socket
                                                ? ARV_GV_STREAM_OPTION_NONE
                                                : ARV_GV_STREAM_OPTION_PACKET_SOCKET_DISABLED);
  arv_camera_gv_set_packet_size_adjustment (camera, settings.packet_size == 0
                                                        ? ARV_GV_PACKET_SIZE_ADJUSTMENT_ONCE
                                                        : ARV_GV_PACKET_SIZE_ADJUSTMENT_NEVER);
  if (settings.packet_size > 0) {
    const std::string what = "packet size of " + std::to_string (settings.packet_size) + " bytes";
    if (settings.packet_size < kGigEMinimumPacket || settings.packet_size > 16384)
      return control.refuse (
          CameraFault::kBadSetting, what + ": GigE Vision allows 576 to 16384 bytes");
    arv_camera_gv_set_packet_size (camera, settings.packet_size, &error);
    CameraStatus status = control.status (what, error);
    if (!status.ok ())
      return status;
  }
  if (settings.packet_delay_ns >= 0)
    arv_camera_gv_set_packet_delay (camera, settings.packet_delay_ns, &error);
  return control.status (
      "delay of " + std::to_string (settings.packet_delay_ns) + " ns between packets", error);
}

CameraStatus
set_features (CameraControl &control, const std::string &features)
{
  std::vector<CameraFeature> list;
  CameraStatus status = parse_camera_features (features, list);
  for (const CameraFeature &feature : list)
    if (status.ok ())
      status = feature.command ? control.execute (feature.name)
                               : control.assign (feature.name, feature.value);
  return status;
}

/* The leader's parameters, and the followers' */

static constexpr const char *kBalanceColours[] = {"Red", "Green", "Blue"};

static std::optional<double> &
balance_of (ImagingParameters &parameters, int colour)
{
  return colour == 0   ? parameters.white_balance_red
         : colour == 1 ? parameters.white_balance_green
                       : parameters.white_balance_blue;
}

static const char *
balance_feature (CameraControl &control)
{
  if (!control.has ("BalanceRatioSelector"))
    return nullptr;
  return control.has ("BalanceRatio")      ? "BalanceRatio"
         : control.has ("BalanceRatioAbs") ? "BalanceRatioAbs"
                                           : nullptr;
}

CameraStatus
read_imaging (CameraControl &control, ImagingParameters &parameters)
{
  parameters = {};
  ArvCamera *camera = control.camera ();
  GError *error = nullptr;
  { /* one feature at a time: triggers wait for the lock */
    const auto guard = control.lock ();
    if (arv_camera_is_exposure_time_available (camera, nullptr))
      parameters.exposure_us = arv_camera_get_exposure_time (camera, &error);
  }
  CameraStatus status = control.status ("exposure", error, CameraFault::kFailed);
  error = nullptr;
  if (status.ok ()) {
    const auto guard = control.lock ();
    if (arv_camera_is_gain_available (camera, nullptr))
      parameters.gain = arv_camera_get_gain (camera, &error);
  }
  if (status.ok ())
    status = control.status ("gain", error, CameraFault::kFailed);
  const char *ratio = status.ok () ? balance_feature (control) : nullptr;
  for (int colour = 0; ratio && colour < 3; colour++) {
    double value = 0;
    if (control.has_entry ("BalanceRatioSelector", kBalanceColours[colour]) &&
        control.assign ("BalanceRatioSelector", kBalanceColours[colour]).ok () &&
        control.read (ratio, value))
      balance_of (parameters, colour) = value;
  }
  return status;
}

static bool
differs (const std::optional<double> &wanted, const std::optional<double> &written)
{
  if (!wanted)
    return false;
  return !written || std::abs (*wanted - *written) > 1e-3 * std::abs (*written) + 1e-9;
}

static double
within (double value, double low, double high)
{
  return low < high ? std::clamp (value, low, high) : value;
}

CameraStatus
write_imaging (
    CameraControl &control, const ImagingParameters &parameters, ImagingParameters &written)
{
  ArvCamera *camera = control.camera ();
  double low = 0, high = 0;
  GError *error = nullptr;
  CameraStatus status;
  if (differs (parameters.exposure_us, written.exposure_us)) {
    const auto guard = control.lock (); /* one feature at a time: triggers wait for it */
    arv_camera_get_exposure_time_bounds (camera, &low, &high, nullptr);
    arv_camera_set_exposure_time (camera, within (*parameters.exposure_us, low, high), &error);
    status = control.status ("exposure", error, CameraFault::kBadSetting);
    if (!status.ok ())
      return status;
    written.exposure_us = parameters.exposure_us;
  }
  if (differs (parameters.gain, written.gain)) {
    const auto guard = control.lock ();
    low = high = 0;
    arv_camera_get_gain_bounds (camera, &low, &high, nullptr);
    arv_camera_set_gain (camera, within (*parameters.gain, low, high), &error);
    status = control.status ("gain", error, CameraFault::kBadSetting);
    if (!status.ok ())
      return status;
    written.gain = parameters.gain;
  }
  const char *ratio = balance_feature (control);
  for (int colour = 0; ratio && colour < 3; colour++) {
    ImagingParameters wanted = parameters;
    if (!differs (balance_of (wanted, colour), balance_of (written, colour)))
      continue;
    status = control.assign ("BalanceRatioSelector", kBalanceColours[colour]);
    if (status.ok ())
      status = control.assign (ratio, number_text (*balance_of (wanted, colour)));
    if (!status.ok ())
      return status;
    balance_of (written, colour) = balance_of (wanted, colour);
  }
  return status;
}
