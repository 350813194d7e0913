/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "colour_cameras.hpp"

namespace rangecast {

/** Makes the cameras of a rig agree on colour: a gain for each view and channel, found where views
 *  see the same surface.
 *
 *  A grid of pixels of each view (another grid in each frame) is looked up in the other views;
 *  where the depths agree, and both see the surface well, the ratio of both colours is taken. For
 * each pair of views and each channel the median of the ratios' logarithms tells how their gains
 * differ; least squares over all pairs, each weighted by how much it shares, makes one gain of each
 * view. Their mean stays 1: nobody knows which camera is right. A gain on values that went through
 * a camera's gamma curve stands for exposure and white balance, which are gains before it, as long
 * as the curve is near a power. */
class ColourBalance {
public:
  using Gains = std::array<float, 3>; ///< red, green, blue

  /** No gain is larger than this, or smaller than its inverse. */
  static constexpr float kMostGain = 1.5f;
  /** A new frame counts that much. */
  static constexpr float kShareOfNew = 0.1f;
  /** This much of a gain (3 in 1000, half a level) is left undone, so that cameras which agree are
   *  left alone, bit by bit. */
  static constexpr float kLeftUndone = 0.003f;

  /** Takes the cameras and forgets the stream. */
  Status set_rig (const Rig &rig);
  void reset ();

  /** Learns from the images' overlaps, and multiplies their colours; depth is only read, and must
   *  be as it was before overlaps were cleared. Images without colour are left alone.
   *  Nothing is allocated once a frame set of so many views has been seen.
   *  @return as ColourCameras::check(); colours are then untouched */
  Status process (std::span<const RangeImage> images, int threads);

  /** What the colours of a view were multiplied with in the last frame. */
  [[nodiscard]] Gains gains (int view_id) const;

private:
  static constexpr int kBins = 640; /* of a histogram */
  using Histogram = std::array<float, kBins>;

  void age (std::span<const RangeImage> images);
  void count_ratios (std::span<const RangeImage> images, std::size_t from);
  void compare (std::span<const RangeImage> images, std::size_t from, int x, int y);
  void solve (std::span<const RangeImage> images);
  void follow (std::span<const RangeImage> images);
  [[nodiscard]] std::size_t pair (std::size_t i, std::size_t j, std::size_t channel) const;

  ColourCameras cameras_;
  std::uint64_t started_ = 0; /* bit i: the log gains of view-id i are known */
  std::uint64_t linked_ = 0;  /* bit i: image i shares surface with another one in this frame */
  std::uint32_t frame_ = 0;
  std::array<Gains, kMaxViews> log_gains_{}; /* by view-id; smoothed */
  std::array<int, kMaxViews> frames_{};      /* by view-id: that its gains were learnt from */
  std::array<Gains, kMaxViews> measured_{};  /* by number of the image, of this frame */
  std::vector<Histogram> ratios_;            /* of each pair of images and channel */
  std::array<int, kMaxViews> ids_{};         /* that these are of */
  bool fresh_ = true;                        /* they are empty */
  std::vector<double> matrix_, right_;       /* of the least squares */
  std::size_t images_ = 0;
};

} // namespace rangecast
