/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "cameras.hpp"

#include <algorithm>
#include <cstdint>

#include "camera/aravis/debug.hpp"
#include "clock.hpp"

namespace {

constexpr std::int64_t kSecond_ns = 1'000'000'000;
constexpr std::int64_t kClockInterval_ns = 5 * kSecond_ns; /* cameras' clocks drift */
constexpr std::int64_t kFollowInterval_ns = kSecond_ns / 2;

} // namespace

/* ---- opening and closing ---- */

CameraStatus
CameraGroup::open ()
{
  close ();
  for (std::size_t i = 0; i < pads_.size (); i++) {
    if (events_.stopping ())
      return {CameraFault::kFailed, "stopped"};
    if (CameraStatus status = open_camera (i); !status.ok ())
      return {status.fault (),
          std::string ("pad ") + GST_PAD_NAME (pads_[i]) + ": " + status.message ()};
  }
  return {};
}

CameraStatus
CameraGroup::open_camera (std::size_t index)
{
  std::unique_ptr<Camera> camera;
  CameraInfo seen;
  CameraStatus status = Camera::open (names_[index], camera, &seen);
  if (status.fault () == CameraFault::kBusy) /* because this element opened it by another name? */
    for (std::size_t other = 0; other < cameras_.size (); other++)
      if (cameras_[other]->info ().is_same (seen))
        return {CameraFault::kBadSetting, "'" + names_[index] + "' is the same camera as '" +
                                              names_[other] + "' of pad " +
                                              GST_PAD_NAME (pads_[other])};
  CameraAbilities abilities;
  if (status.ok ())
    status = camera->abilities (abilities);
  if (!status.ok ())
    return status;
  GST_INFO_OBJECT (pads_[index], "is %s", camera->label ().c_str ());
  cameras_.push_back (std::move (camera));
  abilities_.push_back (std::move (abilities));
  return {};
}

void
CameraGroup::close ()
{
  stop ();
  cameras_.clear ();
  abilities_.clear ();
}

/* ---- format and settings ---- */

CameraStatus
CameraGroup::negotiate ()
{
  std::string why;
  std::vector<std::string> labels;
  for (const auto &camera : cameras_)
    labels.push_back (camera->label ());
  for (GstPad *pad : pads_)
    gst_pad_check_reconfigure (pad);
  GstCaps *offered = camera_source_caps (abilities_, labels, settings_.format, why);
  GST_DEBUG_OBJECT (element_, "the cameras offer %" GST_PTR_FORMAT, offered);
  if (why.empty ())
    choose_camera_format (offered, pads_, abilities_, format_, why);
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
  for (GstPad *pad : pads_)
    if (gst_pad_check_reconfigure (pad) && gst_pad_is_linked (pad))
      needed |= !gst_pad_peer_query_accept_caps (pad, format_.caps);
  return needed;
}

CameraStatus
CameraGroup::configure ()
{
  double exposure_us = 0;
  const auto action_key = g_random_int (); /* other elements' commands mean other cameras */
  for (std::size_t i = 0; i < cameras_.size (); i++) {
    CameraSettings settings = settings_.for_camera (static_cast<int> (i));
    settings.pixel_format = format_.pixel_format;
    settings.width = format_.width;
    settings.height = format_.height;
    settings.action_key = action_key;
    settings.frame_rate = double (format_.fps_n) / format_.fps_d;
    if (CameraStatus status = cameras_[i]->configure (settings); !status.ok ())
      return status;
    ImagingParameters imaging;
    if (cameras_[i]->read_imaging (imaging).ok () && imaging.exposure_us)
      exposure_us = std::max (exposure_us, *imaging.exposure_us);
  }
  action_key_ = action_key;
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
  refused_ = false;
  for (std::size_t i = 0; i < cameras_.size (); i++) {
    CameraStatus status = cameras_[i]->start (
        [this, i] (
            CameraFrame frame) { events_.add_frame (static_cast<int> (i), std::move (frame)); },
        [this] (CameraStatus fault) { events_.fail (std::move (fault)); });
    if (!status.ok ())
      return status;
  }
  return read_clocks ();
}

void
CameraGroup::stop ()
{
  for (const auto &camera : cameras_)
    camera->stop ();
  pairing_.drop_waiting ();
  /* a stream counts from 0 when it starts again */
  const CameraStatistics total = statistics ();
  std::lock_guard guard (lock_);
  closed_total_ = total;
  counted_.clear (); /* cameras_ has them, too */
}

