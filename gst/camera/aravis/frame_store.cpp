/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "frame_store.hpp"

struct FrameStore::Slot {
  std::shared_ptr<FrameStore> store;
  ArvBuffer *frame = nullptr;  /* owns the slot */
  GstBuffer *spare = nullptr;  /* while it is not out */
  GstMemory *memory = nullptr; /* of the GstBuffer */
  bool out = false;            /* the GstBuffer's memory holds a reference on the frame */

  ~Slot ()
  {
    if (spare) {
      GST_MINI_OBJECT_CAST (spare)->dispose = nullptr;
      gst_buffer_unref (spare);
    }
  }
};

GQuark
slot_quark ()
{
  static const GQuark quark = g_quark_from_static_string ("rangecast-camera-frame");
  return quark;
}

void
FrameStore::fill (int count, std::size_t size)
{
  for (int i = 0; i < count; i++) {
    auto *slot = new Slot;
    slot->store = shared_from_this ();
    slot->frame = arv_buffer_new_full (
        size, nullptr, slot, [] (gpointer data) { delete static_cast<Slot *> (data); });
    give_back (slot->frame);
  }
}

void
FrameStore::give_back (ArvBuffer *frame)
{
  {
    std::lock_guard guard (lock_);
    if (stream_) {
      arv_buffer_set_frame_id (frame, kNoId);
      arv_buffer_set_timestamp (frame, 0);
      arv_stream_push_buffer (stream_, frame);
      return;
    }
  }
  g_object_unref (frame);
}

bool
FrameStore::is_closed ()
{
  std::lock_guard guard (lock_);
  return !stream_;
}

void
FrameStore::close ()
{
  std::lock_guard guard (lock_);
  stream_ = nullptr;
}

GstBuffer *
FrameStore::make_buffer (Slot &slot)
{
  std::size_t size = 0;
  const void *data = arv_buffer_get_data (slot.frame, &size);
  slot.memory = gst_memory_new_wrapped (GstMemoryFlags (0), const_cast<void *> (data),
      format_.size (), 0, format_.size (), &slot, memory_gone);
  GstBuffer *buffer = gst_buffer_new ();
  gst_buffer_append_memory (buffer, slot.memory);
  if (format_.video_format != GST_VIDEO_FORMAT_UNKNOWN) {
    gsize offset[GST_VIDEO_MAX_PLANES] = {};
    gint stride[GST_VIDEO_MAX_PLANES] = {format_.stride};
    GstVideoMeta *meta = gst_buffer_add_video_meta_full (buffer, GST_VIDEO_FRAME_FLAG_NONE,
        format_.video_format, format_.width, format_.height, 1, offset, stride);
    meta->meta.flags = GstMetaFlags (meta->meta.flags | GST_META_FLAG_POOLED);
  }
  gst_mini_object_set_qdata (GST_MINI_OBJECT_CAST (buffer), slot_quark (), &slot, nullptr);
  GST_MINI_OBJECT_CAST (buffer)->dispose = dispose;
  GST_BUFFER_FLAG_UNSET (buffer, GST_BUFFER_FLAG_TAG_MEMORY);
  return buffer;
}

GstBufferPtr
FrameStore::wrap (ArvBuffer *frame)
{
  auto *slot = static_cast<Slot *> (const_cast<void *> (arv_buffer_get_user_data (frame)));
  GstBuffer *buffer = slot->spare ? slot->spare : make_buffer (*slot);
  slot->spare = nullptr;
  slot->out = true;
  out_++;
  return GstBufferPtr (buffer);
}

/* As GstBufferPool does: removes metas, flags and times that were set for a frame. */
void
reset_buffer (GstBuffer *buffer)
{
  gst_buffer_foreach_meta (
      buffer,
      [] (GstBuffer *, GstMeta **meta, gpointer) -> gboolean {
        if (!GST_META_FLAG_IS_SET (*meta, GST_META_FLAG_POOLED))
          *meta = nullptr;
        return TRUE;
      },
      nullptr);
  GST_BUFFER_FLAG_UNSET (buffer, ~guint (GST_MINI_OBJECT_FLAG_LAST - 1));
  GST_BUFFER_PTS (buffer) = GST_BUFFER_DTS (buffer) = GST_BUFFER_DURATION (buffer) =
      GST_CLOCK_TIME_NONE;
  GST_BUFFER_OFFSET (buffer) = GST_BUFFER_OFFSET_END (buffer) = GST_BUFFER_OFFSET_NONE;
}

/* Whether nobody else holds the memory, changed it, or put another in its place. */
bool
FrameStore::is_unchanged (GstBuffer *buffer, const Slot &slot)
{
  if (GST_BUFFER_FLAG_IS_SET (buffer, GST_BUFFER_FLAG_TAG_MEMORY) ||
      gst_buffer_n_memory (buffer) != 1 || gst_buffer_peek_memory (buffer, 0) != slot.memory)
    return false;
  gsize offset = 0, whole = 0;
  const gsize size = gst_memory_get_sizes (slot.memory, &offset, &whole);
  return offset == 0 && size == whole && gst_buffer_is_all_memory_writable (buffer);
}

/* The last reference was released. FALSE: the buffer is not freed. */
gboolean
FrameStore::dispose (GstMiniObject *object)
{
  GstBuffer *buffer =
      gst_buffer_ref (GST_BUFFER_CAST (object)); /* else its memory is not writable */
  auto *slot = static_cast<Slot *> (gst_mini_object_get_qdata (object, slot_quark ()));
  const std::shared_ptr<FrameStore> store = slot->store; /* outlives the slot */
  if (!is_unchanged (buffer, *slot) || store->is_closed ()) {
    object->dispose = nullptr;
    gst_buffer_unref (buffer); /* memory_gone() follows with the memory's last reference */
    return FALSE;
  }
  reset_buffer (buffer);
  slot->spare = buffer;
  slot->out = false;
  store->out_--;
  store->give_back (
      slot->frame); /* last: if it was closed meanwhile, deletes frame, slot and buffer */
  return FALSE;
}

void
FrameStore::memory_gone (gpointer data)
{
  auto *slot = static_cast<Slot *> (data);
  if (!slot->out)
    return; /* the slot is being deleted */
  const std::shared_ptr<FrameStore> store = slot->store;
  slot->out = false;
  store->out_--;
  store->give_back (slot->frame);
}
