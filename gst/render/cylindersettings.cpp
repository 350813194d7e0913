/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "cylindersettings.hpp"

#include <cmath>

GST_DEBUG_CATEGORY_EXTERN (gst_cylinder_filter_debug);
#define GST_CAT_DEFAULT gst_cylinder_filter_debug

rangecast::AgreementSettings
CylinderFilterSettings::agreement () const
{
  const auto checks = [this] (GstCylinderFilterAgree check) { return (consistency & check) != 0; };
  return {checks (GST_CYLINDER_FILTER_AGREE_POSES), checks (GST_CYLINDER_FILTER_AGREE_DEPTH),
      checks (GST_CYLINDER_FILTER_AGREE_VIEWS), checks (GST_CYLINDER_FILTER_AGREE_POINTS),
      core.threads};
}

rangecast::ColourSettings
CylinderFilterSettings::colours () const
{
  return {balance == GST_CYLINDER_FILTER_BALANCE_AUTO,
      mode == GST_CYLINDER_FILTER_BLEND ? blend_width_m : 0, core.threads};
}

/* ---- GTypes ---- */

#define GST_TYPE_CYLINDER_FILTER_MODE (gst_cylinder_filter_mode_get_type ())
static GType
gst_cylinder_filter_mode_get_type (void)
{
  static const GEnumValue values[] = {
      {GST_CYLINDER_FILTER_OFF, "Pass buffers through unchanged", "off"},
      {GST_CYLINDER_FILTER_WINNER, "Keep the points of the best view and clear those of the others",
          "winner"},
      {GST_CYLINDER_FILTER_BLEND, "As winner, with colours blended along the seams", "blend"},
      {0, nullptr, nullptr},
  };
  static const GType type = g_enum_register_static ("GstCylinderFilterMode", values);
  return type;
}

#define GST_TYPE_CYLINDER_FILTER_AGREE (gst_cylinder_filter_agree_get_type ())
static GType
gst_cylinder_filter_agree_get_type (void)
{
  static const GFlagsValue values[] = {
      {0, "Nothing", "none"},
      {GST_CYLINDER_FILTER_AGREE_POSES, "Estimate and correct errors of the camera poses", "poses"},
      {GST_CYLINDER_FILTER_AGREE_DEPTH,
          "Move the depths that several views measured of one surface together", "depth"},
      {GST_CYLINDER_FILTER_AGREE_VIEWS, "Omit a view that contradicts the others", "views"},
      {GST_CYLINDER_FILTER_AGREE_POINTS,
          "Clear points that another view sees through in a different colour", "points"},
      {0, nullptr, nullptr},
  };
  static const GType type = g_flags_register_static ("GstCylinderFilterAgree", values);
  return type;
}

#define GST_TYPE_CYLINDER_FILTER_BALANCE (gst_cylinder_filter_balance_get_type ())
static GType
gst_cylinder_filter_balance_get_type (void)
{
  static const GEnumValue values[] = {
      {GST_CYLINDER_FILTER_BALANCE_OFF, "Leave colours unchanged", "off"},
      {GST_CYLINDER_FILTER_BALANCE_AUTO,
          "Estimate a gain per view and channel from surfaces that several views see", "auto"},
      {0, nullptr, nullptr},
  };
  static const GType type = g_enum_register_static ("GstCylinderFilterBalance", values);
  return type;
}

#define GST_TYPE_CYLINDER_FILTER_AXIS (gst_cylinder_filter_axis_get_type ())
static GType
gst_cylinder_filter_axis_get_type (void)
{
  using rangecast::AxisMode;
  static const GEnumValue values[] = {
      {int (AxisMode::kPrincipal), "Principal axis of the points of all views", "principal"},
      {int (AxisMode::kVertical), "World y axis through the centroid of the points", "vertical"},
      {int (AxisMode::kFixed), "Axis given by axis-position and axis-direction", "fixed"},
      {0, nullptr, nullptr},
  };
  static const GType type = g_enum_register_static ("GstCylinderFilterAxis", values);
  return type;
}

/* ---- vectors as GstValueArray ---- */

namespace {

bool
get_vector (const GValue *value, rangecast::Vec3 &vector)
{
  double v[3];
  if (gst_value_array_get_size (value) != 3)
    return false;
  for (guint i = 0; i < 3; i++) {
    const GValue *item = gst_value_array_get_value (value, i);
    GValue number = G_VALUE_INIT;
    g_value_init (&number, G_TYPE_DOUBLE);
    if (!g_value_transform (item, &number) || !std::isfinite (g_value_get_double (&number)))
      return false;
    v[i] = g_value_get_double (&number);
  }
  vector = {v[0], v[1], v[2]};
  return true;
}

GParamSpec *
vector_spec (const char *name, const char *nick, const char *blurb)
{
  return gst_param_spec_array (name, nick, blurb,
      g_param_spec_double ("number", "Number", "One of the components x, y, z", -G_MAXDOUBLE,
          G_MAXDOUBLE, 0, kReadWrite),
      kMutablePlaying);
}

/* As GObject warns of a value that is out of a property's range. */
void
warn_vector (const char *name, const GValue *value, const char *length)
{
  gchar *text = gst_value_serialize (value);
  g_warning ("cylinderfilter: %s=\"%s\": expected three numbers and %s; not changed", name,
      text ? text : "", length);
  g_free (text);
}

void
set_axis_position (CylinderFilterSettings &settings, const GValue *value)
{
  rangecast::Vec3 position;
  if (get_vector (value, position) && norm (position) < 1e6)
    settings.core.fixed_axis.position = position;
  else
    warn_vector ("axis-position", value, "a length below 1e6");
}

void
set_axis_direction (CylinderFilterSettings &settings, const GValue *value)
{
  rangecast::Vec3 direction;
  if (get_vector (value, direction) && norm (direction) >= 1e-6 && norm (direction) < 1e6)
    settings.core.fixed_axis.direction = direction;
  else
    warn_vector ("axis-direction", value, "a length from 1e-6 to below 1e6");
}

} // namespace

