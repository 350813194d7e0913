/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "settings.hpp"

enum {
  PROP_0,
  PROP_VIEWS,
  PROP_VIEW_ID,
  PROP_ARC,
  PROP_DISTANCE,
  PROP_BASELINE,
  PROP_SEED,
  PROP_NOISE,
  PROP_MOTION,
  PROP_EMPTY_FRAMES,
  PROP_NUM_BUFFERS,
  PROP_IS_LIVE,
  PROP_LOCATION,
  PROP_TEXTURE,
  PROP_TEXTURE_FLIP,
  PROP_RIG_EXPORT,
  PROP_RANGE_PERSON_ONLY,
  PROP_N_THREADS,
  PROP_PERSONS,
  PROP_FAR,
  PROP_CAST_SHADOW,
  PROP_LIGHT_DRIFT,
  PROP_WALL_TEXTURE,
  PROP_WALL_WARMTH,
  PROP_CHAIR,
  PROP_LOOP_FRAMES,
  PROP_MODEL_TOP,
  PROP_DRESS,
};

#define TYPE_AVATAR_DRESS (avatar_dress_get_type ())
static GType
avatar_dress_get_type ()
{
  static const GFlagsValue values[] = {{0, "Nothing", "none"},
      {rangecast::kDressHair, "Long hair with free strands", "hair"},
      {rangecast::kDressGlasses, "Glasses", "glasses"},
      {rangecast::kDressCollar, "Open collar", "collar"},
      {rangecast::kDressHand, "Forearm and hand before the chest", "hand"},
      {rangecast::kDressAll, "All of these", "all"}, {0, nullptr, nullptr}};
  static const GType type = g_flags_register_static ("GstAvatarTestSrcDress", values);
  return type;
}

static std::string
string_of (const GValue *value)
{
  const gchar *text = g_value_get_string (value);
  return text ? text : "";
}

static void
set_string (GValue *value, const std::string &text)
{
  g_value_set_string (value, text.empty () ? nullptr : text.c_str ());
}

bool
AvatarSettings::set (guint id, const GValue *value)
{
  switch (id) {
    case PROP_VIEWS:
      scene.views = g_value_get_int (value);
      return true;
    case PROP_VIEW_ID:
      view_id = g_value_get_int (value);
      return true;
    case PROP_ARC:
      scene.arc_deg = g_value_get_double (value);
      return true;
    case PROP_DISTANCE:
      scene.distance_m = g_value_get_double (value);
      return true;
    case PROP_BASELINE:
      scene.baseline_m = g_value_get_double (value);
      return true;
    case PROP_SEED:
      scene.seed = g_value_get_uint (value);
      return true;
    case PROP_NOISE:
      scene.noise_sigma = g_value_get_double (value);
      return true;
    case PROP_MOTION:
      scene.motion = g_value_get_double (value);
      return true;
    case PROP_EMPTY_FRAMES:
      empty_frames = g_value_get_uint (value);
      return true;
    case PROP_LOOP_FRAMES:
      loop_frames = g_value_get_uint (value);
      return true;
    case PROP_NUM_BUFFERS:
      num_buffers = g_value_get_int (value);
      return true;
    case PROP_IS_LIVE:
      is_live = g_value_get_boolean (value);
      return true;
    case PROP_LOCATION:
      scene.model = string_of (value);
      return true;
    case PROP_TEXTURE:
      scene.texture = string_of (value);
      return true;
    case PROP_TEXTURE_FLIP:
      scene.texture_flip = g_value_get_boolean (value);
      return true;
    case PROP_MODEL_TOP:
      scene.model_top_m = g_value_get_double (value);
      return true;
    case PROP_DRESS:
      scene.dress = g_value_get_flags (value);
      return true;
    case PROP_RIG_EXPORT:
      rig_export = string_of (value);
      return true;
    case PROP_RANGE_PERSON_ONLY:
      person_only = g_value_get_boolean (value);
      return true;
    case PROP_N_THREADS:
      n_threads = g_value_get_int (value);
      return true;
    default:
      return set_room (id, value);
  }
}

bool
AvatarSettings::set_room (guint id, const GValue *value)
{
  switch (id) {
    case PROP_PERSONS:
      scene.persons = g_value_get_int (value);
      return true;
    case PROP_FAR:
      scene.far_m = g_value_get_double (value);
      return true;
    case PROP_CAST_SHADOW:
      scene.cast_shadow = g_value_get_double (value);
      return true;
    case PROP_LIGHT_DRIFT:
      scene.light_drift = g_value_get_double (value);
      return true;
    case PROP_WALL_TEXTURE:
      scene.wall_texture = g_value_get_double (value);
      return true;
    case PROP_WALL_WARMTH:
      scene.wall_warmth = g_value_get_double (value);
      return true;
    case PROP_CHAIR:
      scene.chair = g_value_get_boolean (value);
      return true;
    default:
      return false;
  }
}

