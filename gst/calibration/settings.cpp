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
            "'all' for still images (not live, at most 2 per second), else 'spread'", "auto"},
        {int (CalibrationSelection::kAll), "Keep every frame that shows the board", "all"},
        {int (CalibrationSelection::kSpread),
            "Keep frames in which the board is still, sharp and at a new place, size or tilt",
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
        {int (DistortionModel::kEight),
            "k1 k2 p1 p2 k3 k4 k5 k6 (rational model, for wide-angle lenses)", "eight"},
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
        {int (WorldFrame::kCentre),
            "Origin at the point that the cameras look at, first view on +z", "centre"},
        {int (WorldFrame::kFirstView), "Origin in the first view, which looks along -z",
            "first-view"},
        {int (WorldFrame::kBoard),
            "Origin in the middle of the first frame's board, which defines the floor", "board"},
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
  install_enum (c, kCalibrationBoard, "board", "Board", "Type of the calibration board",
      GST_TYPE_RIG_CALIBRATE_BOARD, int (board.kind));
  install_int (c, kCalibrationColumns, "columns", "Columns",
      "Number of inner corners per row, one less than the number of squares", 3, 32, board.columns);
  install_int (c, kCalibrationRows, "rows", "Rows",
      "Number of inner corners per column, one less than the number of squares", 3, 32, board.rows);
  install_double (c, kCalibrationSquareSize, "square-size", "Square size",
      "Side length of a square in metres", 1e-4, 10, board.square_m);
  install_double (c, kCalibrationMarkerSize, "marker-size", "Marker size",
      "Side length of a ChArUco marker in metres (0 = 3/4 of a square)", 0, 10, board.marker_m);
  install_enum (c, kCalibrationDictionary, "dictionary", "Dictionary",
      "Dictionary of the ChArUco markers", GST_TYPE_RIG_CALIBRATE_DICTIONARY, board.dictionary);
}

static void
install_frame_properties (GObjectClass *c)
{
  install_int (c, kCalibrationMinFrames, "min-frames", "Minimum frames",
      "Number of frames in which each camera must have seen the board", 3, 1000,
      kDefaults.core.min_frames);
  install_int (c, kCalibrationMaxFrames, "max-frames", "Maximum frames",
      "Maximum number of frames to keep; beyond it the most redundant frame is replaced", 3, 1000,
      kDefaults.max_frames);
  install_enum (c, kCalibrationSelection, "selection", "Selection", "Which frames to keep",
      GST_TYPE_RIG_CALIBRATE_SELECTION, int (kDefaults.selection));
  g_object_class_install_property (c, kCalibrationAutoFinish,
      g_param_spec_boolean ("auto-finish", "Automatic finish",
          "Calibrate and send EOS as soon as the board was seen often enough by every camera; post "
          "an error if the calibration fails",
          kDefaults.auto_finish, kReady));
  g_object_class_install_property (c, kCalibrationMaxSkew,
      g_param_spec_uint64 ("max-skew", "Maximum skew",
          "Maximum difference of the capture times of one set in nanoseconds (0 = half a frame "
          "period, or 5 ms if the frame rate is unknown)",
          0, G_MAXINT64, kDefaults.max_skew, kReady));
}

void
install_calibration_properties (GObjectClass *c)
{
  install_board_properties (c);
  install_frame_properties (c);
  g_object_class_install_property (c, kCalibrationLocation,
      g_param_spec_string (
          "location", "Location", "Rig file to write (.yaml, .yml or .json)", nullptr, kReady));
  install_enum (c, kCalibrationDistortion, "distortion", "Distortion",
      "Distortion coefficients of the lens model", GST_TYPE_RIG_CALIBRATE_DISTORTION,
      int (kDefaults.core.distortion));
  install_enum (c, kCalibrationWorld, "world", "World",
      "Origin and orientation of the world coordinate system", GST_TYPE_RIG_CALIBRATE_WORLD,
      int (kDefaults.core.world));
  install_double (c, kCalibrationNear, "near", "Near",
      "Near limit written into all views of the rig in metres", 0.001, 1000, kDefaults.core.near_m);
  install_double (c, kCalibrationFar, "far", "Far",
      "Far limit written into all views of the rig in metres", 0.001, 1000, kDefaults.core.far_m);
  install_int (c, kCalibrationTileWidth, "tile-width", "Tile width",
      "Width of each camera's tile in the output in pixels, even", 32, 4096, kDefaults.tile_width);
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
