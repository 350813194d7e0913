/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "gstrangemeta.h"

#include <algorithm>
#include <rangecast/geometry/range_image.hpp>

#include "gstrangeframe.hpp"

static void
gst_range_meta_clear (GstRangeMeta *self)
{
  const GstMeta meta = self->meta;
  *self = GstRangeMeta{};
  self->meta = meta;
  self->capture_time = GST_CLOCK_TIME_NONE;
}

static gboolean
gst_range_meta_init (GstMeta *meta, gpointer, GstBuffer *)
{
  gst_range_meta_clear (reinterpret_cast<GstRangeMeta *> (meta));
  return TRUE;
}

/* Offsets are valid only in copies of the whole buffer. */
static gboolean
gst_range_meta_transform (GstBuffer *dest, GstMeta *meta, GstBuffer *, GQuark type, gpointer data)
{
  if (!GST_META_TRANSFORM_IS_COPY (type))
    return FALSE;
  if (static_cast<GstMetaTransformCopy *> (data)->region)
    return TRUE;
  auto copy =
      reinterpret_cast<GstRangeMeta *> (gst_buffer_add_meta (dest, GST_RANGE_META_INFO, nullptr));
  gstrange::copy_layout (copy, reinterpret_cast<GstRangeMeta *> (meta));
  return TRUE;
}

GType
gst_range_meta_api_get_type (void)
{
  static const GType type = [] {
    static const gchar *tags[] = {GST_META_TAG_MEMORY_STR, nullptr};
    return gst_meta_api_type_register ("GstRangeMetaAPI", tags);
  }();
  return type;
}

const GstMetaInfo *
gst_range_meta_get_info (void)
{
  static const GstMetaInfo *info = gst_meta_register (GST_RANGE_META_API_TYPE, "GstRangeMeta",
      sizeof (GstRangeMeta), gst_range_meta_init, nullptr, gst_range_meta_transform);
  return info;
}

/**
 * gst_buffer_iterate_range_meta:
 * @buffer: a frame set
 * @state: (inout): %NULL at first
 *
 * Returns: (transfer none) (nullable): the next view, in the order in which they were added
 */
GstRangeMeta *
gst_buffer_iterate_range_meta (GstBuffer *buffer, gpointer *state)
{
  return reinterpret_cast<GstRangeMeta *> (
      gst_buffer_iterate_meta_filtered (buffer, state, GST_RANGE_META_API_TYPE));
}

/**
 * gst_buffer_get_range_meta:
 * @buffer: a frame set
 * @view_id: 0 to 63
 *
 * Returns: (transfer none) (nullable): the view, or %NULL if the frame set does not contain it
 */
GstRangeMeta *
gst_buffer_get_range_meta (GstBuffer *buffer, guint view_id)
{
  gpointer state = nullptr;
  GstRangeMeta *meta;
  while ((meta = gst_buffer_iterate_range_meta (buffer, &state)))
    if (meta->view_id == view_id)
      return meta;
  return nullptr;
}

/**
 * gst_buffer_n_range_metas:
 * @buffer: a frame set
 *
 * Returns: the number of views
 */
guint
gst_buffer_n_range_metas (GstBuffer *buffer)
{
  return gst_buffer_get_n_meta (buffer, GST_RANGE_META_API_TYPE);
}

/**
 * gst_range_buffer_append:
 * @frame_set: a writable buffer
 * @views: (transfer none): the frame set whose views are added
 *
 * Adds the views of one buffer to another without copying pixels: the memories are shared, and
 * @frame_set keeps a reference to @views, which then returns to its pool. (Beyond
 * gst_buffer_get_max_memory() memories GStreamer merges them, which copies.)
 *
 * Returns: %FALSE, and @frame_set is unchanged, if both contain the same view-id or @views one
 *   above 63
 */
gboolean
gst_range_buffer_append (GstBuffer *frame_set, GstBuffer *views)
{
  if (!gstrange::append_metas (frame_set, views, gst_buffer_get_size (frame_set)))
    return FALSE;
  gst_buffer_copy_into (frame_set, views, GST_BUFFER_COPY_MEMORY, 0, -1);
  gst_buffer_add_parent_buffer_meta (frame_set, views);
  return TRUE;
}

/* Extends [begin, end) by the bytes of a plane. @return false if they are not in the buffer */
static bool
plane_extent (gsize offset, gsize stride, gsize row_bytes, gsize rows, gsize buffer_size,
    gsize *begin, gsize *end)
{
  if (offset > buffer_size || stride < row_bytes || rows > G_MAXUINT32)
    return false;
  const gsize length = (rows - 1) * stride + row_bytes;
  if (length > buffer_size - offset)
    return false;
  *begin = std::min (*begin, offset);
  *end = std::max (*end, offset + length);
  return true;
}

/* The bytes [begin, end) of both planes of a view that is not empty.
 * @return false if the layout is invalid */
static bool
view_extent (const GstRangeMeta *meta, gsize buffer_size, gsize *begin, gsize *end)
{
  if (meta->width > rangecast::kMaxImageSide || meta->height > rangecast::kMaxImageSide ||
      meta->depth_offset % 2 || meta->depth_stride % 2 || meta->colour_stride % 4)
    return false;
  *begin = G_MAXSIZE;
  *end = 0;
  return plane_extent (meta->depth_offset, meta->depth_stride, gsize{meta->width} * 2, meta->height,
             buffer_size, begin, end) &&
         plane_extent (meta->colour_offset, meta->colour_stride, gsize{meta->width} * 4,
             meta->height, buffer_size, begin, end);
}

