/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "pad.hpp"

#include "common/properties.hpp"

#include <rangecast/geometry/range_image.hpp>

using rangecast::CameraRole;

enum { PROP_0, PROP_VIEW, PROP_ROLE };

struct _GstRigCalibratePad {
  GstAggregatorPad parent;
  int view_id, role; /* guarded by the object lock */
};

G_DEFINE_TYPE (GstRigCalibratePad, gst_rig_calibrate_pad, GST_TYPE_AGGREGATOR_PAD)

#define GST_TYPE_RIG_CALIBRATE_ROLE (gst_rig_calibrate_role_get_type ())
static GType
gst_rig_calibrate_role_get_type (void)
{
  static const GType type = [] {
    static const GEnumValue values[] = {
        {int (CameraRole::kLeft), "Left camera of a stereo pair, or the only camera of a view",
            "left"},
        {int (CameraRole::kRight), "Right camera of a stereo pair", "right"},
        {int (CameraRole::kThird), "Third camera of a view", "third"}, {}};
    return g_enum_register_static ("GstRigCalibrateRole", values);
  }();
  return type;
}

rangecast::CalibrationCamera
calibration_camera (GstRigCalibratePad *pad)
{
  rangecast::CalibrationCamera camera;
  GST_OBJECT_LOCK (pad);
  camera.name = GST_OBJECT_NAME (pad);
  camera.view_id = pad->view_id;
  camera.role = CameraRole (pad->role);
  GST_OBJECT_UNLOCK (pad);
  return camera;
}

void
set_default_view (GstRigCalibratePad *pad, int view_id)
{
  GST_OBJECT_LOCK (pad);
  pad->view_id = view_id;
  GST_OBJECT_UNLOCK (pad);
}

static void
gst_rig_calibrate_pad_set_property (
    GObject *object, guint id, const GValue *value, GParamSpec *pspec)
{
  auto pad = GST_RIG_CALIBRATE_PAD (object);
  GST_OBJECT_LOCK (pad);
  if (id == PROP_VIEW)
    pad->view_id = g_value_get_int (value);
  else if (id == PROP_ROLE)
    pad->role = g_value_get_enum (value);
  else
    G_OBJECT_WARN_INVALID_PROPERTY_ID (object, id, pspec);
  GST_OBJECT_UNLOCK (pad);
}

static void
gst_rig_calibrate_pad_get_property (GObject *object, guint id, GValue *value, GParamSpec *pspec)
{
  auto pad = GST_RIG_CALIBRATE_PAD (object);
  GST_OBJECT_LOCK (pad);
  if (id == PROP_VIEW)
    g_value_set_int (value, pad->view_id);
  else if (id == PROP_ROLE)
    g_value_set_enum (value, pad->role);
  else
    G_OBJECT_WARN_INVALID_PROPERTY_ID (object, id, pspec);
  GST_OBJECT_UNLOCK (pad);
}

static void
gst_rig_calibrate_pad_init (GstRigCalibratePad *)
{
}

static void
gst_rig_calibrate_pad_class_init (GstRigCalibratePadClass *klass)
{
  auto object_class = G_OBJECT_CLASS (klass);
  object_class->set_property = gst_rig_calibrate_pad_set_property;
  object_class->get_property = gst_rig_calibrate_pad_get_property;
  g_object_class_install_property (object_class, PROP_VIEW,
      g_param_spec_int ("view", "View",
          "view-id of the view that the camera belongs to (default: the number of the pad)", 0,
          rangecast::kMaxViews - 1, 0, kMutableReady));
  g_object_class_install_property (object_class, PROP_ROLE,
      g_param_spec_enum ("role", "Role", "Role of the camera in its view",
          GST_TYPE_RIG_CALIBRATE_ROLE, int (CameraRole::kLeft), kMutableReady));
  gst_type_mark_as_plugin_api (GST_TYPE_RIG_CALIBRATE_ROLE, GstPluginAPIFlags (0));
}
