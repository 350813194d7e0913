/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* A head whose surface and colour are known, seen by cameras that are not perfect. */
#pragma once

#include <memory>
#include <string>

#include "frames.hpp"
#include "surface.hpp"

namespace bench {

enum class DepthNoise {
  kExact,
  kSmooth, ///< normal, 3 mm, alike over about 10 pixels
  kStereo, ///< a pair of pictures with 1.5 grey levels of noise, matched as stereodepth does
};
const char *name_of (DepthNoise noise);

struct HeadSettings {
  std::string model;  ///< glTF or OBJ; empty: the built-in figure
  unsigned dress = 0; ///< of the built-in figure, rangecast::DressFlags
  int views = 4, width = 320, height = 240;
  DepthNoise noise = DepthNoise::kExact;
  double colour_noise = 0;          ///< of the pictures, grey levels
  double pose_mm = 0, pose_deg = 0; ///< what the rig is told wrong of each camera, any direction
};

/** What is seen, and what is true about it. */
struct Head {
  FrameSet set;                                     ///< its rig has the pose errors
  rangecast::Rig rig;                               ///< the true one
  std::vector<std::vector<std::uint16_t>> depth;    ///< exact; depth units
  std::vector<std::vector<rangecast::Rgbx>> colour; ///< without noise
  std::shared_ptr<const Surface> surface;
  double nose_y = 0; ///< height of the tip of the nose, metres
};

rangecast::Status make_head (const HeadSettings &settings, Head &head);

} // namespace bench
