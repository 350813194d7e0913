/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "pad.hpp"

#include <chrono>
#include <utility>

CameraPad::CameraPad (GstElement *element, GstPad *pad, Flowed flowed)
    : element_ (element), pad_ (GST_PAD (gst_object_ref (pad))), flowed_ (std::move (flowed))
{
  flush_probe_ = gst_pad_add_probe (pad_, GST_PAD_PROBE_TYPE_EVENT_FLUSH, see_flush, this, nullptr);
}

CameraPad::~CameraPad ()
{
  gst_pad_remove_probe (pad_, flush_probe_);
  clear ();
  gst_clear_caps (&caps_);
  gst_object_unref (pad_);
}

/* ---- the queue ---- */

/* With the lock. */
void
CameraPad::remove (guint index)
{
  GstMiniObject *item = ring_[(first_ + index) % kMaxItems];
  pictures_ -= GST_IS_BUFFER (item);
  for (guint i = index; i > 0; i--)
    ring_[(first_ + i) % kMaxItems] = ring_[(first_ + i - 1) % kMaxItems];
  first_ = (first_ + 1) % kMaxItems;
  count_--;
  gst_mini_object_unref (item);
}

/* With the lock. @return false: there is none */
bool
CameraPad::let_oldest_go (bool gap_too)
{
  for (guint i = 0; i < count_; i++) {
    GstMiniObject *item = ring_[(first_ + i) % kMaxItems];
    const bool gap = GST_IS_EVENT (item) && GST_EVENT_TYPE (GST_EVENT_CAST (item)) == GST_EVENT_GAP;
    if (GST_IS_BUFFER (item) || (gap && gap_too)) {
      remove (i);
      return true;
    }
  }
  return false;
}

void
CameraPad::clear ()
{
  while (count_ > 0)
    remove (0);
}

/* Takes it; with the lock. */
void
CameraPad::put (GstMiniObject *item)
{
  if (flushing_ || ended_) {
    gst_mini_object_unref (item);
    return;
  }
  const bool picture = GST_IS_BUFFER (item);
  if (picture && pictures_ >= kMaxPictures) {
    let_oldest_go (false);
    overrun_++;
    discont_ = true;
  } else if (count_ >= kMaxItems && !let_oldest_go (true)) {
    gst_mini_object_unref (item); /* that many changes of caps have no sense */
    return;
  }
  if (picture && discont_) {
    GST_BUFFER_FLAG_SET (GST_BUFFER_CAST (item), GST_BUFFER_FLAG_DISCONT);
    discont_ = false;
  }
  ring_[(first_ + count_++) % kMaxItems] = item;
  pictures_ += picture;
  changed_.notify_all ();
}

void
CameraPad::set_caps (guint stream, GstCaps *caps)
{
  std::lock_guard guard (lock_);
  if (stream != group_id_ || (caps_ && gst_caps_is_equal (caps_, caps)))
    return;
  gst_caps_replace (&caps_, caps);
  put (GST_MINI_OBJECT_CAST (gst_event_new_caps (caps)));
}

void
CameraPad::send (guint stream, GstBuffer *buffer)
{
  std::lock_guard guard (lock_);
  if (stream == group_id_)
    put (GST_MINI_OBJECT_CAST (buffer));
  else
    gst_buffer_unref (buffer);
}

/* Of many in a row some do: it is the same silence. Before there are caps nobody waits. */
void
CameraPad::send_gap (guint stream, GstClockTime begin, GstClockTime duration)
{
  std::lock_guard guard (lock_);
  discont_ = true;
  if (stream == group_id_ && caps_ && count_ < kMaxItems / 2)
    put (GST_MINI_OBJECT_CAST (gst_event_new_gap (begin, duration)));
}

void
CameraPad::send_eos (guint stream, guint32 seqnum)
{
  std::lock_guard guard (lock_);
  if (stream != group_id_)
    return;
  GstEvent *event = gst_event_new_eos ();
  gst_event_set_seqnum (event, seqnum);
  put (GST_MINI_OBJECT_CAST (event));
  ended_ = true;
}

/* Waits. @return null: flushing */
GstMiniObject *
CameraPad::next_item ()
{
  std::unique_lock guard (lock_);
  changed_.wait (guard, [this] { return flushing_ || count_ > 0; });
  if (flushing_)
    return nullptr;
  GstMiniObject *item = ring_[first_];
  first_ = (first_ + 1) % kMaxItems;
  count_--;
  pictures_ -= GST_IS_BUFFER (item);
  return item;
}

/* ---- flushes that are not ours ---- */

GstPadProbeReturn
CameraPad::see_flush (GstPad *, GstPadProbeInfo *info, gpointer self)
{
  if (GST_EVENT_TYPE (GST_PAD_PROBE_INFO_EVENT (info)) == GST_EVENT_FLUSH_STOP)
    static_cast<CameraPad *> (self)->flushed_by_others ();
  return GST_PAD_PROBE_OK;
}

