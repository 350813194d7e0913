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
        "A difference counts from so many standard deviations of the background (0 to 100, default "
        "4)",
        0, 100, kDefaults.segmentation.noise_factor,
        [] (Settings &s) -> double & { return s.segmentation.noise_factor; }},
    {"depth-threshold", "Depth threshold",
        "Depth speaks for a pixel from so many metres nearer than the background (0 to 10, default "
        "0.02)",
        0, 10, kDefaults.segmentation.depth_threshold_m,
        [] (Settings &s) -> double & { return s.segmentation.depth_threshold_m; }},
    {"colour-threshold", "Colour threshold",
        "Colour speaks for a pixel from so many grey levels of chromatic distortion (0 to 255, "
        "default 18)",
        0, 255, kDefaults.segmentation.colour_threshold,
        [] (Settings &s) -> double & { return s.segmentation.colour_threshold; }},
    {"shadow", "Shadow",
        "A pixel darker than this share of the background is no shadow (0 to 1, default 0.5)", 0, 1,
        kDefaults.segmentation.shadow,
        [] (Settings &s) -> double & { return s.segmentation.shadow; }},
    {"highlight", "Highlight",
        "A pixel brighter than this share of the background is no change of light (1 to 10, "
        "default 1.35)",
        1, 10, kDefaults.segmentation.highlight,
        [] (Settings &s) -> double & { return s.segmentation.highlight; }},
    {"adapt-time", "Adaptation time",
        "Time constant with which the background follows slow change where nobody is, seconds (0 "
        "to 100000, default 30; 0: never)",
        0, 100000, kDefaults.adapt_time_s, [] (Settings &s) -> double & { return s.adapt_time_s; }},
};
static const NumberRow<Settings, int> kIntegers[] = {
    {"min-area", "Minimum area", "Smaller islands are cleared, pixels (0 to 1000000, default 150)",
        0, 1000000, kDefaults.segmentation.min_area,
        [] (Settings &s) -> int & { return s.segmentation.min_area; }},
    {"max-hole", "Maximum hole", "Smaller holes are closed, pixels (0 to 1000000, default 100)", 0,
        1000000, kDefaults.segmentation.max_hole,
        [] (Settings &s) -> int & { return s.segmentation.max_hole; }},
    {"max-people", "Maximum people",
        "Only so many of the largest islands stay (0 to 1000, default 0: all)", 0, 1000,
        kDefaults.segmentation.max_people,
        [] (Settings &s) -> int & { return s.segmentation.max_people; }},
    {"fill", "Fill",
        "Depth is extended so many pixels to what has none, where colour says that it is no "
        "background, and four times as many more where its hue says so (0 to 1000, default 4; 0: "
        "no depth is made)",
        0, 1000, kDefaults.segmentation.fill,
        [] (Settings &s) -> int & { return s.segmentation.fill; }},
    {"fringe", "Fringe",
        "What is nearer but looks like the background beside it must be so wide, pixels (0 to 99, "
        "default 9; 0: depth is taken at its word, for cameras whose depth ends at the silhouette)",
        0, 99, kDefaults.segmentation.fringe,
        [] (Settings &s) -> int & { return s.segmentation.fringe; }},
    {"margin", "Margin",
        "The ROI is this much larger than what is left, pixels each side (0 to 1000, default 0)", 0,
        1000, kDefaults.margin, [] (Settings &s) -> int & { return s.margin; }},
    {"n-threads", "Threads",
        "Views worked on at the same time (0 to 64, default 0: as many as there are cores)", 0, 64,
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
    static const GEnumValue values[] = {
        {int (Cue::kBoth), "Nearer than the background or of another colour", "both"},
        {int (Cue::kColour), "Of another colour", "colour"},
        {int (Cue::kDepth), "Nearer than the background", "depth"}, {}};
    return g_enum_register_static ("GstRoiExtractCue", values);
  }();
  return type;
}

static void
install_background_settings (GObjectClass *object_class)
{
  g_object_class_install_property (object_class, PROP_BACKGROUND_FRAMES,
      g_param_spec_int ("background-frames", "Background frames",
          "Frames of the empty scene from which a background is learnt (1 to 10000, default 30)", 1,
          10000, kDefaults.background_frames, kPlaying));
  g_object_class_install_property (object_class, PROP_SETTLE_FRAMES,
      g_param_spec_int ("settle-frames", "Settle frames",
          "Frames at the start from which nothing is learnt, while exposure settles (0 to 100000, "
          "default 0)",
          0, 100000, kDefaults.settle_frames, kReady));
  g_object_class_install_property (object_class, PROP_BACKGROUND_FILE,
      g_param_spec_string ("background-file", "Background file",
          "Take the background from this file instead of learning it (default: none)", nullptr,
          kReady));
  g_object_class_install_property (object_class, PROP_SAVE_BACKGROUND,
      g_param_spec_string ("save-background", "Save background",
          "Write the background to this file (.yml, .yaml or .json, with .gz if wanted) "
          "whenever one is learnt, and as it has become at EOS (default: none)",
          nullptr, kPlaying));
}

guint
install_roi_settings (GObjectClass *object_class)
{
  install_rows (object_class, kReals, PROP_REALS, kLive);
  install_rows (object_class, kIntegers, PROP_INTEGERS, kLive);
  install_background_settings (object_class);
  g_object_class_install_property (object_class, PROP_CUE,
      g_param_spec_enum ("cue", "Cue", "What speaks for a pixel (default: both)",
          GST_TYPE_ROI_EXTRACT_CUE, int (kDefaults.segmentation.cue), kLive));
  g_object_class_install_property (object_class, PROP_FOLLOW_LIGHT,
      g_param_spec_boolean ("follow-light", "Follow light",
          "Undo what exposure, white balance and lamps do to the whole picture (default: true)",
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
