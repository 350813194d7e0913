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
      {rangecast::kDressHair, "Long hair with loose strands", "hair"},
      {rangecast::kDressGlasses, "Glasses", "glasses"},
      {rangecast::kDressCollar, "Open collar", "collar"},
      {rangecast::kDressHand, "Forearm and hand in front of the chest", "hand"},
      {rangecast::kDressAll, "All accessories", "all"}, {0, nullptr, nullptr}};
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
  to.add_int (PROP_VIEWS, "views", "Views", "Number of stereo cameras in the rig", 1, 64, 4);
  to.add_int (PROP_VIEW_ID, "view-id", "View",
      "View to output, by view-id (-1 = all views on src, view 0 on left, right and third)",
      AvatarSettings::kAllViews, 63, AvatarSettings::kAllViews);
  to.add_double (PROP_ARC, "arc", "Arc",
      "Arc covered by the cameras in degrees (360 = closed ring with view 0 in front of the "
      "figure, less = arc centred on its front)",
      1, 360, 360);
  to.add_double (PROP_DISTANCE, "distance", "Camera distance",
      "Distance from the left cameras to the figure's axis in metres", 0.5, 1.2, 0.8);
  to.add_double (PROP_BASELINE, "baseline", "Baseline",
      "Distance from the left camera to the right and to the third camera in metres", 0.01, 0.3,
      0.1);
  to.add_uint (PROP_SEED, "seed", "Random seed", "Seed of the textures and the sensor noise", 1);
  to.add_double (PROP_NOISE, "noise", "Sensor noise",
      "Standard deviation of the sensor noise in grey levels (0 = none)", 0, 20, 1);
  to.add_double (PROP_MOTION, "motion", "Motion amplitude",
      "Amplitude of the figure's motion (0 = still, 1 = head turns by 20 degrees)", 0, 2, 1);
}

static void
install_dress (const Installer &to)
{
  g_object_class_install_property (to.klass, PROP_DRESS,
      g_param_spec_flags ("dress", "Accessories",
          "Accessories of the built-in figure that add surfaces in front of one another",
          TYPE_AVATAR_DRESS, 0, Installer::kReady));
}

static void
install_room (const Installer &to)
{
  to.add_int (PROP_PERSONS, "persons", "Figures",
      "Number of figures; the second and third stand 0.4 m behind the first, left and right", 1,
      rangecast::SceneSettings::kMaxPersons, 1);
  to.add_double (PROP_FAR, "far", "Far",
      "Far limit of the range images and of the rig in metres (walls are within reach from 3.5)", 1,
      6, 1.3);
  to.add_double (PROP_CAST_SHADOW, "cast-shadow", "Cast shadow",
      "Fraction of light blocked in the shadow that the figures cast on the room", 0, 0.9, 0);
  to.add_double (PROP_LIGHT_DRIFT, "light-drift", "Light drift",
      "Amplitude of a slow brightness change with a period of 40 seconds, as a fraction of the "
      "light",
      0, 0.5, 0);
  to.add_double (PROP_WALL_TEXTURE, "wall-texture", "Wall texture",
      "Contrast of the room's texture (0 = plain walls)", 0, 1, 1);
  to.add_double (PROP_WALL_WARMTH, "wall-warmth", "Wall warmth",
      "Colour of the walls (0 = blue-grey, 1 = similar to skin, hair and wood)", 0, 1, 0);
  to.add_bool (PROP_CHAIR, "chair", "Chair",
      "Place a chair behind the figure; it is also part of the empty room");
}

static void
install_model_and_stream (const Installer &to)
{
  to.add_uint (PROP_EMPTY_FRAMES, "empty-frames", "Empty frames",
      "Number of frames at the start that show the room without the figure", 0);
  to.add_uint (PROP_LOOP_FRAMES, "loop-frames", "Loop frames",
      "Render this many frames once and replay them forwards and backwards to save CPU time; left, "
      "right and third pads only, at most 1 GiB per camera (0 = render every frame)",
      0);
  to.add_int (PROP_NUM_BUFFERS, "num-buffers", "Number of buffers",
      "Number of frames to output before EOS (-1 = unlimited)", -1, G_MAXINT, -1);
  to.add_bool (PROP_IS_LIVE, "is-live", "Is live",
      "Act as a live source, with frames at multiples of the frame period on the pipeline clock");
  to.add_string (PROP_LOCATION, "location", "Location",
      "glTF or OBJ file with the model to show (unset = built-in figure)");
  to.add_double (PROP_MODEL_TOP, "model-top", "Model top",
      "Part of the model to keep, in metres below the crown after scaling it to a person 1.8 m "
      "tall (0 = the whole model scaled to 0.5 m, -1 = 0.5 for models of a standing person, else "
      "0)",
      -1, 1.8, -1);
  to.add_string (PROP_TEXTURE, "texture", "Texture",
      "Image file used as texture of all meshes of the model (unset = as the model's materials "
      "say, or a colour map next to the model file)");
  to.add_bool (
      PROP_TEXTURE_FLIP, "texture-flip", "Flip texture", "Flip the model's textures vertically");
  to.add_string (PROP_RIG_EXPORT, "rig-export", "Rig export",
      "File to write the calibration of all cameras to, YAML or JSON");
  to.add_bool (PROP_RANGE_PERSON_ONLY, "range-person-only", "Crop to person",
      "Crop range images to the bounding box of the figures");
  to.add_int (PROP_N_THREADS, "n-threads", "Threads",
      "Number of threads that render range images (0 = one per CPU core)", 0, 64, 0);
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
