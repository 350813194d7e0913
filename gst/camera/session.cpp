/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The life of a session: beginning and end, faults, what the application asks. */
#include "session.hpp"

#include <future>
#include <gstrange/gstrangestatus.hpp>
#include <system_error>
#include <thread>
#include <utility>

GST_DEBUG_CATEGORY_EXTERN (gst_stereo_cam_src_debug);
#define GST_CAT_DEFAULT gst_stereo_cam_src_debug

using Milliseconds = std::chrono::milliseconds;

static constexpr Milliseconds kRetry{1000}, kGapTime{100};
static constexpr GstClockTime kClockPatience = 10 * GST_SECOND;

/* Exposed, and on its way no longer than until the next one: else pictures would pile up. */
/* Sessions of this process that were told to stop and have not ended: one that looked for its
 * cameras may open one yet, for the moment until it sees that nobody wants it. */
static std::atomic<int> leaving = 0;

GstClockTime
CamSourceSession::latency_of (GstClockTime exposure, GstClockTime period)
{
  const GstClockTime longest = period > 0 ? period : 100 * GST_MSECOND; /* of single shots */
  return MIN (exposure, longest) + longest;
}

/* What is asked before the cameras have answered is what it will mostly be: the rate where
 * downstream leaves a choice, and the exposure that is wanted. */
static GstClockTime
first_latency (const CamSourceSettings &settings, const CamSourceSession *previous)
{
  if (previous && previous->latency () > 0)
    return previous->latency ();
  const auto exposure = static_cast<GstClockTime> (settings.exposure_us * 1000);
  return CamSourceSession::latency_of (exposure, settings.single_shot ? 0 : GST_SECOND / 30);
}

CamSourceSession::CamSourceSession (Setup setup)
    : element_ (GST_ELEMENT (gst_object_ref (setup.element))),
      settings_ (std::move (setup.settings)), names_ (std::move (setup.names)),
      pads_ (std::move (setup.pads)), stream_ (setup.stream),
      clock_ (setup.clock ? GST_CLOCK (gst_object_ref (setup.clock)) : nullptr),
      previous_ (std::move (setup.previous)), ticker_ (setup.element)
{
  latency_ = first_latency (settings_, previous_.get ());
  for (const auto &pad : pads_)
    gst_flow_combiner_add_pad (flows_, pad->pad ());
}

CamSourceSession::~CamSourceSession ()
{
  gst_flow_combiner_free (flows_);
  gst_clear_object (&clock_);
}

/* The element goes last: it may be the last reference, and then what the thread uses goes, too. */
std::shared_ptr<CamSourceSession>
CamSourceSession::begin (Setup setup)
{
  std::shared_ptr<CamSourceSession> session (new CamSourceSession (std::move (setup)));
  const auto body = [self = session] () mutable {
    GstElement *element = self->element_;
    self->run ();
    {
      std::lock_guard guard (self->lock_);
      self->ended_ = true;
      leaving -= self->quit_;
      self->changed_.notify_all ();
    }
    self.reset ();
    gst_object_unref (element);
  };
  try {
    std::thread (body).detach ();
  } catch (const std::system_error &) {
    gst_object_unref (session->element_);
    session.reset ();
  }
  return session;
}

/* ---- the thread ---- */

bool
CamSourceSession::quits ()
{
  std::lock_guard guard (lock_);
  return quit_;
}

void
CamSourceSession::run ()
{
  if (previous_)
    while (!previous_->wait_for_end (Milliseconds (1000)))
      ;
  previous_.reset ();
  while (!quits () && one_guarded_life () == End::kFault) {
    const bool goes_on = stands_fault ();
    stop_cameras ();
    if (!goes_on)
      break;
    rest_before_retry ();
  }
  stop_cameras ();
}

/* While a camera that is away is looked for, which takes seconds, branches go on. */
bool
CamSourceSession::open_with_gaps ()
{
  auto opened = std::async (std::launch::async, [this] { return open_cameras (); });
  while (opened.wait_for (kGapTime) != std::future_status::ready)
    send_gaps ();
  return opened.get ();
}

