/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <vector>

#include "../../geometry/quantiser.hpp"
#include "../../geometry/range_image.hpp"
#include "coded_pixel.hpp"

namespace rangecast {

/** Side of the blocks of pixels that share their motion, in pixels, counted from the top left of
 * the view's full image. */
inline constexpr int kMotionBlock = 16;
/** Greatest |dx| and |dy|, and greatest |dz|. */
inline constexpr int kMaxMotion = 31, kMaxMotionDepth = 65535;

/** The pixel of an earlier frame set that a pixel may equal: at column + dx, row + dy, and dz depth
 *  codes farther away. */
struct BlockMotion {
  std::int32_t dx = 0, dy = 0, dz = 0;

  friend bool operator== (const BlockMotion &, const BlockMotion &) = default;
};

/** Fetches the pixels of an earlier frame set that the pixels of a row may equal.
 *  @param x, y        place of the first pixel in the view's full image
 *  @param motions     of the blocks that the row touches, from the left
 *  @param last_depth  greatest depth code; depths are clamped to it
 *  @param first_y, end_y  rows that may be referred to; kNoPixel outside of them */
void fetch_displaced (const ReferencePlane &plane, int x, int y,
    std::span<const BlockMotion> motions, std::int32_t last_depth, int first_y, int end_y,
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

/** Finds the motion of blocks between two frame sets of a view: the one with which the most pixels
 *  are within the threshold of those of the earlier frame set. */
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
    const PixelLimits &limits;
  };

  /** @param threshold  of depth, R, G, B, codes
   *  @param near_by  motions of neighbouring blocks, which are likely
   *  @param memory   of the view */
  BlockMotion find (const Pictures &pictures, Components threshold, const Area &area,
      std::span<const BlockMotion> near_by, MotionMemory &memory);

private:
  struct Sample {
    Components own; /* depth, R, G, B */
    int x, y;
  };
  struct Match {
    BlockMotion motion;
    int hits = -1;
  };
  void collect_samples (const Pictures &pictures, const Area &area);
  Match match (const Pictures &pictures, Components threshold, const Area &area, int dx, int dy);

  std::vector<Sample> samples_;
  std::vector<std::int32_t> differences_;
  std::vector<std::int32_t> sorted_;
};

} // namespace rangecast
