/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:gstrangebufferpool
 * @title: GstRangeBufferPool
 * @short_description: Recycles the buffers of frame sets
 *
 * Gives buffers with one #GstMemory for each of the caps' views, each large enough for the full
 * image. gst_range_buffer_add_view() then lays a view of any ROI into the next memory. On the way
 * back to the pool the views are forgotten and the memories get their size again.
 *
 * Since: 0.1
 */
#include "gstrangebufferpool.h"

#include "gstrangecaps.h"

struct _GstRangeBufferPool {
  GstBufferPool parent;

  guint views;
  gsize view_size; /* bytes of one memory */
};

G_DEFINE_TYPE (GstRangeBufferPool, gst_range_buffer_pool, GST_TYPE_BUFFER_POOL)

/* Rows of both planes begin at multiples of this many bytes, for vector loads. */
static constexpr gsize kRowAlign = 16;

static gsize
row_stride (gsize width, gsize pixel_bytes)
{
  return (width * pixel_bytes + kRowAlign - 1) & ~(kRowAlign - 1);
}

static gsize
full_view_size (gsize width, gsize height)
{
  return (row_stride (width, 2) + row_stride (width, 4)) * height;
}

static GstMemory *
new_view_memory (GstAllocator *allocator, gsize size, GstAllocationParams params)
{
  params.align |= kRowAlign - 1;
  return gst_allocator_alloc (allocator, size, &params);
}

static gboolean
gst_range_buffer_pool_set_config (GstBufferPool *pool, GstStructure *config)
{
  auto self = GST_RANGE_BUFFER_POOL (pool);
  GstCaps *caps = nullptr;
  guint min = 0, max = 0;
  int width = 0, height = 0, views = 0;

  if (!gst_buffer_pool_config_get_params (config, &caps, nullptr, &min, &max) || !caps) {
    GST_WARNING_OBJECT (pool, "config without caps");
    return FALSE;
  }
  const GstStructure *structure = gst_caps_get_structure (caps, 0);
  if (!gst_structure_get_int (structure, "width", &width) ||
      !gst_structure_get_int (structure, "height", &height) ||
      !gst_structure_get_int (structure, "views", &views) || width < 1 || height < 1 || views < 1) {
    GST_WARNING_OBJECT (pool, "caps without width, height or views: %" GST_PTR_FORMAT, caps);
    return FALSE;
  }
  self->views = static_cast<guint> (views);
  self->view_size = full_view_size (static_cast<gsize> (width), static_cast<gsize> (height));
  gst_buffer_pool_config_set_params (
      config, caps, static_cast<guint> (self->views * self->view_size), min, max);
  return GST_BUFFER_POOL_CLASS (gst_range_buffer_pool_parent_class)->set_config (pool, config);
}

static GstFlowReturn
gst_range_buffer_pool_alloc_buffer (
    GstBufferPool *pool, GstBuffer **buffer, GstBufferPoolAcquireParams *)
{
  auto self = GST_RANGE_BUFFER_POOL (pool);
  GstAllocator *allocator = nullptr;
  GstAllocationParams params;
  gst_allocation_params_init (&params);
  GstStructure *config = gst_buffer_pool_get_config (pool);
  gst_buffer_pool_config_get_allocator (config, &allocator, &params);

  GstBuffer *made = gst_buffer_new ();
  for (guint i = 0; i < self->views; i++) {
    GstMemory *memory = new_view_memory (allocator, self->view_size, params);
    if (!memory) {
      gst_buffer_unref (made);
      gst_structure_free (config);
      return GST_FLOW_ERROR;
    }
    gst_buffer_append_memory (made, memory);
  }
  gst_structure_free (config);
  *buffer = made;
  return GST_FLOW_OK;
}

static void
gst_range_buffer_pool_reset_buffer (GstBufferPool *pool, GstBuffer *buffer)
{
  auto self = GST_RANGE_BUFFER_POOL (pool);
  const guint n = gst_buffer_n_memory (buffer);
  for (guint i = 0; n == self->views && i < n; i++) {
    GstMemory *memory = gst_buffer_peek_memory (buffer, i);
    if (gst_memory_is_writable (memory) && memory->maxsize >= self->view_size)
      gst_memory_resize (memory, -static_cast<gssize> (memory->offset), self->view_size);
  }
  GST_BUFFER_POOL_CLASS (gst_range_buffer_pool_parent_class)->reset_buffer (pool, buffer);
}

