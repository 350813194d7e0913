/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "pose_chain.hpp"

#include "opencv_types.hpp"

#include <algorithm>
#include <limits>

namespace rangecast {
namespace {

/* The corners that both cameras saw, by frame. */
struct CommonCorners {
  std::vector<std::vector<cv::Point3f>> object;
  std::vector<std::vector<cv::Point2f>> first, second;
};

CommonCorners
common_corners (const std::vector<CalibrationFrame> &frames, const BoardSpec &board, int a, int b)
{
  CommonCorners common;
  for (const CalibrationFrame &frame : frames) {
    const Sighting *first = frame.find (a), *second = frame.find (b);
    if (!first || !second)
      continue;
    std::vector<cv::Point3f> object;
    std::vector<cv::Point2f> left, right;
    for (const BoardCorner &c : first->corners) {
      const auto other = std::ranges::find (second->corners, c.id, &BoardCorner::id);
      if (other == second->corners.end ())
        continue;
      object.push_back (opencv_point (board.corner (c.id)));
      left.emplace_back (float (c.x), float (c.y));
      right.emplace_back (float (other->x), float (other->y));
    }
    if (object.size () < 4)
      continue;
    common.object.push_back (std::move (object));
    common.first.push_back (std::move (left));
    common.second.push_back (std::move (right));
  }
  return common;
}

Status
link_cameras (const std::vector<CalibrationCamera> &cameras,
    const std::vector<CalibrationFrame> &frames, const BoardSpec &board,
    const std::vector<LensCalibration> &lenses, CameraLink &link)
{
  const CommonCorners common = common_corners (frames, board, link.a, link.b);
  cv::Mat r, t, e, f;
  cv::Mat k1 (camera_matrix (lenses[link.a].lens)), k2 (camera_matrix (lenses[link.b].lens));
  std::vector<double> d1 = coefficients (lenses[link.a].lens);
  std::vector<double> d2 = coefficients (lenses[link.b].lens);
  const CalibrationCamera &camera = cameras[link.a];
  try {
    cv::stereoCalibrate (common.object, common.first, common.second, k1, d1, k2, d2,
        {camera.width, camera.height}, r, t, e, f,
        cv::CALIB_FIX_INTRINSIC | cv::CALIB_RATIONAL_MODEL,
        {cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 100, 1e-9});
  } catch (const std::exception &problem) {
    return {
        StatusCode::kBadValue, text_of (camera) + " and " + text_of (cameras[link.b]) +
                                   ": no pose fits the boards that both saw: " + problem.what ()};
  }
  link.b_from_a = pose_from_opencv (r, t);
  return {};
}

/* The link with most common frames between a camera with a pose and one without. */
CameraLink
strongest_link (const std::vector<CalibrationFrame> &frames, const std::vector<bool> &placed)
{
  CameraLink best;
  for (int a = 0; a < int (placed.size ()); a++)
    for (int b = 0; b < int (placed.size ()); b++)
      if (placed[a] && !placed[b])
        if (const int frames_shared = shared_frames (frames, a, b); frames_shared > best.frames)
          best = {a, b, frames_shared, {}};
  return best;
}

/* Takes the pose of each board from the camera with the smallest error. */
void
place_boards (const std::vector<CalibrationFrame> &frames, const BoardSpec &board,
    const std::vector<LensCalibration> &lenses, Bundle &bundle)
{
  bundle.first_from_board.assign (frames.size (), {});
  std::vector<double> best (frames.size (), std::numeric_limits<double>::max ());
  for (std::size_t camera = 0; camera < lenses.size (); camera++) {
    const LensCalibration &lens = lenses[camera];
    const Pose first_from_camera = bundle.camera_from_first[camera].inverse ();
    for (std::size_t i = 0; i < lens.frames.size (); i++) {
      const int f = lens.frames[i];
      const Sighting *sighting = frames[f].find (int (camera));
      if (!sighting)
        continue;
      const double rms = reprojection_rms (lens.lens, lens.poses[i], board, sighting->corners);
      if (rms >= best[f])
        continue;
      best[f] = rms;
      bundle.first_from_board[f] = first_from_camera * lens.poses[i];
    }
  }
}

} // namespace

Status
check_linked (
    const std::vector<CalibrationCamera> &cameras, const std::vector<CalibrationFrame> &frames)
{
  const std::vector<int> groups = linked_groups (int (cameras.size ()), frames, kMinSharedFrames);
  const int count = cameras.empty () ? 0 : *std::ranges::max_element (groups) + 1;
  if (count <= 1)
    return {};
  std::string text = "cameras that do not see the same boards: ";
  for (int group = 0; group < count; group++) {
    text += group == 0 ? "" : " | ";
    bool first = true;
    for (std::size_t i = 0; i < cameras.size (); i++)
      if (groups[i] == group) {
        text += (first ? "" : ", ") + text_of (cameras[i]);
        first = false;
      }
  }
  return {StatusCode::kNotFound,
      text + "; show the board to a camera of each group at the same time, in at least " +
          std::to_string (kMinSharedFrames) + " frames"};
}

Status
chain_cameras (const std::vector<CalibrationCamera> &cameras,
    const std::vector<CalibrationFrame> &frames, const BoardSpec &board,
    const std::vector<LensCalibration> &lenses, Bundle &bundle, std::vector<CameraLink> &links,
    const std::stop_token &stop)
{
  links.clear ();
  bundle.lenses.clear ();
  for (const LensCalibration &lens : lenses)
    bundle.lenses.push_back (lens.lens);
  bundle.camera_from_first.assign (cameras.size (), {});
  std::vector<bool> placed (cameras.size ());
  placed[0] = true;
  while (links.size () + 1 < cameras.size ()) {
    if (stop.stop_requested ())
      return {StatusCode::kInterrupted, "the calibration was interrupted"};
    CameraLink link = strongest_link (frames, placed);
    if (Status s = link_cameras (cameras, frames, board, lenses, link); !s.ok ())
      return s;
    bundle.camera_from_first[link.b] = link.b_from_a * bundle.camera_from_first[link.a];
    placed[link.b] = true;
    links.push_back (link);
  }
  place_boards (frames, board, lenses, bundle);
  return {};
}

} // namespace rangecast
