/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include "gstrangemeta.h"

G_BEGIN_DECLS

#define GST_TYPE_RANGE_BUFFER_POOL (gst_range_buffer_pool_get_type ())
GST_RANGE_API
G_DECLARE_FINAL_TYPE (
    GstRangeBufferPool, gst_range_buffer_pool, GST, RANGE_BUFFER_POOL, GstBufferPool)

GST_RANGE_API GstBufferPool *gst_range_buffer_pool_new (void);
GST_RANGE_API gboolean gst_range_buffer_pool_configure (
    GstBufferPool *pool, GstCaps *caps, guint min_buffers, guint max_buffers);

GST_RANGE_API GstBuffer *gst_range_buffer_new (guint views, guint width, guint height);
GST_RANGE_API GstRangeMeta *gst_range_buffer_add_view (GstBuffer *buffer, guint view_id, guint x,
    guint y, guint width, guint height, GstClockTime capture_time);

G_END_DECLS
