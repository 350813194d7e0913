/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The order matters: pixel format before region (bytes per pixel limit the width of some cameras),
 * trigger before frame rate (which is locked while triggered), features last. */
#include "setup.hpp"

#include <algorithm>
#include <cmath>

#include "features.hpp"
#include "format.hpp"

namespace {

/* Cameras decide how much memory is allocated, within this. */
constexpr std::uint64_t kMaxImageBytes = 512 << 20;
constexpr int kMaxSide = 65535;     /* pixels */
constexpr int kMinGigEPacket = 576; /* bytes; GigE Vision */
constexpr int kMaxGigEPacket = 16384;

void
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
    *side = std::clamp (*side, 0, kMaxSide);
  double min_frame_rate = 0;
  if (arv_camera_is_frame_rate_available (camera, nullptr))
    arv_camera_get_frame_rate_bounds (camera, &min_frame_rate, &abilities.max_frame_rate, nullptr);
}

} // namespace

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
  return {};
}

/* ---- image ---- */

namespace {

CameraStatus
choose_pixel_format (CameraControl &control, const std::string &wanted, std::string &name)
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
        "none of the camera's pixel formats is supported: it has " + joined (all) +
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
    return control.refuse (CameraFault::kBadSetting,
        "the camera has no pixel format " + name + "; it has " + joined (all));
  name = *found; /* as this camera writes it */
  return {};
}

/* One side of the region. Steps and limits are checked here because cameras round silently. */
CameraStatus
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

CameraStatus
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
  if (settings.x < 0) /* near the middle, in the steps of the camera */
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

} // namespace

CameraStatus
set_image (CameraControl &control, const CameraSettings &settings)
{
  std::string name;
  CameraStatus status = choose_pixel_format (control, settings.pixel_format, name);
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
    return control.refuse (CameraFault::kFailed, "the camera does not report its pixel format");
  const PixelFormat *pixel = find_pixel_format (format.pixel_format);
  if (!pixel || format.width < 1 || format.height < 1 || format.width > kMaxSide ||
      format.height > kMaxSide)
    return control.refuse (CameraFault::kUnsupported,
        "images of " + std::to_string (format.width) + "x" + std::to_string (format.height) + " " +
            format.pixel_format + " are not supported");
  format.video_format = pixel->video_format;
  format.bayer = pixel->bayer;
  if (std::uint64_t (format.width) * format.height * pixel->bytes > kMaxImageBytes)
    return control.refuse (CameraFault::kUnsupported,
        "images of " + std::to_string (format.width) + "x" + std::to_string (format.height) +
            " are too large: expected at most " + std::to_string (kMaxImageBytes) + " bytes");
  format.stride = format.width * pixel->bytes;
  return {};
}

/* ---- trigger ---- */

