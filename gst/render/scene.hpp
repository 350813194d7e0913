/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <rangecast/surface/surface_scene.hpp>
#include <span>

#include "settings.hpp"
#include "stats.hpp"

/** A frame set prepared for the painters, with striprender's settings, statistics and errors. */
class StripScene : public rangecast::SurfaceScene {
public:
  void set_rig (const rangecast::Rig &rig);

  /** @return kNotFound if a view is not in the rig; kBadSize if an ROI does not lie in its view's
   *  image, or is larger than kMaxStripSide */
  [[nodiscard]] rangecast::Status check (std::span<const rangecast::RangeImage> images) const;

  /** Makes the strips of images that check() accepted. */
  void build (std::span<const rangecast::RangeImage> images, const StripRenderSettings &settings,
      const rangecast::Orbit &orbit, bool same_frame_set)
  {
    SurfaceScene::build (images, {settings.strips, settings.tint_views, settings.strips_serial},
        orbit, same_frame_set);
  }
  /** Sets the counters of the last build(). */
  void count_into (RenderStats &stats) const;

private:
  const rangecast::Rig *rig_ = nullptr;
};
