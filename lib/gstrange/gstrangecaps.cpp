/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:gstrangecaps
 * @title: Caps and cameras
 * @short_description: Calibration of the views in caps
 *
 * Fixed caps of frame sets contain the calibration of each view. An application that produces frame
 * sets describes its cameras and makes caps of them:
 *
 * |[<!-- language="C" -->
 * GstRangeCamera camera;
 * gst_range_camera_init (&camera, 0, 640, 480, 525.0);
 * camera.depth_unit = 0.001;
 * GstCaps *caps = gst_range_caps_new (&camera, 1, 30, 1, &error);
 * ]|
 *
 * Since: 0.1
 */
#include "gstrangecaps.h"

#include <algorithm>

#include "gstrangeinfo.hpp"

using rangecast::Status;
using rangecast::View;

static GstRangeCamera
camera_of (const View &view)
{
  GstRangeCamera camera{guint (view.id), view.width, view.height, view.intrinsics.fx,
      view.intrinsics.fy, view.intrinsics.cx, view.intrinsics.cy, {}, view.depth_unit_m,
      view.near_m, view.far_m, {}};
  const auto &[rotation, translation] = view.world_from_view;
  const double t[] = {translation.x, translation.y, translation.z};
  for (int row = 0; row < 3; row++) {
    std::copy_n (&rotation[3 * row], 3, &camera.world_from_view[4 * row]);
    camera.world_from_view[4 * row + 3] = t[row];
  }
  return camera;
}

static View
view_of (const GstRangeCamera &camera)
{
  View view;
  /* Larger ids would become negative; any number beyond the last is refused. */
  view.id = int (std::min (camera.view_id, guint (rangecast::kMaxViews)));
  view.name = "view " + std::to_string (camera.view_id);
  view.width = camera.width;
  view.height = camera.height;
  view.intrinsics = {camera.fx, camera.fy, camera.cx, camera.cy};
  const double *m = camera.world_from_view;
  view.world_from_view = {
      {m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]}, {m[3], m[7], m[11]}};
  view.depth_unit_m = camera.depth_unit;
  view.near_m = camera.min_depth;
  view.far_m = camera.max_depth;
  return view;
}

G_DEFINE_BOXED_TYPE (GstRangeCamera, gst_range_camera, gst_range_camera_copy, gst_range_camera_free)

/**
 * gst_range_camera_copy:
 * @camera: a camera
 *
 * Returns: (transfer full): a copy, to be freed with gst_range_camera_free()
 */
GstRangeCamera *
gst_range_camera_copy (const GstRangeCamera *camera)
{
  return static_cast<GstRangeCamera *> (g_memdup2 (camera, sizeof *camera));
}

/**
 * gst_range_camera_free:
 * @camera: (transfer full): a camera of gst_range_camera_copy()
 */
void
gst_range_camera_free (GstRangeCamera *camera)
{
  g_free (camera);
}

/**
 * gst_range_camera_init:
 * @camera: the camera
 * @view_id: 0 to 63
 * @width: width of the full image, pixels
 * @height: height of the full image, pixels
 * @focal_length: pixels, both horizontal and vertical
 *
 * Describes a camera at the origin of the world with its principal point at the centre of the
 * image, a depth unit of 0.1 mm, and depth from 0.3 m to 3 m. It looks along -z, with y up. Change
 * the fields that differ.
 */
void
gst_range_camera_init (
    GstRangeCamera *camera, guint view_id, gint width, gint height, gdouble focal_length)
{
  View view;
  view.intrinsics = {focal_length, focal_length, (width - 1) / 2.0, (height - 1) / 2.0};
  view.width = width;
  view.height = height;
  view.world_from_view.rotation = {1, 0, 0, 0, -1, 0, 0, 0, -1};
  *camera = camera_of (view);
  camera->view_id = view_id;
}

/**
 * gst_range_camera_set_pose:
 * @camera: the camera
 * @world_from_view: (array fixed-size=12): rows of the 3x4 matrix [R | t]; X_world = R * X_view +
 * t, metres
 *
 * Sets the pose, for languages that cannot write to the array in the struct.
 */
void
gst_range_camera_set_pose (GstRangeCamera *camera, const gdouble *world_from_view)
{
  std::copy_n (world_from_view, G_N_ELEMENTS (camera->world_from_view), camera->world_from_view);
}

/**
 * gst_range_caps_new:
 * @cameras: (array length=n_cameras): one for each view
 * @n_cameras: 1 to 64
 * @fps_n: frame rate; 0/1 = variable or unknown
 * @fps_d: denominator of the frame rate
 * @error: what is wrong with the cameras, a #GstLibraryError
 *
 * Makes video/x-range caps. Their width and height are those of the largest view.
 *
 * Returns: (transfer full) (nullable): the caps, or %NULL on error
 */
GstCaps *
gst_range_caps_new (
    const GstRangeCamera *cameras, guint n_cameras, gint fps_n, gint fps_d, GError **error)
{
  if (n_cameras == 0 || fps_n < 0 || fps_d < 1) {
    g_set_error (error, GST_LIBRARY_ERROR, GST_LIBRARY_ERROR_SETTINGS,
        "needs at least one camera and a frame rate of at least 0/1, got %u and %d/%d", n_cameras,
        fps_n, fps_d);
    return nullptr;
  }
  rangecast::Rig rig;
  for (guint i = 0; i < n_cameras; i++)
    rig.views.push_back (view_of (cameras[i]));
  if (const Status s = validate (rig); !s.ok ()) {
    g_set_error_literal (
        error, GST_LIBRARY_ERROR, GST_LIBRARY_ERROR_SETTINGS, s.message ().c_str ());
    return nullptr;
  }
  return gstrange::make_range_caps (gstrange::make_info (std::move (rig), fps_n, fps_d));
}

/**
 * gst_range_caps_get_camera:
 * @caps: fixed video/x-range or video/x-neighbour-code caps
 * @view_id: 0 to 63
 * @camera: (out caller-allocates): the view's calibration
 *
 * Returns: %FALSE if the caps have no valid rig, or the rig lacks the view
 */
gboolean
gst_range_caps_get_camera (const GstCaps *caps, guint view_id, GstRangeCamera *camera)
{
  gstrange::RangeInfo info;
  if (!gstrange::parse_caps (caps, info).ok () || view_id >= guint (rangecast::kMaxViews))
    return FALSE;
  const View *view = info.rig.find (static_cast<int> (view_id));
  if (!view)
    return FALSE;
  *camera = camera_of (*view);
  return TRUE;
}

/**
 * gst_range_caps_get_view_ids:
 * @caps: fixed video/x-range or video/x-neighbour-code caps
 *
 * Returns: the views that can occur: bit i is set if the rig has a view of id i; 0 if the caps have
 *   no valid rig
 */
guint64
gst_range_caps_get_view_ids (const GstCaps *caps)
{
  gstrange::RangeInfo info;
  guint64 ids = 0;
  if (gstrange::parse_caps (caps, info).ok ())
    for (const View &view : info.rig.views)
      ids |= guint64{1} << view.id;
  return ids;
}