bool
AvatarSettings::get (guint id, GValue *value) const
{
  switch (id) {
    case PROP_VIEWS:
      g_value_set_int (value, scene.views);
      return true;
    case PROP_VIEW_ID:
      g_value_set_int (value, view_id);
      return true;
    case PROP_ARC:
      g_value_set_double (value, scene.arc_deg);
      return true;
    case PROP_DISTANCE:
      g_value_set_double (value, scene.distance_m);
      return true;
    case PROP_BASELINE:
      g_value_set_double (value, scene.baseline_m);
      return true;
    case PROP_SEED:
      g_value_set_uint (value, scene.seed);
      return true;
    case PROP_NOISE:
      g_value_set_double (value, scene.noise_sigma);
      return true;
    case PROP_MOTION:
      g_value_set_double (value, scene.motion);
      return true;
    case PROP_EMPTY_FRAMES:
      g_value_set_uint (value, empty_frames);
      return true;
    case PROP_LOOP_FRAMES:
      g_value_set_uint (value, loop_frames);
      return true;
    case PROP_NUM_BUFFERS:
      g_value_set_int (value, num_buffers);
      return true;
    case PROP_IS_LIVE:
      g_value_set_boolean (value, is_live);
      return true;
    case PROP_LOCATION:
      set_string (value, scene.model);
      return true;
    case PROP_TEXTURE:
      set_string (value, scene.texture);
      return true;
    case PROP_TEXTURE_FLIP:
      g_value_set_boolean (value, scene.texture_flip);
      return true;
    case PROP_MODEL_TOP:
      g_value_set_double (value, scene.model_top_m);
      return true;
    case PROP_DRESS:
      g_value_set_flags (value, scene.dress);
      return true;
    case PROP_RIG_EXPORT:
      set_string (value, rig_export);
      return true;
    case PROP_RANGE_PERSON_ONLY:
      g_value_set_boolean (value, person_only);
      return true;
    case PROP_N_THREADS:
      g_value_set_int (value, n_threads);
      return true;
    default:
      return get_room (id, value);
  }
}

bool
AvatarSettings::get_room (guint id, GValue *value) const
{
  switch (id) {
    case PROP_PERSONS:
      g_value_set_int (value, scene.persons);
      return true;
    case PROP_FAR:
      g_value_set_double (value, scene.far_m);
      return true;
    case PROP_CAST_SHADOW:
      g_value_set_double (value, scene.cast_shadow);
      return true;
    case PROP_LIGHT_DRIFT:
      g_value_set_double (value, scene.light_drift);
      return true;
    case PROP_WALL_TEXTURE:
      g_value_set_double (value, scene.wall_texture);
      return true;
    case PROP_WALL_WARMTH:
      g_value_set_double (value, scene.wall_warmth);
      return true;
    case PROP_CHAIR:
      g_value_set_boolean (value, scene.chair);
      return true;
    default:
      return false;
  }
}

/* Adds properties that may change in NULL and READY. */
struct Installer {
  GObjectClass *klass;
  static constexpr auto kReady =
      GParamFlags (G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_READY);

  void add_int (guint id, const char *name, const char *nick, const char *blurb, int low, int high,
      int value) const
  {
    g_object_class_install_property (
        klass, id, g_param_spec_int (name, nick, blurb, low, high, value, kReady));
  }
  void add_uint (guint id, const char *name, const char *nick, const char *blurb, guint value) const
  {
    g_object_class_install_property (
        klass, id, g_param_spec_uint (name, nick, blurb, 0, G_MAXUINT, value, kReady));
  }
  void add_double (guint id, const char *name, const char *nick, const char *blurb, double low,
      double high, double value) const
  {
    g_object_class_install_property (
        klass, id, g_param_spec_double (name, nick, blurb, low, high, value, kReady));
  }
  void add_bool (guint id, const char *name, const char *nick, const char *blurb) const
  {
    g_object_class_install_property (
        klass, id, g_param_spec_boolean (name, nick, blurb, FALSE, kReady));
  }
  void add_string (guint id, const char *name, const char *nick, const char *blurb) const
  {
    g_object_class_install_property (
        klass, id, g_param_spec_string (name, nick, blurb, nullptr, kReady));
  }
};

static void
install_scene (const Installer &to)
{
  to.add_int (
      PROP_VIEWS, "views", "Views", "Stereo cameras in the rig (1 to 64, default: 4)", 1, 64, 4);
  to.add_int (PROP_VIEW_ID, "view-id", "View",
      "Which view to give (0 to 63; -1, the default: all on src, view 0 on left, right and third)",
      AvatarSettings::kAllViews, 63, AvatarSettings::kAllViews);
  to.add_double (PROP_ARC, "arc", "Arc",
      "Arc on which the views stand, degrees (1 to 360; 360, the default: a ring, view 0 in front; "
      "less: the figure's front in the middle)",
      1, 360, 360);
  to.add_double (PROP_DISTANCE, "distance", "Distance",
      "From the left cameras to the figure's axis, metres (0.5 to 1.2, default: 0.8)", 0.5, 1.2,
      0.8);
  to.add_double (PROP_BASELINE, "baseline", "Baseline",
      "From left to right and to third camera, metres (0.01 to 0.3, default: 0.1)", 0.01, 0.3, 0.1);
  to.add_uint (PROP_SEED, "seed", "Seed", "Of all patterns and the noise (default: 1)", 1);
  to.add_double (PROP_NOISE, "noise", "Noise",
      "Sensor noise, standard deviation in grey levels (0 to 20, default: 1)", 0, 20, 1);
  to.add_double (PROP_MOTION, "motion", "Motion",
      "How much the figure moves (0 = still, to 2; default: 1)", 0, 2, 1);
}

