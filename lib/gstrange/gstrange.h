/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:gstrange
 * @title: libgstrange
 * @short_description: Read and write range frame sets in applications
 *
 * A video/x-range buffer is one frame set: depth and colour of one or more views, taken at one
 * capture time. Each view has a #GstRangeMeta that says where its planes lie. To read a buffer
 * that an appsink gave:
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
 * gst_range_caps_get_camera() gives what turns a pixel and its depth into a point in the world.
 *
 * Since: 0.1
 */
#pragma once

#include "gstrangebufferpool.h"
#include "gstrangecaps.h"
#include "gstrangemeta.h"