/* The pad has forgotten its segment. The task may have ended because the branch had. */
void
CameraPad::flushed_by_others ()
{
  std::lock_guard guard (lock_);
  if (flushing_)
    return; /* it is ours, or the pad is not active */
  flushed_ = discont_ = true;
  gst_pad_start_task (pad_, loop, this, nullptr);
}

/* What is pushed meanwhile is refused. */
void
CameraPad::wait_while_flushing ()
{
  std::unique_lock guard (lock_);
  changed_.wait_for (guard, std::chrono::milliseconds (20), [this] { return flushing_; });
}

/* ---- the task ---- */

void
CameraPad::push_stream_start ()
{
  if (!needs_start_)
    return;
  needs_start_ = false;
  gchar *id = gst_pad_create_stream_id (pad_, element_, GST_PAD_NAME (pad_));
  GstEvent *event = gst_event_new_stream_start (id);
  gst_event_set_group_id (event, group_id_);
  gst_pad_push_event (pad_, event);
  g_free (id);
}

void
CameraPad::push_segment ()
{
  if (!needs_segment_)
    return;
  needs_segment_ = false;
  GstSegment segment;
  gst_segment_init (&segment, GST_FORMAT_TIME);
  gst_pad_push_event (pad_, gst_event_new_segment (&segment));
}

/* Takes the item. */
GstFlowReturn
CameraPad::push (GstMiniObject *item)
{
  if (GST_IS_BUFFER (item)) {
    push_segment ();
    return gst_pad_push (pad_, GST_BUFFER_CAST (item));
  }
  const GstEventType type = GST_EVENT_TYPE (GST_EVENT_CAST (item));
  if (type != GST_EVENT_CAPS)
    push_segment ();
  const bool taken = gst_pad_push_event (pad_, GST_EVENT_CAST (item));
  if (type == GST_EVENT_EOS)
    return GST_FLOW_EOS;
  return taken || type != GST_EVENT_CAPS || !gst_pad_is_linked (pad_) ? GST_FLOW_OK
                                                                      : GST_FLOW_NOT_NEGOTIATED;
}

void
CameraPad::one_item ()
{
  push_stream_start ();
  GstMiniObject *item = next_item ();
  if (!item) {
    gst_pad_pause_task (pad_);
    return;
  }
  const bool picture = GST_IS_BUFFER (item);
  {
    std::lock_guard guard (lock_);
    needs_segment_ |= std::exchange (flushed_, false);
  }
  const GstFlowReturn flow = push (item);
  const bool tells = picture || flow == GST_FLOW_NOT_NEGOTIATED; /* of the peer's wishes */
  if (tells && flow != GST_FLOW_FLUSHING && std::exchange (last_flow_, flow) != flow)
    flowed_ (*this, flow);
  if (flow == GST_FLOW_FLUSHING)
    wait_while_flushing ();
  else if (flow != GST_FLOW_OK && flow != GST_FLOW_NOT_LINKED) /* it may be linked again */
    gst_pad_pause_task (pad_);
}

void
CameraPad::loop (gpointer self)
{
  static_cast<CameraPad *> (self)->one_item ();
}

/* ---- life ---- */

void
CameraPad::prepare (guint group_id)
{
  std::lock_guard guard (lock_);
  clear ();
  gst_clear_caps (&caps_);
  ended_ = false;
  discont_ = needs_start_ = needs_segment_ = true;
  last_flow_ = GST_FLOW_OK;
  group_id_ = group_id;
}

bool
CameraPad::activate (bool active)
{
  {
    std::lock_guard guard (lock_);
    flushing_ = !active;
    if (!active)
      clear ();
    changed_.notify_all ();
  }
  return active ? gst_pad_start_task (pad_, loop, this, nullptr) : gst_pad_stop_task (pad_);
}

void
CameraPad::flush_start (GstEvent *event)
{
  {
    std::lock_guard guard (lock_);
    flushing_ = true;
    clear ();
    changed_.notify_all ();
  }
  gst_pad_push_event (pad_, gst_event_ref (event));
  gst_pad_pause_task (pad_);
}

void
CameraPad::flush_stop (GstEvent *event)
{
  GST_PAD_STREAM_LOCK (pad_); /* the task stands still */
  gst_pad_push_event (pad_, gst_event_ref (event));
  needs_segment_ = true;
  last_flow_ = GST_FLOW_OK;
  {
    std::lock_guard guard (lock_);
    flushing_ = ended_ = false;
    discont_ = true;
    if (caps_)
      put (GST_MINI_OBJECT_CAST (gst_event_new_caps (caps_)));
  }
  GST_PAD_STREAM_UNLOCK (pad_);
  gst_pad_start_task (pad_, loop, this, nullptr);
}
