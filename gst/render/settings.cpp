/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "settings.hpp"

#include <cstddef>
#include <functional>
#include <iterator>

using rangecast::StripMode;
using Settings = StripRenderSettings;

static constexpr auto kFlags = GParamFlags (G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS |
                                            GST_PARAM_MUTABLE_PLAYING | GST_PARAM_CONTROLLABLE);
/* Of what is decided for a stream rather than for a picture. */
static constexpr auto kRateFlags =
    GParamFlags (G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_PLAYING);
static constexpr rangecast::StripSettings kDefaults;

/* The properties that are plain numbers. */
struct NumberRow {
  const char *name, *nick, *blurb;
  double minimum, maximum, fallback;
  double &(*field) (Settings &);
};
static const NumberRow kNumbers[] = {
    {"azimuth", "Azimuth",
        "Camera angle around the scene in degrees, positive to the right of the first view", -360,
        360, 0, [] (Settings &s) -> double & { return s.camera.orbit.azimuth_deg; }},
    {"elevation", "Elevation", "Camera angle above the first view in degrees", -89, 89, 0,
        [] (Settings &s) -> double & { return s.camera.orbit.elevation_deg; }},
    {"distance", "Distance",
        "Distance of the camera from its target in metres (0 = as the first view)", 0, 1000, 0,
        [] (Settings &s) -> double & { return s.camera.orbit.distance_m; }},
    {"field-of-view", "Field of view", "Vertical field of view in degrees (0 = as the first view)",
        0, 170, 0, [] (Settings &s) -> double & { return s.camera.orbit.fov_deg; }},
    {"pan-x", "Pan x", "Shift of the camera target to the first view's right in metres", -1000,
        1000, 0, [] (Settings &s) -> double & { return s.camera.orbit.pan.x; }},
    {"pan-y", "Pan y", "Shift of the camera target upwards in metres", -1000, 1000, 0,
        [] (Settings &s) -> double & { return s.camera.orbit.pan.y; }},
    {"pan-z", "Pan z", "Shift of the camera target towards the first view in metres", -1000, 1000,
        0, [] (Settings &s) -> double & { return s.camera.orbit.pan.z; }},
    {"auto-orbit", "Auto orbit", "Speed of automatic rotation in degrees per second", -3600, 3600,
        0, [] (Settings &s) -> double & { return s.camera.auto_orbit; }},
    {"depth-step", "Depth step",
        "Depth difference, as a fraction of depth, beyond which neighbouring pixels are not joined",
        0, 1, kDefaults.depth_step, [] (Settings &s) -> double & { return s.strips.depth_step; }},
    {"merge", "Merge tolerance",
        "Tolerance of strip simplification (0 = keep every pixel, 1 = 0.07 % of depth and 1.5 "
        "colour levels)",
        0, 100, kDefaults.merge, [] (Settings &s) -> double & { return s.strips.merge; }},
    {"view-gap", "View gap",
        "Metres by which a view is moved behind the others, times 1 - cosine of its angle to the "
        "viewing direction; not used by mode=blend",
        0, 1, 0.012, [] (Settings &s) -> double & { return s.view_gap_m; }},
    {"blend-range", "Blend range",
        "Depth behind the nearest surface in metres within which views are blended with mode=blend",
        0, 1, 0.02, [] (Settings &s) -> double & { return s.blend_range_m; }},
    {"background-shade", "Background shade",
        "Vertical gradient of an opaque background, as a fraction of its colour (0 = none)", 0, 1,
        0, [] (Settings &s) -> double & { return s.background_shade; }},
    {"point-size", "Point size",
        "Size of a point relative to the footprint of its pixel, for mode=points", 0.1, 100, 1,
        [] (Settings &s) -> double & { return s.point_size; }},
    {"eye-distance", "Eye distance", "Distance between the eyes in metres, for stereoscopic output",
        0, 10, 0.063, [] (Settings &s) -> double & { return s.eye_distance_m; }},
    {"convergence", "Convergence",
        "Distance of zero parallax in metres, for stereoscopic output (0 = camera target, 1000 = "
        "headsets)",
        0, 1000, 0, [] (Settings &s) -> double & { return s.convergence_m; }},
};

