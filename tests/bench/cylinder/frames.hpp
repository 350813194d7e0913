/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Frame sets with their own pixels, and where they come from. */
#pragma once

#include <algorithm>
#include <chrono>
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

/** The median time of some calls of work, each on the set as it was; milliseconds. */
template <typename Work>
double
median_ms (FrameSet &set, int rounds, const Work &work)
{
  std::vector<double> ms;
  for (int i = 0; i < rounds; i++) {
    set.restore ();
    const auto start = std::chrono::steady_clock::now ();
    work ();
    const std::chrono::duration<double, std::milli> took =
        std::chrono::steady_clock::now () - start;
    ms.push_back (took.count ());
  }
  std::nth_element (ms.begin (), ms.begin () + std::ptrdiff_t (ms.size () / 2), ms.end ());
  return ms[ms.size () / 2];
}

/** What tests/bench/bunny-to-range.py wrote there. */
rangecast::Status load_bunny (const std::string &folder, FrameSet &set);

} // namespace bench
