/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "cameras.hpp"

#include <algorithm>
#include <cstdint>
#include <span>

#include "camera/aravis/debug.hpp"
#include "clock.hpp"
#include "conflict.hpp"

namespace {

constexpr std::int64_t kSecond_ns = 1'000'000'000;
constexpr std::int64_t kClockInterval_ns = 5 * kSecond_ns; /* cameras' clocks drift */
constexpr std::int64_t kUnknown_ns = INT64_MIN;
constexpr gint64 kMaxPtpWait_us = 30 * G_USEC_PER_SEC;

} // namespace

CameraStatus
loss_or_fault (Camera &camera, const CameraStatus &status)
{
  const CameraFault fault = status.fault ();
  if (fault != CameraFault::kTimedOut && fault != CameraFault::kLost && fault != CameraFault::kBusy)
    return status;
  camera.give_up ();
  return {CameraFault::kLost, lost_text (camera.label ())};
}

CameraGroup::CameraGroup (GstElement *element, const StereoCamSettings &settings,
    const CameraNames &names, const CameraPads &pads, FramePairing &pairing, Session session)
    : element_ (element), settings_ (settings), names_ (names), pads_ (pads), pairing_ (pairing),
      session_ (std::move (session))
{
}

std::vector<GstPad *>
CameraGroup::gst_pads () const
{
  std::vector<GstPad *> pads;
  for (const auto &pad : pads_)
    pads.push_back (pad->pad ());
  return pads;
}

/* ---- opening and closing ---- */

CameraStatus
CameraGroup::open ()
{
  close ();
  for (std::size_t i = 0; i < pads_.size (); i++) {
    if (!session_.wait (std::chrono::milliseconds (0)))
      return {CameraFault::kFailed, "stopped"};
    if (CameraStatus status = open_camera (i); !status.ok ())
      return {status.fault (), std::string ("pad ") + pads_[i]->name () + ": " + status.message ()};
  }
  return {};
}

CameraStatus
CameraGroup::open_camera (std::size_t index)
{
  std::unique_ptr<Camera> camera;
  CameraInfo seen;
  CameraStatus status = Camera::open (names_[index], camera, &seen);
  if (status.fault () == CameraFault::kBusy && session_.wait_for_other_sessions ())
    status = Camera::open (names_[index], camera, &seen);
  if (status.fault () == CameraFault::kBusy) /* because this element opened it by another name? */
    for (std::size_t other = 0; other < cameras_.size (); other++)
      if (cameras_[other]->info ().is_same (seen))
        return {CameraFault::kBadSetting, "'" + names_[index] + "' is the same camera as '" +
                                              names_[other] + "' of pad " + pads_[other]->name () +
                                              "; expected different cameras"};
  CameraAbilities abilities;
  if (status.ok ())
    status = camera->abilities (abilities);
  if (!status.ok ())
    return status;
  GST_INFO_OBJECT (element_, "%s is %s", pads_[index]->name (), camera->label ().c_str ());
  cameras_.push_back (std::move (camera));
  abilities_.push_back (std::move (abilities));
  set_open (true);
  return {};
}

void
CameraGroup::close ()
{
  stop ();
  cameras_.clear ();
  abilities_.clear ();
  set_open (false);
}

void
CameraGroup::set_open (bool open)
{
  std::lock_guard guard (lock_);
  open_ = open;
  changed_.notify_all ();
}

bool
CameraGroup::wait_until_closed (std::chrono::milliseconds limit)
{
  std::unique_lock guard (lock_);
  return changed_.wait_for (guard, limit, [this] { return !open_; });
}

/* ---- format and settings ---- */

CameraStatus
CameraGroup::negotiate ()
{
  std::string why;
  std::vector<std::string> labels;
  for (const auto &camera : cameras_)
    labels.push_back (camera->label ());
  const std::vector<GstPad *> pads = gst_pads ();
  for (GstPad *pad : pads)
    gst_pad_check_reconfigure (pad);
  GstCaps *offered =
      camera_source_caps (abilities_, labels, settings_.format, settings_.single_shot, why);
  GST_DEBUG_OBJECT (element_, "the cameras offer %" GST_PTR_FORMAT, offered);
  if (!gst_caps_is_empty (offered) && !choose_camera_format (offered, pads, abilities_, format_))
    why = caps_conflict (offered, pads);
  gst_caps_unref (offered);
  if (!why.empty ())
    return {CameraFault::kUnsupported, why};
  GST_INFO_OBJECT (element_, "caps %" GST_PTR_FORMAT, format_.caps);
  return {};
}