static void
install_dress (const Installer &to)
{
  g_object_class_install_property (to.klass, PROP_DRESS,
      g_param_spec_flags ("dress", "Dress",
          "What the built-in figure wears: surfaces one behind the other (default: none)",
          TYPE_AVATAR_DRESS, 0, Installer::kReady));
}

static void
install_room (const Installer &to)
{
  to.add_int (PROP_PERSONS, "persons", "Persons",
      "Figures; the others stand 0.4 m behind the first, left and right (1 to 3, default: 1)", 1,
      rangecast::SceneSettings::kMaxPersons, 1);
  to.add_double (PROP_FAR, "far", "Far",
      "Farthest depth of range images and rig, metres; from 3.5 on it reaches the walls (1 to 6, "
      "default: 1.3)",
      1, 6, 1.3);
  to.add_double (PROP_CAST_SHADOW, "cast-shadow", "Cast shadow",
      "Share of light that is missing in the figures' shadow on the room (0 to 0.9, default: 0)", 0,
      0.9, 0);
  to.add_double (PROP_LIGHT_DRIFT, "light-drift", "Light drift",
      "All light swings by this share, within 40 seconds (0 to 0.5, default: 0)", 0, 0.5, 0);
  to.add_double (PROP_WALL_TEXTURE, "wall-texture", "Wall texture",
      "Contrast of the room's texture (0 = plain, to 1, the default)", 0, 1, 1);
  to.add_double (PROP_WALL_WARMTH, "wall-warmth", "Wall warmth",
      "Colour of the walls (0, the default: blue-grey, to 1: as wood, skin and hair)", 0, 1, 0);
  to.add_bool (PROP_CHAIR, "chair", "Chair",
      "A chair stands behind the figure, also in the empty room (default: false)");
}

static void
install_model_and_stream (const Installer &to)
{
  to.add_uint (PROP_EMPTY_FRAMES, "empty-frames", "Empty frames",
      "So many frames at first show the room without the figure (default: 0)", 0);
  to.add_uint (PROP_LOOP_FRAMES, "loop-frames", "Loop frames",
      "Draw so many pictures of the figure once each, when first shown, and repeat them forwards "
      "and backwards, as cameras that cost no drawing; left, right and third only, at most 1 GiB a "
      "camera (0, the default: draw each picture)",
      0);
  to.add_int (PROP_NUM_BUFFERS, "num-buffers", "Number of buffers",
      "Frames before EOS (default: -1, no end)", -1, G_MAXINT, -1);
  to.add_bool (PROP_IS_LIVE, "is-live", "Is live",
      "Take pictures at multiples of the frame period of the pipeline's clock (default: false)");
  to.add_string (PROP_LOCATION, "location", "Location",
      "Model of the figure, glTF or OBJ (default: the built-in one)");
  to.add_double (PROP_MODEL_TOP, "model-top", "Model top",
      "How much of the model is kept, metres from the crown down of a person of 1.8 m (0.1 to 1.8; "
      "0: all of it, scaled to 0.5 m; -1, the default: 0.5 m of a model that stands like a person, "
      "else all)",
      -1, 1.8, -1);
  to.add_string (PROP_TEXTURE, "texture", "Texture",
      "Picture for all meshes of the model (default: what its materials name, or a colour map "
      "beside it)");
  to.add_bool (PROP_TEXTURE_FLIP, "texture-flip", "Texture upside down",
      "Turn the model's texture upside down, for a picture made for the other direction of v "
      "(default: false)");
  to.add_string (PROP_RIG_EXPORT, "rig-export", "Rig export",
      "Write the calibration of all cameras to this file, YAML or JSON (default: none)");
  to.add_bool (PROP_RANGE_PERSON_ONLY, "range-person-only", "Range of person only",
      "Crop range images to the person's bounding box (default: false)");
  to.add_int (PROP_N_THREADS, "n-threads", "Threads",
      "Threads that draw range images (0, the default: one a core)", 0, 64, 0);
}

void
AvatarSettings::install (GObjectClass *klass)
{
  install_scene ({klass});
  install_dress ({klass});
  gst_type_mark_as_plugin_api (TYPE_AVATAR_DRESS, GstPluginAPIFlags (0));
  install_room ({klass});
  install_model_and_stream ({klass});
}
