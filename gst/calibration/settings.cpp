/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "settings.hpp"

using rangecast::BoardKind;
using rangecast::DistortionModel;
using rangecast::WorldFrame;

#define GST_TYPE_RIG_CALIBRATE_BOARD (gst_rig_calibrate_board_get_type ())
static GType
gst_rig_calibrate_board_get_type (void)
{
  static const GType type = [] {
    static const GEnumValue values[] = {{int (BoardKind::kChessboard), "Chessboard", "chessboard"},
        {int (BoardKind::kCharuco), "Chessboard with ArUco markers in its white squares",
            "charuco"},
        {}};
    return g_enum_register_static ("GstRigCalibrateBoard", values);
  }();
  return type;
}

#define GST_TYPE_RIG_CALIBRATE_DICTIONARY (gst_rig_calibrate_dictionary_get_type ())
static GType
gst_rig_calibrate_dictionary_get_type (void)
{
  static const GType type = [] {
    static std::vector<GEnumValue> values; /* GLib keeps the pointer */
    for (std::string_view name : rangecast::board_dictionaries ()) {
      const int index = int (values.size ());
      values.push_back ({index, name.data (), name.data ()});
    }
    values.push_back ({});
    return g_enum_register_static ("GstRigCalibrateDictionary", values.data ());
  }();
  return type;
}

#define GST_TYPE_RIG_CALIBRATE_SELECTION (gst_rig_calibrate_selection_get_type ())
static GType
gst_rig_calibrate_selection_get_type (void)
{
  static const GType type = [] {
    static const GEnumValue values[] = {
        {int (CalibrationSelection::kAuto),
            "All of photographs (not live, at most 2 a second), spread otherwise", "auto"},
        {int (CalibrationSelection::kAll), "Every frame with a board", "all"},
        {int (CalibrationSelection::kSpread), "Where the board is still, sharp, and lies otherwise",
            "spread"},
        {}};
    return g_enum_register_static ("GstRigCalibrateSelection", values);
  }();
  return type;
}

#define GST_TYPE_RIG_CALIBRATE_DISTORTION (gst_rig_calibrate_distortion_get_type ())
static GType
gst_rig_calibrate_distortion_get_type (void)
{
  static const GType type = [] {
    static const GEnumValue values[] = {{int (DistortionModel::kNone), "No distortion", "none"},
        {int (DistortionModel::kFour), "k1 k2 p1 p2", "four"},
        {int (DistortionModel::kFive), "k1 k2 p1 p2 k3", "five"},
        {int (DistortionModel::kEight), "k1 k2 p1 p2 k3 k4 k5 k6: rational, for wide angles",
            "eight"},
        {}};
    return g_enum_register_static ("GstRigCalibrateDistortion", values);
  }();
  return type;
}

#define GST_TYPE_RIG_CALIBRATE_WORLD (gst_rig_calibrate_world_get_type ())
static GType
gst_rig_calibrate_world_get_type (void)
{
  static const GType type = [] {
    static const GEnumValue values[] = {
        {int (WorldFrame::kCentre), "Origin where the cameras look, first view on +z", "centre"},
        {int (WorldFrame::kFirstView), "Origin in the first view, which looks along -z",
            "first-view"},
        {int (WorldFrame::kBoard), "The first frame's board is the floor, origin in its middle",
            "board"},
        {}};
    return g_enum_register_static ("GstRigCalibrateWorld", values);
  }();
  return type;
}

static constexpr auto kReady =
    GParamFlags (G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_READY);
static const CalibrationProperties kDefaults;

static void
install_int (GObjectClass *c, guint id, const char *name, const char *nick, const char *blurb,
    int minimum, int maximum, int fallback)
{
  g_object_class_install_property (
      c, id, g_param_spec_int (name, nick, blurb, minimum, maximum, fallback, kReady));
}

static void
install_double (GObjectClass *c, guint id, const char *name, const char *nick, const char *blurb,
    double minimum, double maximum, double fallback)
{
  g_object_class_install_property (
      c, id, g_param_spec_double (name, nick, blurb, minimum, maximum, fallback, kReady));
}

