/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "bundle.hpp"

#include <algorithm>
#include <ceres/ceres.h>
#include <ceres/rotation.h>
#include <thread>

namespace rangecast {
namespace {

constexpr int kMaxThreads = 8;
/* Number of cameras from which a sparse solver is used. */
constexpr int kManyCameras = 50;

using PoseParameters = std::array<double, 6>; // angle-axis, translation

PoseParameters
to_parameters (const Pose &pose)
{
  PoseParameters p;
  ceres::RotationMatrixToAngleAxis (ceres::RowMajorAdapter3x3 (pose.rotation.data ()), p.data ());
  p[3] = pose.translation.x;
  p[4] = pose.translation.y;
  p[5] = pose.translation.z;
  return p;
}

Pose
to_pose (const PoseParameters &p)
{
  Pose pose;
  ceres::AngleAxisToRotationMatrix (p.data (), ceres::RowMajorAdapter3x3 (pose.rotation.data ()));
  pose.translation = {p[3], p[4], p[5]};
  return pose;
}

/* Reprojection error of one corner in one image, pixels. */
struct CornerError {
  Vec3 on_board;
  double x, y;

  template <typename T>
  bool operator() (const T *lens, const T *camera, const T *board, T *residual) const
  {
    const T p[3] = {T (on_board.x), T (on_board.y), T (on_board.z)};
    T first[3], seen[3];
    ceres::AngleAxisRotatePoint (board, p, first);
    for (int i = 0; i < 3; i++)
      first[i] += board[3 + i];
    ceres::AngleAxisRotatePoint (camera, first, seen);
    for (int i = 0; i < 3; i++)
      seen[i] += camera[3 + i];
    if (!(seen[2] > T (kNearestM)))
      return false; /* behind the camera: not a solution */
    project (lens, seen, residual);
    residual[0] -= T (x);
    residual[1] -= T (y);
    return true;
  }
};

/* Ends the adjustment when the token requests it. */
class StopCallback : public ceres::IterationCallback {
public:
  explicit StopCallback (std::stop_token stop) : stop_ (std::move (stop)) {}
  ceres::CallbackReturnType operator() (const ceres::IterationSummary &) override
  {
    return stop_.stop_requested () ? ceres::SOLVER_ABORT : ceres::SOLVER_CONTINUE;
  }

private:
  std::stop_token stop_;
};

class Adjustment {
public:
  Adjustment (const Bundle &bundle, const BundleSettings &settings)
      : settings_ (settings), lenses_ (bundle.lenses)
  {
    for (const Pose &pose : bundle.camera_from_first)
      cameras_.push_back (to_parameters (pose));
    for (const Pose &pose : bundle.first_from_board)
      boards_.push_back (to_parameters (pose));
  }

  void add (const BoardSpec &board, const std::vector<CalibrationFrame> &frames)
  {
    std::vector<bool> used (cameras_.size ());
    for (std::size_t f = 0; f < frames.size (); f++)
      for (const Sighting &sighting : frames[f].sightings) {
        used[sighting.camera] = true;
        for (const BoardCorner &c : sighting.corners)
          problem_.AddResidualBlock (new ceres::AutoDiffCostFunction<CornerError, 2, 12, 6, 6> (
                                         new CornerError{board.corner (c.id), c.x, c.y}),
              settings_.robust_px > 0 ? new ceres::HuberLoss (settings_.robust_px) : nullptr,
              lenses_[sighting.camera].data (), cameras_[sighting.camera].data (),
              boards_[f].data ());
      }
    for (std::size_t i = 0; i < used.size (); i++)
      if (used[i])
        hold_lens (lenses_[i].data ());
    if (used[0])
      problem_.SetParameterBlockConstant (cameras_[0].data ());
  }

  bool solve (const std::stop_token &stop)
  {
    ceres::Solver::Options options;
    options.linear_solver_type =
        cameras_.size () > kManyCameras ? ceres::SPARSE_SCHUR : ceres::DENSE_SCHUR;
    options.max_num_iterations = 100;
    options.function_tolerance = 1e-10;
    options.gradient_tolerance = 1e-12;
    options.parameter_tolerance = 1e-10;
    options.num_threads = std::clamp (int (std::thread::hardware_concurrency ()), 1, kMaxThreads);
    options.logging_type = ceres::SILENT;
    StopCallback callback (stop);
    options.callbacks.push_back (&callback);
    ceres::Solver::Summary summary;
    ceres::Solve (options, &problem_, &summary);
    return summary.IsSolutionUsable ();
  }

  void get (Bundle &bundle) const
  {
    bundle.lenses = lenses_;
    for (std::size_t i = 0; i < cameras_.size (); i++)
      bundle.camera_from_first[i] = to_pose (cameras_[i]);
    for (std::size_t i = 0; i < boards_.size (); i++)
      bundle.first_from_board[i] = to_pose (boards_[i]);
  }

private:
  void hold_lens (double *lens)
  {
    const int model = int (settings_.distortion);
    if (model < 8) {
      std::vector<int> absent;
      for (int i = 4 + model; i < 12; i++)
        absent.push_back (i);
      problem_.SetManifold (lens, new ceres::SubsetManifold (12, absent));
    }
  }

  BundleSettings settings_;
  ceres::Problem problem_;
  std::vector<LensParameters> lenses_;
  std::vector<PoseParameters> cameras_, boards_;
};

} // namespace

Status
adjust_bundle (const BoardSpec &board, const std::vector<CalibrationFrame> &frames,
    const BundleSettings &settings, Bundle &bundle, std::stop_token stop)
{
  try {
    Adjustment adjustment (bundle, settings);
    adjustment.add (board, frames);
    const bool solved = adjustment.solve (stop);
    if (stop.stop_requested ())
      return {StatusCode::kInterrupted, "bundle adjustment was interrupted"};
    if (!solved)
      return {StatusCode::kBadValue, "no poses of the cameras fit all boards; trigger the "
                                     "cameras at the same time and hold the board still"};
    adjustment.get (bundle);
  } catch (const std::exception &e) {
    return {StatusCode::kBadValue, std::string ("bundle adjustment: ") + e.what ()};
  }
  return {};
}

} // namespace rangecast
