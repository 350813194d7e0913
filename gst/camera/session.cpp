/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* A session from its beginning to its end; streaming.cpp has what it does while cameras stream. */
#include "session.hpp"

#include <utility>

#include "camera/aravis/debug.hpp"

using Milliseconds = std::chrono::milliseconds;

namespace {

constexpr Milliseconds kRetry{1000}, kGapInterval{100};
constexpr GstClockTime kMaxClockWait = 10 * GST_SECOND;

/* Exposure and transfer; a transfer takes no longer than a frame period, else images would pile
 * up. */
GstClockTime
expected_latency (GstClockTime exposure, GstClockTime period)
{
  return MIN (exposure, period) + period;
}

/* Before the cameras have answered: the last session's, or that of the rate which is chosen where
 * downstream leaves a choice. */
GstClockTime
first_latency (const CameraSession::Setup &setup)
{
  if (setup.previous && setup.previous->latency () > 0)
    return setup.previous->latency ();
  return expected_latency (
      static_cast<GstClockTime> (setup.settings.exposure_us * 1000), GST_SECOND / 30);
}

std::vector<GstPad *>
gst_pads_of (const CameraPads &pads)
{
  std::vector<GstPad *> list;
  for (const auto &pad : pads)
    list.push_back (pad->pad ());
  return list;
}

} // namespace

CameraSession::CameraSession (Setup setup)
    : element_ (GST_ELEMENT (gst_object_ref (setup.element))), settings_ (setup.settings),
      names_ (setup.names), pads_ (setup.pads), gst_pads_ (gst_pads_of (setup.pads)),
      clock_ (setup.clock ? GST_CLOCK (gst_object_ref (setup.clock)) : nullptr),
      pairing_ (element_), trigger_ (element_, settings_, pairing_, events_),
      cameras_ (element_, settings_, names_, gst_pads_, pairing_, events_),
      output_ (element_, pads_, setup.group_id, settings_), latency_ (first_latency (setup)),
      previous_ (std::move (setup.previous))
{
  for (GstPad *pad : gst_pads_)
    gst_flow_combiner_add_pad (combiner_, pad);
}

CameraSession::~CameraSession ()
{
  gst_flow_combiner_free (combiner_);
  gst_clear_object (&clock_);
}

std::shared_ptr<CameraSession>
CameraSession::begin (Setup setup)
{
  std::shared_ptr<CameraSession> session (new CameraSession (std::move (setup)));
  const auto body = [] (gpointer data) -> gpointer {
    auto self = *static_cast<std::shared_ptr<CameraSession> *> (data);
    delete static_cast<std::shared_ptr<CameraSession> *> (data);
    GstElement *element = self->element_;
    self->run ();
    {
      std::lock_guard guard (self->events_.lock);
      self->ended_ = true;
      self->events_.changed.notify_all ();
    }
    self.reset ();
    gst_object_unref (element); /* perhaps the last: with it go the pads, which are used above */
    return nullptr;
  };
  auto *data = new std::shared_ptr<CameraSession> (session);
  if (GThread *thread = g_thread_try_new ("stereocamsrc", body, data, nullptr)) {
    g_thread_unref (thread);
    return session;
  }
  delete data;
  gst_object_unref (session->element_);
  return nullptr;
}

/* ---- the thread ---- */

void
CameraSession::run ()
{
  if (previous_) {
    std::unique_lock guard (previous_->events_.lock);
    previous_->events_.changed.wait (guard, [this] { return previous_->ended_; });
  }
  previous_.reset ();
  while (!events_.stopping () && run_cameras () == End::kFault && report_fault ()) {
    GST_DEBUG_OBJECT (element_, "opening the cameras again in a second");
    wait_before_retry ();
  }
  stop_cameras ();
}

/* From opening the cameras to their loss. */
CameraSession::End
CameraSession::run_cameras ()
{
  End end = End::kRenegotiate;
  GST_DEBUG_OBJECT (element_, "opening cameras");
  CameraStatus status = open_cameras ();
  if (status.ok ())
    status = wait_for_clock ();
  while (status.ok () && end == End::kRenegotiate) {
    status = start_cameras ();
    if (!status.ok ())
      break;
    if (std::exchange (lost_, false)) {
      reconnects_++;
      post_element_message ("stereocamsrc-back", "left", cameras_.cameras ()[0]->label ());
    }
    GST_DEBUG_OBJECT (element_, "streaming");
    end = stream ();
    if (end == End::kFault)
      (void)report_fault (); /* stopping may have to wait for a camera that does not answer */
    trigger_.stop ();
    cameras_.stop ();
  }
  if (!status.ok ())
    events_.fail (std::move (status));
  return events_.stopping () ? End::kStopped : End::kFault;
}

/* Closing a camera that is away, and looking for it, takes seconds; downstream goes on meanwhile.
 */
