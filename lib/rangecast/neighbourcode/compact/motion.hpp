/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "../../geometry/quantiser.hpp"
#include "../../geometry/range_image.hpp"
#include "coded_pixel.hpp"

namespace rangecast {

/** Side of the blocks of pixels that share their motion, in pixels, counted from the top left of
 * the view's full image. */
inline constexpr int kMotionBlock = 16;
/** Greatest |dx| and |dy|, greatest |dz| in depth codes, and greatest |slope_x| and |slope_y|. */
inline constexpr int kMaxMotion = 127, kMaxMotionDepth = 65535, kMaxMotionSlope = 63;

/** The place in an earlier frame set that a pixel may equal, between its pixels, and a plane that
 * is added to its depth. */
struct BlockMotion {
  std::int32_t dx = 0, dy = 0;           ///< quarters of a pixel
  std::int32_t dz = 0;                   ///< units of depth (MotionScale) at the block's centre
  std::int32_t slope_x = 0, slope_y = 0; ///< eighths of a unit from one pixel to the next

  friend bool operator== (const BlockMotion &, const BlockMotion &) = default;
};

/** Its numbers in the order of the bitstream. */
inline constexpr std::int32_t BlockMotion::*kMotionMembers[] = {&BlockMotion::dx, &BlockMotion::dy,
    &BlockMotion::dz, &BlockMotion::slope_x, &BlockMotion::slope_y};

/** What motion means in a slice: follows from its quantiser step of depth. */
struct MotionScale {
  std::int32_t unit = 1;       ///< of depth, codes
  std::int32_t max_gap = 0;    ///< pixels whose depth codes differ by more are not mixed
  std::int32_t last_depth = 0; ///< greatest depth code; depths are clamped to it

  MotionScale () = default;
  MotionScale (std::int32_t depth_step, std::int32_t last)
      : unit (std::max (depth_step / 8, 1)), max_gap (std::min (4 * depth_step, 1023)),
        last_depth (last)
  {
  }
};

/** Whether a reader accepts it. */
bool is_sound (const BlockMotion &motion, const MotionScale &scale);

/** Codes to be added to the depth of a pixel.
 *  @param x, y  its place relative to the top left of the block */
constexpr std::int32_t
depth_offset (const BlockMotion &m, const MotionScale &scale, int x, int y)
{
  return ((8 * m.dz + m.slope_x * (x - 7) + m.slope_y * (y - 7)) * scale.unit + 4) >> 3;
}

/** Fetches the pixels of an earlier frame set that the pixels of a row may equal, interpolated
 *  between its pixels (docs/formats/bitstream.md, "Slices without key"). kNoPixel where that needs
 * a pixel that was not received, and where there is none.
 *  @param plane       holds PixelCodes; kEmptyPixel where they are known to be invalid
 *  @param x, y        place of the first pixel in the view's full image
 *  @param motions     of the blocks that the row touches, from the left
 *  @param first_y, end_y  rows that may be referred to; kNoPixel outside of them */
void fetch_displaced (const ReferencePlane &plane, int x, int y,
    std::span<const BlockMotion> motions, const MotionScale &scale, int first_y, int end_y,
    std::span<PixelCode> to);

/** Number of blocks that columns x to x + columns - 1 touch. */
constexpr std::size_t
motion_blocks (int x, int columns)
{
  return static_cast<std::size_t> ((x + columns - 1) / kMotionBlock - x / kMotionBlock + 1);
}

/** The latest known motion of a view's blocks. Partitions of a frame set, which are coded in
 *  parallel, all see the motion of the frame sets before. */
class MotionMemory {
public:
  /** @param width, height  of the view's full image */
  void resize (int width, int height);
  /** Begins a frame set. */
  void begin () { before_ = now_; }

  [[nodiscard]] BlockMotion before (int x, int y) const { return before_[index (x, y)]; }
  /** To be called once for each block of a frame set. */
  void keep (int x, int y, const BlockMotion &motion) { now_[index (x, y)] = motion; }

private:
  [[nodiscard]] std::size_t index (int x, int y) const
  {
    return static_cast<std::size_t> (y / kMotionBlock) * across_ +
           static_cast<std::size_t> (x / kMotionBlock);
  }

  std::vector<BlockMotion> before_, now_;
  std::size_t across_ = 0;
};

/** Finds the motion of blocks between two frame sets of a view: of those that it tries, the one
 *  with the least error. */
class MotionSearch {
public:
  struct Area {              ///< of one block, and where it may refer to
    int x, y, width, height; ///< in the view's full image
    int first_y, end_y;
  };

  MotionSearch ();

  struct Pictures { ///< what to find motion between
    const ConstRangeImage &image;
    const DepthQuantiser &depth;
    const ColourQuantiser &colour;
    const ReferencePlane &before; ///< holds PixelCodes
    const MotionScale &scale;
  };

  /** @param threshold  of depth and colour, codes
   *  @param near_by  motions of neighbouring blocks, which are likely
   *  @param memory   of the view */
  BlockMotion find (const Pictures &pictures, Components threshold, const Area &area,
      std::span<const BlockMotion> near_by, MotionMemory &memory);

private:
  struct Sample {
    Components own; /* depth, Y, Co, Cg */
    int x, y;       /* in the view's full image */
  };
  /* A sample and the pixel that a motion gives it. */
  struct Pair {
    int x, y;           /* in the block */
    std::int32_t depth; /* own minus the other's */
    float colour_error; /* squared, in units of the threshold */
  };
  void collect_samples (const Pictures &pictures, const Area &area);
  void pair_up (const Pictures &pictures, const Area &area, const BlockMotion &m);
  [[nodiscard]] std::int32_t median_depth ();
  [[nodiscard]] float error_of (const MotionScale &scale, const BlockMotion &m) const;
  void fit_plane (const MotionScale &scale, BlockMotion &m) const;

  std::vector<Sample> samples_;
  std::vector<Pair> pairs_;
  std::vector<std::int32_t> sorted_;
  float depth_weight_ = 0;
  FloatComponents colour_weights_{};
};

} // namespace rangecast
