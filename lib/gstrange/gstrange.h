/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:gstrange
 * @title: libgstrange
 * @short_description: Read and write range frame sets in applications
 *
 * A video/x-range buffer is one frame set: depth and colour of one or more views, captured at the
 * same time. Each view has a #GstRangeMeta that describes the layout of its planes. To read a
 * buffer from an appsink:
 *
 * |[<!-- language="C" -->
 * gpointer state = NULL;
 * GstRangeMeta *meta;
 * while ((meta = gst_buffer_iterate_range_meta (buffer, &state))) {
 *   GstRangeView view;
 *   if (!gst_range_view_map (&view, buffer, meta, GST_MAP_READ))
 *     continue;
 *   ... view.depth, view.colour, view.width x view.height ...
 *   gst_range_view_unmap (&view);
 * }
 * ]|
 *
 * gst_range_caps_get_camera() returns the calibration that maps a pixel and its depth to a point in
 * the world.
 *
 * Since: 0.1
 */
#pragma once

#include "gstrangebufferpool.h"
#include "gstrangecaps.h"
#include "gstrangemeta.h"