CameraStatus
CameraGroup::check_frames (std::int64_t now_ns, std::int64_t since_ns, std::int64_t max_ns)
{
  CameraStatus silent; /* one camera that does not answer may be why others send nothing */
  for (std::size_t i = 0; i < cameras_.size (); i++) {
    const std::int64_t silent_ns =
        now_ns - std::max (pairing_.last_frame_ns (static_cast<int> (i)), since_ns);
    if (silent_ns <= max_ns)
      continue;
    ImagingParameters any; /* does it answer at all? */
    if (CameraStatus lost = cameras_[i]->loss_or_fault (cameras_[i]->read_imaging (any));
        lost.fault () == CameraFault::kLost)
      return lost;
    silent = {CameraFault::kTimedOut,
        cameras_[i]->label () + ": no image for " + std::to_string (silent_ns / kSecond_ns) +
            " s, although it answers (does a firewall block its packets, is its trigger "
            "connected?)"};
  }
  return silent;
}

bool
CameraGroup::lacks_buffers ()
{
  bool lacks = false;
  for (std::size_t i = 0; i < cameras_.size (); i++) {
    const CameraStatistics now = cameras_[i]->statistics ();
    /* else the camera sent many together */
    lacks |= now.underruns > underruns_[i] && now.buffers_out >= settings_.n_buffers - 1;
    underruns_[i] = now.underruns;
  }
  return lacks;
}

/* ---- clocks, and the left camera's settings ---- */

CameraStatus
CameraGroup::synchronise (std::int64_t now_ns)
{
  if (pairing_.clocks_are_off ()) {
    GST_DEBUG_OBJECT (element_, "timestamps contradict the cameras' clocks; reading them again");
    clocks_read_ns_ = 0;
  }
  if (settings_.follows_left () && now_ns - followed_ns_ > kFollowInterval_ns)
    if (CameraStatus lost = follow_left (); !lost.ok ())
      return lost;
  return now_ns - clocks_read_ns_ > kClockInterval_ns ? read_clocks () : CameraStatus ();
}

CameraStatus
CameraGroup::follow_left ()
{
  followed_ns_ = monotonic_ns ();
  ImagingParameters parameters;
  CameraStatus status = cameras_[0]->loss_or_fault (cameras_[0]->read_imaging (parameters));
  for (std::size_t i = 1; i < cameras_.size () && status.ok (); i++)
    status = cameras_[i]->loss_or_fault (cameras_[i]->write_imaging (parameters));
  if (status.fault () == CameraFault::kLost)
    return status;
  if (!status.ok () && !refused_)
    GST_WARNING_OBJECT (element_, "%s", status.message ().c_str ());
  refused_ = !status.ok ();
  return {};
}

/* Sets g_get_monotonic_time minus each camera's time, taken as of the middle of the round trip; of
 * several trips, the shortest. Cameras without a readable clock are paired by arrival. */
CameraStatus
CameraGroup::read_clocks ()
{
  clocks_read_ns_ = monotonic_ns ();
  for (std::size_t i = 0; i < cameras_.size (); i++) {
    std::int64_t shortest_us = G_MAXINT64, offset_ns = 0;
    for (int trip = 0; trip < 3; trip++) {
      std::uint64_t camera_ns = 0;
      std::int64_t read_at_us = 0;
      const gint64 begin_us = g_get_monotonic_time ();
      CameraStatus status =
          cameras_[i]->loss_or_fault (cameras_[i]->read_clock (camera_ns, read_at_us));
      const gint64 trip_us = g_get_monotonic_time () - begin_us;
      if (!status.ok ())
        return status.fault () == CameraFault::kLost ? status : CameraStatus ();
      if (trip_us >= shortest_us)
        continue;
      shortest_us = trip_us;
      offset_ns = read_at_us * 1000 - static_cast<std::int64_t> (camera_ns);
    }
    pairing_.set_clock_offset (static_cast<int> (i), offset_ns);
  }
  return {};
}

/* ---- statistics ---- */

CameraStatistics
CameraGroup::statistics ()
{
  std::lock_guard guard (lock_);
  CameraStatistics sum = closed_total_;
  for (const auto &camera : counted_) {
    const CameraStatistics one = camera->statistics ();
    sum.completed += one.completed;
    sum.failures += one.failures;
    sum.underruns += one.underruns;
    sum.resent_packets += one.resent_packets;
  }
  return sum;
}
