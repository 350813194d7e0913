/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "rig_calibration.hpp"

#include "../geometry/rectified_pose.hpp"
#include "opencv_types.hpp"
#include "pose_chain.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numeric>
#include <span>

namespace rangecast {
namespace {

/* A board with an error above both limits (a multiple of the median, and pixels) is an outlier: it
 * moved, or its corners were misdetected. */
constexpr double kOutlierFactor = 4, kOutlierPx = 0.6;
constexpr int kOutlierRounds = 3;
constexpr double kRobustPx = 1;
/* Maximum error of a calibration, and of a good one, pixels. */
constexpr double kWorstRmsPx = 5;
constexpr double kGoodRmsPx = 1;
/* Row error of a pair that is worth a warning, because stereodepth matches within rows. */
constexpr double kOddRowErrorPx = 1;
/* Maximum relative roll of a pair that can be rectified usefully. */
constexpr double kMaxRollDeg = 45;

Status
bad (const std::string &what)
{
  return {StatusCode::kBadValue, what};
}

std::string
rounded (double value)
{
  char text[32];
  std::snprintf (text, sizeof text, "%.3g", value);
  return text;
}

int
find_camera (const std::vector<CalibrationCamera> &cameras, int view_id, CameraRole role)
{
  for (std::size_t i = 0; i < cameras.size (); i++)
    if (cameras[i].view_id == view_id && cameras[i].role == role)
      return int (i);
  return -1;
}

/* Checks that both cameras are the same way up, and the right one is on the left one's +x side. */
Status
check_pair (
    const CalibrationCamera &left, const CalibrationCamera &right, const Pose &right_from_left)
{
  const std::string view = "view " + std::to_string (left.view_id) + ": ";
  const Vec3 x = right_from_left.rotation * Vec3{1, 0, 0};
  const double roll = std::atan2 (x.y, x.x) * 180 / M_PI; /* about the optical axis, degrees */
  char text[100];
  if (std::abs (roll) > kMaxRollDeg) {
    std::snprintf (text, sizeof text, "%.0f degrees", roll);
    return bad (view + right.name + " (right) " +
                (std::abs (roll) > 135 ? "is upside down" : "lies on its side") + " against " +
                left.name + " (left): it is turned by " + text +
                " about its axis; turn the camera, or its images with videoflip");
  }
  const Vec3 c = right_from_left.inverse ().translation;
  if (std::abs (c.x) < std::abs (c.y) || std::abs (c.x) < 0.5 * std::abs (c.z)) {
    std::snprintf (text, sizeof text, "%.3f m to the %s, %.3f m %s and %.3f m %s", std::abs (c.x),
        c.x < 0 ? "left" : "right", std::abs (c.y), c.y < 0 ? "above" : "below", std::abs (c.z),
        c.z < 0 ? "behind" : "ahead");
    return bad (view + right.name + " (right) stands " + text + " of " + left.name +
                " (left); mount them side by side");
  }
  std::snprintf (text, sizeof text, "%.4f m", norm (c));
  if (c.x < 0)
    return bad (view + "left and right cameras are swapped: " + right.name + " (right) stands " +
                text + " to the left of " + left.name +
                " (left); swap the two. If they are not, both are upside down, or both images "
                "are mirrored");
  return {};
}

/* ---- the world ---- */

Vec3
normalised (Vec3 v)
{
  return 1 / norm (v) * v;
}

Vec3
column (const Pose &pose, int i)
{
  return {pose.rotation[i], pose.rotation[3 + i], pose.rotation[6 + i]};
}

/* A world with this y axis and the z axis closest to `towards`. */
Pose
world_from (Vec3 origin, Vec3 up, Vec3 towards)
{
  const Vec3 y = normalised (up);
  Vec3 flat = towards - dot (towards, y) * y;
  if (norm (flat) < 1e-6) { /* parallel: any direction is as good */
    const Vec3 any = std::abs (y.x) < 0.9 ? Vec3{1, 0, 0} : Vec3{0, 1, 0};
    flat = any - dot (any, y) * y;
  }
  const Vec3 z = normalised (flat), x = cross (y, z);
  Pose pose{{x.x, x.y, x.z, y.x, y.y, y.z, z.x, z.y, z.z}, {}};
  pose.translation = -1 * (pose.rotation * origin);
  return pose;
}

Vec3
mean (std::span<const Vec3> points)
{
  Vec3 sum;
  for (const Vec3 &p : points)
    sum = sum + p;
  return 1.0 / double (points.size ()) * sum;
}

/* The point closest to the optical axes in the least-squares sense; the centre of the boards if the
 * axes are parallel, or meet behind a camera or far beyond all boards.
 */
Vec3
looked_at (std::span<const Pose> cameras, Vec3 middle)
{
  if (cameras.size () == 1) {
    const Vec3 axis = column (cameras[0], 2), at = cameras[0].translation;
    return at + dot (axis, middle - at) * axis;
  }
  cv::Matx33d a = cv::Matx33d::zeros ();
  cv::Vec3d b (0, 0, 0);
  double farthest = 0;
  for (const Pose &camera : cameras) {
    const Vec3 d = column (camera, 2), c = camera.translation;
    const cv::Vec3d direction (d.x, d.y, d.z);
    const cv::Matx33d across = cv::Matx33d::eye () - direction * direction.t ();
    a = a + across;
    b += across * cv::Vec3d (c.x, c.y, c.z);
    farthest = std::max (farthest, norm (middle - c));
  }
  cv::Vec3d values;
  cv::Matx33d vectors;
  if (!cv::eigen (a, values, vectors) || values[2] < 0.01 * double (cameras.size ()))
    return middle;
  const cv::Vec3d p = a.inv () * b;
  const Vec3 point{p[0], p[1], p[2]};
  for (const Pose &camera : cameras) {
    const double depth = dot (column (camera, 2), point - camera.translation);
    if (!(depth > 0 && depth < 3 * farthest))
      return middle;
  }
  return point;
}

/* @param first_from_camera  poses of the left cameras in the frame of the first one, which is
 * included; not empty
 * @param boards  centres of all boards in the first camera's frame, not empty
 * @param first_from_board  for kBoard, with the origin in its centre
 * @return world_from_first */
Pose
place_world (WorldFrame frame, std::span<const Pose> first_from_camera,
    std::span<const Vec3> boards, const Pose &first_from_board)
{
  const Vec3 first = first_from_camera[0].translation;
  if (frame == WorldFrame::kFirstView)
    return world_from (first, {0, -1, 0}, {0, 0, -1});
  const Vec3 middle = mean (boards);
  if (frame == WorldFrame::kBoard) {
    const Vec3 origin = first_from_board.translation;
    Vec3 up = column (first_from_board, 2);
    if (dot (up, first - origin) < 0)
      up = -1 * up;
    return world_from (origin, up, first - origin);
  }
  Vec3 up;
  for (const Pose &camera : first_from_camera)
    up = up - column (camera, 1);
  if (norm (up) < 1e-3)
    up = {0, -1, 0};
  const Vec3 origin = looked_at (first_from_camera, middle);
  return world_from (origin, up, first - origin);
}

/* ---- the calibration ---- */

/* The state of a calibration. */
class Calibration {
public:
  Calibration (const std::vector<CalibrationCamera> &cameras, std::vector<CalibrationFrame> &frames,
      const CalibrationSettings &settings, CalibrationResult &result, std::stop_token stop)
      : cameras_ (cameras), frames_ (frames), settings_ (settings), result_ (result),
        stop_ (std::move (stop))
  {
  }

