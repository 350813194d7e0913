/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* A session while its cameras run: frames become sets, sets go to the pads. */
#include "session.hpp"

#include <algorithm>
#include <gstrange/gstrange.h>
#include <span>

GST_DEBUG_CATEGORY_EXTERN (gst_stereo_cam_src_debug);
#define GST_CAT_DEFAULT gst_stereo_cam_src_debug

static constexpr std::int64_t kSecond = 1'000'000'000;
static constexpr std::int64_t kLook = kSecond / 10;     ///< between two looks around
static constexpr std::int64_t kClockRead = 5 * kSecond; ///< cameras' clocks drift
static constexpr std::int64_t kStatsMessage = 5 * kSecond;
static constexpr std::int64_t kSilence = kSecond;      ///< of all cameras, before GAPs say so
static constexpr std::int64_t kPatience = 3 * kSecond; ///< for a frame of a camera that runs
static constexpr int kPeriods = 3;                     ///< ... or so many, if they are longer

CamSourceSession::End
CamSourceSession::serve ()
{
  for (;;) {
    bool playing = false;
    {
      std::unique_lock guard (lock_);
      changed_.wait_for (guard, std::chrono::nanoseconds (kLook), [this] {
        return quit_ || !inbox_.empty () || !fault_.ok () || fatal_flow_ != GST_FLOW_OK;
      });
      if (quit_)
        return End::kStopped;
      if (!fault_.ok () || fatal_flow_ != GST_FLOW_OK)
        return End::kFault;
      taken_.swap (inbox_);
      if (std::exchange (flushed_, false)) /* running time may begin anew */
      {
        last_pts_ = sent_until_ = GST_CLOCK_TIME_NONE;
        gap_until_ = 0;
      }
      playing = playing_ && !eos_;
    }
    if (playing && !was_playing_)
      begin_to_play ();
    was_playing_ = playing;
    take_frames ();
    const std::int64_t now = g_get_monotonic_time () * 1000;
    if (now - last_look_ns_ < kLook)
      continue;
    last_look_ns_ = now;
    if (needs_other_format ())
      return End::kAgain;
    look_around ();
  }
}

void
CamSourceSession::begin_to_play ()
{
  playing_since_ns_ = g_get_monotonic_time () * 1000;
  GstClock *clock = gst_element_get_clock (element_);
  if (clock_ && clock && clock != clock_)
    GST_ELEMENT_WARNING (element_, CORE, CLOCK,
        ("The pipeline uses another clock than that of clock-server %s: images of different hosts "
         "will not be captured simultaneously",
            settings_.clock_server.c_str ()),
        ("it uses %s", GST_OBJECT_NAME (clock)));
  if (settings_.action_scheduled && settings_.trigger == TriggerMode::kAction)
    warn_if_not_ptp (clock);
  gst_clear_object (&clock);
}

/* Scheduled commands name times of the pipeline's clock, which the cameras take for theirs. */
void
CamSourceSession::warn_if_not_ptp (GstClock *clock)
{
  std::uint64_t camera_ns = 0;
  std::int64_t read_at_us = 0;
  if (!clock || !cameras_[0]->read_clock (camera_ns, read_at_us).ok ())
    return;
  const auto pipeline = static_cast<std::int64_t> (gst_clock_get_time (clock));
  const std::int64_t off = (pipeline - static_cast<std::int64_t> (camera_ns)) / kSecond;
  if (off == 0)
    return;
  GST_ELEMENT_WARNING (element_, CORE, CLOCK,
      ("The pipeline's clock and that of %s differ by %d s: scheduled action commands need one PTP "
       "clock for both (clock-server=ptp:DOMAIN)",
          cameras_[0]->label ().c_str (), int (off)),
      (nullptr));
}

/* In PAUSED a live source has no pictures, but what comes late tells of the cameras' clocks. */
void
CamSourceSession::take_frames ()
{
  for (Arrival &arrival : taken_) {
    pairing_.take (arrival.camera, std::move (arrival.frame));
    CamSourceSet set;
    while (pairing_.next (set)) {
      if (was_playing_)
        send (set);
      set = {};
    }
  }
  taken_.clear ();
}

/* ---- sets ---- */

/* Cameras that another element fires are fired on ticks, too.
 * @return false: from before the stream's beginning */
