/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "view_fit.hpp"

#include <utility>

#include "../geometry/point_cloud.hpp"

namespace rangecast {
namespace {

constexpr std::uint64_t kInterval_ns = 500'000'000;
constexpr std::uint64_t kMaxWait_ns = 5'000'000'000; /* for views that have no points */
constexpr std::size_t kMaxPoints = 16384;            /* of all views: enough for a fit */
constexpr std::size_t kMinPoints = 16;

/* @return in how many views the points are; 0 if they are too few */
std::size_t
sample_points (const SurfaceScene &scene, std::vector<Vec3> &points)
{
  std::size_t count = 0, views = 0;
  for (const SurfaceLayer &layer : scene.layers ()) {
    const std::size_t of_view = count_points (layer.image);
    count += of_view;
    views += of_view > 0;
  }
  if (count < kMinPoints)
    return 0;
  points.clear ();
  points.reserve (kMaxPoints + kMaxViews);
  for (const SurfaceLayer &layer : scene.layers ())
    append_points (layer.image, *layer.view, count / kMaxPoints + 1, points);
  return views;
}

} // namespace

bool
ViewFit::user_moved_camera (const Orbit &orbit) const
{
  const Orbit &before = picture_.orbit;
  return fitted_ &&
         (orbit.distance_m != before.distance_m || orbit.elevation_deg != before.elevation_deg ||
             norm (orbit.pan - before.pan) > 0);
}

void
ViewFit::refit (const SurfaceScene &scene, const Picture &picture)
{
  const std::size_t views = sample_points (scene, candidates_);
  tried_ = picture.pts;
  if (views >= views_ || picture.pts < complete_)
    complete_ = picture.pts;
  if (views == 0 || (views < views_ && picture.pts - complete_ < kMaxWait_ns))
    return;
  const SceneFrame frame =
      fitted_frame (scene.frame (), picture.orbit, picture.aspect, candidates_);
  const double fov = picture.orbit.fov_deg > 0 ? picture.orbit.fov_deg : frame.fov_deg;
  settled_ =
      picture.pts == kNoPts || (fitted_ && views == views_ && is_similar (frame, frame_, fov));
  if (settled_ && fitted_)
    return; /* no jump for a small difference */
  fitted_ = true;
  views_ = views;
  std::swap (points_, candidates_);
  picture_ = picture;
  frame_ = frame;
}

const SceneFrame &
ViewFit::update (const SurfaceScene &scene, const Picture &picture)
{
  if (std::exchange (picture_.home_requests, picture.home_requests) != picture.home_requests) {
    fitted_ = settled_ = false;
    views_ = 0;
  }
  if (user_moved_camera (picture.orbit))
    settled_ = true;
  if (!fitted_ || (!settled_ && (picture.pts < tried_ || picture.pts - tried_ >= kInterval_ns)))
    refit (scene, picture);
  if (points_.empty ())
    return scene.frame ();
  if (picture.aspect != picture_.aspect || picture.orbit.fov_deg != picture_.orbit.fov_deg) {
    picture_.aspect = picture.aspect;
    picture_.orbit.fov_deg = picture.orbit.fov_deg;
    frame_ = fitted_frame (scene.frame (), picture_.orbit, picture_.aspect, points_);
  }
  return frame_;
}

} // namespace rangecast
