/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Frame sets with their own pixels, and where they come from. */
#pragma once

#include <cstdint>
#include <rangecast/base/status.hpp>
#include <rangecast/geometry/range_image.hpp>
#include <rangecast/geometry/rig.hpp>
#include <string>
#include <vector>

namespace bench {

/** A frame set with its own pixels, which can be put back as they were. ROIs are whole pictures. */
struct FrameSet {
  rangecast::Rig rig; ///< range views, in the order of the images; what the work is told
  std::vector<std::vector<std::uint16_t>> depth, fresh;
  std::vector<std::vector<rangecast::Rgbx>> colour, fresh_colour; ///< empty: without colour

  std::vector<rangecast::RangeImage> images ();
  /** The same pixels, cut to the boxes of what was valid, as roiextract does. */
  std::vector<rangecast::RangeImage> images_in_boxes ();
  void restore ()
  {
    depth = fresh;
    colour = fresh_colour;
  }
  /** Valid pixels. */
  [[nodiscard]] std::size_t count () const;
};

/** A point, and the pixel that it comes from. */
struct Spot {
  int view, u, v; ///< view: number of the image
  rangecast::Vec3 point;
  std::size_t pixel; ///< in a row of all images' pixels, one image after the other
};

/** The valid pixels of a frame set as points of the world. */
std::vector<Spot> spots_of (FrameSet &set);

/** A bust of ellipsoids in the middle of views x (width x height), 1.5 mm of noise. */
FrameSet render_bust (int views, int width, int height);
/** A pillar that fills the pictures to their edges. */
FrameSet render_pillar (int views, int width, int height);

/** What pipelines/bunny-to-range.py wrote there. */
rangecast::Status load_bunny (const std::string &folder, FrameSet &set);

} // namespace bench
