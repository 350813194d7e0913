/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* In the order of a frame: pads, the task, negotiation, pushing, the end; then state changes. */
#include "stream.hpp"

#include "common/capsadvice.hpp"

#include <algorithm>
#include <gstrange/gstrange.h>
#include <gstrange/gstrangestatus.hpp>
#include <utility>

GST_DEBUG_CATEGORY_EXTERN (gst_avatar_test_src_debug);
#define GST_CAT_DEFAULT gst_avatar_test_src_debug

/* Downstream asked for something else meanwhile: negotiate again. */
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

/* ---- pads ---- */

void
AvatarStream::add_pad (GstPad *pad, AvatarPadKind kind)
{
  std::lock_guard guard (lock_);
  pads_.push_back (std::make_shared<AvatarPad> (pad, kind));
  gst_flow_combiner_add_pad (combiner_, pad);
  start_task ();
}

void
AvatarStream::remove_pad (GstPad *pad)
{
  std::lock_guard guard (lock_);
  const auto found = std::ranges::find_if (pads_, [&] (const auto &p) { return p->pad () == pad; });
  if (found == pads_.end ())
    return;
  pads_.erase (found);
  gst_flow_combiner_remove_pad (combiner_, pad);
}

void
AvatarStream::pad_linked ()
{
  std::lock_guard guard (lock_);
  start_task ();
}

bool
AvatarStream::has_pad (const AvatarPad &pad) const
{
  return std::ranges::any_of (pads_, [&] (const auto &entry) { return entry.get () == &pad; });
}

bool
AvatarStream::any_linked () const
{
  return std::ranges::any_of (
      pads_, [] (const auto &entry) { return gst_pad_is_linked (entry->pad ()); });
}

/* ---- the task ---- */

/* A pad that is requested while the element runs is linked only a moment later: that is no error.
 */
bool
AvatarStream::must_pause () const
{
  const bool over = eos_wanted_ || ended_;
  return !running_ || pads_.empty () || (!over && !any_linked ());
}

void
AvatarStream::start_task ()
{
  if (must_pause ())
    return;
  if (!task_) {
    task_ = gst_task_new (loop, this, nullptr);
    gst_task_set_lock (task_, &task_lock_);
  }
  gst_task_start (task_);
}

/* A task that was stopped must not be paused: it would never end. */
void
AvatarStream::pause_task ()
{
  if (running_ && task_)
    gst_task_pause (task_);
}

void
AvatarStream::loop (gpointer stream)
{
  auto self = static_cast<AvatarStream *> (stream);
  AvatarPads pads;
  bool over;
  {
    std::lock_guard guard (self->lock_);
    if (self->must_pause ()) {
      GST_DEBUG_OBJECT (self->element_, "pausing: no linked pad");
      self->pause_task (); /* whatever changes that starts it again */
      self->clock_.pause ();
      return;
    }
    pads = self->pads_;
    over = self->eos_wanted_ || self->ended_;
  }
  over |= self->num_buffers_ >= 0 && self->frames_ >= static_cast<guint64> (self->num_buffers_);
  const GstFlowReturn flow = over ? GST_FLOW_EOS : self->output_frame (pads);
  if (flow != GST_FLOW_OK && flow != kAgain)
    self->end_stream (pads, flow);
}

namespace {

bool
any_needs_negotiation (const AvatarPads &pads)
{
  bool needed = false;
  for (const auto &pad : pads)
    needed |= pad->needs_negotiation (); /* resets each pad's mark */
  return needed;
}

} // namespace

GstFlowReturn
AvatarStream::output_frame (const AvatarPads &pads)
{
  GstFlowReturn flow = any_needs_negotiation (pads) ? negotiate (pads) : GST_FLOW_OK;
  if (flow != GST_FLOW_OK)
    return flow;
  FrameTime time{};
  if (!is_live_)
    time = clock_.next ();
  else if (!clock_.wait (element_, time))
    return kAgain;
  if (any_needs_negotiation (pads)) /* pads may have been linked again during the wait */
    flow = negotiate (pads);
  if (flow != GST_FLOW_OK)
    return flow;
  flow = push_frame (pads, time);
  if (flow == GST_FLOW_NOT_LINKED || flow == GST_FLOW_NOT_NEGOTIATED) {
    bool linked;
    {
      std::lock_guard guard (lock_);
      linked = any_linked ();
    }
    if (!linked || any_needs_negotiation (pads))
      return kAgain;
    return flow;
  }
  if (flow != GST_FLOW_OK)
    return flow;
  frames_++;
  return flow;
}