  Status run ()
  {
    Status s = check_counts ();
    if (s.ok () && cameras_.size () > 1)
      s = check_linked (cameras_, frames_);
    if (s.ok ())
      s = calibrate_lenses ();
    if (s.ok ())
      s = chain_cameras (cameras_, frames_, settings_.board, lenses_, bundle_, links_, stop_);
    if (s.ok ())
      s = with_hint (adjust ());
    if (s.ok ())
      s = check_pairs ();
    if (s.ok ())
      s = with_hint (report ());
    return s.ok () ? make_rig () : s;
  }

private:
  std::string what_was_dropped (int camera) const;
  std::string wanted_board () const;
  Status check_counts () const;
  Status calibrate_lenses ();
  Status adjust ();
  Status with_hint (const Status &status) const;
  Status check_pairs () const;
  Status report ();
  Status make_rig ();
  Status drop_outliers (double limit_px, bool &any);
  double outlier_limit () const;
  double sighting_rms (std::size_t frame, const Sighting &sighting) const;
  double reach (int camera) const;
  double row_error (int left, int right) const;
  std::string misalignment_of (const PairReport &pair) const;
  PairReport pair_report (int a, int b) const;
  Pose world_from_first () const;
  Pose between (int a, int b) const
  {
    return bundle_.camera_from_first[b] * bundle_.camera_from_first[a].inverse ();
  }

