/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <span>

#include "../base/status.hpp"
#include "../geometry/range_image.hpp"
#include "../geometry/rig.hpp"
#include "../geometry/world_points.hpp"

namespace rangecast {

/** Maximum difference of depth of two views of one surface, metres: the error of stereo. Colours of
 *  two surfaces differ far more than those of two places of one. */
inline constexpr double kMaxDepthDifferenceM = 0.015;

/** The cameras of a rig, by view-id, to find in one view what another one sees. */
struct ColourCameras {
  struct Camera {
    PixelRays rays;
    PixelLookup lookup;
    float max_difference = 0;   ///< kMaxDepthDifferenceM in depth units
    float steepest = 0;         ///< change of depth a pixel at 60 degrees, as a share of depth
    float pixels_per_metre = 0; ///< times depth units: at depth d a metre has this / d pixels
  };
  /** A pixel of a plane (not of the full image), and depth, in the view's units. */
  struct Place {
    float x, y, depth;
  };

  std::array<Camera, kMaxViews> of;
  std::uint64_t known = 0; ///< bit i: view-id i is in the rig

  /** Takes the cameras. */
  Status set (const Rig &rig);
  /** @return kBadSize for more than kMaxViews images, kNotFound for a view that the rig has not */
  [[nodiscard]] Status check (std::span<const RangeImage> images) const;

  /** The world point of a plane's pixel, metres. */
  void point (const RangeImage &image, int x, int y, std::uint16_t depth, float out[3]) const
  {
    of[static_cast<std::size_t> (image.view_id)].rays.point (
        static_cast<float> (image.roi.x + x), static_cast<float> (image.roi.y + y), depth, out);
  }

  /** Where an image has a point of the world. @return false if that is not on its plane */
  bool find (const RangeImage &image, const float point[3], Place &place) const
  {
    of[static_cast<std::size_t> (image.view_id)].lookup.find (point, place.x, place.y, place.depth);
    place.x -= static_cast<float> (image.roi.x);
    place.y -= static_cast<float> (image.roi.y);
    /* False for NaN. */
    return place.depth > 0 && place.x >= 0 && place.y >= 0 &&
           place.x <= static_cast<float> (image.depth.width - 1) &&
           place.y <= static_cast<float> (image.depth.height - 1);
  }

  /** The pixel that a place falls on. */
  static int column (const Place &place) { return static_cast<int> (place.x + 0.5f); }
  static int row (const Place &place) { return static_cast<int> (place.y + 0.5f); }
};

/** Whether an image has colours. */
inline bool
has_colour (const RangeImage &image)
{
  return !image.depth.empty () && image.colour.same_size (image.depth);
}

} // namespace rangecast
