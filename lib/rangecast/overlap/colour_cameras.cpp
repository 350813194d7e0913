/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "colour_cameras.hpp"

#include <string>

namespace rangecast {

Status
ColourCameras::set (const Rig &rig)
{
  if (Status status = validate (rig); !status.ok ())
    return status;
  known = 0;
  for (const View &view : rig.views) {
    const double units_per_metre = 1 / view.depth_unit_m;
    of[static_cast<std::size_t> (view.id)] = {PixelRays (view), PixelLookup (view),
        static_cast<float> (kMaxDepthDifferenceM * units_per_metre),
        static_cast<float> (std::sqrt (3.0) / view.intrinsics.fx),
        static_cast<float> (view.intrinsics.fx * units_per_metre)};
    known |= std::uint64_t{1} << view.id;
  }
  return {};
}

Status
ColourCameras::check (std::span<const RangeImage> images) const
{
  if (images.size () > kMaxViews)
    return {StatusCode::kBadSize, "frame set: more than 64 views"};
  for (const RangeImage &image : images)
    if (image.view_id < 0 || image.view_id >= kMaxViews || !(known >> image.view_id & 1))
      return {StatusCode::kNotFound,
          "rig: no view " + std::to_string (image.view_id) + ", which the frame set has"};
  return {};
}

} // namespace rangecast