/* ---- negotiation: one size and frame rate for all pads ---- */

GstFlowReturn
AvatarStream::negotiate (const AvatarPads &pads)
{
  for (const auto &pad : pads)
    pad->push_stream_start (element_, group_id_);
  AvatarFormat format{};
  if (!avatar_choose_format (pads, format)) {
    {
      std::lock_guard guard (lock_);
      if (!running_)
        return GST_FLOW_FLUSHING;
    }
    for (const auto &pad : pads)
      if (!require_downstream (element_, pad->pad ()))
        return GST_FLOW_ERROR;
    GST_ELEMENT_ERROR (element_, CORE, NEGOTIATION,
        ("the peers of the pads have no size and frame rate in common (16 to 4096 pixels, 1/1000 "
         "to 1000 frames per second); for other formats than RGBx add videoconvert"),
        (nullptr));
    return GST_FLOW_ERROR;
  }
  GstFlowReturn flow =
      gst_range_flow_return (element_, painter_.set_size (format.width, format.height));
  const bool new_rate = clock_.set_rate (format.fps_n, format.fps_d);
  if (new_rate)
    painter_.clear_loops ();
  for (const auto &pad : pads)
    if (flow == GST_FLOW_OK && gst_pad_is_linked (pad->pad ()))
      flow = negotiate_pad (*pad, format);
  if (flow == GST_FLOW_OK && new_rate && is_live_)
    gst_element_post_message (element_, gst_message_new_latency (GST_OBJECT (element_)));
  for (const auto &pad : pads) /* before the first frame, so that no frame waits for it */
    if (flow == GST_FLOW_OK && gst_pad_is_linked (pad->pad ()) &&
        pad->kind () != AvatarPadKind::kRange)
      flow = gst_range_flow_return (
          element_, painter_.draw_loop (static_cast<rangecast::SceneCamera> (pad->kind ()),
                        double (format.fps_d) / format.fps_n, [this] {
                          std::lock_guard guard (lock_);
                          return running_ && !eos_wanted_;
                        }));
  return flow;
}

GstFlowReturn
AvatarStream::negotiate_pad (AvatarPad &pad, const AvatarFormat &format)
{
  GstCaps *wanted = pad.kind () == AvatarPadKind::kRange
                        ? painter_.make_range_caps (format.fps_n, format.fps_d)
                        : painter_.make_raw_caps (format.fps_n, format.fps_d);
  GstCaps *peer = pad.peer_caps ();
  GstCaps *caps = gst_caps_intersect_full (peer, wanted, GST_CAPS_INTERSECT_FIRST);
  gst_caps_unref (peer);
  gst_caps_unref (wanted);
  if (!gst_caps_is_empty (caps))
    caps = gst_caps_fixate (caps);
  const bool accepted = pad.negotiate (caps);
  GST_INFO_OBJECT (pad.pad (), "caps %" GST_PTR_FORMAT "%s", caps, accepted ? "" : " refused");
  gst_caps_unref (caps);
  if (accepted)
    return GST_FLOW_OK;
  {
    std::lock_guard guard (lock_);
    if (!has_pad (pad) || !gst_pad_is_linked (pad.pad ()))
      return GST_FLOW_OK; /* released or unlinked meanwhile */
  }
  if (GST_PAD_IS_FLUSHING (pad.pad ()))
    return GST_FLOW_FLUSHING;
  if (GST_PAD_NEEDS_RECONFIGURE (pad.pad ()))
    return kAgain;
  const bool is_range = pad.kind () == AvatarPadKind::kRange;
  GST_ELEMENT_ERROR (element_, CORE, NEGOTIATION,
      ("pad %s: the peer accepts %s", GST_PAD_NAME (pad.pad ()),
          is_range ? "no video/x-range with as many views as property views says"
                   : "no RGBx of this size and frame rate"),
      (nullptr));
  return GST_FLOW_ERROR;
}

/* ---- frames ---- */