/* The properties that are on or off, off at first. */
struct SwitchRow {
  const char *name, *nick, *blurb;
  GParamFlags flags;
  bool &(*field) (Settings &);
};
static const SwitchRow kSwitches[] = {
    {"fit", "Fit to content",
        "Fit the view to the content at the start of the stream and on the keys r and Home; camera "
        "properties then count from that view",
        kFlags, [] (Settings &s) -> bool & { return s.fit; }},
    {"show-cameras", "Show cameras", "Draw the rig's cameras and their frusta from near to far",
        kFlags, [] (Settings &s) -> bool & { return s.show_cameras; }},
    {"back-faces", "Back faces",
        "Draw back faces where no front face covers them, for mode=strips (always on for rigs of "
        "one camera)",
        kFlags, [] (Settings &s) -> bool & { return s.back_faces; }},
    {"show-units", "Tint views", "Tint each point with the colour of its view", kFlags,
        [] (Settings &s) -> bool & { return s.show_units; }},
    {"show-stats", "Show statistics", "Overlay statistics on the output", kFlags,
        [] (Settings &s) -> bool & { return s.show_stats; }},
    {"keep-rate", "Keep rate",
        "Output at the negotiated frame rate even if it is the input's, repeating frames while a "
        "live stream stalls",
        kRateFlags, [] (Settings &s) -> bool & { return s.keep_rate; }},
};

enum : guint {
  PROP_NUMBERS = 1,
  PROP_SWITCHES = PROP_NUMBERS + std::size (kNumbers),
  PROP_MODE = PROP_SWITCHES + std::size (kSwitches),
  PROP_BACKGROUND,
  PROP_VIEW_MASK,
  PROP_MAX_GAP,
  PROP_SAMPLES,
  PROP_HOLD_TIME,
  PROP_LAST = PROP_HOLD_TIME
};

/* The row of a property, or nullptr if it is not in the table. */
template <typename Row, std::size_t n>
static const Row *
row_of (const Row (&rows)[n], guint first, guint id)
{
  return id >= first && id - first < n ? &rows[id - first] : nullptr;
}