namespace {

CameraStatus
enable_trigger (CameraControl &control, const std::string &source)
{
  const std::vector<std::string> sources = control.entries ("TriggerSource");
  if (std::find (sources.begin (), sources.end (), source) == sources.end ())
    return control.refuse (
        CameraFault::kBadSetting, "the camera has no trigger source " + source + "; it has " +
                                      (sources.empty () ? "none at all" : joined (sources)));
  CameraStatus status = control.assign_if_there ({"AcquisitionFrameRateEnable"}, "false");
  if (status.ok ())
    status = control.assign_if_there ({"TriggerSelector"},
        control.has_entry ("TriggerSelector", "FrameStart") ? "FrameStart" : "AcquisitionStart");
  if (status.ok ())
    status = control.assign_all ({{"TriggerSource", source}, {"TriggerMode", "On"}});
  return status;
}

CameraStatus
output_exposure (CameraControl &control, const LineTrigger &line)
{
  if (!control.has ("LineSelector") || !control.has ("LineSource"))
    return control.refuse (CameraFault::kBadSetting,
        "the camera cannot be the master of a line trigger: it has no "
        "feature LineSelector or LineSource");
  CameraStatus status = control.assign ("LineSelector", line.output_line);
  if (status.ok ())
    status = control.assign_if_there ({"LineMode"}, "Output");
  if (status.ok ())
    status = control.assign ("LineSource", "ExposureActive");
  return status;
}

CameraStatus
enable_actions (CameraControl &control, const ActionTrigger &action)
{
  const std::vector<std::string> sources = control.entries ("TriggerSource");
  const auto source = std::ranges::find_if (
      sources, [] (const std::string &entry) { return entry.starts_with ("Action"); });
  if (source == sources.end ())
    return control.refuse (
        CameraFault::kBadSetting, "the camera does not support action commands: none of its "
                                  "trigger sources begins with Action; it has " +
                                      joined (sources));
  /* "Action1" is selected by its number, 0 or 1 for the first */
  const std::string number = source->substr (std::string_view ("Action").size ());
  CameraStatus status = control.assign_if_there ({"ActionSelector"}, number);
  if (status.ok ())
    status = control.assign_all ({{"ActionDeviceKey", std::to_string (action.device_key)},
        {"ActionGroupKey", std::to_string (action.group_key)},
        {"ActionGroupMask", std::to_string (action.group_mask)}});
  if (status.ok () && action.ptp && !control.has ("PtpEnable") && !control.has ("GevIEEE1588"))
    return control.refuse (CameraFault::kBadSetting,
        "the camera does not support IEEE 1588, which scheduled action commands require");
  if (status.ok () && action.ptp)
    status = control.assign_if_there ({"PtpEnable", "GevIEEE1588"}, "true");
  return status.ok () ? enable_trigger (control, *source) : status;
}

} // namespace

CameraStatus
set_trigger (CameraControl &control, const CameraSettings &settings)
{
  const auto guard = control.lock ();
  GError *error = nullptr;
  arv_camera_clear_triggers (control.camera (), &error);
  if (error && fault_of (error, CameraFault::kNone) != CameraFault::kNone)
    return control.status ("trigger off", error);
  g_clear_error (&error); /* a camera without triggers */
  arv_camera_set_acquisition_mode (control.camera (), ARV_ACQUISITION_MODE_CONTINUOUS, &error);
  CameraStatus status = control.status ("continuous acquisition", error);
  if (!status.ok ())
    return status;
  switch (settings.trigger) {
    case TriggerMode::kFreeRun:
      return {};
    case TriggerMode::kSoftware:
      return enable_trigger (control, "Software");
    case TriggerMode::kAction:
      return enable_actions (control, settings.action);
    case TriggerMode::kHardware:
      break;
  }
  if (settings.line.master)
    return output_exposure (control, settings.line);
  status = enable_trigger (control, settings.line.source);
  if (status.ok ())
    status = control.assign_if_there ({"TriggerActivation"}, "RisingEdge");
  return status;
}

/* ---- imaging parameters ---- */