  const std::vector<CalibrationCamera> &cameras_;
  std::vector<CalibrationFrame> &frames_;
  const CalibrationSettings &settings_;
  CalibrationResult &result_;
  const std::stop_token stop_;
  std::vector<LensCalibration> lenses_;
  std::vector<CameraLink> links_;
  Bundle bundle_;
};

/* Describes the frames of a camera that drop_outliers() removed; empty if there are none. */
std::string
Calibration::what_was_dropped (int camera) const
{
  const auto count = std::ranges::count (result_.dropped, camera, &DroppedBoard::camera);
  if (count == 0)
    return {};
  return " (" + std::to_string (count) +
         " more do not fit; check that the cameras capture at the same time, and hold the board "
         "still)";
}

std::string
Calibration::wanted_board () const
{
  const bool charuco = settings_.board.kind == BoardKind::kCharuco;
  return std::to_string (settings_.board.columns) + "x" + std::to_string (settings_.board.rows) +
         " inner corners, " +
         (charuco ? "with markers of the dictionary " +
                        std::string (board_dictionaries ()[settings_.board.dictionary]) +
                        " in the white squares (ChArUco), sharp"
                  : "whole and sharp");
}

Status
Calibration::check_counts () const
{
  for (std::size_t i = 0; i < cameras_.size (); i++) {
    const auto count = std::ranges::count_if (
        frames_, [&] (const CalibrationFrame &frame) { return frame.find (int (i)) != nullptr; });
    if (count >= settings_.min_frames)
      continue;
    const std::string dropped = what_was_dropped (int (i));
    if (count == 0 && dropped.empty ())
      return {StatusCode::kNotFound,
          text_of (cameras_[i]) + ": no board was found; show one with " + wanted_board () +
              ", in at least " + std::to_string (settings_.min_frames) + " frames"};
    return {StatusCode::kNotFound,
        text_of (cameras_[i]) + ": the board was found in " + std::to_string (count) +
            (count == 1 ? " frame" : " frames") + (dropped.empty () ? "" : " that fit") + dropped +
            "; show it in at least " + std::to_string (settings_.min_frames)};
  }
  return {};
}

/* Farthest corner from the principal point, pixels. */
double
Calibration::reach (int camera) const
{
  const LensParameters &lens = bundle_.lenses[camera];
  double farthest = 0;
  for (const CalibrationFrame &frame : frames_)
    if (const Sighting *sighting = frame.find (camera))
      for (const BoardCorner &c : sighting->corners)
        farthest = std::max (farthest, std::hypot (c.x - lens[2], c.y - lens[3]));
  return farthest;
}

Status
Calibration::calibrate_lenses ()
{
  lenses_.resize (cameras_.size ());
  for (std::size_t i = 0; i < cameras_.size (); i++) {
    if (stop_.stop_requested ())
      return {StatusCode::kInterrupted, "the calibration was interrupted"};
    if (Status s = calibrate_lens (
            cameras_[i], int (i), frames_, settings_.board, settings_.distortion, lenses_[i]);
        !s.ok ())
      return s;
  }
  return {};
}

double
Calibration::sighting_rms (std::size_t frame, const Sighting &sighting) const
{
  return reprojection_rms (bundle_.lenses[sighting.camera],
      bundle_.camera_from_first[sighting.camera] * bundle_.first_from_board[frame], settings_.board,
      sighting.corners);
}

double
Calibration::outlier_limit () const
{
  std::vector<double> errors;
  for (std::size_t f = 0; f < frames_.size (); f++)
    for (const Sighting &sighting : frames_[f].sightings)
      errors.push_back (sighting_rms (f, sighting));
  if (errors.empty ())
    return kOutlierPx;
  std::ranges::nth_element (errors, errors.begin () + errors.size () / 2);
  return std::max (kOutlierFactor * errors[errors.size () / 2], kOutlierPx);
}

/* @param[out] any  whether any was removed
 * @return the result of check_counts() and check_linked() for the rest */
Status
Calibration::drop_outliers (double limit_px, bool &any)
{
  const std::size_t before = result_.dropped.size ();
  for (std::size_t f = 0; f < frames_.size (); f++)
    std::erase_if (frames_[f].sightings, [&] (const Sighting &sighting) {
      const double rms = sighting_rms (f, sighting);
      const bool fits = rms <= limit_px;
      if (!fits)
        result_.dropped.push_back ({frames_[f].number, sighting.camera, rms});
      return !fits;
    });
  any = result_.dropped.size () > before;
  if (!any)
    return {};
  Status s = check_counts ();
  if (!s.ok () || cameras_.size () < 2)
    return s;
  s = check_linked (cameras_, frames_);
  return s.ok () ? s
                 : bad (s.message () + "; " + std::to_string (result_.dropped.size ()) +
                        " boards that do not fit were skipped; check that the images match");
}

/* If each camera alone fits its boards but all of them together do not, the cause is not the
 * lenses, whatever the status says: adds a hint. */
Status
Calibration::with_hint (const Status &status) const
{
  const bool alone_good = std::ranges::all_of (
      lenses_, [] (const LensCalibration &lens) { return lens.rms_px < kGoodRmsPx; });
  if (status.ok () || status.code () == StatusCode::kInterrupted || cameras_.size () < 2 ||
      !alone_good)
    return status;
  return {status.code (), status.message () +
                              ". Each camera alone fits: were their images captured at the "
                              "same time, and are those of one of them mirrored?"};
}

/* A robust loss identifies outliers; without them, least squares is the best estimate. */
Status
Calibration::adjust ()
{
  BundleSettings bundle{settings_.distortion, kRobustPx};
  bool dropped = false;
  Status s = drop_outliers (std::numeric_limits<double>::max (), dropped); /* behind a camera */
  dropped = true;
  for (int round = 0; s.ok () && dropped && round < kOutlierRounds; round++) {
    s = adjust_bundle (settings_.board, frames_, bundle, bundle_, stop_);
    if (s.ok ())
      s = drop_outliers (outlier_limit (), dropped);
  }
  bundle.robust_px = 0;
  if (s.ok ())
    s = adjust_bundle (settings_.board, frames_, bundle, bundle_, stop_);
  for (std::size_t i = 0; s.ok () && i < cameras_.size (); i++) {
    std::string warning;
    s = check_lens (cameras_[i], bundle_.lenses[i], reach (int (i)), warning);
    if (!warning.empty ())
      result_.warnings.push_back (warning);
  }
  return s;
}

Status
Calibration::check_pairs () const
{
  for (std::size_t left = 0; left < cameras_.size (); left++) {
    if (cameras_[left].role != CameraRole::kLeft)
      continue;
    const int right = find_camera (cameras_, cameras_[left].view_id, CameraRole::kRight);
    if (right < 0)
      continue;
    if (Status s = check_pair (cameras_[left], cameras_[right], between (int (left), right));
        !s.ok ())
      return s;
  }
  return {};
}

/* Median row difference of corresponding corners after rectification, pixels. */
double
Calibration::row_error (int left, int right) const
{
  const Pose right_from_left = between (left, right);
  const LensParameters &l = bundle_.lenses[left], &r = bundle_.lenses[right];
  const Vec3 t = right_from_left.translation;
  cv::Mat r1, r2, p1, p2, q;
  std::vector<double> errors;
  cv::stereoRectify (camera_matrix (l), coefficients (l), camera_matrix (r), coefficients (r),
      {cameras_[left].width, cameras_[left].height}, cv::Matx33d (right_from_left.rotation.data ()),
      cv::Vec3d (t.x, t.y, t.z), r1, r2, p1, p2, q, cv::CALIB_ZERO_DISPARITY, 0);
  for (const CalibrationFrame &frame : frames_) {
    const Sighting *a = frame.find (left), *b = frame.find (right);
    if (!a || !b)
      continue;
    std::vector<cv::Point2d> in[2], out[2];
    for (const BoardCorner &c : a->corners) {
      const auto other = std::ranges::find (b->corners, c.id, &BoardCorner::id);
      if (other == b->corners.end ())
        continue;
      in[0].emplace_back (c.x, c.y);
      in[1].emplace_back (other->x, other->y);
    }
    if (in[0].empty ())
      continue;
    cv::undistortPoints (in[0], out[0], camera_matrix (l), coefficients (l), r1, p1);
    cv::undistortPoints (in[1], out[1], camera_matrix (r), coefficients (r), r2, p2);
    for (std::size_t i = 0; i < out[0].size (); i++)
      errors.push_back (std::abs (out[0][i].y - out[1][i].y));
  }
  if (errors.empty ())
    return -1;
  std::ranges::nth_element (errors, errors.begin () + errors.size () / 2);
  return errors[errors.size () / 2];
}

PairReport
Calibration::pair_report (int a, int b) const
{
  PairReport pair{a, b, 0, 0, norm (between (a, b).translation), -1};
  double squares = 0;
  std::size_t corners = 0;
  for (std::size_t f = 0; f < frames_.size (); f++) {
    const Sighting *first = frames_[f].find (a), *second = frames_[f].find (b);
    if (!first || !second)
      continue;
    pair.frames++;
    for (const Sighting *s : {first, second}) {
      squares += std::pow (sighting_rms (f, *s), 2) * double (s->corners.size ());
      corners += s->corners.size ();
    }
  }
  pair.rms_px = corners ? std::sqrt (squares / double (corners)) : 0;
  if (cameras_[a].view_id == cameras_[b].view_id && cameras_[a].role == CameraRole::kLeft &&
      cameras_[b].role == CameraRole::kRight)
    pair.row_error_px = row_error (a, b);
  return pair;
}

/* Of a stereo pair; rows that differ follow from it. */
std::string
Calibration::misalignment_of (const PairReport &pair) const
{
  if (cameras_[pair.b].role != CameraRole::kRight)
    return {};
  View view;
  view.id = cameras_[pair.a].view_id;
  view.right.emplace ().partner_from_left = between (pair.a, pair.b);
  return describe_misalignment (view);
}

Status
Calibration::report ()
{
  std::vector<double> squares (cameras_.size ());
  std::vector<std::size_t> corners (cameras_.size ());
  for (std::size_t i = 0; i < cameras_.size (); i++)
    result_.cameras.push_back ({int (i), 0, 0, lenses_[i].rms_px});
  for (std::size_t f = 0; f < frames_.size (); f++) {
    result_.frames += !frames_[f].sightings.empty ();
    for (const Sighting &s : frames_[f].sightings) {
      squares[s.camera] += std::pow (sighting_rms (f, s), 2) * double (s.corners.size ());
      corners[s.camera] += s.corners.size ();
      result_.cameras[s.camera].frames++;
    }
  }
  for (std::size_t i = 0; i < cameras_.size (); i++)
    result_.cameras[i].rms_px = std::sqrt (squares[i] / double (corners[i]));
  result_.rms_px = std::sqrt (std::reduce (squares.begin (), squares.end ()) /
                              double (std::reduce (corners.begin (), corners.end ())));
  if (!(result_.rms_px <= kWorstRmsPx))
    return bad ("reprojection error is " + std::to_string (result_.rms_px) + " pixels, more than " +
                std::to_string (int (kWorstRmsPx)) +
                "; check that columns and rows are those of the board");
  for (int a = 0; a < int (cameras_.size ()); a++)
    for (int b = 0; b < int (cameras_.size ()); b++) {
      const bool stereo = cameras_[a].view_id == cameras_[b].view_id &&
                          cameras_[a].role == CameraRole::kLeft &&
                          cameras_[b].role != CameraRole::kLeft;
      const bool linked = cameras_[a].view_id != cameras_[b].view_id &&
                          std::ranges::any_of (links_,
                              [&] (const CameraLink &link) { return link.a == a && link.b == b; });
      if (stereo || linked)
        result_.pairs.push_back (pair_report (a, b));
    }
  for (const PairReport &pair : result_.pairs)
    if (const std::string text = misalignment_of (pair); !text.empty ())
      result_.warnings.push_back (text);
    else if (pair.row_error_px > kOddRowErrorPx)
      result_.warnings.push_back ("view " + std::to_string (cameras_[pair.a].view_id) +
                                  ": rows of " + cameras_[pair.a].name + " and " +
                                  cameras_[pair.b].name + " differ by " +
                                  rounded (pair.row_error_px) +
                                  " pixels after rectification, where 0.3 is good: were the "
                                  "images captured at the same time, and did no camera move?");
  return {};
}

Pose
Calibration::world_from_first () const
{
  const BoardSpec &board = settings_.board;
  const Vec3 middle = board.corner (board.corner_count () - 1);
  std::vector<Pose> views;
  std::vector<Vec3> boards;
  Pose first_board;
  for (std::size_t i = 0; i < cameras_.size (); i++)
    if (cameras_[i].role == CameraRole::kLeft)
      views.push_back (bundle_.camera_from_first[i].inverse ());
  for (std::size_t f = 0; f < frames_.size (); f++)
    if (!frames_[f].sightings.empty ()) {
      boards.push_back (bundle_.first_from_board[f] * (0.5 * middle));
      if (boards.size () == 1) {
        first_board = bundle_.first_from_board[f];
        first_board.translation = boards[0];
      }
    }
  /* place_world() expects the first view's left camera as reference; camera 0 may be another one.
   */
  const Pose reference = views[0].inverse ();
  for (Pose &view : views)
    view = reference * view;
  for (Vec3 &b : boards)
    b = reference * b;
  return place_world (settings_.world, views, boards, reference * first_board) * reference;
}

Status
Calibration::make_rig ()
{
  const Pose world = world_from_first ();
  if (settings_.world == WorldFrame::kBoard && frames_[0].sightings.empty ())
    result_.warnings.push_back (
        "the first frame's board was skipped, so the world begins at that of "
        "another frame; hold it still in the first images");
  for (std::size_t i = 0; i < cameras_.size (); i++) {
    if (cameras_[i].role != CameraRole::kLeft)
      continue;
    View view;
    view.id = cameras_[i].view_id;
    view.name = "view " + std::to_string (view.id);
    view.width = cameras_[i].width;
    view.height = cameras_[i].height;
    view.intrinsics = intrinsics_of (bundle_.lenses[i]);
    view.distortion = distortion_of (bundle_.lenses[i], settings_.distortion);
    view.world_from_view = world * bundle_.camera_from_first[i].inverse ();
    view.near_m = settings_.near_m;
    view.far_m = settings_.far_m;
    if (view.far_m >= 65535 * view.depth_unit_m)
      view.depth_unit_m = view.far_m / 65000; /* as in stereodepth */
    for (const CameraRole role : {CameraRole::kRight, CameraRole::kThird})
      if (const int other = find_camera (cameras_, view.id, role); other >= 0)
        (role == CameraRole::kRight ? view.right : view.third) = PartnerCamera{
            intrinsics_of (bundle_.lenses[other]),
            distortion_of (bundle_.lenses[other], settings_.distortion), between (int (i), other)};
    result_.rig.views.push_back (std::move (view));
  }
  std::ranges::sort (result_.rig.views, {}, &View::id);
  return validate (result_.rig);
}

} // namespace

Status
check_cameras (const std::vector<CalibrationCamera> &cameras, const BoardSpec &board)
{
  if (Status s = validate (board); !s.ok ())
    return s;
  if (cameras.empty ())
    return {StatusCode::kNotFound, "no cameras; add at least one"};
  for (std::size_t i = 0; i < cameras.size (); i++) {
    const CalibrationCamera &camera = cameras[i];
    if (camera.view_id < 0 || camera.view_id >= kMaxViews)
      return bad (text_of (camera) + ": use a view from 0 to " + std::to_string (kMaxViews - 1));
    if (camera.width < 1 || camera.height < 1 || camera.width > kMaxImageSide ||
        camera.height > kMaxImageSide)
      return {StatusCode::kBadSize,
          text_of (camera) + ": set an image size from 1x1 to " + std::to_string (kMaxImageSide)};
    if (const int same = find_camera (cameras, camera.view_id, camera.role); same != int (i))
      return bad (cameras[same].name + " and " + camera.name + " are both the " +
                  std::string (role_name (camera.role)) + " camera of view " +
                  std::to_string (camera.view_id) + "; change the view or role of one");
    const int left = find_camera (cameras, camera.view_id, CameraRole::kLeft);
    if (left < 0)
      return bad (text_of (camera) + ": its view has no left camera; add one");
    if (cameras[left].width != camera.width || cameras[left].height != camera.height)
      return {StatusCode::kBadSize,
          text_of (camera) + " is " + std::to_string (camera.width) + "x" +
              std::to_string (camera.height) + "; use the size of " + text_of (cameras[left]) +
              ", " + std::to_string (cameras[left].width) + "x" +
              std::to_string (cameras[left].height) + ": add videoscale before the pad"};
  }
  if (cameras.size () > 1 && board.is_ambiguous ())
    return bad ("board of " + std::to_string (board.columns) + "x" + std::to_string (board.rows) +
                " inner corners looks the same upside down, so that cameras cannot agree on it; "
                "use an odd and an even number, or a ChArUco board");
  return {};
}

Status
calibrate_rig (const std::vector<CalibrationCamera> &cameras, std::vector<CalibrationFrame> frames,
    const CalibrationSettings &settings, CalibrationResult &result, std::stop_token stop)
{
  result = {};
  if (Status s = check_cameras (cameras, settings.board); !s.ok ())
    return s;
  if (settings.min_frames < 3)
    return bad ("min-frames is " + std::to_string (settings.min_frames) + "; use 3 or more");
  for (const CalibrationFrame &frame : frames)
    for (const Sighting &sighting : frame.sightings)
      if (sighting.camera < 0 || sighting.camera >= int (cameras.size ()) ||
          std::ranges::any_of (sighting.corners, [&] (const BoardCorner &c) {
            return c.id < 0 || c.id >= settings.board.corner_count ();
          }))
        return bad ("a frame has a camera or a corner that does not exist");
  try {
    return Calibration (cameras, frames, settings, result, std::move (stop)).run ();
  } catch (const std::exception &e) {
    return bad (std::string ("calibration: ") + e.what ());
  }
}

} // namespace rangecast
