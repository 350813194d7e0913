/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "../geometry/image_view.hpp"

namespace rangecast {

/** A picture and its halvings, for textures. */
class MipMap {
public:
  /** @param pixels  width x height of level 0, row by row */
  MipMap (int width, int height, std::vector<Rgbx> pixels);

  [[nodiscard]] int levels () const { return static_cast<int> (levels_.size ()); }
  [[nodiscard]] ImageView<const Rgbx> level (int i) const;

private:
  struct Level {
    int width, height;
    std::vector<Rgbx> pixels;
  };
  std::vector<Level> levels_;
};

struct MeshVertex {
  float x, y, z;    ///< metres; y up, the figure faces +z
  float nx, ny, nz; ///< outward, unit length
  float u, v;       ///< texture, 0 to 1; v = 0 is the texture's first row
  float head;       ///< 0: moves with the body; 1: turns with the head
};

/** A textured figure; triangles are counter-clockwise seen from outside. */
struct Mesh {
  std::vector<MeshVertex> vertices;
  std::vector<std::array<std::uint32_t, 3>> triangles;
  MipMap texture{1, 1, {Rgbx{205, 160, 140, 0}}}; ///< plain skin
};

/** Sets each normal to the average of its triangles', weighted by area; vertices at the same
 *  place (texture seams) get the same normal. */
void compute_normals (Mesh &mesh);

/** Scales and moves a figure to the size of the built-in one (0.5 m wide, its box round the
 *  origin) and lets what lies above the neck turn with the head. */
void fit_figure (Mesh &mesh);

/** The built-in figure: head and shoulders, 0.5 m wide, about 13,000 triangles, closed.
 *  @param seed  of hair, skin and shirt */
Mesh make_figure (std::uint32_t seed);

} // namespace rangecast
