/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "stream.hpp"

#include <algorithm>
#include <gstrange/gstrange.h>
#include <gstrange/gstrangestatus.hpp>
#include <utility>

GST_DEBUG_CATEGORY_EXTERN (gst_avatar_test_src_debug);
#define GST_CAT_DEFAULT gst_avatar_test_src_debug

/* Negotiation was overtaken by a new wish of downstream. */
static constexpr GstFlowReturn kAgain = GST_FLOW_CUSTOM_SUCCESS;

AvatarStream::AvatarStream (GstElement *element) : element_ (element)
{
  g_rec_mutex_init (&task_lock_);
}

AvatarStream::~AvatarStream ()
{
  gst_flow_combiner_free (combiner_);
  g_rec_mutex_clear (&task_lock_);
}

AvatarPads
AvatarStream::pads ()
{
  std::lock_guard guard (lock_);
  return pads_;
}

bool
AvatarStream::is_live ()
{
  std::lock_guard guard (lock_);
  return is_live_;
}

guint64
AvatarStream::frames ()
{
  std::lock_guard guard (lock_);
  return frames_;
}

/* ---- pads ---- */

void
AvatarStream::add_pad (GstPad *pad, AvatarPadKind kind)
{
  std::lock_guard guard (lock_);
  pads_.push_back (std::make_shared<AvatarPad> (pad, kind));
  gst_flow_combiner_add_pad (combiner_, pad);
  /* RECONFIGURE says it too, but for links that are made without. */
  g_signal_connect (pad, "linked",
      G_CALLBACK (+[] (GstPad *linked, GstPad *, AvatarStream *stream) {
        gst_pad_mark_reconfigure (linked);
        stream->pad_linked ();
      }),
      this);
  run_task ();
}

void
AvatarStream::remove_pad (GstPad *pad)
{
  std::lock_guard guard (lock_);
  const auto found = std::ranges::find_if (pads_, [&] (const auto &p) { return p->pad () == pad; });
  if (found == pads_.end ())
    return;
  g_signal_handlers_disconnect_by_data (pad, this);
  (*found)->set_flushing (true);
  pads_.erase (found);
  gst_flow_combiner_remove_pad (combiner_, pad);
}

bool
AvatarStream::any_linked () const
{
  return std::ranges::any_of (
      pads_, [] (const auto &entry) { return gst_pad_is_linked (entry->pad ()); });
}

/* A pad that is requested while the element runs is linked only a moment later: that is no error.
 */
bool
AvatarStream::rests () const
{
  const bool over = eos_wanted_ || ended_;
  return !running_ || holds_ > 0 || pads_.empty () || (!over && !any_linked ());
}

bool
AvatarStream::all_unlinked ()
{
  std::lock_guard guard (lock_);
  return !any_linked ();
}

void
AvatarStream::pad_linked ()
{
  std::lock_guard guard (lock_);
  run_task ();
}

bool
AvatarStream::knows (const AvatarPad &pad) const
{
  return std::ranges::any_of (pads_, [&] (const auto &entry) { return entry.get () == &pad; });
}

/* ---- negotiation: one size and frame rate for all pads ---- */

GstCaps *
AvatarStream::caps_for (const AvatarPad &pad, const AvatarFormat &format) const
{
  GstCaps *wanted = pad.kind () == AvatarPadKind::kRange
                        ? painter_.make_range_caps (format.fps_n, format.fps_d)
                        : painter_.make_raw_caps (format.fps_n, format.fps_d);
  GstCaps *peer = pad.peer_caps ();
  GstCaps *both = gst_caps_intersect_full (peer, wanted, GST_CAPS_INTERSECT_FIRST);
  gst_caps_unref (peer);
  gst_caps_unref (wanted);
  return gst_caps_is_empty (both) ? both : gst_caps_fixate (both);
}