bool
CamSourceSession::stamp (const CamSourceSet &set, GstClockTime &pts, GstClockTime &capture)
{
  const GstClockTime base = gst_element_get_base_time (element_);
  capture = set.tick;
  if (!GST_CLOCK_TIME_IS_VALID (capture)) {
    GstClock *clock = gst_element_get_clock (element_);
    if (!clock)
      clock = gst_system_clock_obtain ();
    const std::int64_t age = g_get_monotonic_time () * 1000 - set.taken_ns;
    const auto now = static_cast<std::int64_t> (gst_clock_get_time (clock));
    gst_object_unref (clock);
    std::int64_t taken = std::max<std::int64_t> (now - age, 0);
    const rangecast::TickRate rate{format_.fps_n, format_.fps_d};
    if (settings_.trigger == TriggerMode::kAction && rate.valid ())
      taken = rate.time_of (
          rate.at_or_after (std::max<std::int64_t> (taken - rate.period_ns () / 2, 0)));
    capture = static_cast<GstClockTime> (taken);
  }
  if (capture < base)
    return false;
  pts = capture - base;
  if (GST_CLOCK_TIME_IS_VALID (last_pts_) && pts <= last_pts_ && set.tick == GST_CLOCK_TIME_NONE)
    pts = last_pts_ + 1;
  return true;
}

void
CamSourceSession::send (CamSourceSet &set)
{
  GstClockTime pts = 0, capture = 0;
  if (!stamp (set, pts, capture))
    return;
  if (pts < gap_until_) /* it was said that there is nothing */
    return;
  const GstClockTime period = format_.period ();
  for (std::size_t i = 0; i < pads_.size (); i++) {
    GstBuffer *buffer = set.pictures[i].release ();
    GST_BUFFER_FLAG_UNSET (buffer, GST_BUFFER_FLAG_DISCONT);
    GST_BUFFER_PTS (buffer) = pts;
    GST_BUFFER_DTS (buffer) = GST_CLOCK_TIME_NONE;
    GST_BUFFER_DURATION (buffer) = period > 0 ? period : GST_CLOCK_TIME_NONE;
    GST_BUFFER_OFFSET (buffer) = sent_;
    GST_BUFFER_OFFSET_END (buffer) = sent_ + 1;
    gst_range_buffer_set_capture_time (buffer, capture);
    pads_[i]->send (stream_, buffer);
  }
  sent_++;
  last_pts_ = pts;
  last_sent_ns_ = g_get_monotonic_time () * 1000;
  sent_until_ = pts + period;
  if (settings_.num_buffers >= 0 && sent_ >= static_cast<guint64> (settings_.num_buffers))
    finish (gst_util_seqnum_next ());
}

/* So that branches, and what waits for them elsewhere, go on. */
void
CamSourceSession::send_gaps (GstClockTime until_ago)
{
  GstClockTime now = running_time ();
  {
    std::lock_guard guard (lock_);
    if (!playing_ || eos_ || !GST_CLOCK_TIME_IS_VALID (now))
      return;
  }
  now -= MIN (now, until_ago);
  const GstClockTime begin = GST_CLOCK_TIME_IS_VALID (sent_until_) ? sent_until_ : 0;
  if (now <= begin)
    return;
  for (const auto &pad : pads_)
    pad->send_gap (stream_, begin, now - begin);
  sent_until_ = gap_until_ = now;
}

/* ---- ten times a second ---- */

/* However cameras are fired, and also while they have nothing to send. */
void
CamSourceSession::feel_pulses (std::int64_t now_ns)
{
  for (std::size_t i = 0; i < cameras_.size (); i++) {
    pulses_[i].feel (pairing_.last_arrival (static_cast<int> (i)), now_ns);
    if (pulses_[i].is_gone (now_ns))
      lose (*cameras_[i]);
  }
}

void
CamSourceSession::watch_clock (std::int64_t now_ns, std::int64_t most_ns)
{
  if (!fires () || now_ns - std::max (ticker_.last_shot_ns (), playing_since_ns_) <= most_ns)
    return;
  fail ({CameraFault::kTimedOut,
      "the pipeline clock has stopped: no tick for " + std::to_string (most_ns / kSecond) + " s" +
          (settings_.clock_server.empty ()
                  ? ""
                  : "; is clock-server " + settings_.clock_server + " still the same server?")});
}