bool
CameraGroup::needs_negotiation ()
{
  bool needed = false;
  for (GstPad *pad : gst_pads ())
    if (gst_pad_check_reconfigure (pad) && gst_pad_is_linked (pad))
      needed |= !gst_pad_peer_query_accept_caps (pad, format_.caps);
  return needed;
}

CameraStatus
CameraGroup::configure ()
{
  double exposure_us = 0;
  for (std::size_t i = 0; i < cameras_.size (); i++) {
    CameraSettings settings = settings_.for_camera (static_cast<int> (i));
    settings.pixel_format = format_.pixel_format;
    settings.width = format_.width;
    settings.height = format_.height;
    if (format_.fps_n > 0)
      settings.frame_rate = double (format_.fps_n) / format_.fps_d;
    if (CameraStatus status = cameras_[i]->configure (settings); !status.ok ())
      return status;
    ImagingParameters imaging;
    if (cameras_[i]->read_imaging (imaging).ok () && imaging.exposure_us)
      exposure_us = std::max (exposure_us, *imaging.exposure_us);
  }
  exposure_ = static_cast<GstClockTime> (exposure_us * 1000);
  using By = FramePairing::TriggeredBy;
  const By by = settings_.triggers_cameras ()                ? By::kElement
                : settings_.trigger == TriggerMode::kFreeRun ? By::kCamera
                                                             : By::kExternal;
  /* the other buffers are for images in transfer and downstream */
  const int max_waiting = settings_.n_buffers / 2 - 1;
  pairing_.configure (
      static_cast<int> (cameras_.size ()), by, format_.period (), exposure_, max_waiting);
  return {};
}

/* ---- streaming ---- */

CameraStatus
CameraGroup::start ()
{
  {
    std::lock_guard guard (lock_);
    counted_ = cameras_;
  }
  pairing_.reset ();
  underruns_ = {};
  shortest_round_trip_us_ = {};
  for (std::size_t i = 0; i < cameras_.size (); i++)
    if (CameraStatus status = start_stream (i); !status.ok ())
      return status;
  for (std::size_t i = 0; i < cameras_.size (); i++)
    heartbeats_[i].start (
        cameras_[i]->is_gige () ? cameras_[i]->info ().address : "", monotonic_ns ());
  return {};
}

CameraStatus
CameraGroup::synchronise ()
{
  if (CameraStatus status = read_clocks (); !status.ok ())
    return status;
  if (settings_.follows_left ())
    exposure_sync_.start (cameras_[0], {cameras_.begin () + 1, cameras_.end ()},
        std::chrono::milliseconds (500), [this] (const CameraStatus &status) {
          GST_WARNING_OBJECT (element_, "%s", status.message ().c_str ());
        });
  return settings_.action_scheduled && settings_.trigger == TriggerMode::kAction ? wait_for_ptp ()
                                                                                 : CameraStatus ();
}

CameraStatus
CameraGroup::start_stream (std::size_t index)
{
  return cameras_[index]->start (
      [this, index] (
          CameraFrame frame) { session_.add_frame (static_cast<int> (index), std::move (frame)); },
      session_.fail);
}

/* Cameras need seconds to follow a PTP clock, and ignore scheduled commands until then. */
CameraStatus
CameraGroup::wait_for_ptp ()
{
  const gint64 begin = g_get_monotonic_time ();
  do {
    const auto behind =
        std::ranges::find_if (cameras_, [] (const auto &c) { return !c->clock_is_ptp (); });
    if (behind == cameras_.end ())
      return {};
    if (g_get_monotonic_time () - begin > kMaxPtpWait_us)
      return {CameraFault::kTimedOut,
          (*behind)->label () +
              ": the camera's clock does not follow PTP after 30 s; expected a PTP master "
              "in the camera's network, or action-scheduled=false"};
  } while (session_.wait (std::chrono::milliseconds (200)));
  return {CameraFault::kFailed, "stopped"};
}

void
CameraGroup::stop ()
{
  exposure_sync_.stop ();
  for (const auto &camera : cameras_)
    camera->stop ();
  pairing_.drop_waiting ();
  /* a stream counts from 0 when it starts again */
  const CameraStatistics total = statistics ();
  Cameras counted; /* destroyed without the lock */
  std::lock_guard guard (lock_);
  closed_total_ = total;
  counted.swap (counted_);
}

CameraStatus
CameraGroup::check_heartbeats (std::int64_t now_ns)
{
  CameraStatus lost;
  for (std::size_t i = 0; i < cameras_.size (); i++) {
    heartbeats_[i].poll (pairing_.last_frame_ns (static_cast<int> (i)), now_ns);
    if (heartbeats_[i].is_gone (now_ns))
      lost = loss_or_fault (*cameras_[i], {CameraFault::kLost, ""});
  }
  return lost;
}