/**
 * gst_range_buffer_copy_view:
 * @frame_set: a frame set
 * @meta: one of its views
 *
 * Creates a buffer of one view without copying pixels, the inverse of gst_range_buffer_append().
 * The memory is shared, and the new buffer keeps a reference to @frame_set. Flags, timestamps and
 * capture time are not copied.
 *
 * Returns: (transfer full) (nullable): the view, or %NULL if its planes are not inside the buffer
 */
GstBuffer *
gst_range_buffer_copy_view (GstBuffer *frame_set, const GstRangeMeta *meta)
{
  const bool empty = meta->width == 0 || meta->height == 0;
  gsize begin = 0, end = 0;
  if (!empty && !view_extent (meta, gst_buffer_get_size (frame_set), &begin, &end))
    return nullptr;
  begin -= begin % 4; /* keeps the planes' alignment relative to the buffer */
  GstBuffer *view = gst_buffer_new ();
  if (!empty) {
    gst_buffer_copy_into (view, frame_set, GST_BUFFER_COPY_MEMORY, begin, end - begin);
    gst_buffer_add_parent_buffer_meta (view, frame_set);
  }
  auto added =
      reinterpret_cast<GstRangeMeta *> (gst_buffer_add_meta (view, GST_RANGE_META_INFO, nullptr));
  gstrange::copy_layout (added, meta);
  added->depth_offset = empty ? 0 : meta->depth_offset - begin;
  added->colour_offset = empty ? 0 : meta->colour_offset - begin;
  return view;
}

static GstCaps *
capture_time_reference ()
{
  static GstStaticCaps caps = GST_STATIC_CAPS ("timestamp/x-range-capture");
  return gst_static_caps_get (&caps);
}

/**
 * gst_range_buffer_set_capture_time:
 * @buffer: a writable buffer, raw or coded
 * @time: ns on the clock that the camera hosts share, or %GST_CLOCK_TIME_NONE if unknown
 *
 * Sets the buffer's #GstReferenceTimestampMeta with the reference `timestamp/x-range-capture`, or
 * removes it if @time is %GST_CLOCK_TIME_NONE.
 */
void
gst_range_buffer_set_capture_time (GstBuffer *buffer, GstClockTime time)
{
  GstCaps *reference = capture_time_reference ();
  auto meta = gst_buffer_get_reference_timestamp_meta (buffer, reference);
  if (meta && GST_CLOCK_TIME_IS_VALID (time))
    meta->timestamp = time;
  else if (meta)
    gst_buffer_remove_meta (buffer, GST_META_CAST (meta));
  else if (GST_CLOCK_TIME_IS_VALID (time))
    gst_buffer_add_reference_timestamp_meta (buffer, reference, time, GST_CLOCK_TIME_NONE);
  gst_caps_unref (reference);
}

/**
 * gst_range_buffer_get_capture_time:
 * @buffer: a buffer, raw or coded
 *
 * Returns: the capture time, or %GST_CLOCK_TIME_NONE if the buffer has none
 */
GstClockTime
gst_range_buffer_get_capture_time (GstBuffer *buffer)
{
  GstCaps *reference = capture_time_reference ();
  const auto meta = gst_buffer_get_reference_timestamp_meta (buffer, reference);
  gst_caps_unref (reference);
  if (meta)
    return meta->timestamp;
  gpointer state = nullptr;
  const auto view = gst_buffer_iterate_range_meta (buffer, &state);
  return view ? view->capture_time : GST_CLOCK_TIME_NONE;
}

/**
 * gst_range_view_map:
 * @view: (out caller-allocates): the mapped view
 * @buffer: the buffer with @meta
 * @meta: the view to map
 * @flags: for reading, writing or both
 *
 * Maps one view. The planes of a view with an empty ROI are %NULL.
 *
 * Returns: %FALSE if the planes are not inside the buffer or cannot be mapped; there is nothing to
 *   unmap then
 */
gboolean
gst_range_view_map (
    GstRangeView *view, GstBuffer *buffer, const GstRangeMeta *meta, GstMapFlags flags)
{
  *view = GstRangeView{};
  view->view_id = meta->view_id;
  view->x = meta->x;
  view->y = meta->y;
  view->width = meta->width;
  view->height = meta->height;
  view->depth_stride = meta->depth_stride;
  view->colour_stride = meta->colour_stride;
  if (meta->width == 0 || meta->height == 0)
    return TRUE;
  gsize begin = 0, end = 0, skip = 0;
  guint index = 0, length = 0;
  if (!view_extent (meta, gst_buffer_get_size (buffer), &begin, &end) ||
      !gst_buffer_find_memory (buffer, begin, end - begin, &index, &length, &skip) ||
      !gst_buffer_map_range (buffer, index, length, &view->map, flags))
    return FALSE;
  view->buffer = buffer;
  guint8 *base = view->map.data + skip;
  view->depth = reinterpret_cast<guint16 *> (base + (meta->depth_offset - begin));
  view->colour = base + (meta->colour_offset - begin);
  return TRUE;
}

/**
 * gst_range_view_unmap:
 * @view: a mapped view
 */
void
gst_range_view_unmap (GstRangeView *view)
{
  if (view->buffer)
    gst_buffer_unmap (view->buffer, &view->map);
  view->buffer = nullptr;
  view->depth = nullptr;
  view->colour = nullptr;
}
