/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include "gstrange-prelude.h"

G_BEGIN_DECLS

#define GST_RANGE_META_API_TYPE (gst_range_meta_api_get_type ())
#define GST_RANGE_META_INFO (gst_range_meta_get_info ())

/**
 * GstRangeMeta:
 * @meta: parent
 * @view_id: 0 to 63, unique in the buffer
 * @x: left edge of the ROI in the view's full image, pixels
 * @y: top edge of the ROI, pixels
 * @width: width of the ROI, pixels; 0 for an empty view
 * @height: height of the ROI, pixels; 0 for an empty view
 * @depth_offset: bytes from the start of the buffer to the first depth (uint16 little-endian, in
 *   the view's depth units, 0 = invalid); even
 * @depth_stride: bytes from one row of depth to the next; even
 * @colour_offset: bytes from the start of the buffer to the first pixel (R, G, B, unused)
 * @colour_stride: bytes from one row of colour to the next; a multiple of 4
 * @capture_time: capture time, ns on the clock that the camera hosts share
 *
 * Layout of one view of a frame set. Only the ROI is stored; both planes of a view are in one
 * #GstMemory.
 */
typedef struct {
  GstMeta meta;

  guint view_id;
  guint x, y, width, height;
  gsize depth_offset;
  guint depth_stride;
  gsize colour_offset;
  guint colour_stride;
  GstClockTime capture_time;

  /*< private >*/
  gpointer _gst_reserved[GST_PADDING];
} GstRangeMeta;

GST_RANGE_API GType gst_range_meta_api_get_type (void);
GST_RANGE_API const GstMetaInfo *gst_range_meta_get_info (void);

GST_RANGE_API GstRangeMeta *gst_buffer_get_range_meta (GstBuffer *buffer, guint view_id);
GST_RANGE_API GstRangeMeta *gst_buffer_iterate_range_meta (GstBuffer *buffer, gpointer *state);
GST_RANGE_API guint gst_buffer_n_range_metas (GstBuffer *buffer);

GST_RANGE_API gboolean gst_range_buffer_append (GstBuffer *frame_set, GstBuffer *views);
GST_RANGE_API GstBuffer *gst_range_buffer_copy_view (
    GstBuffer *frame_set, const GstRangeMeta *meta);

GST_RANGE_API void gst_range_buffer_set_capture_time (GstBuffer *buffer, GstClockTime time);
GST_RANGE_API GstClockTime gst_range_buffer_get_capture_time (GstBuffer *buffer);

/**
 * GstRangeView:
 * @view_id: 0 to 63
 * @x: left edge of the ROI in the view's full image, pixels
 * @y: top edge of the ROI, pixels
 * @width: width of the ROI and of both planes, pixels
 * @height: height of the ROI and of both planes, pixels
 * @depth: first row of depth; %NULL if the ROI is empty
 * @depth_stride: bytes from one row of depth to the next
 * @colour: first row of colour, 4 bytes (R, G, B, unused) a pixel; %NULL if the ROI is empty
 * @colour_stride: bytes from one row of colour to the next
 *
 * A mapped view.
 */
typedef struct {
  guint view_id;
  guint x, y, width, height;
  guint16 *depth;
  guint depth_stride;
  guint8 *colour;
  guint colour_stride;

  /*< private >*/
  GstBuffer *buffer;
  GstMapInfo map;
  gpointer _gst_reserved[GST_PADDING];
} GstRangeView;

GST_RANGE_API gboolean gst_range_view_map (
    GstRangeView *view, GstBuffer *buffer, const GstRangeMeta *meta, GstMapFlags flags);
GST_RANGE_API void gst_range_view_unmap (GstRangeView *view);

G_END_DECLS