GstFlowReturn
AvatarStream::negotiate_pad (AvatarPad &pad, const AvatarFormat &format)
{
  if (!gst_pad_is_linked (pad.pad ()))
    return GST_FLOW_OK;
  GstCaps *caps = caps_for (pad, format);
  const bool good = pad.negotiate (caps);
  GST_DEBUG_OBJECT (pad.pad (), "%s %" GST_PTR_FORMAT, good ? "takes" : "refuses", caps);
  gst_caps_unref (caps);
  return good ? GST_FLOW_OK : refused (pad);
}

GstFlowReturn
AvatarStream::refused (const AvatarPad &pad)
{
  {
    std::lock_guard guard (lock_);
    if (!knows (pad) || !gst_pad_is_linked (pad.pad ()))
      return GST_FLOW_OK; /* it went away meanwhile */
  }
  if (GST_PAD_IS_FLUSHING (pad.pad ()))
    return GST_FLOW_FLUSHING;
  if (GST_PAD_NEEDS_RECONFIGURE (pad.pad ()))
    return kAgain; /* the peer wants something else since the format was chosen */
  GST_ELEMENT_ERROR (element_, CORE, NEGOTIATION,
      ("pad %s: the peer accepts none of the formats { RGBx, BGRx, RGB, BGR, GRAY8 }",
          GST_PAD_NAME (pad.pad ())),
      (nullptr));
  return GST_FLOW_ERROR;
}

GstFlowReturn
AvatarStream::no_common_format ()
{
  {
    std::lock_guard guard (lock_);
    if (!running_)
      return GST_FLOW_FLUSHING;
  }
  GST_ELEMENT_ERROR (element_, CORE, NEGOTIATION,
      ("the peers of the pads have no size and frame rate in common (16 to 4096 pixels, 1/1000 to "
       "1000 frames per second)"),
      (nullptr));
  return GST_FLOW_ERROR;
}

GstFlowReturn
AvatarStream::negotiate (const AvatarPads &pads)
{
  for (const auto &pad : pads)
    pad->push_stream_start (element_, group_id_);
  AvatarFormat format{};
  if (!avatar_choose_format (pads, format))
    return no_common_format ();
  GstFlowReturn flow =
      gst_range_flow_return (element_, painter_.set_size (format.width, format.height));
  const bool new_rate = clock_.set_rate (format.fps_n, format.fps_d);
  if (new_rate)
    painter_.forget_loop ();
  for (const auto &pad : pads)
    if (flow == GST_FLOW_OK)
      flow = negotiate_pad (*pad, format);
  if (flow == GST_FLOW_OK && new_rate && is_live_)
    gst_element_post_message (element_, gst_message_new_latency (GST_OBJECT (element_)));
  return flow;
}

/* ---- the streaming thread ---- */

GstFlowReturn
AvatarStream::push_picture (AvatarPad &pad, const AvatarMoment &moment)
{
  GstBuffer *buffer = nullptr;
  GstFlowReturn flow = pad.acquire (&buffer);
  if (flow == GST_FLOW_ERROR)
    return gst_range_flow_return (
        element_, {rangecast::StatusCode::kNoSpace, "out of memory for a frame"});
  if (flow != GST_FLOW_OK)
    return flow;
  flow = gst_range_flow_return (
      element_, pad.kind () == AvatarPadKind::kRange
                    ? painter_.draw_range (moment, buffer)
                    : painter_.draw_raw (static_cast<rangecast::SceneCamera> (pad.kind ()),
                          pad.video (), moment, buffer));
  if (flow != GST_FLOW_OK) {
    gst_buffer_unref (buffer);
    return flow;
  }
  GST_BUFFER_PTS (buffer) = moment.pts;
  GST_BUFFER_DURATION (buffer) = moment.duration;
  GST_BUFFER_OFFSET (buffer) = moment.index;
  GST_BUFFER_OFFSET_END (buffer) = moment.index + 1;
  if (moment.discont)
    GST_BUFFER_FLAG_SET (buffer, GST_BUFFER_FLAG_DISCONT);
  gst_range_buffer_set_capture_time (buffer, moment.capture_time);
  pad.push_segment (segment_, segment_seqnum_);
  return pad.push (buffer);
}

