/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>

#include "image_view.hpp"

namespace rangecast {

/** A rectangle of pixels in the full image of a view. Empty: all four are 0. */
struct Roi {
  int x = 0, y = 0;          ///< top-left pixel
  int width = 0, height = 0; ///< pixels

  [[nodiscard]] bool empty () const { return width <= 0 || height <= 0; }
  friend bool operator== (const Roi &, const Roi &) = default;
};

inline constexpr std::uint16_t kInvalidDepth = 0;
inline constexpr int kMaxViews = 64;
/** Maximum width and height of images in a rig, a range image or a bitstream, pixels. */
inline constexpr int kMaxImageSide = 16384;
/** Views times the widest times the tallest of a rig, pixels: 64 views of 1920x1080 are just below.
 *  A frame set has room for that much, which limits the memory that untrusted data can allocate. */
inline constexpr std::int64_t kMaxRigPixels = std::int64_t{1} << 27;

/** Depth and colour of one view at one capture time, cut to the ROI. Both planes have the ROI's
 *  size; plane pixel (0, 0) is image pixel (roi.x, roi.y). Depth is in the view's depth units,
 *  kInvalidDepth where there is none; the colour of invalid pixels is undefined.
 *  Does not own the pixels. */
template <typename DepthT, typename ColourT> struct BasicRangeImage {
  int view_id = 0; ///< 0 .. kMaxViews - 1
  Roi roi;
  ImageView<DepthT> depth;
  ImageView<ColourT> colour;
  std::uint64_t capture_time_ns = 0; ///< on the clock that the camera hosts share

  operator BasicRangeImage<const DepthT, const ColourT> () const
  {
    return {view_id, roi, depth, colour, capture_time_ns};
  }
};

using RangeImage = BasicRangeImage<std::uint16_t, Rgbx>;
using ConstRangeImage = BasicRangeImage<const std::uint16_t, const Rgbx>;

} // namespace rangecast