/* Cameras that must send pictures, and answer, but send none. */
void
CamSourceSession::watch_cameras (std::int64_t now_ns)
{
  const bool comes_by_itself =
      settings_.trigger == TriggerMode::kFreeRun || (fires () && !settings_.single_shot) ||
      (settings_.trigger == TriggerMode::kHardware && !settings_.output_line.empty ());
  if (!comes_by_itself || !was_playing_)
    return;
  const std::int64_t most =
      std::max (kPatience, kPeriods * static_cast<std::int64_t> (format_.period () + exposure_));
  if (GST_CLOCK_TIME_IS_VALID (sent_until_) && last_sent_ns_ > 0 &&
      now_ns - last_sent_ns_ > std::max (kSilence, most / 2))
    send_gaps (latency_); /* what is under way may still come */
  watch_clock (now_ns, most);
  for (std::size_t i = 0; i < cameras_.size (); i++) {
    const std::int64_t last =
        std::max (pairing_.last_arrival (static_cast<int> (i)), playing_since_ns_);
    if (now_ns - last > most && !pulses_[i].is_doubtful ())
      fail ({CameraFault::kTimedOut,
          cameras_[i]->label () + ": no picture for " + std::to_string ((now_ns - last) / kSecond) +
              " s, although it answers; expected one each frame period (does a firewall block its "
              "packets, is its trigger connected?)"});
  }
}

/* Pictures are lost for want of buffers, and it is not just that a camera sent many at once. */
bool
CamSourceSession::keeps_buffers ()
{
  bool keeps = false;
  for (std::size_t i = 0; i < cameras_.size (); i++) {
    const CameraStatistics now = cameras_[i]->statistics ();
    const bool lost = now.underruns > underruns_[i];
    keeps |= lost && now.buffers_out >= settings_.n_buffers - 1;
    underruns_[i] = now.underruns;
  }
  return keeps;
}

void
CamSourceSession::warn_once (const CameraStatistics &all)
{
  if (keeps_buffers () && !std::exchange (said_underruns_, true))
    GST_ELEMENT_WARNING (element_, RESOURCE, NO_SPACE_LEFT,
        ("Images are lost because downstream holds all buffers of a camera: raise the property "
         "buffers above %d, or make downstream faster",
            settings_.n_buffers),
        (nullptr));
  if (all.failures > 20 && all.failures > all.completed / 4 &&
      !std::exchange (said_incomplete_, true))
    GST_ELEMENT_WARNING (element_, RESOURCE, READ,
        ("Many images arrive incomplete: lower packet-size to the network's MTU, raise "
         "packet-delay or the socket receive buffers"),
        ("%" G_GUINT64_FORMAT " of %" G_GUINT64_FORMAT, guint64 (all.failures),
            guint64 (all.failures + all.completed)));
}

/* A network that loses packets makes pictures wait for them longer than was told. */
void
CamSourceSession::raise_latency ()
{
  const std::int64_t delay = std::min (pairing_.stats ().delay_p99_ns, kSecond);
  const auto told = static_cast<std::int64_t> (latency_.load ());
  if (delay <= told + told / 10)
    return;
  latency_ = static_cast<GstClockTime> (delay + delay / 4);
  gst_element_post_message (element_, gst_message_new_latency (GST_OBJECT (element_)));
}

void
CamSourceSession::look_around ()
{
  const std::int64_t now = g_get_monotonic_time () * 1000;
  feel_pulses (now);
  watch_cameras (now);
  warn_once (camera_statistics ());
  if (pairing_.clocks_are_off ()) {
    shortest_trip_us_ = {};
    last_clock_read_ns_ = 0;
  }
  const bool all_answer = std::ranges::all_of (
      std::span (pulses_).first (cameras_.size ()), [] (const auto &p) { return p.is_sure (); });
  if (all_answer && now - last_clock_read_ns_ > kClockRead) /* else it would wait */
    read_clocks ();
  if (now - last_stats_ns_ > kStatsMessage && was_playing_) {
    last_stats_ns_ = now;
    raise_latency ();
    gst_element_post_message (element_, gst_message_new_element (GST_OBJECT (element_), stats ()));
  }
}
