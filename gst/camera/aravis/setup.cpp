/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The order matters: pixel format before region (bytes per pixel limit the width of some cameras),
 * trigger before frame rate (which is locked while triggered), features last. */
#include "setup.hpp"

#include <algorithm>
#include <cmath>

namespace {

/* Cameras decide how much memory is allocated, within this. */
constexpr std::uint64_t kMaxImageBytes = 512 << 20;
constexpr int kMaxSide = 65535;     /* pixels */
constexpr int kMinGigEPacket = 576; /* bytes; GigE Vision */
constexpr int kMaxGigEPacket = 16384;

/* A supported pixel format. */
struct PixelFormat {
  ArvPixelFormat code;         ///< GenICam's number
  const char *name;            ///< GenICam's name
  GstVideoFormat video_format; ///< UNKNOWN: Bayer
  const char *bayer;           ///< format of video/x-bayer
  int bytes;                   ///< per pixel
};
const PixelFormat kFormats[] = {
    {ARV_PIXEL_FORMAT_MONO_8, "Mono8", GST_VIDEO_FORMAT_GRAY8, "", 1},
    {ARV_PIXEL_FORMAT_RGB_8_PACKED, "RGB8", GST_VIDEO_FORMAT_RGB, "", 3},
    {ARV_PIXEL_FORMAT_BGR_8_PACKED, "BGR8", GST_VIDEO_FORMAT_BGR, "", 3},
    {ARV_PIXEL_FORMAT_BAYER_RG_8, "BayerRG8", GST_VIDEO_FORMAT_UNKNOWN, "rggb", 1},
    {ARV_PIXEL_FORMAT_BAYER_BG_8, "BayerBG8", GST_VIDEO_FORMAT_UNKNOWN, "bggr", 1},
    {ARV_PIXEL_FORMAT_BAYER_GB_8, "BayerGB8", GST_VIDEO_FORMAT_UNKNOWN, "gbrg", 1},
    {ARV_PIXEL_FORMAT_BAYER_GR_8, "BayerGR8", GST_VIDEO_FORMAT_UNKNOWN, "grbg", 1},
};

/* By GenICam's name ("RGB8Packed", as older cameras say, is "RGB8"); null: not supported. */
const PixelFormat *
find_pixel_format (const std::string &name)
{
  const std::string plain = name.ends_with ("8Packed") ? name.substr (0, name.size () - 6) : name;
  const auto *found = std::ranges::find (kFormats, plain, &PixelFormat::name);
  return found == std::end (kFormats) ? nullptr : found;
}

GstCaps *
caps_of (const PixelFormat &format)
{
  const bool bayer = format.video_format == GST_VIDEO_FORMAT_UNKNOWN;
  return gst_caps_new_simple (bayer ? "video/x-bayer" : "video/x-raw", "format", G_TYPE_STRING,
      bayer ? format.bayer : gst_video_format_to_string (format.video_format), "width",
      GST_TYPE_INT_RANGE, 1, G_MAXINT, "height", GST_TYPE_INT_RANGE, 1, G_MAXINT, "framerate",
      GST_TYPE_FRACTION_RANGE, 0, 1, G_MAXINT, 1, nullptr);
}

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
  double whole = 0; /* with binning, less than the sensor has */
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

GstCaps *
camera_caps (const std::string &name)
{
  GstCaps *caps = gst_caps_new_empty ();
  for (const PixelFormat &format : kFormats)
    if (name.empty () || &format == find_pixel_format (name))
      gst_caps_append (caps, caps_of (format));
  return caps;
}

std::string
pixel_format_for_caps (const GstCaps *caps, const std::vector<std::string> &has)
{
  for (const std::string &name : has) {
    const PixelFormat *format = find_pixel_format (name);
    if (!format)
      continue;
    GstCaps *mine = caps_of (*format);
    const bool fits = gst_caps_can_intersect (mine, caps);
    gst_caps_unref (mine);
    if (fits)
      return name;
  }
  return "";
}

/* ---- abilities ---- */

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

/* Cameras round silently, so the region is read again. */
CameraStatus
set_region (CameraControl &control, const CameraSettings &settings)
{
  CameraAbilities a;
  const auto guard = control.lock ();
  ArvCamera *camera = control.camera ();
  read_sizes (control, a);
  /* near the middle, in the steps of the camera */
  int x = std::max (a.max_width - settings.width, 0) / 2;
  int y = std::max (a.max_height - settings.height, 0) / 2;
  x -= x % std::max (1, arv_camera_get_x_offset_increment (camera, nullptr));
  y -= y % std::max (1, arv_camera_get_y_offset_increment (camera, nullptr));
  const auto text = [] (int left, int top, int width, int height) {
    return std::to_string (width) + "x" + std::to_string (height) + " at " + std::to_string (left) +
           "," + std::to_string (top);
  };
  const std::string what = "region of " + text (x, y, settings.width, settings.height),
                    sensor = std::to_string (a.max_width) + "x" + std::to_string (a.max_height);
  if (x + settings.width > a.max_width || y + settings.height > a.max_height)
    return control.refuse (CameraFault::kBadSetting, what + ": the sensor has " + sensor);
  GError *error = nullptr;
  gint got_x = 0, got_y = 0, width = 0, height = 0;
  arv_camera_set_region (camera, x, y, settings.width, settings.height, &error);
  if (!error)
    arv_camera_get_region (camera, &got_x, &got_y, &width, &height, &error);
  CameraStatus status = control.status (what, error);
  const std::string got = text (got_x, got_y, width, height);
  if (status.ok () && what != "region of " + got)
    return control.refuse (
        CameraFault::kBadSetting, what + ": the camera made it " + got + " of " + sensor);
  return status;
}

} // namespace

