/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <vector>

#include "../geometry/camera.hpp"
#include "../geometry/image_view.hpp"
#include "mesh.hpp"
#include "rasteriser.hpp"

namespace rangecast {

/** A wooden chair on the room's floor, left of the figure and 0.9 m behind it as view 0 sees it. */
Mesh make_chair (std::uint32_t seed);

/** The shadow that figures cast onto the room: a map of the directions in which the light of a lamp
 *  at the upper left of the front is blocked, with a soft rim. */
class ShadowMap {
public:
  ShadowMap ();
  [[nodiscard]] const Intrinsics &intrinsics () const { return intrinsics_; }
  [[nodiscard]] const Pose &world_from_lamp () const { return world_from_lamp_; }

  /** @name One moment: begin, add every mesh as the lamp sees it, end. @{ */
  void begin ();
  void add (const std::vector<RasterVertex> &vertices, const Mesh &mesh);
  void end ();
  /** @} */

  /** Darkens the room, before figures are drawn.
   *  @param room  1/z of the room, 1/m, row by row
   *  @param strength  fraction of the light that is blocked in full shadow */
  void darken (const Intrinsics &camera, const Pose &world_from_camera, const float *room,
      double strength, ImageView<Rgbx> colour) const;

private:
  [[nodiscard]] float at (Vec3 world) const;

  Intrinsics intrinsics_;
  Pose world_from_lamp_, lamp_from_world_;
  Rasteriser rasteriser_;
  std::vector<Rgbx> scratch_;
  std::vector<float> dark_, rows_; ///< 0 = lit, 1 = full shadow
};

} // namespace rangecast
