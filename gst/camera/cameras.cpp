/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* A session's cameras: opening, format, settings, triggers, clocks. */
#include "session.hpp"

#include <algorithm>
#include <cstdint>

#include "conflict.hpp"

GST_DEBUG_CATEGORY_EXTERN (gst_stereo_cam_src_debug);
#define GST_CAT_DEFAULT gst_stereo_cam_src_debug

/* Scheduled action commands go out so much before their tick. */
static constexpr GstClockTime kActionLead = 20 * GST_MSECOND;

static constexpr std::int64_t kNotRead = INT64_MIN;

static constexpr gint64 kPtpPatience = 30 * G_USEC_PER_SEC;

/* Cameras of one element under two names: it is this element itself that has control. */
CameraStatus
CamSourceSession::busy_or_twice (
    const CameraInfo &seen, std::size_t camera, CameraStatus busy) const
{
  for (std::size_t other = 0; other < cameras_.size (); other++)
    if (cameras_[other]->info ().is_same (seen))
      return {CameraFault::kBadSetting, "'" + names_[camera] + "' is the same camera as '" +
                                            names_[other] + "' of pad " + pads_[other]->name () +
                                            "; expected different cameras"};
  return busy;
}

bool
CamSourceSession::open_cameras ()
{
  cameras_.clear ();
  set_has_cameras (false);
  abilities_.clear ();
  for (std::size_t i = 0; i < pads_.size (); i++) {
    if (quits ())
      return false;
    std::unique_ptr<Camera> camera;
    CameraInfo seen;
    CameraStatus status = Camera::open (names_[i], camera, &seen);
    if (status.fault () == CameraFault::kBusy && wait_for_leavers ())
      status = Camera::open (names_[i], camera, &seen);
    if (status.fault () == CameraFault::kBusy)
      status = busy_or_twice (seen, i, std::move (status));
    CameraAbilities abilities;
    if (status.ok ())
      status = camera->abilities (abilities);
    if (!status.ok ()) {
      fail ({status.fault (), std::string ("pad ") + pads_[i]->name () + ": " + status.message ()});
      return false;
    }
    GST_INFO_OBJECT (element_, "%s is %s", pads_[i]->name (), camera->label ().c_str ());
    cameras_.push_back (std::move (camera));
    set_has_cameras (true);
    abilities_.push_back (std::move (abilities));
  }
  return !quits ();
}

/* ---- the format ---- */

std::vector<GstPad *>
CamSourceSession::gst_pads () const
{
  std::vector<GstPad *> pads;
  for (const auto &pad : pads_)
    pads.push_back (pad->pad ());
  return pads;
}

bool
CamSourceSession::choose_format ()
{
  std::string why;
  std::vector<std::string> labels;
  for (const auto &camera : cameras_)
    labels.push_back (camera->label ());
  GstCaps *offered =
      camera_source_caps (abilities_, labels, settings_.format, settings_.single_shot, why);
  const std::vector<GstPad *> pads = gst_pads ();
  for (GstPad *pad : pads)
    gst_pad_check_reconfigure (pad);
  bool chosen = false;
  if (!gst_caps_is_empty (offered)) {
    chosen = choose_camera_format (offered, pads, abilities_, format_);
    if (!chosen)
      why = caps_conflict (offered, pads);
  }
  gst_caps_unref (offered);
  if (!chosen)
    fail ({CameraFault::kUnsupported, why});
  return chosen;
}

/* A link that is made anew may want something else. */
bool
CamSourceSession::needs_other_format ()
{
  bool other = false;
  for (GstPad *pad : gst_pads ())
    if (gst_pad_check_reconfigure (pad) && gst_pad_is_linked (pad))
      other |= !gst_pad_peer_query_accept_caps (pad, format_.caps);
  return other;
}

/* ---- settings ---- */

