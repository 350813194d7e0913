/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "stream.hpp"

/* ---- buffers ---- */

void
FrameStore::fill (int count, std::size_t size)
{
  for (int i = 0; i < count; i++)
    give_back (arv_buffer_new_allocate (size));
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

void
FrameStore::close ()
{
  std::lock_guard guard (lock_);
  stream_ = nullptr;
}

GstBufferPtr
FrameStore::wrap (ArvBuffer *frame)
{
  using Use = std::pair<std::shared_ptr<FrameStore>, ArvBuffer *>;
  const auto memory_gone = [] (gpointer data) {
    const std::unique_ptr<Use> use (static_cast<Use *> (data));
    use->first->out_--;
    use->first->give_back (use->second);
  };
  std::size_t size = 0;
  const void *data = arv_buffer_get_data (frame, &size);
  GstBuffer *buffer = gst_buffer_new_wrapped_full (GstMemoryFlags (0), const_cast<void *> (data),
      format_.size (), 0, format_.size (), new Use (shared_from_this (), frame), memory_gone);
  if (format_.video_format != GST_VIDEO_FORMAT_UNKNOWN) {
    gsize offset[GST_VIDEO_MAX_PLANES] = {};
    gint stride[GST_VIDEO_MAX_PLANES] = {format_.stride};
    gst_buffer_add_video_meta_full (buffer, GST_VIDEO_FRAME_FLAG_NONE, format_.video_format,
        format_.width, format_.height, 1, offset, stride);
  }
  out_++;
  return GstBufferPtr (buffer);
}

/* ---- frames ---- */

void
CameraRun::on_done ()
{
  std::lock_guard guard (lock);
  while (!stopped && stream) {
    ArvBuffer *buffer = arv_stream_try_pop_buffer (stream);
    if (!buffer)
      break;
    deliver (buffer);
  }
}

bool
CameraRun::fits (ArvBuffer *buffer) const
{
  const ArvBufferPayloadType type = arv_buffer_get_payload_type (buffer);
  if (type != ARV_BUFFER_PAYLOAD_TYPE_IMAGE && type != ARV_BUFFER_PAYLOAD_TYPE_EXTENDED_CHUNK_DATA)
    return false;
  std::size_t size = 0, all = 0;
  gint x_padding = 0, y_padding = 0;
  if (arv_buffer_get_image_data (buffer, &size) != arv_buffer_get_data (buffer, &all))
    return false;
  arv_buffer_get_image_padding (buffer, &x_padding, &y_padding);
  return size >= format.size () && x_padding == 0 &&
         arv_buffer_get_image_width (buffer) == format.width &&
         arv_buffer_get_image_height (buffer) == format.height &&
         arv_buffer_get_image_pixel_format (buffer) == format.code;
}

/* buffer: transfer full */
void
CameraRun::deliver (ArvBuffer *buffer)
{
  const ArvBufferStatus status = arv_buffer_get_status (buffer);
  const std::uint64_t id = arv_buffer_get_frame_id (buffer);
  if (id == FrameStore::kNoId || !counter.is_id (id) || status == ARV_BUFFER_STATUS_ABORTED ||
      status == ARV_BUFFER_STATUS_CLEARED) { /* its number is unknown: a gap */
    store->give_back (buffer);
    return;
  }
  CameraFrame frame;
  frame.number = counter.number (id);
  frame.arrived_us = g_get_monotonic_time ();
  const std::uint64_t taken = arv_buffer_get_timestamp (buffer);
  if (taken != arv_buffer_get_system_timestamp (buffer) &&
      taken < kMaxCameraTime_ns) /* else Aravis filled it in */
    frame.camera_time_ns = taken;
  if (ARV_IS_GV_STREAM (stream)) {
    guint64 missing = 0;
    arv_gv_stream_get_statistics (ARV_GV_STREAM (stream), nullptr, &missing);
    frame.missing_packets = missing - missing_packets;
    missing_packets = missing;
  }
  if (status == ARV_BUFFER_STATUS_SUCCESS && fits (buffer))
    frame.buffer = store->wrap (buffer);
  else
    store->give_back (buffer);
  arrived (std::move (frame));
}

CameraStatistics
CameraRun::statistics () const
{
  CameraStatistics numbers;
  guint64 completed = 0, failures = 0, underruns = 0, resent = 0;
  arv_stream_get_statistics (stream, &completed, &failures, &underruns);
  if (ARV_IS_GV_STREAM (stream))
    arv_gv_stream_get_statistics (ARV_GV_STREAM (stream), &resent, nullptr);
  numbers.completed = completed;
  numbers.failures = failures;
  numbers.underruns = underruns;
  numbers.resent_packets = resent;
  return numbers;
}
