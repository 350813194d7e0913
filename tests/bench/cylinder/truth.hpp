/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What is left of a frame set, against the true surface. */
#pragma once

#include <string>
#include <vector>

#include "frames.hpp"
#include "surface.hpp"

namespace bench {

/** What a method came to. Shares are 0 to 1. */
struct Verdict {
  std::size_t points = 0; ///< that are left
  double removed = 0;     ///< share of the points that were there
  /** Of the cells (4 mm high, 360 round the vertical through the middle of all points) that hold
   *  points, those in which points of several views share a surface (no gap of 3 cm between). */
  double cells_double = 0;
  /** Thickness of the surface in a slice 8 mm high: in each 5 degrees the range from the 10 % to
   *  the 90 % of the points' heights above the true surface. Mean and 95 % of all angles. */
  double thickness_mm = 0, thickness95_mm = 0;
  double distance_mm = 0, distance95_mm = 0; ///< of what is left to the true surface: median, 95 %
  /** Of the surface that cameras see, what has no point within 2 pixels' width along it and 20 mm
   *  across it; and with 6 mm across it, which stereo's own errors exceed. */
  double uncovered = 0, uncovered_6mm = 0;
  std::size_t strips = 0, isolated = 0; ///< as striprender would draw what is left
};

/** Knows what is true about a frame set, and judges what is left of it. */
class Judge {
public:
  /** @param set       with its fresh points
   *  @param visible   places of the true surface that should be covered
   *  @param slice_y   height of the slice, metres */
  Judge (FrameSet &set, const Surface &surface, std::vector<Sample> visible, double slice_y);

  /** @param set  the same set, with some points cleared */
  [[nodiscard]] Verdict judge (FrameSet &set) const;

  /** Those of the places that have a fresh point. */
  [[nodiscard]] std::vector<Sample> covered (const FrameSet &set) const;

private:
  void find_covers (double reach);
  void find_slice (double slice_y);
  [[nodiscard]] double cells_double (const std::vector<char> &alive) const;
  void judge_slice (const std::vector<char> &alive, Verdict &verdict) const;
  void judge_distance (const std::vector<char> &alive, Verdict &verdict) const;
  [[nodiscard]] std::vector<char> alive_in (const FrameSet &set) const;
  [[nodiscard]] bool is_covered (
      std::size_t sample, const std::vector<char> &alive, double across) const;

  std::vector<Spot> spots_;
  std::vector<double> height_; /* of each spot above the true surface, metres */
  rangecast::Vec3 middle_;
  std::vector<Sample> visible_;
  std::vector<std::uint32_t> covers_begin_, covers_; /* spots that cover each of visible_ */
  std::vector<float> across_;                     /* of each of covers_: metres off the surface */
  std::vector<std::vector<std::uint32_t>> slice_; /* spots of each angle */
};

/** Places of the surface that at least one camera sees.
 *  @param depth  exact depth of each view of the rig, depth units */
std::vector<Sample> visible_places (const Surface &surface, const rangecast::Rig &rig,
    const std::vector<std::vector<std::uint16_t>> &depth);

} // namespace bench
