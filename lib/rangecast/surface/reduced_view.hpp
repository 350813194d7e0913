/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <vector>

#include "../geometry/range_image.hpp"
#include "../geometry/rig.hpp"

namespace rangecast {

/** A range image and the camera that took it. */
struct SurfaceView {
  ConstRangeImage image;
  const View *view;
};

/** A view of half the resolution, and its memory. */
class ReducedView {
public:
  /** Takes every second pixel of every second row of a view's ROI, which becomes the whole image.
   *  @return the reduced view; valid until the next call */
  SurfaceView reduce (const SurfaceView &from);
  /** Valid pixels of the view that was reduced. */
  [[nodiscard]] std::uint64_t points () const { return points_; }

private:
  View view_;
  std::vector<std::uint16_t> depth_;
  std::vector<Rgbx> colour_;
  std::uint64_t points_ = 0;
};

} // namespace rangecast