CameraStatus
CameraSession::open_cameras ()
{
  CameraStatus status (CameraFault::kFailed, "cannot start the thread that opens the cameras");
  if (!opening_.start ())
    return status;
  opening_.post ([this, &status] (const std::stop_token &) {
    stop_cameras ();
    status = cameras_.open ();
  });
  while (!opening_.wait_until_idle (kGapInterval))
    send_gaps ();
  return status;
}

/* Running time jumps forward with the clock when it is synchronised. */
CameraStatus
CameraSession::wait_for_clock ()
{
  if (!clock_ || clock_ready_)
    return {};
  for (GstClockTime waited = 0; !gst_clock_wait_for_sync (clock_, 100 * GST_MSECOND);
       waited += 100 * GST_MSECOND)
    if (events_.stopping () || waited >= kMaxClockWait)
      return {CameraFault::kTimedOut,
          "clock-server " + settings_.clock_server +
              " does not answer; rangemux with clock-port provides a network clock"};
  clock_ready_ = true;
  post_element_message ("stereocamsrc-clock", "server", settings_.clock_server);
  return {};
}

CameraStatus
CameraSession::start_cameras ()
{
  CameraStatus status = cameras_.negotiate ();
  if (status.ok ())
    status = cameras_.configure ();
  if (!status.ok ())
    return status;
  const SourceFormat &format = cameras_.format ();
  const GstClockTime latency = expected_latency (cameras_.exposure (), format.period ());
  if (latency_.exchange (latency) != latency)
    gst_element_post_message (element_, gst_message_new_latency (GST_OBJECT (element_)));
  clear_frames ();
  was_playing_ = false;
  output_.set_format (format);
  status = cameras_.start ();
  if (status.ok ())
    status =
        trigger_.start (cameras_.cameras (), cameras_.action_key (), {format.fps_n, format.fps_d});
  return status;
}

void
CameraSession::stop_cameras ()
{
  trigger_.stop ();
  cameras_.close ();
  clear_frames ();
}

void
CameraSession::clear_frames ()
{
  std::vector<CameraEvents::Frame> late; /* destroyed without the lock: buffers return */
  late.reserve (pads_.size () * static_cast<std::size_t> (settings_.n_buffers) + 8);
  std::lock_guard guard (events_.lock);
  late.swap (events_.frames);
}

void
CameraSession::wait_before_retry ()
{
  retry_.reset ();
  for (Milliseconds waited{0}; waited < kRetry; waited += kGapInterval) {
    std::unique_lock guard (events_.lock);
    events_.fault = {};
    if (events_.changed.wait_for (guard, kGapInterval, [this] { return events_.stop; }))
      return;
    guard.unlock ();
    send_gaps ();
  }
}

void
CameraSession::send_gaps (GstClockTime until_ago)
{
  {
    std::lock_guard guard (events_.lock);
    if (!playing_ || eos_)
      return;
  }
  output_.send_gaps (until_ago);
}

/* ---- faults ---- */

/* Posts the fault that ended streaming, once. @return whether to try again */
bool
CameraSession::report_fault ()
{
  if (retry_)
    return *retry_;
  CameraStatus fault;
  GstFlowReturn flow = GST_FLOW_OK;
  {
    std::lock_guard guard (events_.lock);
    if (events_.stop)
      return false;
    fault = events_.fault;
    flow = flow_;
  }
  retry_ = flow == GST_FLOW_OK && settings_.reconnect && fault.may_recover ();
  if (!*retry_) {
    if (flow == GST_FLOW_OK)
      post_fault (fault, false);
    else if (flow != GST_FLOW_EOS)
      GST_ELEMENT_FLOW_ERROR (element_, flow);
    send_eos (gst_util_seqnum_next ());
  } else if (!std::exchange (lost_, true)) {
    post_fault (fault, true);
    post_element_message ("stereocamsrc-lost", "reason", fault.message ());
  }
  return *retry_;
}

void
CameraSession::post_fault (const CameraStatus &fault, bool warning)
{
  static constexpr std::pair<CameraFault, GstResourceError> kCodes[] = {
      {CameraFault::kNotFound, GST_RESOURCE_ERROR_NOT_FOUND},
      {CameraFault::kBusy, GST_RESOURCE_ERROR_BUSY},
      {CameraFault::kNoPermission, GST_RESOURCE_ERROR_NOT_AUTHORIZED},
      {CameraFault::kTimedOut, GST_RESOURCE_ERROR_READ},
      {CameraFault::kLost, GST_RESOURCE_ERROR_READ},
      {CameraFault::kBadSetting, GST_RESOURCE_ERROR_SETTINGS},
  };
  GQuark domain = GST_RESOURCE_ERROR;
  gint code = GST_RESOURCE_ERROR_FAILED;
  for (const auto &[kind, resource_error] : kCodes)
    if (kind == fault.fault ())
      code = resource_error;
  if (fault.fault () == CameraFault::kUnsupported) {
    domain = GST_STREAM_ERROR;
    code = GST_STREAM_ERROR_FORMAT;
  }
  const std::string text = fault.message () + (warning ? "; trying again until it comes back" : "");
  if (!events_.stopping ())
    gst_element_message_full (element_, warning ? GST_MESSAGE_WARNING : GST_MESSAGE_ERROR, domain,
        code, g_strdup (text.c_str ()), nullptr, __FILE__, GST_FUNCTION, __LINE__);
}

