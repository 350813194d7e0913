/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <rangecast/surface/scene_fit.hpp>
#include <vector>

#include "scene.hpp"

/** Fits the camera to the first frame sets of a stream: to the first one that has points, then
 * again every half second until the view stays about the same and every view that had points still
 * has some, or some have had none for five seconds. From then on the fit holds, so that the picture
 * never follows movements. Streaming thread.
 */
class ViewFit {
public:
  /** What a fit is made for. */
  struct Picture {
    rangecast::Orbit orbit;
    double aspect = 1;                      ///< width / height
    GstClockTime pts = GST_CLOCK_TIME_NONE; ///< of the frame set
    guint home_requests = 0;                ///< another number asks for a new fit
  };

  /** Forgets the fit. */
  void reset () { *this = {}; }
  /** The frame in which to draw the scene, which must be built; its own as long as it has no
   * points. A picture of another shape or field of view has the same points fitted anew. */
  [[nodiscard]] const rangecast::SceneFrame &update (
      const StripScene &scene, const Picture &picture);

private:
  [[nodiscard]] bool is_due (GstClockTime pts) const;
  [[nodiscard]] bool is_moved_by_hand (const rangecast::Orbit &orbit) const;
  void refit (const StripScene &scene, const Picture &picture);

  bool fitted_ = false, settled_ = false;
  GstClockTime tried_ = GST_CLOCK_TIME_NONE; /* PTS of the last frame set that was looked at */
  GstClockTime complete_ = 0;                /* PTS of the last one with points in all `views_` */
  std::size_t views_ = 0;                    /* with points */
  std::vector<rangecast::Vec3> points_, candidates_; /* of the fit; of the frame set looked at */
  Picture picture_;                                  /* that the fit is for */
  rangecast::SceneFrame frame_;
};
