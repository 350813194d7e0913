/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <rangecast/surface/camera_lines.hpp>
#include <rangecast/surface/orbit.hpp>
#include <span>
#include <vector>

#include "picture.hpp"
#include "settings.hpp"
#include "stats.hpp"

/** A frame set prepared for the painters, and what follows from its rig. Keeps its memory from one
 *  frame set to the next. For one thread at a time. */
class StripScene {
public:
  void set_rig (const rangecast::Rig &rig);
  /** The camera's default position, from the rig. */
  [[nodiscard]] const rangecast::SceneFrame &frame () const { return frame_; }
  [[nodiscard]] std::size_t rig_views () const { return rig_->views.size (); }
  /** The rig's cameras and their frusta. */
  [[nodiscard]] std::span<const rangecast::LineVertex> camera_lines () const { return lines_; }

  /** @return kNotFound if a view is not in the rig; kBadSize if an ROI does not lie in its view's
   *  image, or is larger than kMaxStripSide */
  [[nodiscard]] rangecast::Status check (std::span<const rangecast::RangeImage> images) const;

  /** Makes the strips of images that check() accepted. If it is the same frame set as last time and
   *  nothing that strips depend on has changed, they are kept. Colours are those of the images, or
   *  tinted (tint-views). In mode blend, views that look against the viewer only fill holes: they
   *  are reduced to half their resolution. The images must stay mapped as long as the layers are
   *  used. */
  void build (std::span<const rangecast::RangeImage> images, const StripRenderSettings &settings,
      const rangecast::Orbit &orbit, bool same_frame_set);
  /** Changes with each build() that does not keep everything; never 0. */
  [[nodiscard]] guint64 serial () const { return serial_; }
  [[nodiscard]] std::span<const RenderLayer> layers () const { return {layers_.data (), count_}; }
  /** World points around all points of the frame set. */
  [[nodiscard]] std::span<const rangecast::Vec3> hull () const { return hull_; }
  /** Sets the counters of the last build(). */
  void count_into (RenderStats &stats) const;

private:
  struct ViewMemory {
    std::vector<rangecast::StripVertex> vertices;
    std::vector<rangecast::Rgbx> tinted;
    rangecast::BlendPlanes planes;
    std::vector<rangecast::BlendVertex> blend_vertices;
    rangecast::ReducedView reduced;
  };
  guint64 views_against (std::span<const rangecast::RangeImage> images,
      const StripRenderSettings &settings, const rangecast::Orbit &orbit) const;
  void build_view (std::size_t which, const StripRenderSettings &settings);

  const rangecast::Rig *rig_ = nullptr;
  rangecast::SceneFrame frame_;
  std::vector<rangecast::LineVertex> lines_;
  std::array<ViewMemory, rangecast::kMaxViews> memory_; /* by number in the buffer */
  std::array<rangecast::StripResult, rangecast::kMaxViews> results_{};
  std::array<rangecast::SurfaceView, rangecast::kMaxViews> views_;
  std::array<RenderLayer, rangecast::kMaxViews> layers_;
  std::size_t count_ = 0; /* of the layers */
  std::vector<rangecast::Vec3> hull_;
  guint built_with_ = 0;  /* StripRenderSettings::strips_serial */
  guint64 reduced_ = 0;   /* bit i: number i of the images */
  bool complete_ = false; /* the last build() did not throw, and the rig is still the same */
  guint64 serial_ = 1;
};
