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

/** A frame set made ready to be painted, and what its rig tells of the scene. Streaming thread.
 *  Memory is kept from one frame set to the next. */
class StripScene {
public:
  void set_rig (const rangecast::Rig &rig);
  [[nodiscard]] const rangecast::SceneFrame &frame () const { return frame_; }
  [[nodiscard]] std::size_t rig_views () const { return rig_->views.size (); }
  /** Where the rig's cameras stand and what they see. */
  [[nodiscard]] std::span<const rangecast::LineVertex> camera_lines () const { return lines_; }

  /** @return kNotFound if a view is not in the rig; kBadSize if an ROI does not lie in its view's
   *  image, or is larger than kMaxStripSide */
  [[nodiscard]] rangecast::Status check (std::span<const rangecast::RangeImage> images) const;

  /** Makes the strips of images that check() has found good; if it is the same frame set as the
   * last time and nothing that strips depend on has changed, all is still there. Colours are of the
   * images, or tinted (tint-views). In mode blend views that look against the viewer are reduced to
   * half their resolution: they only fill holes. The images must stay mapped as long as the layers
   * are used. */
  void build (std::span<const rangecast::RangeImage> images, const StripRenderSettings &settings,
      const rangecast::Orbit &orbit, bool same_frame_set);
  /** Another one after each build() that made something else than the one before; never 0. */
  [[nodiscard]] guint64 serial () const { return serial_; }
  /** Of all views that the rig has. */
  [[nodiscard]] std::span<const RenderLayer> layers () const { return {layers_.data (), count_}; }
  /** World points that surround all points of the frame set. */
  [[nodiscard]] std::span<const rangecast::Vec3> hull () const { return hull_; }
  /** Of the last build(). */
  void count_into (RenderStats &stats) const;

private:
  struct ViewMemory {
    std::vector<rangecast::StripVertex> vertices;
    std::vector<rangecast::Rgbx> tinted;
    rangecast::BlendPlanes planes;
    std::vector<rangecast::BlendVertex> blend_vertices;
    rangecast::ReducedView reduced;
  };
  bool is_built (std::size_t images, const StripRenderSettings &settings) const;
  guint64 views_against (std::span<const rangecast::RangeImage> images,
      const StripRenderSettings &settings, const rangecast::Orbit &orbit) const;
  void build_view (std::size_t which, const StripRenderSettings &settings);
  void surround ();

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
  bool complete_ = false; /* the last build() was not broken off, and the rig is still that one */
  guint64 serial_ = 1;
};