bool
CamSourceSession::configure_cameras ()
{
  double exposure_us = 0;
  for (std::size_t i = 0; i < cameras_.size (); i++) {
    CameraSettings settings = settings_.for_camera (static_cast<int> (i));
    settings.pixel_format = format_.pixel_format;
    settings.width = format_.width;
    settings.height = format_.height;
    if (format_.fps_n > 0)
      settings.frame_rate = double (format_.fps_n) / format_.fps_d;
    if (CameraStatus status = cameras_[i]->configure (settings); !status.ok ()) {
      fail (std::move (status));
      return false;
    }
    CameraLook look;
    if (cameras_[i]->read_look (look).ok () && look.exposure_us)
      exposure_us = std::max (exposure_us, *look.exposure_us);
  }
  const auto exposure = static_cast<GstClockTime> (exposure_us * 1000);
  exposure_ = exposure;
  /* the others are for what is on its way, and for downstream */
  const int waiting = settings_.n_buffers / 2 - 1;
  using Fired = CamSourcePairing::Fired;
  const Fired fired = fires ()                                     ? Fired::kHere
                      : settings_.trigger == TriggerMode::kFreeRun ? Fired::kAlone
                                                                   : Fired::kElsewhere;
  pairing_.start (static_cast<int> (cameras_.size ()), fired, format_.period (), exposure, waiting);
  const GstClockTime latency = latency_of (exposure, format_.period ());
  if (latency_.exchange (latency) != latency)
    gst_element_post_message (element_, gst_message_new_latency (GST_OBJECT (element_)));
  return !quits ();
}

/* ---- running ---- */

bool
CamSourceSession::start_cameras ()
{
  {
    std::lock_guard guard (lock_);
    inbox_.clear ();
    inbox_.reserve (cameras_.size () * static_cast<std::size_t> (settings_.n_buffers) + 8);
    counted_ = cameras_;
  }
  pairing_.forget ();
  underruns_ = {};
  shortest_trip_us_ = {};
  was_playing_ = false;
  for (std::size_t i = 0; i < cameras_.size (); i++) {
    const auto arrived = [this, i] (CameraFrame frame) {
      std::lock_guard guard (lock_);
      inbox_.push_back ({static_cast<int> (i), std::move (frame)});
      changed_.notify_all ();
    };
    const auto lost = [this] (CameraStatus status) { fail (std::move (status)); };
    if (CameraStatus status = cameras_[i]->start (arrived, lost); !status.ok ()) {
      fail (std::move (status));
      return false;
    }
  }
  for (std::size_t i = 0; i < cameras_.size (); i++)
    pulses_[i].start (cameras_[i]->is_gige () ? cameras_[i]->info ().address : "",
        g_get_monotonic_time () * 1000);
  for (const auto &pad : pads_)
    pad->set_caps (stream_, format_.caps);
  read_clocks ();
  if (settings_.follows_left ()) {
    look_.start (cameras_[0], {cameras_.begin () + 1, cameras_.end ()},
        std::chrono::milliseconds (500), [this] (const CameraStatus &status) {
          GST_WARNING_OBJECT (element_, "%s", status.message ().c_str ());
        });
  }
  if (!wait_for_ptp ())
    return false;
  start_ticker ();
  return true;
}

/* Cameras need seconds to follow a PTP clock, and obey no time before. */
bool
CamSourceSession::wait_for_ptp ()
{
  if (!settings_.action_scheduled || settings_.trigger != TriggerMode::kAction)
    return true;
  for (const gint64 begin = g_get_monotonic_time ();;) {
    const Camera *behind = nullptr;
    for (const auto &camera : cameras_)
      if (!behind && !camera->clock_is_ptp ())
        behind = camera.get ();
    if (!behind)
      return true;
    if (g_get_monotonic_time () - begin > kPtpPatience) {
      fail ({CameraFault::kTimedOut,
          behind->label () + ": its clock does not follow PTP after 30 s; expected a PTP master in "
                             "its network, or action-scheduled=false"});
      return false;
    }
    std::unique_lock guard (lock_);
    if (changed_.wait_for (
            guard, std::chrono::milliseconds (200), [this] { return quit_ || !fault_.ok (); }))
      return false;
  }
}

void
CamSourceSession::start_ticker ()
{
  if (!fires ())
    return;
  if (settings_.trigger == TriggerMode::kSoftware)
    triggers_.start (static_cast<int> (cameras_.size ()), [this] (int camera) {
      CameraStatus status = cameras_[camera]->trigger_software ();
      if (!status.ok () && !fail_if_gone (*cameras_[camera], status))
        fail (std::move (status));
    });
  if (settings_.trigger == TriggerMode::kAction) {
    std::vector<std::string> interfaces;
    for (const auto &camera : cameras_)
      interfaces.push_back (camera->interface_address ());
    if (CameraStatus status = action_.open (interfaces); !status.ok ()) {
      fail (std::move (status));
      return;
    }
  }
  const bool scheduled = settings_.trigger == TriggerMode::kAction && settings_.action_scheduled;
  CamSourceTicker::Actions actions;
  actions.may_fire = [this] {
    return pairing_.may_fire (settings_.single_shot, g_get_monotonic_time () * 1000);
  };
  actions.fire = [this] (GstClockTime tick) { fire (tick); };
  ticker_.start ({format_.fps_n, format_.fps_d}, settings_.single_shot, scheduled ? kActionLead : 0,
      std::move (actions));
}