/* A pad that was released meanwhile says nothing about the others. */
GstFlowReturn
AvatarStream::combine (const AvatarPad &pad, GstFlowReturn flow)
{
  std::lock_guard guard (lock_);
  return knows (pad) ? gst_flow_combiner_update_pad_flow (combiner_, pad.pad (), flow)
                     : GST_FLOW_OK;
}

GstFlowReturn
AvatarStream::push_pictures (const AvatarPads &pads, const AvatarMoment &moment)
{
  GstFlowReturn flow = GST_FLOW_OK;
  for (const auto &pad : pads) {
    const GstFlowReturn pushed = push_picture (*pad, moment);
    flow = combine (*pad, pushed);
    if (flow != GST_FLOW_OK && flow != GST_FLOW_NOT_LINKED) /* that counts when all are asked */
      return flow;
  }
  return flow;
}

bool
AvatarStream::any_stale (const AvatarPads &pads)
{
  bool stale = false;
  for (const auto &pad : pads)
    stale |= pad->needs_negotiation ();
  return stale;
}

GstFlowReturn
AvatarStream::negotiate_if_stale (const AvatarPads &pads)
{
  return any_stale (pads) ? negotiate (pads) : GST_FLOW_OK;
}

GstFlowReturn
AvatarStream::one_frame (const AvatarPads &pads)
{
  GstFlowReturn flow = negotiate_if_stale (pads);
  if (flow != GST_FLOW_OK)
    return flow == kAgain ? GST_FLOW_OK : flow;
  AvatarMoment moment{};
  if (!is_live_)
    moment = clock_.next ();
  else if (!clock_.wait (element_, moment))
    return GST_FLOW_OK;             /* the loop looks why */
  flow = negotiate_if_stale (pads); /* pads may have been linked anew during the wait */
  if (flow != GST_FLOW_OK)
    return flow == kAgain ? GST_FLOW_OK : flow;
  if (GST_CLOCK_TIME_IS_VALID (segment_.stop) && moment.pts >= segment_.stop)
    return GST_FLOW_EOS;
  flow = push_pictures (pads, moment);
  if (flow == GST_FLOW_NOT_LINKED || flow == GST_FLOW_NOT_NEGOTIATED)
    return all_unlinked () || any_stale (pads) ? GST_FLOW_OK : flow; /* overtaken, too */
  if (flow != GST_FLOW_OK)
    return flow;
  segment_.position = moment.pts + moment.duration;
  sent_++;
  std::lock_guard guard (lock_);
  frames_++;
  return flow;
}

/* A task that was told to stop must not be told to pause: it would never end. */
void
AvatarStream::pause_task ()
{
  if (running_ && task_)
    gst_task_pause (task_);
}

GstEvent *
AvatarStream::end_event () const
{
  GstEvent *event = (segment_.flags & GST_SEGMENT_FLAG_SEGMENT) != 0
                        ? gst_event_new_segment_done (GST_FORMAT_TIME, segment_.position)
                        : gst_event_new_eos ();
  gst_event_set_seqnum (event, segment_seqnum_);
  return event;
}

void
AvatarStream::post_segment_done ()
{
  GstMessage *message =
      gst_message_new_segment_done (GST_OBJECT (element_), GST_FORMAT_TIME, segment_.position);
  gst_message_set_seqnum (message, segment_seqnum_);
  gst_element_post_message (element_, message);
}

void
AvatarStream::end_stream (const AvatarPads &pads, GstFlowReturn flow)
{
  GST_INFO_OBJECT (element_, "pausing: %s", gst_flow_get_name (flow));
  bool again;
  {
    std::lock_guard guard (lock_);
    pause_task ();
    again = ended_;
    ended_ = flow != GST_FLOW_FLUSHING;
  }
  if (flow == GST_FLOW_FLUSHING)
    return;
  if (flow == GST_FLOW_NOT_LINKED || flow == GST_FLOW_NOT_NEGOTIATED)
    GST_ELEMENT_FLOW_ERROR (element_, flow);
  if (!again && (segment_.flags & GST_SEGMENT_FLAG_SEGMENT) != 0)
    post_segment_done ();
  for (const auto &pad : pads) {
    pad->push_stream_start (element_, group_id_);
    pad->push_segment (segment_, segment_seqnum_);
    pad->push_end (end_event ());
  }
}