void
CameraSession::post_element_message (const char *name, const char *field, const std::string &value)
{
  if (events_.stopping ())
    return;
  GstStructure *structure = gst_structure_new (name, field, G_TYPE_STRING, value.c_str (), nullptr);
  gst_element_post_message (element_, gst_message_new_element (GST_OBJECT (element_), structure));
}

/* ---- any thread ---- */

void
CameraSession::set_playing (bool playing)
{
  {
    std::lock_guard guard (events_.lock);
    playing_ = playing;
    events_.changed.notify_all ();
  }
  trigger_.set_playing (playing);
}

void
CameraSession::request_stop ()
{
  {
    std::lock_guard guard (events_.lock);
    events_.stop = true;
    events_.changed.notify_all ();
  }
  trigger_.set_playing (false);
}

bool
CameraSession::wait_until_ended (Milliseconds limit)
{
  std::unique_lock guard (events_.lock);
  return events_.changed.wait_for (guard, limit, [this] { return ended_; });
}

void
CameraSession::send_eos (guint32 seqnum)
{
  {
    std::lock_guard guard (events_.lock);
    if (std::exchange (eos_, true))
      return;
  }
  trigger_.set_playing (false);
  output_.send_eos (seqnum);
}

void
CameraSession::handle_flow (const CameraPad &pad, GstFlowReturn flow)
{
  std::lock_guard guard (events_.lock);
  const GstFlowReturn all = gst_flow_combiner_update_pad_flow (combiner_, pad.pad (), flow);
  GST_DEBUG_OBJECT (
      pad.pad (), "flow %s, of all pads %s", gst_flow_get_name (flow), gst_flow_get_name (all));
  if (all == GST_FLOW_OK || all == GST_FLOW_FLUSHING || flow_ != GST_FLOW_OK)
    return;
  flow_ = all;
  events_.changed.notify_all ();
}

GstStructure *
CameraSession::stats ()
{
  static constexpr const char *kNames[] = {"left", "right", "third"};
  const PairingStatistics pairing = pairing_.stats ();
  const CameraStatistics cameras = cameras_.statistics ();
  GstStructure *s = gst_structure_new ("stereocamsrc-stats", "sets", G_TYPE_UINT64, pairing.sets,
      "time-mismatch", G_TYPE_UINT64, pairing.time_mismatch, "unknown", G_TYPE_UINT64,
      pairing.unknown, "missed-ticks", G_TYPE_UINT64, trigger_.missed (), "missing-packets",
      G_TYPE_UINT64, pairing.missing_packets, "resent-packets", G_TYPE_UINT64,
      guint64 (cameras.resent_packets), "underruns", G_TYPE_UINT64, guint64 (cameras.underruns),
      "reconnects", G_TYPE_UINT64, reconnects_.load (), nullptr);
  for (std::size_t i = 0; i < pads_.size (); i++) {
    const std::string name = kNames[i];
    gst_structure_set (s, ("dropped-" + name).c_str (), G_TYPE_UINT64, pairing.dropped[i],
        ("incomplete-" + name).c_str (), G_TYPE_UINT64, pairing.incomplete[i],
        ("overrun-" + name).c_str (), G_TYPE_UINT64, pads_[i]->overrun (), nullptr);
  }
  if (pairing.has_spread)
    gst_structure_set (s, "spread-p50", G_TYPE_INT64, gint64 (pairing.spread_p50_ns), "spread-p99",
        G_TYPE_INT64, gint64 (pairing.spread_p99_ns), "delay-p50", G_TYPE_INT64,
        gint64 (pairing.delay_p50_ns), "delay-p99", G_TYPE_INT64, gint64 (pairing.delay_p99_ns),
        nullptr);
  return s;
}

StatsRow
CameraSession::stats_row ()
{
  const PairingStatistics pairing = pairing_.stats ();
  guint64 lost = 0;
  for (int i = 0; i < kMaxCameras; i++)
    lost += pairing.dropped[i] + pairing.incomplete[i];
  StatsRow row{.counters = {.frames = pairing.sets, .lost = lost, .late = trigger_.missed ()}};
  if (pairing.has_spread) {
    row.latency_p50 = pairing.delay_p50_ns;
    row.latency_p99 = pairing.delay_p99_ns;
  }
  return row;
}