/* The ticker's thread. Answers may come before the last camera has acknowledged. */
void
CamSourceSession::fire (GstClockTime tick)
{
  const bool scheduled = settings_.trigger == TriggerMode::kAction && settings_.action_scheduled;
  const gint64 lead = scheduled ? static_cast<gint64> (kActionLead) : 0;
  pairing_.fired (tick, g_get_monotonic_time () * 1000 + lead);
  if (settings_.trigger == TriggerMode::kSoftware) {
    triggers_.run ();
    return;
  }
  ActionCommand command;
  command.device_key = settings_.action_device_key;
  command.group_key = settings_.action_group_key;
  command.group_mask = settings_.action_group_mask;
  if (scheduled)
    command.time_ns = tick;
  if (CameraStatus status = action_.send (command); !status.ok ())
    fail (std::move (status));
}

/* The middle of the round trip is only as good as the trip is short: of several, the shortest;
 * later ones only if they are no longer than twice that. @return not ok: the camera does not tell
 */
static CameraStatus
read_offset (Camera &camera, std::int64_t &shortest_us, std::int64_t &offset_ns)
{
  const bool first = shortest_us == 0;
  for (int i = 0; i < (first ? 5 : 1); i++) {
    std::uint64_t camera_ns = 0;
    std::int64_t read_at_us = 0;
    const gint64 begin = g_get_monotonic_time ();
    if (CameraStatus status = camera.read_clock (camera_ns, read_at_us); !status.ok ())
      return status;
    const gint64 trip = MAX (g_get_monotonic_time () - begin, 1);
    if (shortest_us == 0 || trip < shortest_us || (!first && trip <= 2 * shortest_us)) {
      shortest_us = shortest_us == 0 ? trip : MIN (shortest_us, trip);
      offset_ns = read_at_us * 1000 - static_cast<std::int64_t> (camera_ns);
    } else if (!first) {
      shortest_us += shortest_us / 2 + 10; /* a clock drifts: what is old gets worse */
    }
  }
  return {};
}

/* Cameras that follow one IEEE 1588 clock get one offset, so that their stamps compare exactly. */
void
CamSourceSession::read_clocks ()
{
  last_clock_read_ns_ = g_get_monotonic_time () * 1000;
  bool ptp = true;
  for (const auto &camera : cameras_)
    ptp = ptp && camera->clock_is_ptp ();
  std::int64_t offset = kNotRead;
  for (std::size_t i = 0; i < cameras_.size (); i++) {
    if (i == 0 || !ptp)
      offset = kNotRead;
    if (offset == kNotRead) {
      const CameraStatus status = read_offset (*cameras_[i], shortest_trip_us_[i], offset);
      if (fail_if_gone (*cameras_[i], status) || (!status.ok () && !ptp))
        return;
    }
    if (offset != kNotRead)
      pairing_.set_clock_offset (static_cast<int> (i), offset);
  }
}

void
CamSourceSession::stop_cameras ()
{
  ticker_.stop ();
  look_.stop ();
  triggers_.stop ();
  action_.close ();
  for (const auto &camera : cameras_)
    camera->stop ();
  pairing_.drop_waiting ();
  bank_statistics ();
  cameras_.clear ();
  set_has_cameras (false);
}

/* Cameras that stand still count from 0 when they begin again. */
void
CamSourceSession::bank_statistics ()
{
  const CameraStatistics all = camera_statistics ();
  std::vector<std::shared_ptr<Camera>> counted; /* and their last references go without the lock */
  std::vector<Arrival> late;
  std::lock_guard guard (lock_);
  before_ = all;
  counted.swap (counted_);
  late.swap (inbox_);
}

CameraStatistics
CamSourceSession::camera_statistics ()
{
  std::vector<std::shared_ptr<Camera>> cameras;
  CameraStatistics sum;
  {
    std::lock_guard guard (lock_);
    cameras = counted_;
    sum = before_;
  }
  for (const auto &camera : cameras) {
    const CameraStatistics one = camera->statistics ();
    sum.completed += one.completed;
    sum.failures += one.failures;
    sum.underruns += one.underruns;
    sum.resent_packets += one.resent_packets;
    sum.missing_packets += one.missing_packets;
  }
  return sum;
}
