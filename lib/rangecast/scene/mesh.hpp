/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "../geometry/image_view.hpp"

namespace rangecast {

/** A picture and its halvings, for textures. A pixel's x is its alpha. */
class MipMap {
public:
  /** @param pixels  width x height of level 0, row by row
   *  @param alpha_cutoff  not 0: each level's alpha is scaled so that as large a share of it
   *                       reaches the cutoff as of level 0: strands do not thin out with distance
   */
  MipMap (int width, int height, std::vector<Rgbx> pixels, std::uint8_t alpha_cutoff = 0);

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

/** How a texture continues outside of 0 to 1. */
enum class TextureWrap { kClamp, kRepeat, kMirror };

/** A textured surface; triangles are counter-clockwise seen from outside. */
struct Mesh {
  std::vector<MeshVertex> vertices;
  std::vector<std::array<std::uint32_t, 3>> triangles;
  std::vector<Rgbx> colours; ///< one a vertex, multiplied with the texture; empty: white
  std::shared_ptr<const MipMap> texture = plain_texture ({205, 160, 140, 255}); ///< plain skin
  TextureWrap wrap_u = TextureWrap::kClamp, wrap_v = TextureWrap::kClamp;
  std::uint8_t alpha_cutoff = 0; ///< where the texture's alpha is less, nothing is drawn
  bool double_sided = false;     ///< seen from inside too

  static std::shared_ptr<const MipMap> plain_texture (Rgbx colour);
};

/** The meshes of one person. */
using Figure = std::vector<Mesh>;

/** Sets each normal to the average of its triangles', weighted by area; vertices at the same
 *  place (texture seams) get the same normal. */
void compute_normals (Mesh &mesh);

/** Removes the vertices, and their colours, that belong to no triangle. */
void drop_unused_vertices (Mesh &mesh);

/** Values of model_top_m. */
inline constexpr double kTopAutomatic = -1, kTopAll = 0;
/** Height of the person that model_top_m is about, metres. */
inline constexpr double kPersonHeight = 1.8;

/** Scales and moves a figure so that its box lies round the origin, and lets what lies above the
 *  neck turn with the head.
 *  @param top_m  kTopAll: the greater of width and height becomes that of the built-in figure,
 *                0.5 m; more: the figure becomes a person of 1.8 m of whom only so much from the
 *                crown down is kept, and no more than 0.45 m off the axis, before which the cameras
 *                stand; kTopAutomatic: 0.5 m of what stands like a person (at least 3.5 times as
 *                high as deep), all of anything else
 *  @return false if no triangle is left */
bool fit_figure (Figure &figure, double top_m);

/** The built-in figure: head and shoulders, 0.5 m wide, about 13,000 triangles, closed; after that
 *  mesh, those of each accessory.
 *  @param seed   of hair, skin and shirt
 *  @param dress  DressFlags of scene.hpp */
Figure make_figure (std::uint32_t seed, unsigned dress = 0);

} // namespace rangecast