CameraStatus
set_image (CameraControl &control, const CameraSettings &settings, CameraFormat &format)
{
  const PixelFormat *pixel = find_pixel_format (settings.pixel_format);
  const std::string size = std::to_string (settings.width) + "x" + std::to_string (settings.height);
  if (!pixel)
    return control.refuse (
        CameraFault::kUnsupported, "pixel format " + settings.pixel_format + " is not supported");
  if (settings.width < 1 || settings.height < 1 ||
      std::uint64_t (settings.width) * settings.height > kMaxImageBytes / pixel->bytes)
    return control.refuse (CameraFault::kUnsupported, "images of " + size + " have more than " +
                                                          std::to_string (kMaxImageBytes) +
                                                          " bytes, or none");
  format = {.code = pixel->code,
      .video_format = pixel->video_format,
      .width = settings.width,
      .height = settings.height,
      .stride = settings.width * pixel->bytes};
  CameraStatus status = control.assign ("PixelFormat", settings.pixel_format);
  return status.ok () ? set_region (control, settings) : status;
}

/* ---- trigger ---- */

namespace {

CameraStatus
enable_trigger (CameraControl &control, const std::string &source)
{
  const std::vector<std::string> selectors = control.entries ("TriggerSelector");
  const bool frame_start = std::ranges::find (selectors, "FrameStart") != selectors.end ();
  CameraStatus status = control.assign_if_there ("AcquisitionFrameRateEnable", "false");
  if (status.ok ())
    status = control.assign_if_there (
        "TriggerSelector", frame_start ? "FrameStart" : "AcquisitionStart");
  if (status.ok ())
    status = control.assign_all ({{"TriggerSource", source}, {"TriggerMode", "On"}});
  return status;
}

CameraStatus
output_exposure (CameraControl &control, const std::string &line)
{
  CameraStatus status = control.assign ("LineSelector", line);
  if (status.ok ())
    status = control.assign_if_there ("LineMode", "Output");
  if (status.ok ())
    status = control.assign ("LineSource", "ExposureActive");
  return status;
}

CameraStatus
enable_actions (CameraControl &control, std::uint32_t key)
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
  CameraStatus status = control.assign_if_there ("ActionSelector", number);
  if (status.ok ())
    status = control.assign_all ({{"ActionDeviceKey", std::to_string (key)},
        {"ActionGroupKey", "1"}, {"ActionGroupMask", "1"}});
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
      return enable_actions (control, settings.action_key);
    case TriggerMode::kHardware:
      break;
  }
  if (!settings.output_line.empty ())
    return output_exposure (control, settings.output_line);
  status = enable_trigger (control, settings.trigger_line);
  if (status.ok ())
    status = control.assign_if_there ("TriggerActivation", "RisingEdge");
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
  error = nullptr;
  value.set (camera, *wanted, &error);
  return control.status (name + " of " + number_text (*wanted) + value.unit, error);
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
         (settings.trigger == TriggerMode::kHardware && !settings.output_line.empty ());
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
  double low = 0, high = 0;
  GError *error = nullptr;
  arv_camera_set_frame_rate (camera, settings.frame_rate, &error); /* clamps */
  if (!error)
    arv_camera_get_frame_rate_bounds (camera, &low, &high, &error);
  CameraStatus status = control.status (what, error);
  if (status.ok () && low < high &&
      (settings.frame_rate < low * 0.999 || settings.frame_rate > high * 1.001))
    return control.refuse (
        CameraFault::kBadSetting, what + ": the camera accepts " + number_text (low) + " to " +
                                      number_text (high) + " at this size and exposure");
  return status;
}

} // namespace

