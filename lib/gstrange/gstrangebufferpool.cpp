/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:gstrangebufferpool
 * @title: GstRangeBufferPool
 * @short_description: Buffer pool for frame sets
 *
 * Allocates buffers for the full images of all views of the caps: one #GstMemory for each view, or
 * a single one for more views than gst_buffer_get_max_memory(), because GStreamer would merge them.
 * The memories have size 0 at first; gst_range_buffer_add_view() places a view in the next one,
 * which grows to the size of its ROI. The pool removes the views from returned buffers.
 *
 * Since: 0.1
 */
#include "gstrangebufferpool.h"

#include <cstdlib>
#include <cstring>
#include <rangecast/geometry/range_image.hpp>

#include "gstrangecaps.h"

struct _GstRangeBufferPool {
  GstBufferPool parent;

  guint views;
  gsize view_size; /* bytes of the full image of one view */
  gboolean
      waits_for_memories; /* no max-buffers, so nobody waits for a buffer that is in `shared` */
  GstAtomicQueue *shared; /* buffers that were released before their memories */
};

G_DEFINE_TYPE (GstRangeBufferPool, gst_range_buffer_pool, GST_TYPE_BUFFER_POOL)

/* Row alignment of both planes in bytes, for vector loads. */
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

static bool
has_one_memory_for_all (guint views)
{
  return views > gst_buffer_get_max_memory ();
}

/* Qdata of a memory for several views: their number. */
static GQuark
views_quark ()
{
  static const GQuark quark = g_quark_from_static_string ("gst-range-views");
  return quark;
}

static guint
views_that_fit (GstMemory *memory)
{
  const guint views =
      GPOINTER_TO_UINT (gst_mini_object_get_qdata (GST_MINI_OBJECT_CAST (memory), views_quark ()));
  return MAX (views, 1);
}

/* The limits of rigs apply to untrusted caps, too. */
static bool
within_limits (gint64 views, gint64 width, gint64 height)
{
  using namespace rangecast;
  return views <= kMaxViews && width <= kMaxImageSide && height <= kMaxImageSide &&
         views * width * height <= kMaxRigPixels;
}

/* Unlike GStreamer's system allocator, does not abort when out of memory. */
static GstMemory *
try_system_memory (gsize size, const GstAllocationParams &params)
{
  const gsize all = (params.prefix + size + params.padding + params.align) & ~params.align;
  auto data = static_cast<guint8 *> (std::aligned_alloc (params.align + 1, all));
  if (!data)
    return nullptr;
  if (params.flags & GST_MEMORY_FLAG_ZERO_PREFIXED)
    std::memset (data, 0, params.prefix);
  if (params.flags & GST_MEMORY_FLAG_ZERO_PADDED)
    std::memset (data + params.prefix + size, 0, all - params.prefix - size);
  return gst_memory_new_wrapped (params.flags, data, all, params.prefix, size, data, std::free);
}

static GstMemory *
try_memory (GstAllocator *wanted, gsize size, GstAllocationParams params)
{
  params.align |= kRowAlign - 1;
  GstAllocator *system = gst_allocator_find (GST_ALLOCATOR_SYSMEM);
  GstAllocator *allocator =
      wanted ? GST_ALLOCATOR (gst_object_ref (wanted)) : gst_allocator_find (nullptr);
  GstMemory *memory = allocator == system ? try_system_memory (size, params)
                                          : gst_allocator_alloc (allocator, size, &params);
  gst_object_unref (allocator);
  gst_object_unref (system);
  return memory;
}

/* @return nullptr when out of memory */
static GstBuffer *
try_buffer (
    GstAllocator *allocator, const GstAllocationParams &params, guint views, gsize view_size)
{
  const bool one_for_all = has_one_memory_for_all (views);
  GstBuffer *buffer = gst_buffer_new ();
  for (guint i = 0; i < (one_for_all ? 1 : views); i++) {
    GstMemory *memory = try_memory (allocator, one_for_all ? views * view_size : view_size, params);
    if (!memory) {
      gst_buffer_unref (buffer);
      return nullptr;
    }
    if (one_for_all)
      gst_mini_object_set_qdata (
          GST_MINI_OBJECT_CAST (memory), views_quark (), GUINT_TO_POINTER (views), nullptr);
    gst_buffer_append_memory (buffer, memory);
  }
  return buffer;
}