/* Where the system gives no more threads, as the standard library says it. */
CamSourceSession::End
CamSourceSession::one_guarded_life ()
{
  try {
    return one_life ();
  } catch (const std::exception &e) {
    fail ({CameraFault::kFailed, std::string ("cannot run the camera loop: ") + e.what ()});
    return End::kFault;
  }
}

/* From opening the cameras to their loss. */
CamSourceSession::End
CamSourceSession::one_life ()
{
  if (!open_with_gaps ())
    return quits () ? End::kStopped : End::kFault;
  if (!wait_for_clock ())
    return quits () ? End::kStopped : End::kFault;
  End end = End::kAgain;
  while (end == End::kAgain) {
    if (!choose_format () || !configure_cameras () || !start_cameras ())
      return quits () ? End::kStopped : End::kFault;
    if (std::exchange (said_fault_, false)) {
      reconnects_++;
      say ("stereocamsrc-back", "left", cameras_[0]->label ());
    }
    end = serve ();
    if (end == End::kFault)
      (void)stands_fault (); /* what follows may wait for a camera that does not answer */
    ticker_.stop ();
    look_.stop ();
    triggers_.stop ();
    for (const auto &camera : cameras_)
      camera->stop ();
    bank_statistics ();
  }
  return end;
}

/* The clock runs by itself meanwhile; base time and running time are of the pipeline, and jump
 * forward with it. */
bool
CamSourceSession::wait_for_clock ()
{
  if (!clock_ || clock_ready_)
    return true;
  for (GstClockTime waited = 0; !gst_clock_wait_for_sync (clock_, 100 * GST_MSECOND);
       waited += 100 * GST_MSECOND) {
    if (quits ())
      return false;
    if (waited >= kClockPatience) {
      fail ({CameraFault::kTimedOut, "clock-server " + settings_.clock_server +
                                         " does not answer; expected a network clock there, as "
                                         "rangemux with clock-port provides"});
      return false;
    }
  }
  clock_ready_ = true;
  say ("stereocamsrc-clock", "server", settings_.clock_server);
  return true;
}

/* ---- faults ---- */

void
CamSourceSession::fail (CameraStatus status)
{
  std::lock_guard guard (lock_);
  if (fault_.ok ()) /* the first is the cause of the others */
    fault_ = std::move (status);
  changed_.notify_all ();
}

void
CamSourceSession::lose (Camera &camera)
{
  camera.give_up ();
  fail ({CameraFault::kLost, lost_text (camera.label ())});
}

/* @param status  of a call that was made while the camera ran */
bool
CamSourceSession::fail_if_gone (Camera &camera, const CameraStatus &status)
{
  const CameraFault fault = status.fault ();
  const bool gone = fault == CameraFault::kTimedOut || fault == CameraFault::kLost ||
                    fault == CameraFault::kBusy; /* others have control now */
  if (gone)
    lose (camera);
  return gone;
}

struct ErrorDomain {
  GQuark domain;
  gint code;
};

static ErrorDomain
domain_of (CameraFault fault)
{
  switch (fault) {
    case CameraFault::kNotFound:
      return {GST_RESOURCE_ERROR, GST_RESOURCE_ERROR_NOT_FOUND};
    case CameraFault::kBusy:
      return {GST_RESOURCE_ERROR, GST_RESOURCE_ERROR_BUSY};
    case CameraFault::kNoPermission:
      return {GST_RESOURCE_ERROR, GST_RESOURCE_ERROR_NOT_AUTHORIZED};
    case CameraFault::kTimedOut:
    case CameraFault::kLost:
      return {GST_RESOURCE_ERROR, GST_RESOURCE_ERROR_READ};
    case CameraFault::kBadSetting:
      return {GST_RESOURCE_ERROR, GST_RESOURCE_ERROR_SETTINGS};
    case CameraFault::kUnsupported:
      return {GST_STREAM_ERROR, GST_STREAM_ERROR_FORMAT};
    default:
      return {GST_RESOURCE_ERROR, GST_RESOURCE_ERROR_FAILED};
  }
}

