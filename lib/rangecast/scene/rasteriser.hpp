/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <vector>

#include "../geometry/camera.hpp"
#include "mesh.hpp"

namespace rangecast {

/** A corner of a triangle as a camera sees it. */
struct RasterVertex {
  float x, y;          ///< pixels; (0, 0) is the centre of the top-left pixel
  float inverse_depth; ///< 1 / m; 0 or less: behind the camera, its triangles are skipped
  float u, v;          ///< texture, 0 to 1
  float light;         ///< the texture's colour is multiplied by it, 0 to 1
  float back_light;    ///< the same of the other side, if the mesh is double-sided
};

/** Draws textured triangles into a picture, nearest first by z-buffer. Coverage is decided at pixel
 *  centres in fixed point (1/256 pixel), so that meshes have no cracks; depth, texture and light
 *  are exact at pixel centres (linear in 1/z). The texture is sampled bilinearly in the mip level
 *  that fits the triangle's size. Silhouettes are not antialiased. */
class Rasteriser {
public:
  /** Starts a picture behind and in front of surfaces drawn before; allocates only if it is larger
   *  than any before. @param inverse_depth  1/z, 1/m, row by row */
  void begin (int width, int height, const std::vector<float> &inverse_depth);
  /** Draws what faces the camera, and the rest of a double-sided mesh.
   *  @param vertices  the mesh's as the camera sees them */
  void draw (const std::vector<RasterVertex> &vertices, const Mesh &mesh, ImageView<Rgbx> colour);
  /** 1/z of what was drawn, 1/m, row by row; 0 where nothing was. */
  [[nodiscard]] const float *row (int y) const
  {
    return inverse_depth_.data () + static_cast<std::size_t> (y) * width_;
  }

private:
  struct Plane;
  struct Corner;
  template <bool kPlain>
  void triangle (
      const Corner &a, const Corner &b, const Corner &c, const Mesh &mesh, ImageView<Rgbx> colour);

  int width_ = 0, height_ = 0;
  std::vector<float> inverse_depth_;
};

} // namespace rangecast
