/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "stripsettings.hpp"

#include <iterator>

using rangecast::StripMode;
using Settings = StripRenderSettings;

static constexpr auto kFlags = GParamFlags (G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS |
                                            GST_PARAM_MUTABLE_PLAYING | GST_PARAM_CONTROLLABLE);
static constexpr rangecast::StripSettings kDefaults;

/* The properties that are plain numbers. */
struct NumberRow {
  const char *name, *nick, *blurb;
  double minimum, maximum, fallback;
  double &(*field) (Settings &);
};
static const NumberRow kNumbers[] = {
    {"azimuth", "Azimuth",
        "Degrees round the scene from the first view, to the right (-360 to 360, default 0)", -360,
        360, 0, [] (Settings &s) -> double & { return s.camera.orbit.azimuth_deg; }},
    {"elevation", "Elevation", "Degrees above the first view's height (-89 to 89, default 0)", -89,
        89, 0, [] (Settings &s) -> double & { return s.camera.orbit.elevation_deg; }},
    {"distance", "Distance",
        "Metres from what is looked at (0 to 1000, default 0: the first view's distance)", 0, 1000,
        0, [] (Settings &s) -> double & { return s.camera.orbit.distance_m; }},
    {"field-of-view", "Field of view",
        "Vertical angle in degrees (0 to 170, default 0: the first view's)", 0, 170, 0,
        [] (Settings &s) -> double & { return s.camera.orbit.fov_deg; }},
    {"pan-x", "Pan x",
        "Metres by which what is looked at moves to the first view's right (-1000 to 1000, "
        "default 0)",
        -1000, 1000, 0, [] (Settings &s) -> double & { return s.camera.orbit.pan.x; }},
    {"pan-y", "Pan y", "Metres by which what is looked at moves up (-1000 to 1000, default 0)",
        -1000, 1000, 0, [] (Settings &s) -> double & { return s.camera.orbit.pan.y; }},
    {"pan-z", "Pan z",
        "Metres by which what is looked at moves towards the first view (-1000 to 1000, default 0)",
        -1000, 1000, 0, [] (Settings &s) -> double & { return s.camera.orbit.pan.z; }},
    {"auto-orbit", "Auto orbit",
        "Degrees a second by which the azimuth grows by itself from the first frame on (-3600 to "
        "3600, default 0)",
        -3600, 3600, 0, [] (Settings &s) -> double & { return s.camera.auto_orbit; }},
    {"depth-step", "Depth step",
        "Neighbours that differ by more than this share of their depth are not joined (0 to 1, "
        "default 0.03)",
        0, 1, kDefaults.depth_step, [] (Settings &s) -> double & { return s.strips.depth_step; }},
    {"merge", "Merge",
        "Strips leave out pixels that are off the surface between others by less than this times "
        "0.07 % of their depth and 1.5 levels of colour; copies: 0.4 % and 12 levels (0 = none, "
        "to 100, default 1)",
        0, 100, kDefaults.merge, [] (Settings &s) -> double & { return s.strips.merge; }},
    {"view-gap", "View gap",
        "Metres by which what a view sees moves behind what others see, times 1 - cosine of the "
        "angle between its direction and the picture's (0 to 1, default 0.004)",
        0, 1, 0.004, [] (Settings &s) -> double & { return s.view_gap_m; }},
    {"point-size", "Point size", "Of mode points, in footprints of a pixel (0.1 to 100, default 1)",
        0.1, 100, 1, [] (Settings &s) -> double & { return s.point_size; }},
};

enum : guint {
  PROP_NUMBERS = 1,
  PROP_MODE = PROP_NUMBERS + std::size (kNumbers),
  PROP_BACKGROUND,
  PROP_MAX_GAP,
  PROP_SHOW_CAMERAS,
  PROP_BACK_FACES,
  PROP_SAMPLES,
  PROP_LAST = PROP_SAMPLES
};

GType
gst_strip_render_mode_get_type (void)
{
  static const GType type = [] {
    static const GEnumValue values[] = {
        {int (StripMode::kStrips), "Bands of triangles along the rows", "strips"},
        {int (StripMode::kRectangles), "One rectangle a pixel", "rectangles"},
        {int (StripMode::kPoints), "One point a pixel", "points"}, {}};
    return g_enum_register_static ("GstStripRenderMode", values);
  }();
  return type;
}