void
AvatarStream::loop (gpointer stream)
{
  auto self = static_cast<AvatarStream *> (stream);
  AvatarPads pads;
  bool over;
  {
    std::lock_guard guard (self->lock_);
    if (self->rests ()) {
      self->pause_task (); /* whoever changes that starts it again */
      self->clock_.note_rest ();
      return;
    }
    pads = self->pads_;
    over = self->eos_wanted_ || self->ended_;
  }
  over |= self->num_buffers_ >= 0 && self->sent_ >= static_cast<guint64> (self->num_buffers_);
  const GstFlowReturn flow = over ? GST_FLOW_EOS : self->one_frame (pads);
  if (flow != GST_FLOW_OK)
    self->end_stream (pads, flow);
}

void
AvatarStream::run_task ()
{
  if (rests ())
    return;
  if (!task_) {
    task_ = gst_task_new (loop, this, nullptr);
    gst_task_set_lock (task_, &task_lock_);
  }
  gst_task_start (task_);
}

/* ---- flushes and seeks ---- */

bool
AvatarStream::end ()
{
  std::lock_guard guard (lock_);
  eos_wanted_ = running_;
  if (running_)
    clock_.interrupt ();
  run_task ();
  return running_;
}

/* Makes the streaming thread stand still soon; hold task_lock_ to know that it does. */
void
AvatarStream::hold_task ()
{
  std::lock_guard guard (lock_);
  holds_++;
  pause_task ();
  clock_.interrupt ();
}

void
AvatarStream::push_flush_start (guint32 seqnum)
{
  for (const auto &pad : pads ()) {
    GstEvent *event = gst_event_new_flush_start ();
    gst_event_set_seqnum (event, seqnum);
    gst_pad_push_event (pad->pad (), event);
    pad->set_flushing (true);
  }
}

void
AvatarStream::push_flush_stop (guint32 seqnum, bool reset_time)
{
  for (const auto &pad : pads ()) {
    GstEvent *event = gst_event_new_flush_stop (reset_time);
    gst_event_set_seqnum (event, seqnum);
    gst_pad_push_event (pad->pad (), event);
    pad->set_flushing (false);
  }
}

/* Lets the thread go on in the segment. */
void
AvatarStream::release_task (guint32 seqnum)
{
  std::lock_guard guard (lock_);
  segment_seqnum_ = seqnum;
  eos_wanted_ = ended_ = false;
  for (const auto &pad : pads_)
    pad->restart ();
  gst_flow_combiner_reset (combiner_);
  if (--holds_ > 0 || !running_)
    return;
  clock_.resume ();
  run_task ();
}

bool
AvatarStream::flush_start (GstEvent *event)
{
  {
    std::lock_guard guard (lock_);
    if (!running_ || app_flush_)
      return false;
    app_flush_ = true;
  }
  hold_task ();
  push_flush_start (gst_event_get_seqnum (event));
  return true;
}

/* Running time starts anew, with the next frame. */
void
AvatarStream::restart_time ()
{
  segment_.start = segment_.time = segment_.position;
  segment_.base = segment_.offset = 0;
}

bool
AvatarStream::flush_stop (GstEvent *event)
{
  gboolean reset_time = TRUE;
  gst_event_parse_flush_stop (event, &reset_time);
  {
    std::lock_guard guard (lock_);
    if (!app_flush_)
      return false;
    app_flush_ = false;
  }
  g_rec_mutex_lock (&task_lock_);
  push_flush_stop (gst_event_get_seqnum (event), reset_time);
  if (reset_time && !is_live_)
    restart_time ();
  clock_.seek (segment_.position);
  release_task (gst_event_get_seqnum (event));
  g_rec_mutex_unlock (&task_lock_);
  return true;
}