static void
gst_range_buffer_pool_init (GstRangeBufferPool *)
{
}

static void
gst_range_buffer_pool_class_init (GstRangeBufferPoolClass *klass)
{
  auto pool_class = GST_BUFFER_POOL_CLASS (klass);
  pool_class->set_config = gst_range_buffer_pool_set_config;
  pool_class->alloc_buffer = gst_range_buffer_pool_alloc_buffer;
  pool_class->reset_buffer = gst_range_buffer_pool_reset_buffer;
}

/**
 * gst_range_buffer_pool_new:
 *
 * Returns: (transfer full): a pool, to be configured with video/x-range caps
 */
GstBufferPool *
gst_range_buffer_pool_new (void)
{
  auto pool = static_cast<GstBufferPool *> (g_object_new (GST_TYPE_RANGE_BUFFER_POOL, nullptr));
  gst_object_ref_sink (pool);
  return pool;
}

/**
 * gst_range_buffer_pool_configure:
 * @pool: an inactive pool
 * @caps: fixed video/x-range caps
 * @min_buffers: how many buffers to allocate at once
 * @max_buffers: how many at most, 0 = no limit
 *
 * Returns: %FALSE if the caps have no size or number of views
 */
gboolean
gst_range_buffer_pool_configure (
    GstBufferPool *pool, GstCaps *caps, guint min_buffers, guint max_buffers)
{
  GstStructure *config = gst_buffer_pool_get_config (pool);
  gst_buffer_pool_config_set_params (config, caps, 0, min_buffers, max_buffers);
  return gst_buffer_pool_set_config (pool, config);
}

/**
 * gst_range_buffer_new:
 * @views: how many views shall fit
 * @width: of the largest ROI, pixels
 * @height: of the largest ROI, pixels
 *
 * The same as a buffer of a #GstRangeBufferPool, without a pool.
 *
 * Returns: (transfer full): a buffer without views
 */
GstBuffer *
gst_range_buffer_new (guint views, guint width, guint height)
{
  GstAllocationParams params;
  gst_allocation_params_init (&params);
  GstBuffer *buffer = gst_buffer_new ();
  for (guint i = 0; i < views; i++)
    gst_buffer_append_memory (
        buffer, new_view_memory (nullptr, full_view_size (width, height), params));
  return buffer;
}

/**
 * gst_range_buffer_add_view:
 * @buffer: a writable buffer of a #GstRangeBufferPool or gst_range_buffer_new()
 * @view_id: 0 to 63
 * @x: left edge of the ROI, pixels
 * @y: top edge of the ROI, pixels
 * @width: of the ROI, pixels; 0 for an empty one
 * @height: of the ROI, pixels; 0 for an empty one
 * @capture_time: ns on the clock that the camera hosts share
 *
 * Lays a view into the buffer's next memory, which shrinks to what the ROI needs. Call it once
 * for every memory, with an empty ROI for a view that is missing. The pixels are not touched.
 *
 * Returns: (transfer none) (nullable): where its planes lie, or %NULL if the buffer has no
 *   memory left or the ROI does not fit into it
 */
GstRangeMeta *
gst_range_buffer_add_view (GstBuffer *buffer, guint view_id, guint x, guint y, guint width,
    guint height, GstClockTime capture_time)
{
  const guint index = gst_buffer_n_range_metas (buffer);
  if (index >= gst_buffer_n_memory (buffer))
    return nullptr;
  const gsize size = full_view_size (width, height);
  GstMemory *memory = gst_buffer_peek_memory (buffer, index);
  if (size > memory->size)
    return nullptr;
  gst_memory_resize (memory, 0, size);

  gsize offset = 0;
  for (guint i = 0; i < index; i++)
    offset += gst_buffer_peek_memory (buffer, i)->size;
  auto meta =
      reinterpret_cast<GstRangeMeta *> (gst_buffer_add_meta (buffer, GST_RANGE_META_INFO, nullptr));
  meta->view_id = view_id;
  meta->x = x;
  meta->y = y;
  meta->width = width;
  meta->height = height;
  meta->depth_stride = static_cast<guint> (row_stride (width, 2));
  meta->depth_offset = offset;
  meta->colour_stride = static_cast<guint> (row_stride (width, 4));
  meta->colour_offset = offset + gsize{meta->depth_stride} * height;
  meta->capture_time = capture_time;
  return meta;
}