void
CamSourceSession::post_fault (bool warning)
{
  CameraStatus fault;
  {
    std::lock_guard guard (lock_);
    if (quit_)
      return;
    fault = fault_;
  }
  const ErrorDomain error = domain_of (fault.fault ());
  const std::string text = fault.message () + (warning ? "; trying again until it comes back" : "");
  gst_element_message_full (element_, warning ? GST_MESSAGE_WARNING : GST_MESSAGE_ERROR,
      error.domain, error.code, g_strdup (text.c_str ()), nullptr, __FILE__, GST_FUNCTION,
      __LINE__);
}

void
CamSourceSession::say (const char *name, const char *field, const std::string &value)
{
  if (quits ())
    return;
  GstStructure *structure = gst_structure_new (name, field, G_TYPE_STRING, value.c_str (), nullptr);
  gst_element_post_message (element_, gst_message_new_element (GST_OBJECT (element_), structure));
}

/* Tells a life's fault, once. @return false: it is the end */
bool
CamSourceSession::stands_fault ()
{
  if (!stands_)
    stands_ = tell_fault ();
  return *stands_;
}

bool
CamSourceSession::tell_fault ()
{
  bool may = false;
  GstFlowReturn flow = GST_FLOW_OK;
  {
    std::lock_guard guard (lock_);
    may = settings_.reconnect && fault_.may_recover ();
    flow = fatal_flow_;
    if (quit_)
      return false;
  }
  if (flow != GST_FLOW_OK) {
    if (flow != GST_FLOW_EOS)
      GST_ELEMENT_FLOW_ERROR (element_, flow);
    finish (gst_util_seqnum_next ());
    return false;
  }
  if (!may) {
    post_fault (false);
    finish (gst_util_seqnum_next ());
    return false;
  }
  if (!said_fault_) {
    std::string text;
    {
      std::lock_guard guard (lock_);
      text = fault_.message ();
    }
    post_fault (true);
    say ("stereocamsrc-lost", "reason", text);
  }
  said_fault_ = true;
  return true;
}

void
CamSourceSession::rest_before_retry ()
{
  for (Milliseconds rested{0}; rested < kRetry; rested += kGapTime) {
    {
      std::unique_lock guard (lock_);
      fault_ = {};
      stands_.reset ();
      if (changed_.wait_for (guard, kGapTime, [this] { return quit_; }))
        return;
    }
    send_gaps ();
  }
}

/* Ends all pads. */
void
CamSourceSession::finish (guint32 seqnum)
{
  {
    std::lock_guard guard (lock_);
    if (std::exchange (eos_, true))
      return;
  }
  ticker_.set_playing (false);
  for (const auto &pad : pads_)
    pad->send_eos (stream_, seqnum);
}

/* ---- any thread ---- */

void
CamSourceSession::set_playing (bool playing)
{
  {
    std::lock_guard guard (lock_);
    playing_ = playing;
    changed_.notify_all ();
  }
  ticker_.set_playing (playing);
}

void
CamSourceSession::ask_to_stop ()
{
  {
    std::lock_guard guard (lock_);
    leaving += !quit_ && !ended_;
    quit_ = true;
    changed_.notify_all ();
  }
  ticker_.set_playing (false);
}

bool
CamSourceSession::wait_for_cameras (Milliseconds most)
{
  std::unique_lock guard (lock_);
  return changed_.wait_for (guard, most, [this] { return ended_ || !has_cameras_; });
}

void
CamSourceSession::set_has_cameras (bool has)
{
  std::lock_guard guard (lock_);
  has_cameras_ = has;
  changed_.notify_all ();
}