bool
AvatarStream::seek_segment (GstEvent *event)
{
  gdouble rate;
  GstFormat format;
  GstSeekFlags flags;
  GstSeekType start_type, stop_type;
  gint64 start, stop;
  gst_event_parse_seek (event, &rate, &format, &flags, &start_type, &start, &stop_type, &stop);
  GstSegment segment = segment_;
  if (!gst_segment_do_seek (
          &segment, rate, format, flags, start_type, start, stop_type, stop, nullptr))
    return false;
  segment_ = segment;
  clock_.seek (segment.position);
  return true;
}

/* Every sink of a pipeline hands on the same seek: all but the first find it done. */
AvatarStream::SeekAnswer
AvatarStream::admit_seek (GstEvent *event)
{
  gdouble rate;
  GstFormat format;
  GstSeekFlags flags;
  gst_event_parse_seek (event, &rate, &format, &flags, nullptr, nullptr, nullptr, nullptr);
  std::lock_guard guard (lock_);
  if (!running_ || is_live_ || format != GST_FORMAT_TIME || rate <= 0 ||
      (flags & GST_SEEK_FLAG_INSTANT_RATE_CHANGE) != 0)
    return SeekAnswer::kNo;
  if (last_seek_ == gst_event_get_seqnum (event))
    return SeekAnswer::kDone;
  last_seek_ = gst_event_get_seqnum (event);
  return (flags & GST_SEEK_FLAG_FLUSH) != 0 ? SeekAnswer::kFlush : SeekAnswer::kContinue;
}

bool
AvatarStream::seek (GstEvent *event)
{
  const guint32 seqnum = gst_event_get_seqnum (event);
  const SeekAnswer answer = admit_seek (event);
  if (answer == SeekAnswer::kNo || answer == SeekAnswer::kDone)
    return answer == SeekAnswer::kDone;
  hold_task ();
  if (answer == SeekAnswer::kFlush)
    push_flush_start (seqnum);
  g_rec_mutex_lock (&task_lock_);
  if (answer == SeekAnswer::kFlush)
    push_flush_stop (seqnum, true);
  const bool done = seek_segment (event);
  release_task (seqnum);
  g_rec_mutex_unlock (&task_lock_);
  return done;
}

/* ---- life ---- */

/* With no pad there is nothing to stream, but the rig file is written all the same. */
bool
AvatarStream::start (const AvatarSettings &settings)
{
  bool idle;
  {
    std::lock_guard guard (lock_);
    is_live_ = settings.is_live;
    frames_ = 0;
    eos_wanted_ = ended_ = false;
    last_seek_ = GST_SEQNUM_INVALID;
    gst_flow_combiner_reset (combiner_);
    idle = pads_.empty ();
  }
  clock_.start ();
  painter_.start (settings);
  num_buffers_ = settings.num_buffers;
  sent_ = 0;
  group_id_ = gst_util_group_id_next ();
  segment_seqnum_ = gst_util_seqnum_next ();
  gst_segment_init (&segment_, GST_FORMAT_TIME);
  if (!idle || settings.rig_export.empty ())
    return true;
  return gst_range_flow_return (element_, painter_.set_size (320, 240)) == GST_FLOW_OK;
}

void
AvatarStream::run ()
{
  std::lock_guard guard (lock_);
  running_ = true;
  run_task ();
}

void
AvatarStream::ask_to_stop ()
{
  std::lock_guard guard (lock_);
  running_ = false;
  if (task_)
    gst_task_stop (task_);
  clock_.interrupt ();
  for (const auto &pad : pads_)
    pad->set_flushing (true);
}

void
AvatarStream::stop ()
{
  GstTask *task;
  {
    std::lock_guard guard (lock_);
    task = std::exchange (task_, nullptr);
    holds_ -= app_flush_;
    app_flush_ = false;
  }
  if (task)
    gst_task_join (task);
  gst_clear_object (&task);
  g_rec_mutex_lock (&task_lock_); /* a seek may be on its way */
  painter_.start ({});
  for (const auto &pad : pads ())
    pad->stop ();
  g_rec_mutex_unlock (&task_lock_);
}