GstFlowReturn
AvatarStream::push_frame (const AvatarPads &pads, const FrameTime &time)
{
  GST_LOG_OBJECT (element_, "frame %" G_GUINT64_FORMAT " at %" GST_TIME_FORMAT, time.index,
      GST_TIME_ARGS (time.pts));
  GstFlowReturn flow = GST_FLOW_OK;
  for (const auto &pad : pads) {
    const GstFlowReturn pushed = push_picture (*pad, time);
    {
      std::lock_guard guard (lock_); /* a pad that was released does not count */
      flow = has_pad (*pad) ? gst_flow_combiner_update_pad_flow (combiner_, pad->pad (), pushed)
                            : GST_FLOW_OK;
    }
    if (flow != GST_FLOW_OK && flow != GST_FLOW_NOT_LINKED) /* that counts when all were pushed */
      return flow;
  }
  return flow;
}

GstFlowReturn
AvatarStream::push_picture (AvatarPad &pad, const FrameTime &time)
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
                    ? painter_.draw_range (time, buffer)
                    : painter_.draw_raw (static_cast<rangecast::SceneCamera> (pad.kind ()),
                          pad.video (), time, buffer));
  if (flow != GST_FLOW_OK) {
    gst_buffer_unref (buffer);
    return flow;
  }
  GST_BUFFER_PTS (buffer) = time.pts;
  GST_BUFFER_DURATION (buffer) = time.duration;
  GST_BUFFER_OFFSET (buffer) = time.index;
  GST_BUFFER_OFFSET_END (buffer) = time.index + 1;
  if (time.discont)
    GST_BUFFER_FLAG_SET (buffer, GST_BUFFER_FLAG_DISCONT);
  gst_range_buffer_set_capture_time (buffer, time.capture_time);
  pad.push_segment ();
  return pad.push (buffer);
}

void
AvatarStream::end_stream (const AvatarPads &pads, GstFlowReturn flow)
{
  GST_INFO_OBJECT (element_, "pausing: %s", gst_flow_get_name (flow));
  {
    std::lock_guard guard (lock_);
    pause_task ();
    ended_ = flow != GST_FLOW_FLUSHING;
  }
  if (flow == GST_FLOW_FLUSHING)
    return;
  if (flow == GST_FLOW_NOT_LINKED || flow == GST_FLOW_NOT_NEGOTIATED)
    GST_ELEMENT_FLOW_ERROR (element_, flow);
  for (const auto &pad : pads) {
    pad->push_stream_start (element_, group_id_);
    pad->push_segment ();
    pad->push_eos ();
  }
}

/* ---- EOS ---- */

bool
AvatarStream::end ()
{
  std::lock_guard guard (lock_);
  eos_wanted_ = running_;
  if (running_)
    clock_.interrupt ();
  start_task ();
  return running_;
}

/* ---- state changes ---- */

bool
AvatarStream::start (const AvatarSettings &settings)
{
  bool has_pads;
  {
    std::lock_guard guard (lock_);
    eos_wanted_ = ended_ = false;
    gst_flow_combiner_reset (combiner_);
    has_pads = !pads_.empty ();
  }
  clock_.start ();
  painter_.start (settings);
  is_live_ = settings.is_live;
  num_buffers_ = settings.num_buffers;
  frames_ = 0;
  group_id_ = gst_util_group_id_next ();
  /* without a pad there is nothing to stream, but the rig file is written */
  return has_pads || settings.rig_export.empty () ||
         gst_range_flow_return (element_, painter_.set_size (320, 240)) == GST_FLOW_OK;
}

void
AvatarStream::run ()
{
  std::lock_guard guard (lock_);
  running_ = true;
  start_task ();
}

void
AvatarStream::request_stop ()
{
  std::lock_guard guard (lock_);
  running_ = false;
  if (task_)
    gst_task_stop (task_);
  clock_.interrupt ();
}

void
AvatarStream::stop ()
{
  GstTask *task;
  AvatarPads pads;
  {
    std::lock_guard guard (lock_);
    task = std::exchange (task_, nullptr);
    pads = pads_;
  }
  if (task)
    gst_task_join (task);
  gst_clear_object (&task);
  clock_.stop ();
  painter_.start ({});
  for (const auto &pad : pads)
    pad->stop ();
}