bool
CamSourceSession::wait_for_leavers ()
{
  static constexpr Milliseconds kLook (50), kMax (5000);
  bool waited = false;
  for (Milliseconds passed (0); leaving > 0 && !quits () && passed < kMax; passed += kLook) {
    waited = true;
    std::this_thread::sleep_for (kLook);
  }
  return waited && !quits ();
}

bool
CamSourceSession::wait_for_end (Milliseconds most)
{
  std::unique_lock guard (lock_);
  return changed_.wait_for (guard, most, [this] { return ended_; });
}

void
CamSourceSession::end (guint32 seqnum)
{
  finish (seqnum);
}

/* Also after EOS: it goes on. */
void
CamSourceSession::flushed ()
{
  pairing_.drop_waiting ();
  bool playing;
  {
    std::lock_guard guard (lock_);
    eos_ = false;
    flushed_ = true;
    fatal_flow_ = GST_FLOW_OK;
    gst_flow_combiner_reset (flows_);
    playing = playing_;
  }
  ticker_.set_playing (playing);
}

void
CamSourceSession::pad_flowed (const CamSourcePad &pad, GstFlowReturn flow)
{
  std::lock_guard guard (lock_);
  const GstFlowReturn all = gst_flow_combiner_update_pad_flow (flows_, pad.pad (), flow);
  GST_DEBUG_OBJECT (
      pad.pad (), "%s, together %s", gst_flow_get_name (flow), gst_flow_get_name (all));
  if (all == GST_FLOW_OK || all == GST_FLOW_FLUSHING || fatal_flow_ != GST_FLOW_OK)
    return;
  fatal_flow_ = all;
  changed_.notify_all ();
}

GstClockTime
CamSourceSession::running_time ()
{
  GstClock *clock = gst_element_get_clock (element_);
  if (!clock)
    return GST_CLOCK_TIME_NONE;
  const GstClockTime now = gst_clock_get_time (clock), base = gst_element_get_base_time (element_);
  gst_object_unref (clock);
  return now >= base ? now - base : GST_CLOCK_TIME_NONE;
}

static void
set_nanoseconds (GstStructure *s, const char *field, std::int64_t value)
{
  gst_structure_set (s, field, G_TYPE_INT64, gint64 (value), nullptr);
}

GstStructure *
CamSourceSession::stats ()
{
  static constexpr const char *kNames[] = {"left", "right", "third"};
  const CamSourcePairingStats pairing = pairing_.stats ();
  const CameraStatistics cameras = camera_statistics ();
  GstStructure *s = gst_structure_new ("stereocamsrc-stats", "sets", G_TYPE_UINT64, pairing.sets,
      "apart", G_TYPE_UINT64, pairing.apart, "unknown", G_TYPE_UINT64, pairing.unknown,
      "missed-ticks", G_TYPE_UINT64, ticker_.missed (), "missing-packets", G_TYPE_UINT64,
      pairing.missing_packets, "resent-packets", G_TYPE_UINT64, guint64 (cameras.resent_packets),
      "underruns", G_TYPE_UINT64, guint64 (cameras.underruns), "reconnects", G_TYPE_UINT64,
      reconnects_.load (), nullptr);
  for (std::size_t i = 0; i < pads_.size (); i++) {
    const std::string name = kNames[i];
    gst_structure_set (s, ("dropped-" + name).c_str (), G_TYPE_UINT64, pairing.dropped[i],
        ("incomplete-" + name).c_str (), G_TYPE_UINT64, pairing.incomplete[i],
        ("overrun-" + name).c_str (), G_TYPE_UINT64, pads_[i]->overrun (), nullptr);
  }
  if (pairing.has_spread) {
    set_nanoseconds (s, "spread-p50", pairing.spread_p50_ns);
    set_nanoseconds (s, "spread-p99", pairing.spread_p99_ns);
    set_nanoseconds (s, "delay-p50", pairing.delay_p50_ns);
    set_nanoseconds (s, "delay-p99", pairing.delay_p99_ns);
  }
  return s;
}
