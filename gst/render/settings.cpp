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
        "Modes other than blend: metres by which what a view sees moves behind what others see, "
        "times 1 - cosine of the "
        "angle between its direction and the picture's (0 to 1, default 0.012)",
        0, 1, 0.012, [] (Settings &s) -> double & { return s.view_gap_m; }},
    {"blend-range", "Blend range",
        "Of mode blend: metres behind the nearest surface in which what other views see is taken "
        "for "
        "the same surface (0 to 1, default 0.02)",
        0, 1, 0.02, [] (Settings &s) -> double & { return s.blend_range_m; }},
    {"background-shade", "Background shade",
        "Share by which an opaque background is lighter at the top and darker at the bottom (0 to "
        "1, default 0)",
        0, 1, 0, [] (Settings &s) -> double & { return s.background_shade; }},
    {"point-size", "Point size", "Of mode points, in footprints of a pixel (0.1 to 100, default 1)",
        0.1, 100, 1, [] (Settings &s) -> double & { return s.point_size; }},
    {"eye-distance", "Eye distance",
        "Metres between the eyes of stereoscopic pictures (0 to 10, default 0.063)", 0, 10, 0.063,
        [] (Settings &s) -> double & { return s.eye_distance_m; }},
    {"convergence", "Convergence",
        "Metres from the viewer to what both eyes' pictures have in the same place, the plane of "
        "the screen (0 to 1000, default 0: what is looked at; 1000 for headsets)",
        0, 1000, 0, [] (Settings &s) -> double & { return s.convergence_m; }},
};

/* The properties that are on or off, off at first. */
struct SwitchRow {
  const char *name, *nick, *blurb;
  GParamFlags flags;
  bool &(*field) (Settings &);
};
static const SwitchRow kSwitches[] = {
    {"fit", "Fit",
        "Camera properties count from a view that is centred on what is drawn and as near as it "
        "fits, found when the stream begins and by the keys r and Home (default false: from the "
        "first view)",
        kFlags, [] (Settings &s) -> bool & { return s.fit; }},
    {"show-cameras", "Show cameras",
        "Also draw where the rig's cameras stand, and their frusta from near to far (default "
        "false)",
        kFlags, [] (Settings &s) -> bool & { return s.show_cameras; }},
    {"back-faces", "Back faces",
        "Mode strips: also show surfaces from behind, from inside a body, where no front is "
        "(default "
        "false; always with one camera)",
        kFlags, [] (Settings &s) -> bool & { return s.back_faces; }},
    {"show-units", "Show units",
        "Points in shades of their camera's colour, which show-cameras has too (default false)",
        kFlags, [] (Settings &s) -> bool & { return s.show_units; }},
    {"show-stats", "Show statistics",
        "Rates, points, views, triangles and latency as text over the picture (default false)",
        kFlags, [] (Settings &s) -> bool & { return s.show_stats; }},
    {"keep-rate", "Keep rate",
        "Pictures at the output's frame rate even if that is the input's: without holes, and a "
        "live stream that stalls is drawn on (default false: then one picture a frame set)",
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
        {int (StripMode::kBlend), "Strips, blended where several views see a surface", "blend"},
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
  for (guint i = 0; i < std::size (kSwitches); i++) {
    const SwitchRow &row = kSwitches[i];
    g_object_class_install_property (object_class, PROP_SWITCHES + i,
        g_param_spec_boolean (row.name, row.nick, row.blurb, FALSE, row.flags));
  }
  g_object_class_install_property (object_class, PROP_MODE,
      g_param_spec_enum ("mode", "Mode", "What is drawn for the points (default: blend)",
          GST_TYPE_STRIP_RENDER_MODE, int (StripMode::kBlend), kFlags));
  g_object_class_install_property (object_class, PROP_BACKGROUND,
      g_param_spec_uint ("background", "Background",
          "Colour behind the scene, ARGB (default 0xff20242a)", 0, G_MAXUINT32,
          Settings::kDefaultBackground, kFlags));
  g_object_class_install_property (object_class, PROP_VIEW_MASK,
      g_param_spec_uint64 ("view-mask", "View mask",
          "The views that are drawn: bit n is the view with view-id n (default "
          "0xffffffffffffffff: all; 0: the background alone)",
          0, G_MAXUINT64, G_MAXUINT64, kFlags));
  g_object_class_install_property (object_class, PROP_MAX_GAP,
      g_param_spec_int ("max-gap", "Maximum gap",
          "Invalid pixels of a row or a column that strips bridge (0 to 1000, default 2)", 0, 1000,
          kDefaults.max_gap, kFlags));
  g_object_class_install_property (object_class, PROP_SAMPLES,
      g_param_spec_int ("samples", "Samples",
          "Samples of a pixel, for antialiasing (0 or 1 = none, to 64, default 0); less where "
          "OpenGL has no more",
          0, 64, 0, kFlags));
  g_object_class_install_property (object_class, PROP_HOLD_TIME,
      g_param_spec_uint64 ("hold-time", "Hold time",
          "ns for which the last frame set is drawn on, at the output's frame rate, when none "
          "follows; only if that rate is not the input's, or with keep-rate; a minute at most "
          "unless live (0 to 18446744073709551615, default 18446744073709551615: for ever)",
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
