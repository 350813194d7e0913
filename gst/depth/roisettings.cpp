/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "roisettings.hpp"

#include <iterator>

#include "common/propertyrows.hpp"

using rangecast::Cue;
using Settings = RoiSettings;

static constexpr auto kReady =
    GParamFlags (G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_READY);
static constexpr auto kPlaying =
    GParamFlags (G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_PLAYING);
static constexpr auto kLive = GParamFlags (kPlaying | GST_PARAM_CONTROLLABLE);
static const Settings kDefaults;

/* All of them kLive. */
static const NumberRow<Settings, double> kReals[] = {
    {"noise-factor", "Noise factor",
        "Number of standard deviations of the background's noise from which a difference counts", 0,
        100, kDefaults.segmentation.noise_factor,
        [] (Settings &s) -> double & { return s.segmentation.noise_factor; }},
    {"depth-threshold", "Depth threshold",
        "Minimum distance in front of the background in metres at which depth marks a pixel as "
        "foreground",
        0, 10, kDefaults.segmentation.depth_threshold_m,
        [] (Settings &s) -> double & { return s.segmentation.depth_threshold_m; }},
    {"colour-threshold", "Colour threshold",
        "Minimum chromatic distortion in grey levels at which colour marks a pixel as foreground",
        0, 255, kDefaults.segmentation.colour_threshold,
        [] (Settings &s) -> double & { return s.segmentation.colour_threshold; }},
    {"shadow", "Shadow limit",
        "Ratio to the background's brightness down to which a pixel may be a shadow", 0, 1,
        kDefaults.segmentation.shadow,
        [] (Settings &s) -> double & { return s.segmentation.shadow; }},
    {"highlight", "Highlight limit",
        "Ratio to the background's brightness up to which a pixel may be a change of light", 1, 10,
        kDefaults.segmentation.highlight,
        [] (Settings &s) -> double & { return s.segmentation.highlight; }},
    {"adapt-time", "Adaptation time",
        "Time constant in seconds with which the background follows slow changes (0 = never)", 0,
        100000, kDefaults.adapt_time_s, [] (Settings &s) -> double & { return s.adapt_time_s; }},
};
static const NumberRow<Settings, int> kIntegers[] = {
    {"min-area", "Minimum area",
        "Minimum area of a foreground region in pixels; smaller regions are cleared", 0, 1000000,
        kDefaults.segmentation.min_area,
        [] (Settings &s) -> int & { return s.segmentation.min_area; }},
    {"max-hole", "Maximum hole area", "Maximum area of a hole in pixels that is closed", 0, 1000000,
        kDefaults.segmentation.max_hole,
        [] (Settings &s) -> int & { return s.segmentation.max_hole; }},
    {"max-people", "Maximum people", "Number of largest foreground regions to keep (0 = all)", 0,
        1000, kDefaults.segmentation.max_people,
        [] (Settings &s) -> int & { return s.segmentation.max_people; }},
    {"fill", "Depth extrapolation",
        "Distance in pixels to which depth is extrapolated into foreground without depth; up to "
        "five times as far where the hue differs from the background (0 = off)",
        0, 1000, kDefaults.segmentation.fill,
        [] (Settings &s) -> int & { return s.segmentation.fill; }},
    {"fringe", "Fringe width",
        "Minimum width in pixels of a region that is nearer than the background but looks like it "
        "(0 = trust depth at silhouettes, for cameras with exact depth edges)",
        0, 99, kDefaults.segmentation.fringe,
        [] (Settings &s) -> int & { return s.segmentation.fringe; }},
    {"margin", "Margin", "Margin added to each side of the ROI in pixels", 0, 1000,
        kDefaults.margin, [] (Settings &s) -> int & { return s.margin; }},
    {"n-threads", "Threads", "Number of threads that process views (0 = one per CPU core)", 0, 64,
        kDefaults.n_threads, [] (Settings &s) -> int & { return s.n_threads; }},
};

enum : guint {
  PROP_REALS = 1,
  PROP_INTEGERS = PROP_REALS + std::size (kReals),
  PROP_BACKGROUND_FRAMES = PROP_INTEGERS + std::size (kIntegers),
  PROP_SETTLE_FRAMES,
  PROP_BACKGROUND_FILE,
  PROP_SAVE_BACKGROUND,
  PROP_CUE,
  PROP_FOLLOW_LIGHT
};

