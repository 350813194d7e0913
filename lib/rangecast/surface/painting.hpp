/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* One picture of a frame set, and the numbers that follow from it: for lib/rangecast/render, and
 * for the shaders of shaders.hpp in OpenGL and WebGL2. */
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "orbit.hpp"
#include "shaders.hpp"
#include "surface_scene.hpp"

namespace rangecast {

/** Metres by which a view's surfaces move away from the viewer, times 1 - cosine of the angle
 *  between the two's directions; not in mode kBlend. More than stereo's noise, less than a nose:
 *  with 4, 12, 40 and 100 mm PSNR is 42.9, 43.4, 43.3 and 43.3 dB. */
inline constexpr double kViewGap_m = 0.012;
/** Mode kBlend: metres behind the nearest surface within which views are blended, divided by the
 * sine of ViewCotangent. */
inline constexpr double kBlendRange_m = 0.02;
/** The background, sRGB, 0xRRGGBB. */
inline constexpr unsigned kBackgroundColour = 0x20242a;

/** What to draw of a frame set. Row 0 of the picture is at y = -1 in clip coordinates. */
struct SurfacePicture {
  Mat4 clip_from_world;
  StripMode mode = StripMode::kBlend;
  float background[4] = {0, 0, 0, 1}; ///< R, G, B, A, straight, 0 to 1
  float background_shade = 0; ///< share by which the colour is lighter in the first row and darker
                              ///< in the last one
  float point_size = 1;       ///< mode kPoints: in footprints of a pixel
  float pixels_per_unit = 1;  ///< pixels that a length of 1 at a distance of 1 covers
  bool back_faces = false;    ///< mode kStrips: draws both sides; mode kBlend always does
  double blend_range_m = kBlendRange_m; ///< mode kBlend: metres behind the nearest surface within
                                        ///< which views are blended
  int width = 0, height = 0;            ///< of the whole output, pixels
  Roi part;                             ///< of it that the picture fills
  Roi covered = {};                     ///< of that: all pixels that may show something, and a
                                        ///< margin of at least one pixel

  /** Whether triangles seen from behind are left out: noise turns many a single rectangle over. */
  [[nodiscard]] bool culls () const { return mode == StripMode::kStrips && !back_faces; }
};

/** Pass 1: each view is drawn into a cell of one framebuffer of its own; in modes other than kBlend
 * all into one. Cells are as large as the part of the picture that may be covered. With more views
 * than cells, those that look least as the viewer does share the last one, where the nearest
 * surface counts. */
struct BlendAtlas {
  int width = 0, height = 0; ///< of all cells together
  std::size_t cells = 0;
  std::array<std::array<int, 2>, kMaxBlendCells> from_picture{}; ///< what leads from a pixel of
                                                                 ///< the picture to a cell's
  std::vector<std::size_t> cell_of;                              ///< by number of the layer
};
/** Number of the cell of each layer, in `to`. @param alignments  view_alignment() of each layer */
void choose_cells (
    std::span<const double> alignments, std::size_t cells, std::vector<std::size_t> &to);
/** @param alignments   view_alignment() of each layer
 *  @param max_cells    from 1
 *  @param covered      part of the picture, not empty
 *  @param max_side     of a texture, pixels; at least those of `covered`
 *  @param[out] to      replaced; keeps its memory */
void make_blend_atlas (std::span<const double> alignments, std::size_t max_cells,
    const Roi &covered, int max_side, BlendAtlas &to);

/** Where a layer is drawn: u_clip_from_pixel and u_behind. */
struct LayerPlace {
  Mat4 clip_from_pixel;
  float behind[2];
};
LayerPlace place_layer (const Mat4 &clip_from_pixel, const Mat4 &clip_from_world, double gap_m);

/** Metres by which a view's surfaces move away from the viewer. Mode kBlend: views that look
 * against the viewer show the inside of surfaces, which fills holes, but must not hide an outside a
 * little behind it. Other modes: where two views see one surface, the one that looks more as the
 * viewer does is in front: it has more pixels there, and noise must not let both show. */
double layer_gap (StripMode mode, const Mat4 &clip_from_world, const View &view);

/** The angle between a view's ray and the viewer's: u_lens, u_viewer and u_unit. */
struct LayerAngles {
  float lens[4];   ///< principal point in the ROI, 1 / focal lengths; pixels
  float viewer[3]; ///< in the view's camera coordinates, metres
  float unit;      ///< metres per depth unit
};
LayerAngles layer_angles (const Mat4 &clip_from_world, const View &view, const Roi &roi);

/** Longest gap that pass 3 fills, pixels: gaps up to half of it take the colours around them, wider
 *  ones a share of those. */
int fill_reach (int picture_height);

/** Pixels that a length of 1 at a distance of 1 covers. @param height  of the picture, pixels */
double pixels_per_unit (const SceneFrame &scene, const Orbit &orbit, int height);

} // namespace rangecast
