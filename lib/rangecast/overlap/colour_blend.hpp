/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "colour_cameras.hpp"

namespace rangecast {

/** Lets colours pass into one another where the points of one view end and another's begin.
 *
 *  A view's point beside one that was cleared (and that another view still has) lies on a seam. In
 *  cells of 8 x 8 pixels along seams, what the view saw is compared with what the other view saw of
 *  the same points: the ratio of both sums, for each channel. Each point of the view within
 *  `width_m` of the seam, counted along its surface (not across depth steps), is multiplied by a
 *  share of that ratio: half (of its difference from 1) at the seam, falling smoothly to nothing at
 *  the width. The other side does the same, so both sides meet at the mean of both. What is smaller
 *  than a cell stays the view's own: mixing points themselves would double every eyelash where
 *  depth or poses are a pixel off. Depth is never written. */
class ColourBlend {
public:
  /** Sets the cameras. */
  Status set_rig (const Rig &rig) { return cameras_.set (rig); }

  /** Stores the images' depths before overlaps are cleared. Allocates only for images with more
   *  pixels than all before.
   *  @return as ColourCameras::check(), kNoSpace without memory */
  Status remember (std::span<const RangeImage> images);

  /** Blends the colours of the same images, some of whose points are cleared now, with all colours
   *  as they were. Images without colour are left alone.
   *  @param width_m  0 .. 1; 0 = do nothing
   *  @return kBadSize if the images are not those that were remembered, kNoSpace without memory */
  Status blend (std::span<const RangeImage> images, double width_m, int threads);

private:
  /* How far a pixel is from the seam, and whose side lies behind it. */
  struct Seam {
    std::uint8_t distance; /* half pixels; kFar: none near */
    std::uint8_t other;    /* number of the image */
  };
  /* A pixel to be changed: by that share of the ratio. */
  struct Near {
    std::uint16_t x, y;
    float share;
  };
  using Colour = std::array<float, 3>;
  /* Sums over pixels along the seam: what the view has, and what the other one saw of it. */
  struct Cell {
    Colour mine{}, theirs{};
    void add (const Cell &other, float weight);
  };
  /* What belongs to one image. */
  struct Work {
    std::vector<Near> near;
    std::vector<Cell> cells; /* row by row */
    std::vector<Colour> ratios;
    int first = 0, last = -1; /* rows with seams */
    int nearest = 0;          /* depth of seams */
  };
  using Images = std::span<const RangeImage>;

  [[nodiscard]] std::uint16_t before (Images images, std::size_t i, int x, int y) const
  {
    return before_[begin_[i] + static_cast<std::size_t> (y) * images[i].depth.width + x];
  }
  Status work (Images images, double width_m, int threads);
  void find_lost (Images images, std::size_t i);
  void find_seams (Images images, std::size_t i);
  [[nodiscard]] int owner_of (Images images, std::size_t i, int x, int y) const;
  [[nodiscard]] int seam_at (Images images, std::size_t i, int x, int y) const;
  [[nodiscard]] int farthest (const RangeImage &image, const Work &work, float width_m) const;
  void spread (Images images, std::size_t i, int max_distance, bool down);
  void find_near (Images images, std::size_t i, int max_distance, float width_m);
  void compare (Images images, std::size_t i);
  bool seen_by (
      Images images, std::size_t j, const float point[3], Colour &colour, float &trust) const;
  void find_ratios (const RangeImage &image, Work &work) const;
  void change (const RangeImage &image, const Work &work) const;

  ColourCameras cameras_;
  std::vector<std::size_t> begin_; /* of each image in what follows, and the end */
  std::vector<std::uint16_t> before_;
  std::vector<std::uint8_t> lost_; /* 1: was cleared */
  std::vector<Seam> seams_;
  std::array<Work, kMaxViews> works_; /* of each image */
};

} // namespace rangecast