static void
empty_memories (GstBuffer *buffer)
{
  for (guint i = 0; i < gst_buffer_n_memory (buffer); i++)
    gst_memory_resize (gst_buffer_peek_memory (buffer, i), 0, 0);
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
  if (!within_limits (views, width, height)) {
    GST_WARNING_OBJECT (pool, "caps larger than any rig: %" GST_PTR_FORMAT, caps);
    return FALSE;
  }
  self->waits_for_memories = max == 0;
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

  *buffer = try_buffer (allocator, params, self->views, self->view_size);
  gst_structure_free (config);
  return *buffer ? GST_FLOW_OK : GST_FLOW_ERROR;
}

/* The base class keeps a released buffer only if it has its original size. */
static void
reset_whole (GstBufferPool *pool, GstBuffer *buffer)
{
  auto self = GST_RANGE_BUFFER_POOL (pool);
  const bool one_for_all = has_one_memory_for_all (self->views);
  const gsize size = one_for_all ? self->views * self->view_size : self->view_size;
  const guint n = gst_buffer_n_memory (buffer);
  for (guint i = 0; n == (one_for_all ? 1 : self->views) && i < n; i++) {
    GstMemory *memory = gst_buffer_peek_memory (buffer, i);
    if (gst_memory_is_writable (memory) && memory->maxsize >= size)
      gst_memory_resize (memory, -static_cast<gssize> (memory->offset), size);
  }
  GST_BUFFER_POOL_CLASS (gst_range_buffer_pool_parent_class)->reset_buffer (pool, buffer);
}

/* For buffers in release_buffer(), which follows. */
static void
gst_range_buffer_pool_reset_buffer (GstBufferPool *pool, GstBuffer *buffer)
{
  if (!GST_RANGE_BUFFER_POOL (pool)->waits_for_memories)
    reset_whole (pool, buffer);
}

/* A buffer whose memories are also in another one (gst_range_buffer_append()) is released by that
 * one's GstParentBufferMeta, which GStreamer 1.22 frees before the memories. They are still shared
 * then, and the base class would free the buffer each time. It is kept until the next acquire
 * instead. */
static void
gst_range_buffer_pool_release_buffer (GstBufferPool *pool, GstBuffer *buffer)
{
  auto self = GST_RANGE_BUFFER_POOL (pool);
  if (self->waits_for_memories && !gst_buffer_is_all_memory_writable (buffer)) {
    gst_atomic_queue_push (self->shared, buffer);
    return;
  }
  if (self->waits_for_memories)
    reset_whole (pool, buffer);
  GST_BUFFER_POOL_CLASS (gst_range_buffer_pool_parent_class)->release_buffer (pool, buffer);
}

/* Returns the kept buffers to the pool; the base class frees those that are still shared. */
static void
release_shared (GstBufferPool *pool)
{
  while (gpointer buffer = gst_atomic_queue_pop (GST_RANGE_BUFFER_POOL (pool)->shared)) {
    reset_whole (pool, GST_BUFFER (buffer));
    GST_BUFFER_POOL_CLASS (gst_range_buffer_pool_parent_class)
        ->release_buffer (pool, GST_BUFFER (buffer));
  }
}

static gboolean
gst_range_buffer_pool_stop (GstBufferPool *pool)
{
  release_shared (pool);
  return GST_BUFFER_POOL_CLASS (gst_range_buffer_pool_parent_class)->stop (pool);
}

static GstFlowReturn
gst_range_buffer_pool_acquire_buffer (
    GstBufferPool *pool, GstBuffer **buffer, GstBufferPoolAcquireParams *params)
{
  release_shared (pool);
  const GstFlowReturn flow = GST_BUFFER_POOL_CLASS (gst_range_buffer_pool_parent_class)
                                 ->acquire_buffer (pool, buffer, params);
  if (flow == GST_FLOW_OK)
    empty_memories (*buffer);
  return flow;
}