CameraStatus
CameraGroup::check_frames (std::int64_t now_ns, std::int64_t since_ns, std::int64_t max_ns)
{
  for (std::size_t i = 0; i < cameras_.size (); i++) {
    const std::int64_t silent_ns =
        now_ns - std::max (pairing_.last_frame_ns (static_cast<int> (i)), since_ns);
    if (silent_ns > max_ns && !heartbeats_[i].is_overdue ())
      return {CameraFault::kTimedOut,
          cameras_[i]->label () + ": no image for " + std::to_string (silent_ns / kSecond_ns) +
              " s, although it answers; expected one each frame period (does a firewall block its "
              "packets, is its trigger connected?)"};
  }
  return {};
}

bool
CameraGroup::lacks_buffers ()
{
  bool lacks = false;
  for (std::size_t i = 0; i < cameras_.size (); i++) {
    const CameraStatistics now = cameras_[i]->statistics ();
    /* else the camera sent many at once */
    lacks |= now.underruns > underruns_[i] && now.buffers_out >= settings_.n_buffers - 1;
    underruns_[i] = now.underruns;
  }
  return lacks;
}

/* ---- clocks ---- */

CameraStatus
CameraGroup::update_clocks (std::int64_t now_ns)
{
  if (pairing_.clocks_are_off ()) {
    GST_DEBUG_OBJECT (element_, "timestamps contradict the cameras' clocks; reading them again");
    shortest_round_trip_us_ = {};
    clocks_read_ns_ = 0;
  }
  /* a camera that does not answer would be waited for */
  const bool all_answer = std::ranges::all_of (std::span (heartbeats_).first (cameras_.size ()),
      [] (const Heartbeat &heartbeat) { return heartbeat.is_answering (); });
  return all_answer && now_ns - clocks_read_ns_ > kClockInterval_ns ? read_clocks ()
                                                                    : CameraStatus ();
}

namespace {

/* Reads g_get_monotonic_time minus the camera's time, taken as of the middle of the round trip:
 * the shorter the trip, the better. The first reading takes the shortest of several trips; later
 * ones are used only if they take no longer than twice the shortest.
 * @param[out] offset_ns  unchanged if the trip was too long */
CameraStatus
read_offset (Camera &camera, std::int64_t &shortest_us, std::int64_t &offset_ns)
{
  const bool first = shortest_us == 0;
  for (int i = 0; i < (first ? 5 : 1); i++) {
    std::uint64_t camera_ns = 0;
    std::int64_t read_at_us = 0;
    const gint64 begin = g_get_monotonic_time ();
    if (CameraStatus status = camera.read_clock (camera_ns, read_at_us); !status.ok ())
      return status;
    const gint64 trip_us = MAX (g_get_monotonic_time () - begin, 1);
    if (shortest_us == 0 || trip_us < shortest_us || (!first && trip_us <= 2 * shortest_us)) {
      shortest_us = shortest_us == 0 ? trip_us : MIN (shortest_us, trip_us);
      offset_ns = read_at_us * 1000 - static_cast<std::int64_t> (camera_ns);
    } else if (!first) {
      shortest_us += shortest_us / 2 + 10; /* a clock drifts: an old reading gets worse */
    }
  }
  return {};
}

} // namespace

/* Cameras that follow one IEEE 1588 clock share one offset, so that their timestamps compare
 * exactly. Cameras without a readable clock are paired by arrival. */
CameraStatus
CameraGroup::read_clocks ()
{
  clocks_read_ns_ = monotonic_ns ();
  bool ptp = true;
  for (const auto &camera : cameras_)
    ptp = ptp && camera->clock_is_ptp ();
  std::int64_t offset_ns = kUnknown_ns;
  for (std::size_t i = 0; i < cameras_.size (); i++) {
    if (!ptp)
      offset_ns = kUnknown_ns;
    if (offset_ns == kUnknown_ns) {
      const CameraStatus status = loss_or_fault (
          *cameras_[i], read_offset (*cameras_[i], shortest_round_trip_us_[i], offset_ns));
      if (status.fault () == CameraFault::kLost)
        return status;
      if (!status.ok () && !ptp)
        return {};
    }
    if (offset_ns != kUnknown_ns)
      pairing_.set_clock_offset (static_cast<int> (i), offset_ns);
  }
  return {};
}

/* ---- statistics ---- */

CameraStatistics
CameraGroup::statistics ()
{
  Cameras cameras;
  CameraStatistics sum;
  {
    std::lock_guard guard (lock_);
    cameras = counted_;
    sum = closed_total_;
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
