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
        {int (FrameSelection::kAuto),
            "'all' for still images (not live, at most 2 per second), else 'spread'", "auto"},
        {int (FrameSelection::kAll), "Keep every frame that shows the board", "all"},
        {int (FrameSelection::kSpread),
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

PropertyTable<RigCalibrateSettings> &
rig_calibrate_properties ()
{
  using S = RigCalibrateSettings;
  using Core = rangecast::CalibrationSettings;
  using Board = rangecast::BoardSpec;
  using P = PropertyTable<S>;
  static P table = {
      P::enumeration<&S::core, &Core::board, &Board::kind> ("board", "Board",
          "Type of the calibration board", GST_TYPE_RIG_CALIBRATE_BOARD, kMutableReady),
      P::number<&S::core, &Core::board, &Board::columns> ("columns", "Columns",
          "Number of inner corners per row, one less than the number of squares", 3, 32,
          kMutableReady),
      P::number<&S::core, &Core::board, &Board::rows> ("rows", "Rows",
          "Number of inner corners per column, one less than the number of squares", 3, 32,
          kMutableReady),
      P::number<&S::core, &Core::board, &Board::square_m> ("square-size", "Square size",
          "Side length of a square in metres", 1e-4, 10., kMutableReady),
      P::number<&S::core, &Core::board, &Board::marker_m> ("marker-size", "Marker size",
          "Side length of a ChArUco marker in metres (0 = 3/4 of a square)", 0, 10, kMutableReady),
      P::enumeration<&S::core, &Core::board, &Board::dictionary> ("dictionary", "Dictionary",
          "Dictionary of the ChArUco markers", GST_TYPE_RIG_CALIBRATE_DICTIONARY, kMutableReady),
      P::text<&S::location> (
          "location", "Location", "Rig file to write (.yaml, .yml or .json)", kMutableReady),
      P::number<&S::core, &Core::min_frames> ("min-frames", "Minimum frames",
          "Number of frames in which each camera must have seen the board", 3, 1000, kMutableReady),
      P::number<&S::max_frames> ("max-frames", "Maximum frames",
          "Maximum number of frames to keep; beyond it the most redundant frame is replaced", 3,
          1000, kMutableReady),
      P::enumeration<&S::selection> ("selection", "Selection", "Which frames to keep",
          GST_TYPE_RIG_CALIBRATE_SELECTION, kMutableReady),
      P::enumeration<&S::core, &Core::distortion> ("distortion", "Distortion",
          "Distortion coefficients of the lens model", GST_TYPE_RIG_CALIBRATE_DISTORTION,
          kMutableReady),
      P::enumeration<&S::core, &Core::world> ("world", "World",
          "Origin and orientation of the world coordinate system", GST_TYPE_RIG_CALIBRATE_WORLD,
          kMutableReady),
      P::number<&S::core, &Core::near_m> ("near", "Near",
          "Near limit written into all views of the rig in metres", 0.001, 1000., kMutableReady),
      P::number<&S::core, &Core::far_m> ("far", "Far",
          "Far limit written into all views of the rig in metres", 0.001, 1000., kMutableReady),
      P::boolean<&S::auto_finish> ("auto-finish", "Automatic finish",
          "Calibrate and send EOS as soon as the board was seen often enough by every camera; post "
          "an error if the calibration fails",
          kMutableReady),
      P::number<&S::max_skew> ("max-skew", "Maximum skew",
          "Maximum difference of the capture times of one set in nanoseconds (0 = half a frame "
          "period, or 5 ms if the frame rate is unknown)",
          GstClockTime (0), GstClockTime (G_MAXINT64), kMutableReady),
      P::number<&S::tile_width> ("tile-width", "Tile width",
          "Width of each camera's tile in the output in pixels, even", 32, 4096, kMutableReady),
  };
  return table;
}
