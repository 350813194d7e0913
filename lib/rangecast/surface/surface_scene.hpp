/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "blend_planes.hpp"
#include "orbit.hpp"
#include "reduced_view.hpp"
#include "strips.hpp"

namespace rangecast {

/** One view of a frame set as it is drawn: a triangle strip, or points. */
struct SurfaceLayer {
  ConstRangeImage image;
  const View *view;
  std::span<const SurfaceVertex> vertices;
};

/** What the vertices of a scene depend on beside the frame set. */
struct SurfaceSettings {
  StripSettings strips;
  bool tint_views = false; ///< colours say which camera saw a point
  bool operator== (const SurfaceSettings &) const = default;
};

/** A frame set prepared for painters, and what follows from its rig. Keeps its memory from one
 *  frame set to the next. For one thread at a time. */
class SurfaceScene {
public:
  /** The rig must live as long as it is used here. Views that have left still count for frame(), so
   * that the picture does not turn, unless another one is elsewhere now: then this is another rig.
   *  @return whether it is the same rig, with other views or slightly corrected perhaps */
  bool set_rig (const Rig &rig);
  /** Forgets the views that have left. */
  void reset () { known_ = {}; }
  /** The camera's default position, from the rig and the views that have left. */
  [[nodiscard]] const SceneFrame &frame () const { return frame_; }
  [[nodiscard]] std::size_t rig_views () const { return rig_->views.size (); }

  /** Makes the strips of images, each of a view in the rig, its ROI in that view's image and no
   *  larger than kMaxStripSide. If it is the same frame set as last time and nothing that strips
   *  depend on has changed, they are kept. Colours are those of the images, or tinted. In mode
   *  kBlend, views that look against the viewer only fill holes: they are reduced to half their
   *  resolution. The images must stay mapped as long as the layers are used. */
  void build (std::span<const RangeImage> images, const SurfaceSettings &settings,
      const Orbit &orbit, bool same_frame_set);
  /** Changes with each build() that does not keep everything; never 0. */
  [[nodiscard]] std::uint64_t serial () const { return serial_; }
  [[nodiscard]] std::span<const SurfaceLayer> layers () const { return {layers_.data (), count_}; }
  /** Counters of a layer of the last build(). */
  [[nodiscard]] const StripResult &result (std::size_t layer) const { return results_[layer]; }
  /** World points around all points of the frame set. */
  [[nodiscard]] std::span<const Vec3> hull () const { return hull_; }

private:
  struct ViewMemory {
    std::vector<StripVertex> strips;
    std::vector<SurfaceVertex> vertices;
    std::vector<Rgbx> tinted;
    BlendPlanes planes;
    ReducedView reduced;
  };
  /* By number of the image: quarters of a pixel by which surfaces reach beyond their last pixels.
   */
  using Reaches = std::array<int, kMaxViews>;
  static constexpr int kReduced = -1; /* reach 1, and the image is halved */
  Reaches reaches_for (std::span<const RangeImage> images, const SurfaceSettings &settings,
      const Orbit &orbit) const;
  void build_view (std::size_t which, const SurfaceSettings &settings);

  const Rig *rig_ = nullptr;
  Rig known_; /* rig_ and the views that have left */
  SceneFrame frame_;
  std::array<ViewMemory, kMaxViews> memory_; /* by number in the frame set */
  std::array<StripResult, kMaxViews> results_{};
  std::array<SurfaceView, kMaxViews> views_;
  std::array<SurfaceLayer, kMaxViews> layers_;
  std::size_t count_ = 0; /* of the layers */
  std::vector<Vec3> hull_;
  SurfaceSettings built_with_;
  Reaches reaches_{};
  bool complete_ = false; /* the last build() did not throw, and the rig is still the same */
  std::uint64_t serial_ = 1;
};

} // namespace rangecast
