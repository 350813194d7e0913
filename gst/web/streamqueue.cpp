/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "streamqueue.hpp"

#include <algorithm>
#include <utility>

#include "category.hpp"

namespace web {

namespace {

/** Frame sets that wait for the server's thread; more would be late. */
constexpr std::ptrdiff_t kMaxFrameSets = 8;
constexpr std::size_t kMaxItems = 100; /* when a packet of speech comes */

bool
is_frame_set (const StreamItem &item)
{
  return std::holds_alternative<FrameSet> (item);
}

} // namespace

StreamQueue::StreamQueue (GstObject *element, GMainContext *context, Deliver deliver)
    : element_ (element), context_ (context), deliver_ (std::move (deliver))
{
}

void
StreamQueue::set_rig (std::string rig_units)
{
  std::lock_guard guard (lock_);
  rig_units_ = std::make_shared<const std::string> (std::move (rig_units));
}

void
StreamQueue::push (BytesPtr units, bool key, bool discontinuity, gint64 captured_us)
{
  std::lock_guard guard (lock_);
  discontinuity |= std::exchange (flushed_, false);
  const auto number = guint32 (frame_sets_++);
  if (std::ranges::count_if (items_, is_frame_set) >= kMaxFrameSets)
    GST_DEBUG_OBJECT (element_, "the server is busy; dropping frame set %u", number);
  else
    add (FrameSet{std::move (units), rig_units_, key, discontinuity, number, captured_us});
}

void
StreamQueue::push_audio (BytesPtr packet, gint64 captured_us)
{
  std::lock_guard guard (lock_);
  const guint32 number = next_audio_++;
  if (items_.size () >= kMaxItems)
    GST_DEBUG_OBJECT (element_, "the server is busy; dropping packet %u of speech", number);
  else
    add (AudioPacket{std::move (packet), number, captured_us});
}

void
StreamQueue::set_audio (bool available)
{
  std::lock_guard guard (lock_);
  if (std::exchange (has_audio_, available) != available)
    add (SpeechChange{available});
}

bool
StreamQueue::has_audio ()
{
  std::lock_guard guard (lock_);
  return has_audio_;
}

void
StreamQueue::end ()
{
  std::lock_guard guard (lock_);
  add (EndOfStream{});
}

void
StreamQueue::flush ()
{
  std::lock_guard guard (lock_);
  std::erase_if (items_, is_frame_set);
  flushed_ = true;
}

guint64
StreamQueue::frame_sets ()
{
  std::lock_guard guard (lock_);
  return frame_sets_;
}

/* With the lock held. Not g_main_context_invoke(), which may call at once. */
void
StreamQueue::add (StreamItem item)
{
  items_.push_back (std::move (item));
  if (std::exchange (woken_, true))
    return;
  GSource *source = g_idle_source_new ();
  const auto call = [] (gpointer self) -> gboolean {
    static_cast<StreamQueue *> (self)->deliver ();
    return G_SOURCE_REMOVE;
  };
  g_source_set_priority (source, G_PRIORITY_DEFAULT);
  g_source_set_callback (source, call, this, nullptr);
  g_source_attach (source, context_);
  g_source_unref (source);
}

void
StreamQueue::deliver ()
{
  std::deque<StreamItem> items;
  {
    std::lock_guard guard (lock_);
    items.swap (items_);
    woken_ = false;
  }
  for (const StreamItem &item : items)
    deliver_ (item);
}

} // namespace web
