/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "settings.hpp"

#include <rangecast/geometry/rig.hpp>

using rangecast::Status;
using rangecast::StatusCode;
using Settings = CamSourceSettings;

GType
gst_stereo_cam_src_trigger_get_type (void)
{
  static const GEnumValue values[] = {
      {gint (TriggerMode::kFreeRun),
          "Cameras run freely at their frame rate; the nearest frames are paired", "free-run"},
      {gint (TriggerMode::kSoftware),
          "Software trigger at multiples of the frame period on the pipeline clock", "software"},
      {gint (TriggerMode::kHardware), "Electrical signal on trigger-line", "hardware"},
      {gint (TriggerMode::kAction), "GigE Vision action commands to all cameras of a rig",
          "action"},
      {0, nullptr, nullptr},
  };
  static gsize type = 0;
  if (g_once_init_enter (&type))
    g_once_init_leave (&type, g_enum_register_static ("GstStereoCamSrcTrigger", values));
  return type;
}

/* ---- properties: tables ---- */

struct TextRow {
  const char *name, *nick, *blurb;
  std::string &(*field) (Settings &);
};
struct IntegerRow {
  const char *name, *nick, *blurb;
  int minimum, maximum;
  int &(*field) (Settings &);
};
struct UnsignedRow {
  const char *name, *nick, *blurb;
  guint &(*field) (Settings &);
};
struct SwitchRow {
  const char *name, *nick, *blurb;
  bool &(*field) (Settings &);
};

#define FIELD(type, member) [] (Settings &s) -> type & { return s.member; }

static const TextRow kTexts[] = {
    {"left", "Left camera", "Left camera: name, serial number, IP or MAC address, or Aravis id",
        FIELD (std::string, names[0])},
    {"right", "Right camera", "Right camera: name, serial number, IP or MAC address, or Aravis id",
        FIELD (std::string, names[1])},
    {"third", "Third camera", "Third camera: name, serial number, IP or MAC address, or Aravis id",
        FIELD (std::string, names[2])},
    {"rig", "Rig", "Rig file that names the cameras of the view, used if left and right are unset",
        FIELD (std::string, rig)},
    {"format", "Pixel format",
        "GenICam pixel format, such as Mono8 or BayerRG8 (unset = negotiated with downstream)",
        FIELD (std::string, format)},
    {"features", "Features",
        "GenICam features to set on all cameras after all other settings: \"Name=Value Name=Value "
        "Command ...\"",
        FIELD (std::string, features)},
    {"trigger-line", "Trigger line", "Input line of the cameras for trigger=hardware",
        FIELD (std::string, trigger_line)},
    {"output-line", "Output line",
        "Output line of the left camera for trigger=hardware; the left camera then runs freely and "
        "triggers the others (unset = external signal)",
        FIELD (std::string, output_line)},
    {"clock-server", "Clock server",
        "Network clock to provide to the pipeline: HOST:PORT of a GStreamer network clock, or "
        "ptp:DOMAIN",
        FIELD (std::string, clock_server)},
};

static const IntegerRow kIntegers[] = {
    {"view-id", "View ID", "View of the rig file that names the cameras", 0, 63,
        FIELD (int, view_id)},
    {"offset-x", "Offset x",
        "Left edge of the region of interest on the sensor in pixels (-1 = centred)", -1, 65535,
        FIELD (int, offset_x)},
    {"offset-y", "Offset y",
        "Top edge of the region of interest on the sensor in pixels (-1 = centred)", -1, 65535,
        FIELD (int, offset_y)},
    {"packet-size", "Packet size",
        "GigE Vision packet size in bytes, with headers (0 = largest that passes the network, -1 = "
        "leave unchanged)",
        -1, 65535, FIELD (int, packet_size)},
    {"buffers", "Buffers",
        "Number of buffers per camera, shared by the camera's stream and downstream", 2, 256,
        FIELD (int, n_buffers)},
    {"num-buffers", "num-buffers", "Number of image sets to output before EOS (-1 = unlimited)", -1,
        G_MAXINT, FIELD (int, num_buffers)},
};

static const UnsignedRow kUnsigneds[] = {
    {"action-device-key", "Action device key", "ActionDeviceKey of the cameras for trigger=action",
        FIELD (guint, action_device_key)},
    {"action-group-key", "Action group key", "ActionGroupKey of the cameras for trigger=action",
        FIELD (guint, action_group_key)},
    {"action-group-mask", "Action group mask", "ActionGroupMask of the cameras for trigger=action",
        FIELD (guint, action_group_mask)},
};

