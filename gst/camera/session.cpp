/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* A session from its beginning to its end; streaming.cpp has what it does while cameras stream. */
#include "session.hpp"

#include <future>
#include <thread>
#include <utility>

#include "camera/aravis/debug.hpp"

using Milliseconds = std::chrono::milliseconds;

namespace {

constexpr Milliseconds kRetry{1000}, kGapInterval{100};
constexpr GstClockTime kMaxClockWait = 10 * GST_SECOND;

/* Sessions of this process that were asked to stop and have not ended. One that is still looking
 * for its cameras may open one, until it sees that it is to stop. */
std::atomic<int> stopping_sessions = 0;

/* Exposure and transfer; a transfer takes no longer than a frame period, else images would pile
 * up. @param period  0: single shots */
GstClockTime
expected_latency (GstClockTime exposure, GstClockTime period)
{
  const GstClockTime longest = period > 0 ? period : 100 * GST_MSECOND;
  return MIN (exposure, longest) + longest;
}

/* Before the cameras have answered: the last session's, or that of the rate which is chosen where
 * downstream leaves a choice. */
GstClockTime
first_latency (const CameraSession::Setup &setup)
{
  if (setup.previous && setup.previous->latency () > 0)
    return setup.previous->latency ();
  return expected_latency (static_cast<GstClockTime> (setup.settings.exposure_us * 1000),
      setup.settings.single_shot ? 0 : GST_SECOND / 30);
}

} // namespace

CameraSession::CameraSession (Setup setup)
    : element_ (GST_ELEMENT (gst_object_ref (setup.element))), settings_ (setup.settings),
      names_ (setup.names), pads_ (setup.pads),
      clock_ (setup.clock ? GST_CLOCK (gst_object_ref (setup.clock)) : nullptr),
      pairing_ (element_), trigger_ (element_, settings_, pairing_),
      cameras_ (element_, settings_, names_, pads_, pairing_,
          {.add_frame =
                  [this] (int camera, CameraFrame frame) {
                    std::lock_guard guard (lock_);
                    inbox_.push_back ({camera, std::move (frame)});
                    changed_.notify_all ();
                  },
              .fail = [this] (CameraStatus fault) { fail (std::move (fault)); },
              .wait = [this] (Milliseconds time) { return wait (time); },
              .wait_for_other_sessions = [this] { return wait_for_other_sessions (); }}),
      output_ (element_, pads_, setup.group_id, settings_), latency_ (first_latency (setup)),
      previous_ (std::move (setup.previous))
{
  for (const auto &pad : pads_)
    gst_flow_combiner_add_pad (combiner_, pad->pad ());
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
      std::lock_guard guard (self->lock_);
      self->ended_ = true;
      stopping_sessions -= self->stop_;
      self->changed_.notify_all ();
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
    std::unique_lock guard (previous_->lock_);
    previous_->changed_.wait (guard, [this] { return previous_->ended_; });
  }
  previous_.reset ();
  while (!stopping () && run_cameras () == End::kFault) {
    const bool retry = report_fault ();
    stop_cameras ();
    if (!retry)
      break;
    GST_DEBUG_OBJECT (element_, "cameras closed; opening them again in a second");
    wait_before_retry ();
  }
  stop_cameras ();
}

/* From opening the cameras to their loss. */
CameraSession::End
CameraSession::run_cameras ()
{
  End end = End::kRenegotiate;
  try {
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
      fail (std::move (status));
  } catch (const std::exception &e) { /* the system gives no more threads */
    fail ({CameraFault::kFailed, std::string ("cannot run the camera loop: ") + e.what ()});
  }
  if (stopping ())
    return End::kStopped;
  return end == End::kRenegotiate ? End::kFault : end;
}

/* Looking for a camera that is away takes seconds; downstream goes on meanwhile. */
CameraStatus
CameraSession::open_cameras ()
{
  auto opened = std::async (std::launch::async, [this] { return cameras_.open (); });
  while (opened.wait_for (kGapInterval) != std::future_status::ready)
    send_gaps ();
  return opened.get ();
}