GType
gst_strip_render_mode_get_type (void)
{
  static const GType type = [] {
    static const GEnumValue values[] = {
        {int (StripMode::kBlend), "Surfaces of all views, blended where they overlap", "blend"},
        {int (StripMode::kStrips), "Triangle strips along the rows", "strips"},
        {int (StripMode::kRectangles), "One rectangle per pixel", "rectangles"},
        {int (StripMode::kPoints), "One point per pixel", "points"}, {}};
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
  for (guint i = 0; i < std::size (kSwitches); i++) {
    const SwitchRow &row = kSwitches[i];
    g_object_class_install_property (object_class, PROP_SWITCHES + i,
        g_param_spec_boolean (row.name, row.nick, row.blurb, FALSE, row.flags));
  }
  g_object_class_install_property (object_class, PROP_MODE,
      g_param_spec_enum ("mode", "Mode", "Rendering mode", GST_TYPE_STRIP_RENDER_MODE,
          int (StripMode::kBlend), kFlags));
  g_object_class_install_property (object_class, PROP_BACKGROUND,
      g_param_spec_uint ("background", "Background", "Background colour, ARGB", 0, G_MAXUINT32,
          Settings::kDefaultBackground, kFlags));
  g_object_class_install_property (object_class, PROP_VIEW_MASK,
      g_param_spec_uint64 ("view-mask", "View mask",
          "Bit mask of the views to draw; bit n is view-id n", 0, G_MAXUINT64, G_MAXUINT64,
          kFlags));
  g_object_class_install_property (object_class, PROP_MAX_GAP,
      g_param_spec_int ("max-gap", "Maximum gap",
          "Maximum number of invalid pixels in a row or column that strips bridge", 0, 1000,
          kDefaults.max_gap, kFlags));
  g_object_class_install_property (object_class, PROP_SAMPLES,
      g_param_spec_int ("samples", "Multisampling",
          "Number of samples per pixel for antialiasing, limited by OpenGL (0 or 1 = off); not "
          "used by mode=blend",
          0, 64, 0, kFlags));
  g_object_class_install_property (object_class, PROP_HOLD_TIME,
      g_param_spec_uint64 ("hold-time", "Hold time",
          "Time in nanoseconds for which the last frame set is repeated when no other follows, if "
          "the output has a frame rate of its own (G_MAXUINT64 = forever; not live: one minute at "
          "most)",
          0, G_MAXUINT64, G_MAXUINT64, kRateFlags));
  return PROP_LAST;
}

template <typename Row>
static auto
value_of (Settings settings, const Row &row)
{
  return row.field (settings); /* of the copy */
}

void
notify_strip_settings (GObject *object, const Settings &before, const Settings &after)
{
  for (const NumberRow &row : kNumbers)
    if (value_of (before, row) != value_of (after, row))
      g_object_notify (object, row.name);
}

template <typename Whole>
static bool
lies_in (const Whole &whole, const double &part)
{
  const auto begin = reinterpret_cast<const std::byte *> (&whole);
  const auto at = reinterpret_cast<const std::byte *> (&part);
  return !std::less () (at, begin) && std::less () (at, begin + sizeof whole);
}

bool
set_strip_setting (Settings &settings, guint id, const GValue *value)
{
  bool of_camera = false;
  if (const auto number = row_of (kNumbers, PROP_NUMBERS, id)) {
    double &field = number->field (settings);
    of_camera = lies_in (settings.camera, field);
    field = g_value_get_double (value);
  } else if (const auto on_off = row_of (kSwitches, PROP_SWITCHES, id))
    on_off->field (settings) = g_value_get_boolean (value);
  else if (id == PROP_MODE)
    settings.strips.mode = StripMode (g_value_get_enum (value));
  else if (id == PROP_BACKGROUND)
    settings.background = g_value_get_uint (value);
  else if (id == PROP_VIEW_MASK)
    settings.view_mask = g_value_get_uint64 (value);
  else if (id == PROP_MAX_GAP)
    settings.strips.max_gap = g_value_get_int (value);
  else if (id == PROP_SAMPLES)
    settings.samples = g_value_get_int (value);
  else if (id == PROP_HOLD_TIME)
    settings.hold_time = g_value_get_uint64 (value);
  else
    return false;
  settings.strips_serial += !of_camera; /* a camera on its path must not cost new strips */
  return true;
}

bool
get_strip_setting (const Settings &settings, guint id, GValue *value)
{
  if (const auto row = row_of (kNumbers, PROP_NUMBERS, id))
    g_value_set_double (value, value_of (settings, *row));
  else if (const auto on_off = row_of (kSwitches, PROP_SWITCHES, id))
    g_value_set_boolean (value, value_of (settings, *on_off));
  else if (id == PROP_MODE)
    g_value_set_enum (value, int (settings.strips.mode));
  else if (id == PROP_BACKGROUND)
    g_value_set_uint (value, settings.background);
  else if (id == PROP_VIEW_MASK)
    g_value_set_uint64 (value, settings.view_mask);
  else if (id == PROP_MAX_GAP)
    g_value_set_int (value, settings.strips.max_gap);
  else if (id == PROP_SAMPLES)
    g_value_set_int (value, settings.samples);
  else if (id == PROP_HOLD_TIME)
    g_value_set_uint64 (value, settings.hold_time);
  else
    return false;
  return true;
}