static const SwitchRow kSwitches[] = {
    {"auto-exposure", "Automatic exposure", "Automatic exposure time on the left camera",
        FIELD (bool, auto_exposure)},
    {"auto-gain", "Automatic gain", "Automatic gain on the left camera", FIELD (bool, auto_gain)},
    {"auto-white-balance", "Automatic white balance", "Automatic white balance on the left camera",
        FIELD (bool, auto_white_balance)},
    {"lock-exposure", "Lock exposure",
        "Copy the left camera's automatic settings to the other cameras (false = each camera "
        "adjusts itself)",
        FIELD (bool, lock_exposure)},
    {"packet-resend", "Packet resend", "Request retransmission of missing GigE Vision packets",
        FIELD (bool, packet_resend)},
    {"action-send", "Action send",
        "Send the action commands for trigger=action; exactly one element per rig does",
        FIELD (bool, action_send)},
    {"action-scheduled", "Action scheduled",
        "Send action commands ahead of time with the time to execute them; requires cameras and "
        "pipeline on one PTP clock",
        FIELD (bool, action_scheduled)},
    {"single-shot", "Single shot", "Capture only when the capture signal is emitted",
        FIELD (bool, single_shot)},
    {"reconnect", "Reconnect", "Reconnect to a lost camera and post a warning instead of an error",
        FIELD (bool, reconnect)},
};

enum : guint {
  PROP_TEXTS = 1,
  PROP_INTEGERS = PROP_TEXTS + G_N_ELEMENTS (kTexts),
  PROP_UNSIGNEDS = PROP_INTEGERS + G_N_ELEMENTS (kIntegers),
  PROP_SWITCHES = PROP_UNSIGNEDS + G_N_ELEMENTS (kUnsigneds),
  PROP_TRIGGER = PROP_SWITCHES + G_N_ELEMENTS (kSwitches),
  PROP_EXPOSURE,
  PROP_GAIN,
  PROP_PACKET_DELAY,
  PROP_FIRST_FREE,
};
const guint CamSourceSettings::kFirstFreeId = PROP_FIRST_FREE;

template <typename Row, std::size_t N>
static const Row *
find_row (const Row (&rows)[N], guint id, guint first)
{
  return id >= first && id < first + N ? &rows[id - first] : nullptr;
}

static constexpr auto kFlags =
    GParamFlags (G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_READY);

static void
install_numbers (GObjectClass *object_class)
{
  g_object_class_install_property (object_class, PROP_TRIGGER,
      g_param_spec_enum ("trigger", "Trigger", "What triggers the cameras",
          GST_TYPE_STEREO_CAM_SRC_TRIGGER, gint (Settings{}.trigger), kFlags));
  g_object_class_install_property (object_class, PROP_EXPOSURE,
      g_param_spec_double ("exposure", "Exposure",
          "Exposure time of all cameras in microseconds (0 = leave unchanged)", 0, 1e9, 0, kFlags));
  g_object_class_install_property (object_class, PROP_GAIN,
      g_param_spec_double ("gain", "Gain",
          "Gain of all cameras in their own unit, usually dB (-1 = leave unchanged)", -1, 1000, -1,
          kFlags));
  g_object_class_install_property (object_class, PROP_PACKET_DELAY,
      g_param_spec_int64 ("packet-delay", "Packet delay",
          "Delay between GigE Vision packets in nanoseconds (-1 = leave unchanged)", -1,
          G_GINT64_CONSTANT (1000000000), -1, kFlags));
}

void
CamSourceSettings::install (GObjectClass *object_class)
{
  Settings defaults;
  for (guint i = 0; const TextRow &row : kTexts) {
    const std::string &fallback = row.field (defaults);
    g_object_class_install_property (object_class, PROP_TEXTS + i++,
        g_param_spec_string (row.name, row.nick, row.blurb,
            fallback.empty () ? nullptr : fallback.c_str (), kFlags));
  }
  for (guint i = 0; const IntegerRow &row : kIntegers)
    g_object_class_install_property (object_class, PROP_INTEGERS + i++,
        g_param_spec_int (
            row.name, row.nick, row.blurb, row.minimum, row.maximum, row.field (defaults), kFlags));
  for (guint i = 0; const UnsignedRow &row : kUnsigneds)
    g_object_class_install_property (object_class, PROP_UNSIGNEDS + i++,
        g_param_spec_uint (
            row.name, row.nick, row.blurb, 0, G_MAXUINT, row.field (defaults), kFlags));
  for (guint i = 0; const SwitchRow &row : kSwitches)
    g_object_class_install_property (object_class, PROP_SWITCHES + i++,
        g_param_spec_boolean (row.name, row.nick, row.blurb, row.field (defaults), kFlags));
  install_numbers (object_class);
}

bool
CamSourceSettings::set (guint id, const GValue *value)
{
  if (const auto text = find_row (kTexts, id, PROP_TEXTS))
    text->field (*this) = g_value_get_string (value) ? g_value_get_string (value) : "";
  else if (const auto integer = find_row (kIntegers, id, PROP_INTEGERS))
    integer->field (*this) = g_value_get_int (value);
  else if (const auto number = find_row (kUnsigneds, id, PROP_UNSIGNEDS))
    number->field (*this) = g_value_get_uint (value);
  else if (const auto on = find_row (kSwitches, id, PROP_SWITCHES))
    on->field (*this) = g_value_get_boolean (value);
  else if (id == PROP_TRIGGER)
    trigger = TriggerMode (g_value_get_enum (value));
  else if (id == PROP_EXPOSURE)
    exposure_us = g_value_get_double (value);
  else if (id == PROP_GAIN)
    gain = g_value_get_double (value);
  else if (id == PROP_PACKET_DELAY)
    packet_delay_ns = g_value_get_int64 (value);
  else
    return false;
  return true;
}