static void
install_enum (GObjectClass *c, guint id, const char *name, const char *nick, const char *blurb,
    GType type, int fallback)
{
  g_object_class_install_property (
      c, id, g_param_spec_enum (name, nick, blurb, type, fallback, kReady));
  gst_type_mark_as_plugin_api (type, GstPluginAPIFlags (0));
}

static void
install_board_properties (GObjectClass *c)
{
  const rangecast::BoardSpec &board = kDefaults.core.board;
  install_enum (c, kCalibrationBoard, "board", "Board", "Kind of board (default: chessboard)",
      GST_TYPE_RIG_CALIBRATE_BOARD, int (board.kind));
  install_int (c, kCalibrationColumns, "columns", "Columns",
      "Inner corners across the board, one less than squares (3 to 32, default 9)", 3, 32,
      board.columns);
  install_int (c, kCalibrationRows, "rows", "Rows",
      "Inner corners down the board, one less than squares (3 to 32, default 6)", 3, 32,
      board.rows);
  install_double (c, kCalibrationSquareSize, "square-size", "Square size",
      "Side of a square, metres (0.0001 to 10, default 0.025)", 1e-4, 10, board.square_m);
  install_double (c, kCalibrationMarkerSize, "marker-size", "Marker size",
      "ChArUco: side of a marker, metres (less than a square, default 0: 3/4 of a square)", 0, 10,
      board.marker_m);
  install_enum (c, kCalibrationDictionary, "dictionary", "Dictionary",
      "ChArUco: the markers' dictionary (default: 4x4-50)", GST_TYPE_RIG_CALIBRATE_DICTIONARY,
      board.dictionary);
}

static void
install_frame_properties (GObjectClass *c)
{
  install_int (c, kCalibrationMinFrames, "min-frames", "Minimum frames",
      "Frames in which each camera must have seen the board (3 to 1000, default 8)", 3, 1000,
      kDefaults.core.min_frames);
  install_int (c, kCalibrationMaxFrames, "max-frames", "Maximum frames",
      "Frames to keep; then the one most like others makes room (3 to 1000, default 100)", 3, 1000,
      kDefaults.max_frames);
  install_enum (c, kCalibrationSelection, "selection", "Selection",
      "Which frames to keep (default: auto)", GST_TYPE_RIG_CALIBRATE_SELECTION,
      int (kDefaults.selection));
  g_object_class_install_property (c, kCalibrationAutoFinish,
      g_param_spec_boolean ("auto-finish", "Finish automatically",
          "Calibrate and end the stream as soon as the coverage is complete, with an error if that "
          "cannot be done (default: false)",
          kDefaults.auto_finish, kReady));
  g_object_class_install_property (c, kCalibrationMaxSkew,
      g_param_spec_uint64 ("max-skew", "Maximum skew",
          "Pictures whose capture times differ by no more belong together, ns (default 0: half a "
          "frame period, or 5 ms where the frame rate is unknown)",
          0, G_MAXINT64, kDefaults.max_skew, kReady));
}

void
install_calibration_properties (GObjectClass *c)
{
  install_board_properties (c);
  install_frame_properties (c);
  g_object_class_install_property (c, kCalibrationLocation,
      g_param_spec_string ("location", "Location",
          "Rig file to write, .yaml, .yml or .json (default: none)", nullptr, kReady));
  install_enum (c, kCalibrationDistortion, "distortion", "Distortion",
      "Coefficients of the lens model (default: five)", GST_TYPE_RIG_CALIBRATE_DISTORTION,
      int (kDefaults.core.distortion));
  install_enum (c, kCalibrationWorld, "world", "World", "Where the world lies (default: centre)",
      GST_TYPE_RIG_CALIBRATE_WORLD, int (kDefaults.core.world));
  install_double (c, kCalibrationNear, "near", "Near",
      "Nearest depth of interest, written into all views, metres (0.001 to 1000, default 0.3)",
      0.001, 1000, kDefaults.core.near_m);
  install_double (c, kCalibrationFar, "far", "Far",
      "Farthest depth of interest, written into all views, metres (0.001 to 1000, default 3)",
      0.001, 1000, kDefaults.core.far_m);
  install_int (c, kCalibrationTileWidth, "tile-width", "Tile width",
      "Width of each camera's picture in the output, pixels, even (32 to 4096, default 480)", 32,
      4096, kDefaults.tile_width);
}

