/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "../base/status.hpp"
#include "../geometry/range_image.hpp"
#include "../geometry/rig.hpp"

namespace rangecast {

/** Accessories of the built-in figure: surfaces in front of one another. */
enum DressFlags : unsigned {
  kDressHair = 1,    ///< long hair, with strands that hang free before cheeks and neck
  kDressGlasses = 2, ///< thin rims before the eyes
  kDressCollar = 4,  ///< a stiff white collar, open at the throat
  kDressHand = 8,    ///< a forearm and an open hand before the chest
  kDressAll = 15,
};

/** Settings of the synthetic rig. */
struct SceneSettings {
  int views = 4;           ///< 1 .. kMaxViews
  int width = 320;         ///< pixels, 16 .. 4096
  int height = 240;        ///< pixels, 16 .. 4096
  double arc_deg = 360;    ///< 360: a full ring, view 0 on +z; less: an arc with +z in its middle
  double distance_m = 0.8; ///< of the left cameras from the y axis, 0.5 .. 1.2
  double baseline_m = 0.1; ///< left to right, and left to third, 0.01 .. 0.3
  double noise_sigma = 1;  ///< sensor noise, grey levels, 0 .. 20
  double motion = 1;       ///< of the figure: 0 = still, 1 = as of a person who talks, up to 2
  std::uint32_t seed = 1;  ///< of all patterns and of the noise
  std::string model;       ///< glTF file; empty: the built-in figure
  double model_top_m = -1; ///< of a model of 1.8 m, kept from the crown down, 0.1 .. 1.8; 0: all
                           ///< of it, 0.5 m large; -1: 0.5 m of a standing person, else all

  unsigned dress = 0;      ///< DressFlags of the built-in figure
  double far_m = 1.3;      ///< farthest depth, 1 .. 6; from 3.5 on it reaches the room's walls
  double wall_texture = 1; ///< contrast of the room's texture, 0 = plain .. 1
  double wall_warmth = 0;  ///< 0 = blue-grey walls .. 1 = as wood, skin and hair
};

enum class SceneCamera {
  kLeft,
  kRight, ///< baseline_m along the left camera's +x
  kThird, ///< baseline_m above the left camera
};

/** A moving head and shoulders in a textured room, seen by a rig of ideal stereo cameras (no
 *  distortion, rectified) with focal length = width. The same settings and times give the same
 *  pictures, in every process. Cameras are independent: different ones may be rendered at the same
 *  time. The first picture of a camera draws the room and allocates; later ones allocate nothing.
 */
class Scene {
public:
  /** @return kBadValue naming the setting; kNotFound, kBadData or kUnsupported naming the model */
  static Status create (const SceneSettings &settings, std::unique_ptr<Scene> &scene);
  ~Scene ();
  Scene (const Scene &) = delete;
  Scene &operator= (const Scene &) = delete;

  /** Raw rig: each view with its right and third camera; near 0.45 m, far as set, unit 0.1 mm. */
  [[nodiscard]] const Rig &rig () const;
  /** The rig of the exact range images: the left cameras alone. */
  [[nodiscard]] const Rig &range_rig () const;

  /** Draws what one camera sees.
   *  @param time_s   moment of the motion, seconds
   *  @param empty    the room without the figure
   *  @param[out] colour  H x W of the rig
   *  @param[out] depth   H x W, depth units at pixel centres, 0 outside near..far (so on the wall,
   *                      unless far reaches it); may be empty
   *  @param[out] mask    H x W, 1 = person, 0 = room; may be empty
   *  @return kNotFound if there is no such view, kBadSize if a picture has another size */
  Status render (int view_id, SceneCamera camera, double time_s, bool empty, ImageView<Rgbx> colour,
      ImageView<std::uint16_t> depth, ImageView<std::uint8_t> mask);

  /** Draws whole range images of several views, in parallel.
   *  @param images   each of another view, its ROI the full picture; pixels are written
   *  @param[out] boxes  the person's bounding box in each, empty if it is not to be seen
   *  @param n_threads  0 = number of cores */
  Status render_range (std::span<const RangeImage> images, double time_s, bool empty,
      std::span<Roi> boxes, int n_threads);

private:
  Scene ();
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

} // namespace rangecast