CameraStatus
set_imaging (CameraControl &control, const CameraSettings &settings)
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
  return status;
}

/* ---- transport ---- */

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
    if (control.assign ("BalanceRatioSelector", kBalanceColours[colour]).ok () &&
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

/* ---- clock ---- */

namespace {

/* Bootstrap registers of GigE Vision, which every camera has. The latch holds the clock for
 * reading.
 */
constexpr guint64 kTimestampControl = 0x0944, kTimestampHigh = 0x0948, kTimestampLow = 0x094c;
constexpr guint32 kTimestampLatch = 2;

std::uint64_t
ticks_to_ns (std::uint64_t ticks, std::uint64_t frequency)
{
  constexpr std::uint64_t kSecond = 1'000'000'000;
  if (frequency == 0)
    return 0;
  return ticks / frequency * kSecond +
         gst_util_uint64_scale (ticks % frequency, kSecond, frequency);
}

} // namespace

/* Registers need no lock, unlike features. */
static CameraStatus
read_gige_clock (CameraControl &control, std::uint64_t &time_ns, std::int64_t &read_at_us)
{
  ArvDevice *device = control.device ();
  GError *error = nullptr;
  guint32 high = 0, low = 0;
  const guint64 frequency =
      arv_gv_device_get_timestamp_tick_frequency (ARV_GV_DEVICE (device), &error);
  const std::int64_t before = g_get_monotonic_time ();
  if (!error)
    arv_device_write_register (device, kTimestampControl, kTimestampLatch, &error);
  read_at_us = (before + g_get_monotonic_time ()) / 2;
  if (!error)
    arv_device_read_register (device, kTimestampHigh, &high, &error);
  if (!error)
    arv_device_read_register (device, kTimestampLow, &low, &error);
  if (!error)
    time_ns = ticks_to_ns (std::uint64_t (high) << 32 | low, frequency);
  return control.status ("its clock", error, CameraFault::kFailed);
}

static CameraStatus
read_usb_clock (CameraControl &control, std::uint64_t &time_ns, std::int64_t &read_at_us)
{
  double ticks = 0; /* ns in USB3 Vision: those of a clock since 1970 are rounded to 256 */
  const std::int64_t before = g_get_monotonic_time ();
  CameraStatus status = control.execute ("TimestampLatch");
  read_at_us = (before + g_get_monotonic_time ()) / 2;
  if (status.ok () && !control.read ("TimestampLatchValue", ticks))
    return control.refuse (CameraFault::kFailed, "the camera has no feature 'TimestampLatchValue'");
  time_ns = static_cast<std::uint64_t> (std::clamp (ticks, 0., double (kMaxCameraTime_ns)));
  return status;
}

CameraStatus
read_clock (CameraControl &control, std::uint64_t &time_ns, std::int64_t &read_at_us)
{
  time_ns = 0;
  CameraStatus status = ARV_IS_GV_DEVICE (control.device ())
                            ? read_gige_clock (control, time_ns, read_at_us)
                            : read_usb_clock (control, time_ns, read_at_us);
  if (status.ok () && (time_ns == 0 || time_ns >= kMaxCameraTime_ns))
    return control.refuse (CameraFault::kFailed, "the camera has no readable clock");
  return status;
}