void
set_vector (GValue *array, const rangecast::Vec3 &vector)
{
  for (double number : {vector.x, vector.y, vector.z}) {
    GValue value = G_VALUE_INIT;
    g_value_init (&value, G_TYPE_DOUBLE);
    g_value_set_double (&value, number);
    gst_value_array_append_and_take_value (array, &value);
  }
}

PropertyTable<CylinderFilterSettings> &
cylinder_properties ()
{
  using S = CylinderFilterSettings;
  using Core = rangecast::CylinderSettings;
  using Cells = rangecast::CellSettings;
  using P = PropertyTable<S>;
  static constexpr const char *kConsistencyBlurb =
      "Which consistency checks and corrections to apply between views";
  static P table = {
      P::enumeration<&S::mode> ("mode", "Mode", "What to do with points that several views see",
          GST_TYPE_CYLINDER_FILTER_MODE, kControllable),
      P::enumeration<&S::balance> ("colour-balance", "Colour balance",
          "How to match the colours of the views", GST_TYPE_CYLINDER_FILTER_BALANCE, kControllable),
      P::number<&S::blend_width_m> ("blend-width", "Blend width",
          "Distance from a seam within which colours are blended with mode=blend, in metres", 0, 1,
          kControllable),
      P::flag_set<&S::consistency> ("consistency", "View consistency", kConsistencyBlurb,
          GST_TYPE_CYLINDER_FILTER_AGREE, kControllable),
      P::flag_set<&S::consistency> ("agree", "View consistency", "Former name of consistency",
          GST_TYPE_CYLINDER_FILTER_AGREE, GParamFlags (kControllable | G_PARAM_DEPRECATED)),
      P::enumeration<&S::core, &Core::axis> ("axis", "Axis",
          "How to choose the axis of the cylinder", GST_TYPE_CYLINDER_FILTER_AXIS, kControllable),
      P::custom (vector_spec ("axis-position", "Axis position",
                     "A point <x, y, z> of the axis for axis=fixed, in world coordinates and "
                     "metres, less than 1e6 from the origin"),
          set_axis_position,
          [] (const S &s, GValue *value) { set_vector (value, s.core.fixed_axis.position); }),
      P::custom (vector_spec ("axis-direction", "Axis direction",
                     "Direction <x, y, z> of the axis for axis=fixed, in world coordinates, of "
                     "length 1e-6 to 1e6"),
          set_axis_direction,
          [] (const S &s, GValue *value) { set_vector (value, s.core.fixed_axis.direction); }),
      P::number<&S::core, &Core::max_clusters> ("bodies", "Maximum bodies",
          "Maximum number of separate bodies that get a cylinder each (1 = one cylinder for "
          "everything, as with axis=fixed)",
          1, rangecast::kMaxClusters, kControllable),
      P::number<&S::core, &Core::cells, &Cells::height_m> ("unit-height", "Slice height",
          "Height of a slice of the cylinder in metres", 0.0002, 10., kControllable),
      P::number<&S::core, &Core::cells, &Cells::columns> (
          "columns", "Cells per slice", "Number of cells around a slice", 8, 3600, kControllable),
      P::number<&S::core, &Core::cells, &Cells::layer_gap_m> ("layer-gap", "Layer gap",
          "Radial gap in metres beyond which points of one cell belong to different surfaces", 0,
          100, kControllable),
      P::number<&S::core, &Core::cells, &Cells::smoothing_m> ("smoothing", "Smoothing radius",
          "Radius in metres of the neighbourhood that decides which view wins a cell (0 = each "
          "cell on its own)",
          0, 1, kControllable),
      P::number<&S::core, &Core::overlap> ("overlap", "Overlap",
          "Distance in pixels to which the winning view's surface must extend around a point "
          "before the point is cleared (1 or more = no holes open, larger = wider overlap for "
          "blending)",
          0, rangecast::kMaxOverlap, kControllable),
      P::number<&S::core, &Core::hysteresis> ("hysteresis", "Hysteresis",
          "Cosine by which another view must face the surface more directly to take over a cell (0 "
          "= no memory of earlier frames)",
          0, 2, kControllable),
      P::number<&S::core, &Core::agreement> ("agreement", "Neighbour bonus",
          "Bonus, as a cosine, of a view in cells whose neighbours it won", 0, 2, kControllable),
      P::number<&S::core, &Core::threads> ("n-threads", "Threads",
          "Number of threads that process views and slices (0 = one per CPU core)", 0, 64,
          kMutablePlaying),
  };
  return table;
}