/* Running time jumps forward with the clock when it is synchronised. */
CameraStatus
CameraSession::wait_for_clock ()
{
  if (!clock_ || clock_ready_)
    return {};
  for (GstClockTime waited = 0; !gst_clock_wait_for_sync (clock_, 100 * GST_MSECOND);
       waited += 100 * GST_MSECOND)
    if (stopping () || waited >= kMaxClockWait)
      return {CameraFault::kTimedOut, "clock-server " + settings_.clock_server +
                                          " does not answer; expected a network clock there, as "
                                          "rangemux with clock-port provides"};
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
  clear_inbox ();
  was_playing_ = false;
  status =
      wait (Milliseconds (0)) ? cameras_.start () : CameraStatus (CameraFault::kFailed, "stopped");
  if (!status.ok ())
    return status;
  output_.set_format (format);
  status = cameras_.synchronise ();
  if (status.ok ())
    status = trigger_.start (cameras_.cameras (), {format.fps_n, format.fps_d},
        [this] (CameraStatus fault) { fail (std::move (fault)); });
  return status;
}

void
CameraSession::stop_cameras ()
{
  trigger_.stop ();
  cameras_.close ();
  clear_inbox ();
}

void
CameraSession::clear_inbox ()
{
  std::vector<CameraEvent> late; /* destroyed without the lock: buffers return to their camera */
  late.reserve (pads_.size () * static_cast<std::size_t> (settings_.n_buffers) + 8);
  std::lock_guard guard (lock_);
  late.swap (inbox_);
}

bool
CameraSession::wait_for_other_sessions ()
{
  constexpr Milliseconds kInterval (50), kMax (5000);
  bool waited = false;
  for (Milliseconds passed (0); stopping_sessions > 0 && !stopping () && passed < kMax;
       passed += kInterval) {
    waited = true;
    std::this_thread::sleep_for (kInterval);
  }
  return waited && !stopping ();
}

/* @return false: the session is to stop, or has failed */
bool
CameraSession::wait (Milliseconds time)
{
  std::unique_lock guard (lock_);
  return !changed_.wait_for (guard, time, [this] { return stop_ || !fault_.ok (); });
}

void
CameraSession::wait_before_retry ()
{
  retry_.reset ();
  for (Milliseconds waited{0}; waited < kRetry; waited += kGapInterval) {
    std::unique_lock guard (lock_);
    fault_ = {};
    if (changed_.wait_for (guard, kGapInterval, [this] { return stop_; }))
      return;
    guard.unlock ();
    send_gaps ();
  }
}

void
CameraSession::send_gaps (GstClockTime until_ago)
{
  {
    std::lock_guard guard (lock_);
    if (!playing_ || eos_)
      return;
  }
  output_.send_gaps (until_ago);
}

/* ---- faults ---- */

/* Any thread. */
void
CameraSession::fail (CameraStatus fault)
{
  std::lock_guard guard (lock_);
  if (!fault_.ok ())
    return;
  GST_DEBUG_OBJECT (element_, "%s", fault.message ().c_str ());
  fault_ = std::move (fault);
  changed_.notify_all ();
}