bool
CamSourceSettings::get (guint id, GValue *value) const
{
  Settings copy = *this; /* fields are found in what may be written */
  if (const auto text = find_row (kTexts, id, PROP_TEXTS))
    g_value_set_string (value, text->field (copy).empty () ? nullptr : text->field (copy).c_str ());
  else if (const auto integer = find_row (kIntegers, id, PROP_INTEGERS))
    g_value_set_int (value, integer->field (copy));
  else if (const auto number = find_row (kUnsigneds, id, PROP_UNSIGNEDS))
    g_value_set_uint (value, number->field (copy));
  else if (const auto on = find_row (kSwitches, id, PROP_SWITCHES))
    g_value_set_boolean (value, on->field (copy));
  else if (id == PROP_TRIGGER)
    g_value_set_enum (value, gint (trigger));
  else if (id == PROP_EXPOSURE)
    g_value_set_double (value, exposure_us);
  else if (id == PROP_GAIN)
    g_value_set_double (value, gain);
  else if (id == PROP_PACKET_DELAY)
    g_value_set_int64 (value, packet_delay_ns);
  else
    return false;
  return true;
}

/* ---- the cameras ---- */

static Status
names_from_rig (const Settings &settings, CameraNames &found)
{
  rangecast::Rig rig;
  if (Status s = rangecast::load_rig (settings.rig, rig); !s.ok ())
    return s;
  const std::string which = settings.rig + ": view " + std::to_string (settings.view_id);
  const rangecast::View *view = rig.find (settings.view_id);
  if (!view)
    return {StatusCode::kNotFound,
        settings.rig + ": has no view with view-id " + std::to_string (settings.view_id)};
  found = {
      view->camera, view->right ? view->right->camera : "", view->third ? view->third->camera : ""};
  for (int i = 0; i < 2; i++)
    if (found[i].empty ())
      return {StatusCode::kNotFound, which + " does not name its " + (i ? "right" : "left") +
                                         " camera; expected the names of a stereo pair"};
  return {};
}

Status
CamSourceSettings::find_names (CameraNames &found) const
{
  found = names;
  if (names[0].empty () && names[1].empty () && !rig.empty ()) {
    CameraNames of_rig;
    if (Status s = names_from_rig (*this, of_rig); !s.ok ())
      return s;
    found = {of_rig[0], of_rig[1], names[2].empty () ? of_rig[2] : names[2]};
  }
  if (found[0].empty () != found[1].empty () && !rig.empty ())
    return {StatusCode::kNotFound,
        std::string ("no ") + (found[0].empty () ? "left" : "right") + " camera: property " +
            (found[0].empty () ? "right" : "left") +
            " names one, so rig is ignored; expected both left and right, or neither and rig"};
  if (found[0].empty () || found[1].empty ())
    return {StatusCode::kNotFound, std::string ("no ") + (found[0].empty () ? "left" : "right") +
                                       " camera: expected property " +
                                       (found[0].empty () ? "left" : "right") +
                                       ", or rig with a file that names the cameras"};
  for (int i = 0; i < rangecast::kMaxCameras; i++)
    for (int j = 0; j < i; j++)
      if (found[i] == found[j])
        return {StatusCode::kBadValue,
            "camera " + found[i] + " is named twice; expected different cameras"};
  return {};
}

Status
CamSourceSettings::check () const
{
  const bool by_element = trigger == TriggerMode::kSoftware || trigger == TriggerMode::kAction;
  if (single_shot && !by_element)
    return {StatusCode::kBadValue,
        std::string ("single-shot with trigger=") +
            (trigger == TriggerMode::kFreeRun ? "free-run" : "hardware") +
            ": this element does not trigger the cameras; expected trigger=software or action"};
  return {};
}

static AutoMode
mode_of (bool regulates, bool follows, bool is_left, bool fixed)
{
  if (regulates && (is_left || !follows))
    return AutoMode::kAuto;
  return regulates || fixed ? AutoMode::kManual : AutoMode::kUnchanged;
}

CameraSettings
CamSourceSettings::for_camera (int camera) const
{
  CameraSettings s;
  const bool left = camera == 0;
  s.x = offset_x;
  s.y = offset_y;
  s.trigger = trigger;
  s.line.source = trigger_line;
  s.line.master = left && !output_line.empty ();
  if (!output_line.empty ())
    s.line.output_line = output_line;
  s.action = {action_device_key, action_group_key, action_group_mask, action_scheduled};
  s.exposure_mode = mode_of (auto_exposure, lock_exposure, left, exposure_us > 0);
  s.gain_mode = mode_of (auto_gain, lock_exposure, left, gain >= 0);
  s.white_balance_mode = mode_of (auto_white_balance, lock_exposure, left, false);
  if (exposure_us > 0)
    s.exposure_us = exposure_us;
  if (gain >= 0)
    s.gain = gain;
  s.features = features;
  s.packet_size = packet_size;
  s.packet_delay_ns = packet_delay_ns;
  s.packet_resend = packet_resend;
  s.n_buffers = n_buffers;
  return s;
}
