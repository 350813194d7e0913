/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <vector>

#include "../../geometry/quantiser.hpp"
#include "../../geometry/range_image.hpp"
#include "coded_pixel.hpp"

namespace rangecast {

/** Pixels of slices that refer to an earlier frame set share motion in blocks of so many columns
 * and rows, counted from the top left of the view's full image. */
inline constexpr int kMotionBlock = 16;
/** Greatest |dx| and |dy|, and greatest |dz|. */
inline constexpr int kMaxMotion = 31, kMaxMotionDepth = 65535;

/** Which pixel of an earlier frame set a pixel may equal: at column + dx, row + dy, and dz depth
 *  codes further away. */
struct BlockMotion {
  std::int32_t dx = 0, dy = 0, dz = 0;

  friend bool operator== (const BlockMotion &, const BlockMotion &) = default;
};

/** A pixel moved by dz depth codes; kNoPixel stays that. */
constexpr PixelCode
displaced (PixelCode code, std::int32_t dz, std::int32_t last_depth)
{
  if (code == kNoPixel)
    return code;
  const auto depth = std::clamp (static_cast<std::int32_t> (code & 0xffff) + dz, 0, last_depth);
  return (code & ~PixelCode{0xffff}) | static_cast<PixelCode> (depth);
}

/** What of an earlier frame set the pixels of a row may equal.
 *  @param x, y  of the first pixel, in the view's full image
 *  @param motions  of the blocks that the row touches, from the left
 *  @param first_y, end_y  rows to which it may refer */
void fetch_displaced (const ReferencePlane &plane, int x, int y,
    std::span<const BlockMotion> motions, std::int32_t last_depth, int first_y, int end_y,
    std::span<PixelCode> to);

/** How many blocks columns x to x + columns - 1 touch. */
constexpr std::size_t
motion_blocks (int x, int columns)
{
  return static_cast<std::size_t> ((x + columns - 1) / kMotionBlock - x / kMotionBlock + 1);
}

/** The motion of a view's blocks when it was last found. Pieces of a frame set that are coded at
 * the same time all see that of frame sets before. */
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

/** Finds the motion of blocks between two frame sets of a view: that with which the most pixels
 *  come near enough to those of the earlier one. */
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
    const ReferencePlane &before; ///< with pixels as these profiles have them
    const Limits &limits;
  };

  /** @param threshold  of depth, R, G, B, codes
   *  @param near_by  motions that are likely: of neighbouring blocks
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
  void take_samples (const Pictures &pictures, const Area &area);
  Match match (const Pictures &pictures, Components threshold, const Area &area, int dx, int dy);

  std::vector<Sample> samples_;
  std::vector<std::int32_t> differences_;
  std::vector<std::int32_t> sorted_;
};

} // namespace rangecast
