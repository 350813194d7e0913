/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "settings.hpp"

#include <rangecast/rigfile/rig_file.hpp>

using rangecast::Status;
using rangecast::StatusCode;

static const GEnumValue kTriggers[] = {
    {gint (TriggerMode::kFreeRun),
        "Cameras run freely at their frame rate; the nearest frames are paired", "free-run"},
    {gint (TriggerMode::kSoftware),
        "Software trigger at multiples of the frame period on the pipeline clock", "software"},
    {gint (TriggerMode::kHardware), "Electrical signal on trigger-line", "hardware"},
    {gint (TriggerMode::kAction), "GigE Vision action commands to all cameras of a rig", "action"},
    {0, nullptr, nullptr},
};

namespace {

struct Name {
  int index;
  auto &operator() (auto &settings) const { return settings.names[index]; }
};
constexpr Name kLeft{0}, kRight{1}, kThird{2};

} // namespace

PropertyTable<StereoCamSettings> &
stereo_cam_properties ()
{
  using S = StereoCamSettings;
  using P = PropertyTable<S>;
  static P table = {
      P::text<kLeft> ("left", "Left camera",
          "Left camera: name, serial number, IP or MAC address, or Aravis id", kMutableReady),
      P::text<kRight> ("right", "Right camera",
          "Right camera: name, serial number, IP or MAC address, or Aravis id", kMutableReady),
      P::text<kThird> ("third", "Third camera",
          "Third camera: name, serial number, IP or MAC address, or Aravis id", kMutableReady),
      P::text<&S::rig> ("rig", "Rig",
          "Rig file that names the cameras of the view, used if left and right are unset",
          kMutableReady),
      P::text<&S::format> ("format", "Pixel format",
          "GenICam pixel format, such as Mono8 or BayerRG8 (unset = negotiated with downstream)",
          kMutableReady),
      P::text<&S::features> ("features", "Features",
          "GenICam features to set on all cameras after all other settings: \"Name=Value "
          "Name='a text' Command ...\"",
          kMutableReady),
      P::text<&S::trigger_line> ("trigger-line", "Trigger line",
          "Input line of the cameras for trigger=hardware", kMutableReady),
      P::text<&S::output_line> ("output-line", "Output line",
          "Output line of the left camera for trigger=hardware; the left camera then runs freely "
          "and triggers the others (unset = external signal)",
          kMutableReady),
      P::text<&S::clock_server> ("clock-server", "Clock server",
          "Network clock to provide to the pipeline: HOST:PORT of a GStreamer network clock, or "
          "ptp:DOMAIN",
          kMutableReady),
      P::number<&S::view_id> ("view-id", "View ID", "View of the rig file that names the cameras",
          0, 63, kMutableReady),
      P::number<&S::packet_size> ("packet-size", "Packet size",
          "GigE Vision packet size in bytes, with headers (0 = largest that passes the network, -1 "
          "= leave unchanged)",
          -1, 65535, kMutableReady),
      P::number<&S::n_buffers> ("buffers", "Buffers",
          "Number of buffers per camera, shared by the camera's stream and downstream", 2, 256,
          kMutableReady),
      P::number<&S::num_buffers> ("num-buffers", "num-buffers",
          "Number of image sets to output before EOS (-1 = unlimited)", -1, G_MAXINT,
          kMutableReady),
      P::boolean<&S::auto_exposure> ("auto-exposure", "Automatic exposure",
          "Automatic exposure time on the left camera", kMutableReady),
      P::boolean<&S::auto_gain> (
          "auto-gain", "Automatic gain", "Automatic gain on the left camera", kMutableReady),
      P::boolean<&S::auto_white_balance> ("auto-white-balance", "Automatic white balance",
          "Automatic white balance on the left camera", kMutableReady),
      P::boolean<&S::lock_exposure> ("lock-exposure", "Lock exposure",
          "Copy the left camera's automatic settings to the other cameras (false = each camera "
          "adjusts itself)",
          kMutableReady),
      P::boolean<&S::packet_resend> ("packet-resend", "Packet resend",
          "Request retransmission of missing GigE Vision packets", kMutableReady),
      P::boolean<&S::reconnect> ("reconnect", "Reconnect",
          "Reconnect to a lost camera and post a warning instead of an error", kMutableReady),
      P::enumeration<&S::trigger> ("trigger", "Trigger", "What triggers the cameras",
          "GstStereoCamSrcTrigger", kTriggers, kMutableReady),
      P::number<&S::exposure_us> ("exposure", "Exposure",
          "Exposure time of all cameras in microseconds (0 = leave unchanged)", 0., 1e9,
          kMutableReady),
      P::number<&S::gain> ("gain", "Gain",
          "Gain of all cameras in their own unit, usually dB (-1 = leave unchanged)", -1, 1000,
          kMutableReady),
      P::number<&S::packet_delay_ns> ("packet-delay", "Packet delay",
          "Delay between GigE Vision packets in nanoseconds (-1 = leave unchanged)", -1, 1000000000,
          kMutableReady),
  };
  return table;
}

/* ---- the cameras ---- */

namespace {

Status
names_from_rig (const StereoCamSettings &settings, CameraNames &found)
{
  rangecast::Rig rig;
  if (Status s = rangecast::load_rig (settings.rig, rig); !s.ok ())
    return s;
  const std::string which = settings.rig + ": view " + std::to_string (settings.view_id);
  const rangecast::View *view = rig.find (settings.view_id);
  if (!view)
    return {StatusCode::kNotFound, settings.rig + ": " + rig.without_view (settings.view_id)};
  found = camera_names (*view);
  for (int i = 0; i < 2; i++)
    if (found[i].empty ())
      return {StatusCode::kNotFound, which + " does not name its " + (i ? "right" : "left") +
                                         " camera; set properties left and right"};
  return {};
}

AutoMode
mode_of (bool regulates, bool follows, bool is_left, bool fixed)
{
  if (regulates && (is_left || !follows))
    return AutoMode::kAuto;
  return regulates || fixed ? AutoMode::kManual : AutoMode::kUnchanged;
}

} // namespace

Status
StereoCamSettings::find_names (CameraNames &found) const
{
  found = names;
  if (names[0].empty () && names[1].empty () && !rig.empty ()) {
    CameraNames of_rig;
    if (Status s = names_from_rig (*this, of_rig); !s.ok ())
      return s;
    found = {of_rig[0], of_rig[1], names[2].empty () ? of_rig[2] : names[2]};
  }
  if (found[0].empty () || found[1].empty ()) {
    const std::string missing = found[0].empty () ? "left" : "right";
    return {StatusCode::kNotFound,
        "no " + missing + " camera: set property " + missing +
            (found[0] == found[1] ? ", or rig to a file that names the cameras"
                : rig.empty ()    ? ""
                                  : "; rig is ignored where one of left and right is set")};
  }
  for (int i = 0; i < kMaxCameras; i++)
    for (int j = 0; j < i; j++)
      if (found[i] == found[j])
        return {StatusCode::kBadValue, "camera " + found[i] + " is named twice"};
  return {};
}

CameraSettings
StereoCamSettings::for_camera (int camera) const
{
  CameraSettings s;
  const bool left = camera == 0;
  s.trigger = trigger;
  s.trigger_line = trigger_line;
  if (left)
    s.output_line = output_line;
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
