/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "../geometry/rig.hpp"
#include "../geometry/world_points.hpp"
#include "view_pairs.hpp"

namespace rangecast {

/** Makes the cameras of a rig agree on colour: a gain for each view and channel, found where views
 *  see the same surface.
 *
 *  A grid of pixels of each view (another grid in each frame) is looked up in the other views;
 *  where the depths agree, and both see the surface well, the ratio of both colours is taken. For
 * each pair of views and each channel the median of the ratios' logarithms is the difference
 * of their gains; least squares over all pairs, each weighted by how much it shares, makes one gain
 * of each view. Their median stays 1: a camera whose exposure is wrong does not change the others.
 * A gain on values that went through a camera's gamma curve stands for exposure and white balance,
 * which are gains before it, as long as the curve is near a power. */
class ColourBalance {
public:
  using Gains = std::array<float, 3>; ///< red, green, blue

  /** No gain is larger than this, or smaller than its inverse. */
  static constexpr float kMaxGain = 1.75f;
  /** Weight of a new frame. */
  static constexpr float kShareOfNew = 0.1f;
  /** Smaller gains are not applied, and larger ones are reduced by this (0.2 %, a quarter of a
   *  level), so that the colours of cameras which agree do not change in any bit. */
  static constexpr float kLeftUndone = 0.002f;

  /** Sets the cameras, of a valid rig; gains are kept. */
  void set_rig (const Rig &rig);
  void reset ();

  /** Learns from the images' overlaps, and multiplies their colours; depth is only read. Images
   *  without colour are left alone. The statistics of a pair of views are kept while one of them is
   *  missing. Nothing is allocated once all views have been seen together.
   *  @param images  of views of the rig */
  void process (std::span<const RangeImage> images, int threads);

  /** Factors of a view's colours in the last frame. */
  [[nodiscard]] Gains gains (int view_id) const;
  /** Whether they have been learnt. */
  [[nodiscard]] bool has_gains (int view_id) const
  {
    return view_id >= 0 && view_id < kMaxViews && (started_ >> view_id & 1);
  }

private:
  static constexpr int kBins = 640; /* of a histogram */
  using Histogram = std::array<float, kBins>;
  /* Of log (colour of `first` / colour of `second`), for each channel. */
  struct Pair {
    int first = 0, second = 0; /* view-ids, the smaller one first */
    std::array<Histogram, 3> ratios{};
  };
  struct Camera {
    PixelRays rays;
    PixelLookup lookup;
    float max_difference = 0; /* of the depth of two views of one surface, depth units */
    float steepest = 0;       /* change of depth a pixel at 60 degrees, as a share of depth */
  };

  void age (std::span<const RangeImage> images);
  void count_ratios (std::span<const RangeImage> images, std::size_t from);
  void compare (std::span<const RangeImage> images, std::size_t from, int x, int y);
  void solve ();
  void follow (std::span<const RangeImage> images);
  double middle_of_linked (std::uint64_t views);

  std::array<Camera, kMaxViews> cameras_; /* by view-id */
  std::uint64_t started_ = 0;             /* bit i: the log gains of view-id i are known */
  std::uint64_t linked_ = 0;              /* bit i: view-id i shares surface with another one */
  std::uint32_t frame_ = 0;
  std::array<Gains, kMaxViews> log_gains_{}; /* by view-id; smoothed */
  std::array<int, kMaxViews> frames_{};      /* by view-id: that its gains were learnt from */
  std::array<Gains, kMaxViews> measured_{};  /* by view-id, of this frame */
  ViewPairs<Pair> pairs_;                    /* of views that were there together */
  bool fresh_ = true; /* some of this frame's pairs have counted nothing yet */
  std::vector<double> matrix_, right_, sorted_; /* of the least squares */
};

} // namespace rangecast