namespace {

/* A value that cameras can adjust by themselves. ArvCamera knows under which of several names a
 * camera has it. */
struct AdjustableValue {
  const char *name, *unit;
  gboolean (*is_auto_available) (ArvCamera *, GError **);
  void (*set_auto) (ArvCamera *, ArvAuto, GError **);
  gboolean (*is_available) (ArvCamera *, GError **);
  double (*get) (ArvCamera *, GError **);
  void (*get_bounds) (ArvCamera *, double *, double *, GError **);
  void (*set) (ArvCamera *, double, GError **);
};
constexpr AdjustableValue kExposure = {"exposure", " us", arv_camera_is_exposure_auto_available,
    arv_camera_set_exposure_time_auto, arv_camera_is_exposure_time_available,
    arv_camera_get_exposure_time, arv_camera_get_exposure_time_bounds,
    arv_camera_set_exposure_time};
constexpr AdjustableValue kGain = {"gain", "", arv_camera_is_gain_auto_available,
    arv_camera_set_gain_auto, arv_camera_is_gain_available, arv_camera_get_gain,
    arv_camera_get_gain_bounds, arv_camera_set_gain};

CameraStatus
set_value (CameraControl &control, const AdjustableValue &value, AutoMode mode,
    const std::optional<double> &wanted)
{
  if (mode == AutoMode::kUnchanged)
    return {};
  const std::string name = value.name;
  ArvCamera *camera = control.camera ();
  const bool automatic = mode == AutoMode::kAuto;
  GError *error = nullptr;
  if (value.is_auto_available (camera, nullptr))
    value.set_auto (camera, automatic ? ARV_AUTO_CONTINUOUS : ARV_AUTO_OFF, &error);
  else if (automatic)
    return control.refuse (CameraFault::kBadSetting, "the camera has no automatic " + name);
  CameraStatus status = control.status ("automatic " + name, error);
  if (!status.ok () || automatic || !wanted)
    return status;
  double low = 0, high = 0;
  const std::string what = name + " of " + number_text (*wanted) + value.unit;
  error = nullptr;
  value.get_bounds (camera, &low, &high, &error);
  if (!error && low < high && (*wanted < low || *wanted > high))
    return control.refuse (CameraFault::kBadSetting, what + ": the camera accepts " +
                                                         number_text (low) + " to " +
                                                         number_text (high) + value.unit);
  g_clear_error (&error); /* a camera without bounds */
  value.set (camera, *wanted, &error);
  return control.status (what, error);
}

CameraStatus
set_white_balance (CameraControl &control, AutoMode mode)
{
  if (mode == AutoMode::kUnchanged)
    return {};
  if (!control.has ("BalanceWhiteAuto"))
    return mode == AutoMode::kManual ? CameraStatus ()
                                     : control.refuse (CameraFault::kBadSetting,
                                           "the camera has no automatic white balance");
  return control.assign ("BalanceWhiteAuto", mode == AutoMode::kAuto ? "Continuous" : "Off");
}

/* Else its trigger sets the rate. */
bool
runs_freely (const CameraSettings &settings)
{
  return settings.trigger == TriggerMode::kFreeRun ||
         (settings.trigger == TriggerMode::kHardware && settings.line.master);
}

CameraStatus
set_frame_rate (CameraControl &control, const CameraSettings &settings)
{
  if (settings.frame_rate <= 0 || !runs_freely (settings))
    return {};
  ArvCamera *camera = control.camera ();
  const std::string what = "frame rate of " + number_text (settings.frame_rate);
  if (!arv_camera_is_frame_rate_available (camera, nullptr))
    return control.refuse (
        CameraFault::kBadSetting, what + ": the camera's frame rate cannot be set");
  GError *error = nullptr;
  arv_camera_set_frame_rate (camera, settings.frame_rate, &error);
  CameraStatus status = control.status (what, error);
  if (!status.ok () && status.fault () != CameraFault::kBadSetting)
    return status;
  double low = 0, high = 0;
  error = nullptr;
  arv_camera_get_frame_rate_bounds (camera, &low, &high, &error);
  const bool known = !error && low < high;
  g_clear_error (&error);
  if (known && (settings.frame_rate < low * 0.999 || settings.frame_rate > high * 1.001))
    return control.refuse (
        CameraFault::kBadSetting, what + ": the camera accepts " + number_text (low) + " to " +
                                      number_text (high) + " at this size and exposure");
  return status;
}

} // namespace

CameraStatus
set_imaging (CameraControl &control, const CameraSettings &settings, double &frame_rate)
{
  const auto guard = control.lock ();
  /* A long exposure limits the rate of some cameras, and a high rate the exposure: a rate that is
   * refused is tried again after the exposure. */
  CameraStatus rate = set_frame_rate (control, settings);
  CameraStatus status =
      set_value (control, kExposure, settings.exposure_mode, settings.exposure_us);
  if (!rate.ok () && status.ok ())
    rate = set_frame_rate (control, settings);
  if (status.ok ())
    status = rate;
  if (status.ok ())
    status = set_value (control, kGain, settings.gain_mode, settings.gain);
  if (status.ok ())
    status = set_white_balance (control, settings.white_balance_mode);
  frame_rate = 0;
  if (status.ok () && runs_freely (settings) &&
      arv_camera_is_frame_rate_available (control.camera (), nullptr))
    frame_rate = std::max (0.0, arv_camera_get_frame_rate (control.camera (), nullptr));
  return status;
}

/* ---- transport and other features ---- */