GType
gst_roi_extract_cue_get_type (void)
{
  static const GType type = [] {
    static const GEnumValue values[] = {{int (Cue::kBoth), "Depth and colour", "both"},
        {int (Cue::kColour), "Colour only", "colour"}, {int (Cue::kDepth), "Depth only", "depth"},
        {}};
    return g_enum_register_static ("GstRoiExtractCue", values);
  }();
  return type;
}

static void
install_background_settings (GObjectClass *object_class)
{
  g_object_class_install_property (object_class, PROP_BACKGROUND_FRAMES,
      g_param_spec_int ("background-frames", "Background frames",
          "Number of frames of the empty scene from which to learn the background", 1, 10000,
          kDefaults.background_frames, kPlaying));
  g_object_class_install_property (object_class, PROP_SETTLE_FRAMES,
      g_param_spec_int ("settle-frames", "Settle frames",
          "Number of frames to skip before learning, while automatic exposure settles", 0, 100000,
          kDefaults.settle_frames, kReady));
  g_object_class_install_property (object_class, PROP_BACKGROUND_FILE,
      g_param_spec_string ("background-file", "Background file",
          "Background file to load instead of learning (unset = learn)", nullptr, kReady));
  g_object_class_install_property (object_class, PROP_SAVE_BACKGROUND,
      g_param_spec_string ("save-background", "Save background",
          "Background file to write after learning and at EOS (.yml, .yaml or .json, optionally "
          "with .gz)",
          nullptr, kPlaying));
}

guint
install_roi_settings (GObjectClass *object_class)
{
  install_rows (object_class, kReals, PROP_REALS, kLive);
  install_rows (object_class, kIntegers, PROP_INTEGERS, kLive);
  install_background_settings (object_class);
  g_object_class_install_property (object_class, PROP_CUE,
      g_param_spec_enum ("cue", "Segmentation cue", "What distinguishes foreground from background",
          GST_TYPE_ROI_EXTRACT_CUE, int (kDefaults.segmentation.cue), kLive));
  g_object_class_install_property (object_class, PROP_FOLLOW_LIGHT,
      g_param_spec_boolean ("follow-light", "Follow light",
          "Compensate brightness and white balance changes of the whole image",
          kDefaults.segmentation.follow_light, kLive));
  return PROP_FOLLOW_LIGHT;
}

static std::string
get_text (const GValue *value)
{
  const gchar *text = g_value_get_string (value);
  return text ? text : "";
}

static void
set_text (GValue *value, const std::string &text)
{
  g_value_set_string (value, text.empty () ? nullptr : text.c_str ());
}

bool
set_roi_setting (Settings &settings, guint id, const GValue *value)
{
  if (const auto real = find_row (kReals, id, PROP_REALS))
    real->field (settings) = g_value_get_double (value);
  else if (const auto integer = find_row (kIntegers, id, PROP_INTEGERS))
    integer->field (settings) = g_value_get_int (value);
  else if (id == PROP_BACKGROUND_FRAMES)
    settings.background_frames = g_value_get_int (value);
  else if (id == PROP_SETTLE_FRAMES)
    settings.settle_frames = g_value_get_int (value);
  else if (id == PROP_BACKGROUND_FILE)
    settings.background_file = get_text (value);
  else if (id == PROP_SAVE_BACKGROUND)
    settings.save_background = get_text (value);
  else if (id == PROP_CUE)
    settings.segmentation.cue = Cue (g_value_get_enum (value));
  else if (id == PROP_FOLLOW_LIGHT)
    settings.segmentation.follow_light = g_value_get_boolean (value);
  else
    return false;
  return true;
}

bool
get_roi_setting (const Settings &settings, guint id, GValue *value)
{
  Settings copy = settings; /* fields are found in what may be written */
  if (const auto real = find_row (kReals, id, PROP_REALS))
    g_value_set_double (value, real->field (copy));
  else if (const auto integer = find_row (kIntegers, id, PROP_INTEGERS))
    g_value_set_int (value, integer->field (copy));
  else if (id == PROP_BACKGROUND_FRAMES)
    g_value_set_int (value, settings.background_frames);
  else if (id == PROP_SETTLE_FRAMES)
    g_value_set_int (value, settings.settle_frames);
  else if (id == PROP_BACKGROUND_FILE)
    set_text (value, settings.background_file);
  else if (id == PROP_SAVE_BACKGROUND)
    set_text (value, settings.save_background);
  else if (id == PROP_CUE)
    g_value_set_enum (value, int (settings.segmentation.cue));
  else if (id == PROP_FOLLOW_LIGHT)
    g_value_set_boolean (value, settings.segmentation.follow_light);
  else
    return false;
  return true;
}