/* Posts the fault that ended streaming, once. @return whether to try again */
bool
CameraSession::report_fault ()
{
  if (retry_)
    return *retry_;
  CameraStatus fault;
  GstFlowReturn flow = GST_FLOW_OK;
  {
    std::lock_guard guard (lock_);
    if (stop_)
      return false;
    fault = fault_;
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
  GQuark domain = GST_RESOURCE_ERROR;
  gint code = GST_RESOURCE_ERROR_FAILED;
  switch (fault.fault ()) {
    case CameraFault::kNotFound:
      code = GST_RESOURCE_ERROR_NOT_FOUND;
      break;
    case CameraFault::kBusy:
      code = GST_RESOURCE_ERROR_BUSY;
      break;
    case CameraFault::kNoPermission:
      code = GST_RESOURCE_ERROR_NOT_AUTHORIZED;
      break;
    case CameraFault::kTimedOut:
    case CameraFault::kLost:
      code = GST_RESOURCE_ERROR_READ;
      break;
    case CameraFault::kBadSetting:
      code = GST_RESOURCE_ERROR_SETTINGS;
      break;
    case CameraFault::kUnsupported:
      domain = GST_STREAM_ERROR;
      code = GST_STREAM_ERROR_FORMAT;
      break;
    default:
      break;
  }
  const std::string text = fault.message () + (warning ? "; trying again until it comes back" : "");
  if (!stopping ())
    gst_element_message_full (element_, warning ? GST_MESSAGE_WARNING : GST_MESSAGE_ERROR, domain,
        code, g_strdup (text.c_str ()), nullptr, __FILE__, GST_FUNCTION, __LINE__);
}

void
CameraSession::post_element_message (const char *name, const char *field, const std::string &value)
{
  if (stopping ())
    return;
  GstStructure *structure = gst_structure_new (name, field, G_TYPE_STRING, value.c_str (), nullptr);
  gst_element_post_message (element_, gst_message_new_element (GST_OBJECT (element_), structure));
}

/* ---- any thread ---- */

void
CameraSession::set_playing (bool playing)
{
  {
    std::lock_guard guard (lock_);
    playing_ = playing;
    changed_.notify_all ();
  }
  trigger_.set_playing (playing);
}

void
CameraSession::request_stop ()
{
  {
    std::lock_guard guard (lock_);
    stopping_sessions += !stop_ && !ended_;
    stop_ = true;
    changed_.notify_all ();
  }
  trigger_.set_playing (false);
}

bool
CameraSession::stopping ()
{
  std::lock_guard guard (lock_);
  return stop_;
}

void
CameraSession::send_eos (guint32 seqnum)
{
  {
    std::lock_guard guard (lock_);
    if (std::exchange (eos_, true))
      return;
  }
  trigger_.set_playing (false);
  output_.send_eos (seqnum);
}

void
CameraSession::flush ()
{
  pairing_.drop_waiting ();
  bool playing;
  {
    std::lock_guard guard (lock_);
    eos_ = false;
    flushed_ = true;
    flow_ = GST_FLOW_OK;
    gst_flow_combiner_reset (combiner_);
    playing = playing_;
  }
  trigger_.set_playing (playing);
}

void
CameraSession::handle_flow (const CameraPad &pad, GstFlowReturn flow)
{
  std::lock_guard guard (lock_);
  const GstFlowReturn all = gst_flow_combiner_update_pad_flow (combiner_, pad.pad (), flow);
  GST_DEBUG_OBJECT (
      pad.pad (), "flow %s, of all pads %s", gst_flow_get_name (flow), gst_flow_get_name (all));
  if (all == GST_FLOW_OK || all == GST_FLOW_FLUSHING || flow_ != GST_FLOW_OK)
    return;
  flow_ = all;
  changed_.notify_all ();
}

GstStructure *
CameraSession::stats ()
{
  static constexpr const char *kNames[] = {"left", "right", "third"};
  const PairingStatistics pairing = pairing_.stats ();
  const CameraStatistics cameras = cameras_.statistics ();
  GstStructure *s = gst_structure_new ("stereocamsrc-stats", "sets", G_TYPE_UINT64, pairing.sets,
      "apart", G_TYPE_UINT64, pairing.apart, "unknown", G_TYPE_UINT64, pairing.unknown,
      "missed-ticks", G_TYPE_UINT64, trigger_.missed (), "missing-packets", G_TYPE_UINT64,
      pairing.missing_packets, "resent-packets", G_TYPE_UINT64, guint64 (cameras.resent_packets),
      "underruns", G_TYPE_UINT64, guint64 (cameras.underruns), "reconnects", G_TYPE_UINT64,
      reconnects_.load (), nullptr);
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
