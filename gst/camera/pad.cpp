/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "pad.hpp"

#include <utility>

#include "camera/aravis/debug.hpp"

CameraPad::CameraPad (GstElement *element, GstPad *pad, FlowChanged flow_changed)
    : element_ (element), pad_ (GST_PAD (gst_object_ref (pad))),
      flow_changed_ (std::move (flow_changed))
{
}

CameraPad::~CameraPad ()
{
  clear ();
  gst_queue_array_free (queue_);
  gst_clear_caps (&caps_);
  gst_object_unref (pad_);
}

/* ---- into the queue ---- */

void
CameraPad::set_caps (guint group_id, GstCaps *caps)
{
  std::lock_guard guard (lock_);
  if (group_id != group_id_ || (caps_ && gst_caps_is_equal (caps_, caps)))
    return;
  gst_caps_replace (&caps_, caps);
  put (GST_MINI_OBJECT_CAST (gst_event_new_caps (caps)));
}

void
CameraPad::send (guint group_id, GstBuffer *buffer)
{
  std::lock_guard guard (lock_);
  if (group_id == group_id_)
    put (GST_MINI_OBJECT_CAST (buffer));
  else
    gst_buffer_unref (buffer);
}

/* Before there are caps nobody waits. Some of many gaps in a row are enough, and bound the queue.
 */
void
CameraPad::send_gap (guint group_id, GstClockTime begin, GstClockTime duration)
{
  std::lock_guard guard (lock_);
  if (group_id == group_id_ && caps_ && gst_queue_array_get_length (queue_) < kMaxItems)
    put (GST_MINI_OBJECT_CAST (gst_event_new_gap (begin, duration)));
  else
    discont_ = true;
}

void
CameraPad::send_eos (guint group_id, guint32 seqnum)
{
  std::lock_guard guard (lock_);
  if (group_id != group_id_)
    return;
  GstEvent *event = gst_event_new_eos ();
  gst_event_set_seqnum (event, seqnum);
  put (GST_MINI_OBJECT_CAST (event));
  ended_ = true;
}

/* Takes the item. With the lock. */
void
CameraPad::put (GstMiniObject *item)
{
  if (flushing_ || ended_) {
    gst_mini_object_unref (item);
    return;
  }
  const bool image = GST_IS_BUFFER (item);
  if (image && images_ >= kMaxImages) {
    GST_DEBUG_OBJECT (pad_, "downstream is blocked: dropping the oldest queued image");
    drop_oldest_image ();
    overrun_++;
    discont_ = true;
  }
  gst_queue_array_push_tail (queue_, item);
  images_ += image;
  changed_.notify_all ();
}

/* With the lock. */
void
CameraPad::drop_oldest_image ()
{
  guint i = 0;
  while (!GST_IS_BUFFER (gst_queue_array_peek_nth (queue_, i)))
    i++;
  gst_buffer_unref (GST_BUFFER_CAST (gst_queue_array_drop_element (queue_, i)));
  images_--;
}

/* With the lock. */
void
CameraPad::clear ()
{
  while (auto item = static_cast<GstMiniObject *> (gst_queue_array_pop_head (queue_)))
    gst_mini_object_unref (item);
  images_ = 0;
}

/* ---- the task ---- */

void
CameraPad::loop (gpointer self)
{
  static_cast<CameraPad *> (self)->push_next ();
}

void
CameraPad::push_next ()
{
  if (std::exchange (needs_start_, false)) {
    gchar *id = gst_pad_create_stream_id (pad_, element_, GST_PAD_NAME (pad_));
    GstEvent *event = gst_event_new_stream_start (id);
    gst_event_set_group_id (event, group_id_);
    gst_pad_push_event (pad_, event);
    g_free (id);
  }
  GstMiniObject *item = nullptr;
  {
    std::unique_lock guard (lock_);
    changed_.wait (guard, [this] { return flushing_ || gst_queue_array_get_length (queue_) > 0; });
    if (!flushing_) {
      item = static_cast<GstMiniObject *> (gst_queue_array_pop_head (queue_));
      images_ -= GST_IS_BUFFER (item);
      if (GST_IS_EVENT (item))
        discont_ |= GST_EVENT_TYPE (item) == GST_EVENT_GAP;
      else if (std::exchange (discont_, false))
        GST_BUFFER_FLAG_SET (GST_BUFFER_CAST (item), GST_BUFFER_FLAG_DISCONT);
    }
  }
  if (!item) {
    gst_pad_pause_task (pad_);
    return;
  }
  const bool image = GST_IS_BUFFER (item);
  const GstFlowReturn flow = push (item);
  if (image && flow != GST_FLOW_OK) { /* it is lost */
    std::lock_guard guard (lock_);
    discont_ = true;
  }
  const bool tells_flow = image || flow == GST_FLOW_NOT_NEGOTIATED; /* other events do not */
  if (tells_flow && flow != GST_FLOW_FLUSHING && std::exchange (last_flow_, flow) != flow)
    flow_changed_ (*this, flow);
  /* Downstream may be linked again, or come back from READY. */
  if (flow != GST_FLOW_OK && flow != GST_FLOW_NOT_LINKED && flow != GST_FLOW_FLUSHING) {
    GST_DEBUG_OBJECT (pad_, "pausing: %s", gst_flow_get_name (flow));
    gst_pad_pause_task (pad_);
  }
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
  const bool accepted = gst_pad_push_event (pad_, GST_EVENT_CAST (item));
  if (type == GST_EVENT_EOS)
    return GST_FLOW_EOS;
  return accepted || type != GST_EVENT_CAPS || !gst_pad_is_linked (pad_) ? GST_FLOW_OK
                                                                         : GST_FLOW_NOT_NEGOTIATED;
}

void
CameraPad::push_segment ()
{
  if (!std::exchange (needs_segment_, false))
    return;
  GstSegment segment;
  gst_segment_init (&segment, GST_FORMAT_TIME);
  gst_pad_push_event (pad_, gst_event_new_segment (&segment));
}

/* ---- state changes ---- */

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