CameraStatus
set_transport (CameraControl &control, const CameraSettings &settings)
{
  ArvCamera *camera = control.camera ();
  const auto guard = control.lock ();
  if (!arv_camera_is_gv_device (camera))
    return {};
  GError *error = nullptr;
  /* a memory-mapped packet socket costs less CPU time, but images arrive later */
  arv_camera_gv_set_stream_options (camera, ARV_GV_STREAM_OPTION_PACKET_SOCKET_DISABLED);
  arv_camera_gv_set_packet_size_adjustment (camera, settings.packet_size == 0
                                                        ? ARV_GV_PACKET_SIZE_ADJUSTMENT_ONCE
                                                        : ARV_GV_PACKET_SIZE_ADJUSTMENT_NEVER);
  if (settings.packet_size > 0) {
    const std::string what = "packet size of " + std::to_string (settings.packet_size) + " bytes";
    if (settings.packet_size < kMinGigEPacket || settings.packet_size > kMaxGigEPacket)
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

/* ---- imaging parameters while streaming: one feature at a time, since triggers wait for the
 * control's lock ---- */

namespace {

constexpr const char *kBalanceColours[] = {"Red", "Green", "Blue"};

/* Null: the camera has none. */
const char *
balance_feature (CameraControl &control)
{
  if (!control.has ("BalanceRatioSelector"))
    return nullptr;
  return control.has ("BalanceRatio")      ? "BalanceRatio"
         : control.has ("BalanceRatioAbs") ? "BalanceRatioAbs"
                                           : nullptr;
}

CameraStatus
read_value (CameraControl &control, const AdjustableValue &value, std::optional<double> &current)
{
  const auto guard = control.lock ();
  GError *error = nullptr;
  if (value.is_available (control.camera (), nullptr))
    current = value.get (control.camera (), &error);
  return control.status (value.name, error, CameraFault::kFailed);
}

bool
differs (const std::optional<double> &wanted, const std::optional<double> &written)
{
  return wanted && (!written || std::abs (*wanted - *written) > 1e-3 * std::abs (*written) + 1e-9);
}

CameraStatus
write_value (CameraControl &control, const AdjustableValue &value,
    const std::optional<double> &wanted, std::optional<double> &written)
{
  if (!differs (wanted, written))
    return {};
  const auto guard = control.lock ();
  double low = 0, high = 0;
  GError *error = nullptr;
  value.get_bounds (control.camera (), &low, &high, nullptr);
  value.set (control.camera (), low < high ? std::clamp (*wanted, low, high) : *wanted, &error);
  CameraStatus status = control.status (value.name, error);
  if (status.ok ())
    written = wanted;
  return status;
}

} // namespace

CameraStatus
read_imaging (CameraControl &control, ImagingParameters &parameters)
{
  parameters = {};
  CameraStatus status = read_value (control, kExposure, parameters.exposure_us);
  if (status.ok ())
    status = read_value (control, kGain, parameters.gain);
  const char *ratio = status.ok () ? balance_feature (control) : nullptr;
  for (int colour = 0; ratio && colour < 3; colour++) {
    double value = 0;
    if (control.has_entry ("BalanceRatioSelector", kBalanceColours[colour]) &&
        control.assign ("BalanceRatioSelector", kBalanceColours[colour]).ok () &&
        control.read (ratio, value))
      parameters.white_balance[colour] = value;
  }
  return status;
}

CameraStatus
write_imaging (
    CameraControl &control, const ImagingParameters &parameters, ImagingParameters &written)
{
  CameraStatus status =
      write_value (control, kExposure, parameters.exposure_us, written.exposure_us);
  if (status.ok ())
    status = write_value (control, kGain, parameters.gain, written.gain);
  const char *ratio = status.ok () ? balance_feature (control) : nullptr;
  for (int colour = 0; ratio && colour < 3 && status.ok (); colour++) {
    const auto &wanted = parameters.white_balance[colour];
    if (!differs (wanted, written.white_balance[colour]))
      continue;
    status = control.assign_all (
        {{"BalanceRatioSelector", kBalanceColours[colour]}, {ratio, number_text (*wanted)}});
    if (status.ok ())
      written.white_balance[colour] = wanted;
  }
  return status;
}
