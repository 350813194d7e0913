/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* A session while its cameras stream: frames become sets, sets go to the pads, and ten times a
 * second cameras, clocks and losses are checked. */
#include "session.hpp"

#include <algorithm>

#include "camera/aravis/debug.hpp"
#include "clock.hpp"

namespace {

constexpr std::int64_t kSecond_ns = 1'000'000'000;
constexpr std::int64_t kCheckInterval_ns = kSecond_ns / 10;
constexpr std::int64_t kLatencyInterval_ns = 5 * kSecond_ns;
constexpr std::int64_t kSilence_ns = kSecond_ns;        /* of all cameras, before GAPs are sent */
constexpr std::int64_t kMaxSilence_ns = 3 * kSecond_ns; /* of a camera that should send */
constexpr int kMaxSilentPeriods = 3;                    /* ... if that is longer */
constexpr guint64 kMinIncompleteImages = 20;            /* before a warning, which also needs ... */
constexpr guint64 kMaxIncompleteShare = 4; /* ... more than 1 incomplete image in 4 complete ones */

} // namespace

CameraSession::End
CameraSession::stream ()
{
  for (;;) {
    bool playing = false;
    {
      std::unique_lock guard (events_.lock);
      events_.changed.wait_for (guard, std::chrono::nanoseconds (kCheckInterval_ns), [this] {
        return events_.stop || !events_.frames.empty () || !events_.fault.ok () ||
               flow_ != GST_FLOW_OK;
      });
      if (events_.stop)
        return End::kStopped;
      if (!events_.fault.ok () || flow_ != GST_FLOW_OK)
        return End::kFault;
      frames_.swap (events_.frames);
      playing = playing_ && !eos_;
    }
    if (playing && !was_playing_)
      begin_playing ();
    was_playing_ = playing;
    handle_frames ();
    const std::int64_t now_ns = monotonic_ns ();
    if (now_ns - checked_ns_ < kCheckInterval_ns)
      continue;
    checked_ns_ = now_ns;
    if (cameras_.needs_negotiation ())
      return End::kRenegotiate;
    run_periodic_checks ();
  }
}

void
CameraSession::begin_playing ()
{
  playing_since_ns_ = monotonic_ns ();
  GstClock *clock = gst_element_get_clock (element_);
  if (clock_ && clock && clock != clock_)
    GST_ELEMENT_WARNING (element_, CORE, CLOCK,
        ("The pipeline uses another clock than that of clock-server %s: images of different hosts "
         "will not be captured simultaneously",
            settings_.clock_server.c_str ()),
        ("it uses %s", GST_OBJECT_NAME (clock)));
  gst_clear_object (&clock);
}

/* In PAUSED a live source has no data, but late frames still tell the cameras' delays and clocks.
 */
void
CameraSession::handle_frames ()
{
  for (CameraEvents::Frame &event : frames_) {
    pairing_.add_frame (event.camera, std::move (event.frame));
    ImageSet set;
    while (pairing_.next_set (set)) {
      if (was_playing_ && !output_.send (set)) {
        send_eos (gst_util_seqnum_next ());
        was_playing_ = false; /* later sets of the batch are beyond num-buffers */
      }
      set = {};
    }
  }
  frames_.clear ();
}

/* ---- ten times a second ---- */

void
CameraSession::run_periodic_checks ()
{
  warn_about_losses ();
  CameraStatus status = check_silence (checked_ns_);
  if (status.ok ())
    status = cameras_.synchronise (checked_ns_);
  if (!status.ok ())
    events_.fail (std::move (status));
  if (was_playing_ && checked_ns_ - latency_updated_ns_ > kLatencyInterval_ns) {
    latency_updated_ns_ = checked_ns_;
    update_latency ();
  }
}

/* Cameras that should send images, but send none. */
CameraStatus
CameraSession::check_silence (std::int64_t now_ns)
{
  const bool ticks = settings_.triggers_cameras ();
  const bool should_send =
      ticks || settings_.trigger == TriggerMode::kFreeRun ||
      (settings_.trigger == TriggerMode::kHardware && !settings_.output_line.empty ());
  if (!should_send || !was_playing_)
    return {};
  const auto period_ns =
      static_cast<std::int64_t> (cameras_.format ().period () + cameras_.exposure ());
  const std::int64_t max_ns = std::max (kMaxSilence_ns, kMaxSilentPeriods * period_ns);
  if (output_.last_sent_ns () > 0 &&
      now_ns - output_.last_sent_ns () > std::max (kSilence_ns, max_ns / 2))
    send_gaps (latency_); /* up to `latency_` ago: later images may be in transfer */
  if (trigger_.busy ())   /* a camera that does not answer a trigger is reported by it */
    return {};
  if (ticks && now_ns - std::max (trigger_.last_trigger_ns (), playing_since_ns_) > max_ns)
    return {CameraFault::kTimedOut,
        "the pipeline clock has stopped: no tick for " + std::to_string (max_ns / kSecond_ns) +
            " s" +
            (settings_.clock_server.empty ()
                    ? ""
                    : "; is clock-server " + settings_.clock_server + " still the same server?")};
  return cameras_.check_frames (now_ns, playing_since_ns_, max_ns);
}

void
CameraSession::warn_about_losses ()
{
  if (cameras_.lacks_buffers () && !std::exchange (warned_buffers_, true))
    GST_ELEMENT_WARNING (element_, RESOURCE, NO_SPACE_LEFT,
        ("Images are lost because downstream holds all buffers of a camera: raise the property "
         "buffers above %d, or make downstream faster",
            settings_.n_buffers),
        (nullptr));
  const CameraStatistics all = cameras_.statistics ();
  if (all.failures > kMinIncompleteImages && all.failures > all.completed / kMaxIncompleteShare &&
      !std::exchange (warned_incomplete_, true))
    GST_ELEMENT_WARNING (element_, RESOURCE, READ,
        ("Many images arrive incomplete: lower packet-size to the network's MTU, raise "
         "packet-delay or the socket receive buffers"),
        ("%" G_GUINT64_FORMAT " of %" G_GUINT64_FORMAT, guint64 (all.failures),
            guint64 (all.failures + all.completed)));
}

/* Where a network loses packets, images wait for them for longer than the latency says. */
void
CameraSession::update_latency ()
{
  const std::int64_t delay_ns = std::min (pairing_.stats ().delay_p99_ns, kSecond_ns);
  const auto latency_ns = static_cast<std::int64_t> (latency_.load ());
  if (delay_ns <= latency_ns + latency_ns / 10)
    return;
  latency_ = static_cast<GstClockTime> (delay_ns + delay_ns / 4);
  gst_element_post_message (element_, gst_message_new_latency (GST_OBJECT (element_)));
}
