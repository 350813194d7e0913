/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "../geometry/range_image.hpp"
#include "orbit.hpp"
#include "surface_scene.hpp"

namespace rangecast {

/** A frame set without a time. */
inline constexpr std::uint64_t kNoPts = UINT64_MAX;

/** Fits the camera to the first frame sets of a stream: to the first one with points, then every
 *  half second until two fits agree and every view that had points still has some, or some have had
 *  none for five seconds. From then on the fit holds, so that the camera does not follow movements.
 *  For one thread at a time. */
class ViewFit {
public:
  /** What a fit depends on. */
  struct Picture {
    Orbit orbit;
    double aspect = 1;          ///< width / height
    std::uint64_t pts = kNoPts; ///< of the frame set, ns
    unsigned home_requests = 0; ///< a change requests a new fit
  };

  /** Forgets the fit. */
  void reset () { *this = {}; }
  /** The camera's default position for a scene that is built; the scene's own before the first fit.
   *  A picture of another shape or field of view has the same points fitted again. */
  [[nodiscard]] const SceneFrame &update (const SurfaceScene &scene, const Picture &picture);

private:
  [[nodiscard]] bool user_moved_camera (const Orbit &orbit) const;
  void refit (const SurfaceScene &scene, const Picture &picture);

  bool fitted_ = false, settled_ = false;
  std::uint64_t tried_ = kNoPts;          /* PTS of the last frame set that was examined */
  std::uint64_t complete_ = 0;            /* PTS of the last one with points in `views_` views */
  std::size_t views_ = 0;                 /* with points */
  std::vector<Vec3> points_, candidates_; /* of the fit; of the frame set that is examined */
  Picture picture_;                       /* that the fit is for */
  SceneFrame frame_;
};

/** The scene with another target and distance: the points, seen from the orbit's direction with its
 *  field of view, are in the middle of the picture and fill 85 % of its width or height, whichever
 *  they reach first. The target is in the middle of their depth, and the principal point in the
 *  middle of the picture. The outermost 0.2 % of the points at each edge are treated as noise.
 *  @param aspect  width / height of the picture
 *  @param points  world, metres; if there are none, the scene stays as it is */
SceneFrame fitted_frame (
    const SceneFrame &scene, const Orbit &orbit, double aspect, std::span<const Vec3> points);

} // namespace rangecast
