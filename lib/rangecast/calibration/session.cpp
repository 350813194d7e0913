/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "session.hpp"

#include "../opencv/threads.hpp"
#include "pose_chain.hpp"

#include <algorithm>
#include <numeric>

namespace rangecast {

Status
CalibrationSession::set (const SessionSettings &settings)
{
  if (Status s = validate (settings.calibration.board); !s.ok ())
    return s;
  const CalibrationSettings &c = settings.calibration;
  if (!(c.near_m > 0 && c.near_m < c.far_m))
    return {StatusCode::kBadValue, "near is " + std::to_string (c.near_m) + " m and far is " +
                                       std::to_string (c.far_m) + " m; set near between 0 and far"};
  if (settings.selection.max_frames < c.min_frames)
    return {StatusCode::kBadValue,
        "max-frames is " + std::to_string (settings.selection.max_frames) +
            "; set it to min-frames, " + std::to_string (c.min_frames) + ", or more"};
  settings_ = settings;
  selector_.set (settings.calibration.board, settings.selection);
  clear ();
  return {};
}

void
CalibrationSession::clear ()
{
  selector_.clear ();
  states_.clear ();
  cameras_.clear ();
  verdict_ = FrameVerdict::kNoBoard;
}

Status
CalibrationSession::examine (const std::vector<CalibrationCamera> &cameras,
    std::span<const ImageView<const Rgbx>> pictures, std::uint64_t time_ns, std::uint64_t number)
{
  if (cameras.size () < cameras_.size () ||
      !std::equal (cameras_.begin (), cameras_.end (), cameras.begin ()))
    clear (); /* one was removed or replaced */
  cameras_ = cameras;
  while (states_.size () < cameras.size ()) {
    states_.push_back (std::make_unique<CameraState> ());
    if (Status s = states_.back ()->detector.set (settings_.calibration.board, settings_.thorough);
        !s.ok ())
      return s;
  }
  in_parallel_with_opencv (cameras.size (), 0, [&] (std::size_t i) {
    CameraState &state = *states_[i];
    state.corners.clear ();
    state.status = {};
    if (!pictures[i].empty ())
      state.status = state.detector.detect (pictures[i], state.corners, state.edge_width);
  });
  CalibrationFrame frame;
  frame.number = number;
  std::vector<double> edge_widths;
  std::vector<bool> has_image;
  for (std::size_t i = 0; i < cameras.size (); i++) {
    has_image.push_back (!pictures[i].empty ());
    if (!states_[i]->status.ok ())
      return states_[i]->status;
    if (states_[i]->corners.empty ())
      continue;
    frame.sightings.push_back ({int (i), states_[i]->corners});
    edge_widths.push_back (states_[i]->edge_width);
  }
  verdict_ = selector_.offer (cameras, std::move (frame), edge_widths, time_ns, has_image);
  for (const auto &state : states_)
    state->seen[int (verdict_)] += !state->corners.empty ();
  return {};
}

std::vector<int>
CalibrationSession::groups () const
{
  return linked_groups (int (cameras_.size ()), selector_.frames (), kMinSharedFrames);
}

bool
CalibrationSession::complete () const
{
  for (std::size_t i = 0; i < cameras_.size (); i++) {
    const CameraCoverage c = coverage (int (i));
    if (!c.complete () || c.frames < settings_.calibration.min_frames)
      return false;
  }
  return !cameras_.empty () && std::ranges::count (groups (), 0) == int (cameras_.size ());
}

void
CalibrationSession::draw (
    std::span<const ImageView<const Rgbx>> pictures, ImageView<Rgbx> out) const
{
  if (cameras_.empty ())
    return;
  const int columns = lay_out (cameras_, 2).columns;
  const TileLayout layout = lay_out (cameras_, out.width / columns);
  if (layout.width () > out.width || layout.height () > out.height)
    return;
  for (int i = 0; i < layout.columns * layout.rows; i++) {
    TileContents contents;
    if (i < int (cameras_.size ())) {
      contents.picture = pictures[i];
      contents.corners = states_[i]->corners;
      contents.columns = settings_.calibration.board.columns;
      contents.coverage = coverage (i);
      contents.taken = verdict_ == FrameVerdict::kTaken && !states_[i]->corners.empty ();
    }
    draw_tile (contents,
        out.crop (i % layout.columns * layout.tile_width, i / layout.columns * layout.tile_height,
            layout.tile_width, layout.tile_height));
  }
}

/* Explains why too few of the boards seen were kept. */
Status
CalibrationSession::check_kept () const
{
  for (std::size_t i = 0; i < cameras_.size (); i++) {
    const auto &seen = states_[i]->seen;
    const int all = std::reduce (seen.begin (), seen.end ());
    const int kept = coverage (int (i)).frames, wanted = settings_.calibration.min_frames;
    if (states_[i]->detector.is_mirrored ())
      return {StatusCode::kBadValue,
          text_of (cameras_[i]) +
              ": its images are mirrored; switch off the camera's mirror mode, or use videoflip"};
    if (kept >= wanted || kept >= all)
      continue;
    std::string text = text_of (cameras_[i]) + ": the board was found in " + std::to_string (all) +
                       " images, but only " + std::to_string (kept) + " were kept, fewer than " +
                       std::to_string (wanted) + ". Of the rest";
    const std::pair<FrameVerdict, const char *> reasons[] = {{FrameVerdict::kMoving, "moving"},
        {FrameVerdict::kBlurred, "blurred"}, {FrameVerdict::kSimilar, "similar to an earlier one"}};
    const char *comma = "";
    for (const auto &[verdict, reason] : reasons)
      if (const int count = seen[int (verdict)]) {
        text += std::string (comma) + " " + std::to_string (count) + " were " + reason;
        comma = ",";
      }
    return {StatusCode::kNotFound, text + "; hold the board still for a moment at each new place"};
  }
  return {};
}

Status
CalibrationSession::calibrate (CalibrationResult &result, std::stop_token stop) const
{
  result = {};
  if (Status s = check_kept (); !s.ok ())
    return s;
  return calibrate_rig (
      cameras_, selector_.frames (), settings_.calibration, result, std::move (stop));
}

} // namespace rangecast