static void
gst_range_buffer_pool_finalize (GObject *object)
{
  gst_atomic_queue_unref (GST_RANGE_BUFFER_POOL (object)->shared); /* empty since stop */
  G_OBJECT_CLASS (gst_range_buffer_pool_parent_class)->finalize (object);
}

static void
gst_range_buffer_pool_init (GstRangeBufferPool *self)
{
  self->shared = gst_atomic_queue_new (4);
}

static void
gst_range_buffer_pool_class_init (GstRangeBufferPoolClass *klass)
{
  auto pool_class = GST_BUFFER_POOL_CLASS (klass);
  G_OBJECT_CLASS (klass)->finalize = gst_range_buffer_pool_finalize;
  pool_class->set_config = gst_range_buffer_pool_set_config;
  pool_class->alloc_buffer = gst_range_buffer_pool_alloc_buffer;
  pool_class->release_buffer = gst_range_buffer_pool_release_buffer;
  pool_class->stop = gst_range_buffer_pool_stop;
  pool_class->acquire_buffer = gst_range_buffer_pool_acquire_buffer;
  pool_class->reset_buffer = gst_range_buffer_pool_reset_buffer;
}

/**
 * gst_range_buffer_pool_new:
 *
 * Returns: (transfer full): a new pool; configure it with gst_range_buffer_pool_configure()
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
 * @min_buffers: number of buffers to allocate in advance
 * @max_buffers: maximum number of buffers, 0 = unlimited
 *
 * Configures the pool for frame sets of these caps.
 *
 * Returns: %FALSE if the caps lack size or number of views, or exceed the limits of a rig
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
 * @views: maximum number of views
 * @width: width of the largest ROI, pixels
 * @height: height of the largest ROI, pixels
 *
 * Allocates a buffer like those of a #GstRangeBufferPool, without a pool.
 *
 * Returns: (transfer full) (nullable): a buffer without views; %NULL if it would exceed the limits
 * of a rig, or when out of memory
 */
GstBuffer *
gst_range_buffer_new (guint views, guint width, guint height)
{
  if (!within_limits (views, width, height))
    return nullptr;
  GstAllocationParams params;
  gst_allocation_params_init (&params);
  GstBuffer *buffer = try_buffer (nullptr, params, views, full_view_size (width, height));
  if (buffer)
    empty_memories (buffer);
  return buffer;
}

/**
 * gst_range_buffer_add_view:
 * @buffer: a writable buffer of a #GstRangeBufferPool or gst_range_buffer_new()
 * @view_id: 0 to 63, not in the buffer yet
 * @x: left edge of the ROI, pixels
 * @y: top edge of the ROI, pixels
 * @width: width of the ROI, pixels; 0 for an empty one
 * @height: height of the ROI, pixels; 0 for an empty one
 * @capture_time: ns on the clock that the camera hosts share
 *
 * Adds a view to the buffer, in its next memory or behind the other views in the common one. A view
 * that is missing gets an empty ROI. Does not write pixels.
 *
 * Returns: (transfer none) (nullable): the layout of the planes, or %NULL if the buffer has a view
 * of that id, has no room for another view, or the ROI is too large
 */
GstRangeMeta *
gst_range_buffer_add_view (GstBuffer *buffer, guint view_id, guint x, guint y, guint width,
    guint height, GstClockTime capture_time)
{
  const guint index = gst_buffer_n_range_metas (buffer), memories = gst_buffer_n_memory (buffer);
  if (memories == 0 || !within_limits (1, width, height) ||
      gst_buffer_get_range_meta (buffer, view_id))
    return nullptr;
  GstMemory *memory = gst_buffer_peek_memory (buffer, MIN (index, memories - 1));
  if (index >= memories && index >= views_that_fit (memory))
    return nullptr;
  const gsize size = full_view_size (width, height);
  if (size > memory->maxsize - memory->offset - memory->size)
    return nullptr;
  const gsize offset = gst_buffer_get_size (buffer);
  gst_memory_resize (memory, 0, memory->size + size);

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
