/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "settings.hpp"

using rangecast::BoardKind;
using rangecast::DistortionModel;
using rangecast::WorldFrame;

static const GEnumValue kBoards[] = {{int (BoardKind::kChessboard), "Chessboard", "chessboard"},
    {int (BoardKind::kCharuco), "Chessboard with ArUco markers in its white squares", "charuco"},
    {}};

static const GEnumValue kDistortions[] = {{int (DistortionModel::kNone), "No distortion", "none"},
    {int (DistortionModel::kFour), "k1 k2 p1 p2", "four"},
    {int (DistortionModel::kFive), "k1 k2 p1 p2 k3", "five"},
    {int (DistortionModel::kEight),
        "k1 k2 p1 p2 k3 k4 k5 k6 (rational model, for wide-angle lenses)", "eight"},
    {}};

static const GEnumValue kWorlds[] = {
    {int (WorldFrame::kCentre), "Origin at the point that the cameras look at, first view on +z",
        "centre"},
    {int (WorldFrame::kFirstView), "Origin in the first view, which looks along -z", "first-view"},
    {int (WorldFrame::kBoard),
        "Origin in the middle of the first frame's board, which defines the floor", "board"},
    {}};

PropertyTable<RigCalibrateSettings> &
rig_calibrate_properties ()
{
  using S = RigCalibrateSettings;
  using Core = rangecast::CalibrationSettings;
  using Board = rangecast::BoardSpec;
  using P = PropertyTable<S>;
  static const std::vector<GEnumValue> kDictionaries = [] { /* GLib keeps the pointer */
    std::vector<GEnumValue> list;
    for (std::string_view name : rangecast::board_dictionaries ())
      list.push_back ({int (list.size ()), name.data (), name.data ()});
    list.push_back ({});
    return list;
  }();
  static P table = {
      P::enumeration<&S::core, &Core::board, &Board::kind> ("board", "Board",
          "Type of the calibration board", "GstRigCalibrateBoard", kBoards, kMutableReady),
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
          "Dictionary of the ChArUco markers", "GstRigCalibrateDictionary", kDictionaries.data (),
          kMutableReady),
      P::text<&S::location> (
          "location", "Location", "Rig file to write (.yaml, .yml or .json)", kMutableReady),
      P::number<&S::core, &Core::min_frames> ("min-frames", "Minimum frames",
          "Number of frames in which each camera must have seen the board", 3, 1000, kMutableReady),
      P::enumeration<&S::core, &Core::distortion> ("distortion", "Distortion",
          "Distortion coefficients of the lens model", "GstRigCalibrateDistortion", kDistortions,
          kMutableReady),
      P::enumeration<&S::core, &Core::world> ("world", "World",
          "Origin and orientation of the world coordinate system", "GstRigCalibrateWorld", kWorlds,
          kMutableReady),
      P::number<&S::core, &Core::near_m> ("near", "Near",
          "Near limit written into all views of the rig in metres", 0.001, 1000., kMutableReady),
      P::number<&S::core, &Core::far_m> ("far", "Far",
          "Far limit written into all views of the rig in metres", 0.001, 1000., kMutableReady),
      P::boolean<&S::auto_finish> ("auto-finish", "Automatic finish",
          "Calibrate and send EOS as soon as the board was seen often enough by every camera; post "
          "an error if the calibration fails",
          kMutableReady),
  };
  return table;
}