bool
set_calibration_property (CalibrationProperties &p, guint id, const GValue *value)
{
  switch (id) {
    case kCalibrationBoard:
      p.core.board.kind = BoardKind (g_value_get_enum (value));
      return true;
    case kCalibrationColumns:
      p.core.board.columns = g_value_get_int (value);
      return true;
    case kCalibrationRows:
      p.core.board.rows = g_value_get_int (value);
      return true;
    case kCalibrationSquareSize:
      p.core.board.square_m = g_value_get_double (value);
      return true;
    case kCalibrationMarkerSize:
      p.core.board.marker_m = g_value_get_double (value);
      return true;
    case kCalibrationDictionary:
      p.core.board.dictionary = g_value_get_enum (value);
      return true;
    case kCalibrationLocation:
      p.location = g_value_get_string (value) ? g_value_get_string (value) : "";
      return true;
    case kCalibrationMinFrames:
      p.core.min_frames = g_value_get_int (value);
      return true;
    case kCalibrationMaxFrames:
      p.max_frames = g_value_get_int (value);
      return true;
    case kCalibrationSelection:
      p.selection = CalibrationSelection (g_value_get_enum (value));
      return true;
    case kCalibrationDistortion:
      p.core.distortion = DistortionModel (g_value_get_enum (value));
      return true;
    case kCalibrationWorld:
      p.core.world = WorldFrame (g_value_get_enum (value));
      return true;
    case kCalibrationNear:
      p.core.near_m = g_value_get_double (value);
      return true;
    case kCalibrationFar:
      p.core.far_m = g_value_get_double (value);
      return true;
    case kCalibrationAutoFinish:
      p.auto_finish = g_value_get_boolean (value);
      return true;
    case kCalibrationMaxSkew:
      p.max_skew = g_value_get_uint64 (value);
      return true;
    case kCalibrationTileWidth:
      p.tile_width = g_value_get_int (value);
      return true;
    default:
      return false;
  }
}

bool
get_calibration_property (const CalibrationProperties &p, guint id, GValue *value)
{
  switch (id) {
    case kCalibrationBoard:
      g_value_set_enum (value, int (p.core.board.kind));
      return true;
    case kCalibrationColumns:
      g_value_set_int (value, p.core.board.columns);
      return true;
    case kCalibrationRows:
      g_value_set_int (value, p.core.board.rows);
      return true;
    case kCalibrationSquareSize:
      g_value_set_double (value, p.core.board.square_m);
      return true;
    case kCalibrationMarkerSize:
      g_value_set_double (value, p.core.board.marker_m);
      return true;
    case kCalibrationDictionary:
      g_value_set_enum (value, p.core.board.dictionary);
      return true;
    case kCalibrationLocation:
      g_value_set_string (value, p.location.empty () ? nullptr : p.location.c_str ());
      return true;
    case kCalibrationMinFrames:
      g_value_set_int (value, p.core.min_frames);
      return true;
    case kCalibrationMaxFrames:
      g_value_set_int (value, p.max_frames);
      return true;
    case kCalibrationSelection:
      g_value_set_enum (value, int (p.selection));
      return true;
    case kCalibrationDistortion:
      g_value_set_enum (value, int (p.core.distortion));
      return true;
    case kCalibrationWorld:
      g_value_set_enum (value, int (p.core.world));
      return true;
    case kCalibrationNear:
      g_value_set_double (value, p.core.near_m);
      return true;
    case kCalibrationFar:
      g_value_set_double (value, p.core.far_m);
      return true;
    case kCalibrationAutoFinish:
      g_value_set_boolean (value, p.auto_finish);
      return true;
    case kCalibrationMaxSkew:
      g_value_set_uint64 (value, p.max_skew);
      return true;
    case kCalibrationTileWidth:
      g_value_set_int (value, p.tile_width);
      return true;
    default:
      return false;
  }
}