guint
install_strip_settings (GObjectClass *object_class)
{
  for (guint i = 0; i < std::size (kNumbers); i++) {
    const NumberRow &row = kNumbers[i];
    g_object_class_install_property (object_class, PROP_NUMBERS + i,
        g_param_spec_double (
            row.name, row.nick, row.blurb, row.minimum, row.maximum, row.fallback, kFlags));
  }
  g_object_class_install_property (object_class, PROP_MODE,
      g_param_spec_enum ("mode", "Mode", "What is drawn for the points (default: strips)",
          GST_TYPE_STRIP_RENDER_MODE, int (StripMode::kStrips), kFlags));
  g_object_class_install_property (object_class, PROP_BACKGROUND,
      g_param_spec_uint ("background", "Background",
          "Colour behind the scene, ARGB (default 0xff20242a)", 0, G_MAXUINT32,
          Settings::kDefaultBackground, kFlags));
  g_object_class_install_property (object_class, PROP_MAX_GAP,
      g_param_spec_int ("max-gap", "Maximum gap",
          "Invalid pixels of a row or a column that strips bridge (0 to 1000, default 6)", 0, 1000,
          kDefaults.max_gap, kFlags));
  g_object_class_install_property (object_class, PROP_SHOW_CAMERAS,
      g_param_spec_boolean ("show-cameras", "Show cameras",
          "Also draw where the rig's cameras stand, and their frusta from near to far (default "
          "false)",
          FALSE, kFlags));
  g_object_class_install_property (object_class, PROP_BACK_FACES,
      g_param_spec_boolean ("back-faces", "Back faces",
          "Strips also show surfaces from behind, from inside a body, where no front is (default "
          "false; always with one camera)",
          FALSE, kFlags));
  g_object_class_install_property (object_class, PROP_SAMPLES,
      g_param_spec_int ("samples", "Samples",
          "Samples of a pixel, for antialiasing (0 or 1 = none, to 64, default 0); less where "
          "OpenGL has no more",
          0, 64, 0, kFlags));
  return PROP_LAST;
}

static double
number (Settings settings, const NumberRow &row)
{
  return row.field (settings); /* of the copy */
}

void
notify_strip_settings (GObject *object, const Settings &before, const Settings &after)
{
  for (const NumberRow &row : kNumbers)
    if (number (before, row) != number (after, row))
      g_object_notify (object, row.name);
}

bool
set_strip_setting (Settings &settings, guint id, const GValue *value)
{
  if (id >= PROP_NUMBERS && id < PROP_NUMBERS + std::size (kNumbers))
    kNumbers[id - PROP_NUMBERS].field (settings) = g_value_get_double (value);
  else if (id == PROP_MODE)
    settings.strips.mode = StripMode (g_value_get_enum (value));
  else if (id == PROP_BACKGROUND)
    settings.background = g_value_get_uint (value);
  else if (id == PROP_MAX_GAP)
    settings.strips.max_gap = g_value_get_int (value);
  else if (id == PROP_SHOW_CAMERAS)
    settings.show_cameras = g_value_get_boolean (value);
  else if (id == PROP_BACK_FACES)
    settings.back_faces = g_value_get_boolean (value);
  else if (id == PROP_SAMPLES)
    settings.samples = g_value_get_int (value);
  else
    return false;
  return true;
}

bool
get_strip_setting (const Settings &settings, guint id, GValue *value)
{
  if (id >= PROP_NUMBERS && id < PROP_NUMBERS + std::size (kNumbers))
    g_value_set_double (value, number (settings, kNumbers[id - PROP_NUMBERS]));
  else if (id == PROP_MODE)
    g_value_set_enum (value, int (settings.strips.mode));
  else if (id == PROP_BACKGROUND)
    g_value_set_uint (value, settings.background);
  else if (id == PROP_MAX_GAP)
    g_value_set_int (value, settings.strips.max_gap);
  else if (id == PROP_SHOW_CAMERAS)
    g_value_set_boolean (value, settings.show_cameras);
  else if (id == PROP_BACK_FACES)
    g_value_set_boolean (value, settings.back_faces);
  else if (id == PROP_SAMPLES)
    g_value_set_int (value, settings.samples);
  else
    return false;
  return true;
}
