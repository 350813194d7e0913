/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include "gstrange-prelude.h"

G_BEGIN_DECLS

#define GST_RANGE_MEDIA_TYPE "video/x-range"
#define GST_NEIGHBOUR_CODE_MEDIA_TYPE "video/x-neighbour-code"

/**
 * GST_RANGE_SIZE_CAPS:
 *
 * Fields that raw and coded frame sets have in common, for pad templates.
 */
#define GST_RANGE_SIZE_CAPS                                                                        \
  "width = (int) [ 1, 16384 ], height = (int) [ 1, 16384 ], "                                      \
  "framerate = (fraction) [ 0/1, 2147483647/1 ], views = (int) [ 1, 64 ]"

/**
 * GST_RANGE_CAPS:
 *
 * Raw frame sets. Fixed caps also have rig = (buffer), the binary form of the rig, with one range
 * view for each view-id that can occur.
 */
#define GST_RANGE_CAPS GST_RANGE_MEDIA_TYPE ", format = (string) Z16_RGBx, " GST_RANGE_SIZE_CAPS

/**
 * GST_NEIGHBOUR_CODE_CAPS:
 *
 * Coded frame sets in buffers of access units. Fixed caps also have rig = (buffer). Key access
 * units hold the rig, too: buffers from one on, written one after another, are a recording.
 */
#define GST_NEIGHBOUR_CODE_CAPS                                                                    \
  GST_NEIGHBOUR_CODE_MEDIA_TYPE                                                                    \
  ", version = (int) 4, alignment = (string) access-unit, " GST_RANGE_SIZE_CAPS

/**
 * GST_NEIGHBOUR_CODE_STREAM_CAPS:
 *
 * The same in any buffers, as those of a file.
 */
#define GST_NEIGHBOUR_CODE_STREAM_CAPS GST_NEIGHBOUR_CODE_MEDIA_TYPE ", version = (int) 4"

/**
 * GstRangeCamera:
 * @view_id: 0 to 63
 * @width: width of the full image, pixels
 * @height: height of the full image, pixels
 * @fx: horizontal focal length, pixels
 * @fy: vertical focal length, pixels
 * @cx: principal point, pixels; (0, 0) is the centre of the top-left pixel
 * @cy: principal point, pixels
 * @world_from_view: rows of the 3x4 matrix [R | t]; X_world = R * X_view + t, metres
 * @depth_unit: metres per depth step
 * @min_depth: nearest depth of interest, metres
 * @max_depth: farthest depth of interest, metres
 *
 * Calibration of one view. Pixel (u, v) with depth d is the point
 * z = d * depth_unit, X_view = ((u - cx) / fx * z, (v - cy) / fy * z, z): x right, y down, z
 * forward.
 */
typedef struct {
  guint view_id;
  gint width, height;
  gdouble fx, fy, cx, cy;
  gdouble world_from_view[12];
  gdouble depth_unit;
  gdouble min_depth, max_depth;

  /*< private >*/
  gpointer _gst_reserved[GST_PADDING];
} GstRangeCamera;

#define GST_TYPE_RANGE_CAMERA (gst_range_camera_get_type ())
GST_RANGE_API GType gst_range_camera_get_type (void);
GST_RANGE_API GstRangeCamera *gst_range_camera_copy (const GstRangeCamera *camera);
GST_RANGE_API void gst_range_camera_free (GstRangeCamera *camera);
GST_RANGE_API void gst_range_camera_init (
    GstRangeCamera *camera, guint view_id, gint width, gint height, gdouble focal_length);
GST_RANGE_API void gst_range_camera_set_pose (
    GstRangeCamera *camera, const gdouble *world_from_view);

GST_RANGE_API GstCaps *gst_range_caps_new (
    const GstRangeCamera *cameras, guint n_cameras, gint fps_n, gint fps_d, GError **error);
GST_RANGE_API gboolean gst_range_caps_get_camera (
    const GstCaps *caps, guint view_id, GstRangeCamera *camera);
GST_RANGE_API guint64 gst_range_caps_get_view_ids (const GstCaps *caps);

G_END_DECLS
