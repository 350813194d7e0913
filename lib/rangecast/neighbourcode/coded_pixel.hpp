/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What encoder and decoder of the profiles packed and entropy know of a pixel, and how they predict
 * one. docs/bitstream.md specifies it. */
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <span>

#include "reference.hpp"

namespace rangecast {

/** Where a pixel came from. Contexts are made of it. */
enum class Origin : std::uint8_t {
  kNone = 0,      ///< invalid, or outside the slice
  kLeft = 1,      ///< equals the left pixel
  kUpper = 2,     ///< equals one of the three above
  kPredicted = 3, ///< is what the neighbours let expect
  kCorrected = 4, ///< the same and a residual
};

/** What a slice of these profiles holds for one pixel. The first four are places of neighbours.
 *  kTakeEarlier is said apart from the others: the same pixel of an earlier frame set. */
enum PixelChoice : int {
  kTakeLeft,
  kTakeUpperLeft,
  kTakeUpper,
  kTakeUpperRight,
  kPredict,
  kCorrect,
  kTakeEarlier
};
inline constexpr int kChoices = 6;

/** Depth code and colour of a pixel as one number that can be compared: from bit 0 upwards, 16 bits
 *  each, depth, Y, Co, Cg. */
using PixelCode = std::uint64_t;

using Components = std::array<std::int32_t, 4>; /* depth, Y, Co, Cg */
inline constexpr int kComponents = 4;

constexpr PixelCode
pack_components (const Components &c)
{
  PixelCode code = 0;
  for (int i = 0; i < kComponents; i++)
    code |= PixelCode{static_cast<std::uint16_t> (c[i])} << 16 * i;
  return code;
}

constexpr Components
components_of (PixelCode code)
{
  const auto colour = [&] (int i) {
    return static_cast<std::int32_t> (static_cast<std::int16_t> (code >> 16 * i));
  };
  return {static_cast<std::int32_t> (code & 0xffff), colour (1), colour (2), colour (3)};
}

/** Of an invalid pixel, and of a valid one that refers to something that was not received. No other
 *  has it, because Y is not negative. */
inline constexpr PixelCode kNoPixel = ReferencePlane::kNone;

/** Sizes of a residual, at most 9 each, one a byte from the least significant; 0 for copies. */
using Activity = std::uint32_t;

/** Two plain numbers: it is copied for every pixel, and whole. */
struct CodedPixel {
  PixelCode code = kNoPixel;
  /* Its origin, from bit 8 its kind, from bit 16 its choice and one, from bit 32 its activity. The
   * choice is kept only in slices that refer to earlier frame sets. */
  std::uint64_t state = 0;

  constexpr CodedPixel () = default;
  constexpr CodedPixel (PixelCode pixel, Origin origin, Activity activity = 0)
      : code (pixel), state (static_cast<std::uint64_t> (origin) |
                             static_cast<std::uint64_t> (std::min (int (origin), 3)) << 8 |
                             std::uint64_t{activity} << 32)
  {
  }
  /** One that equals another. */
  static constexpr CodedPixel copy (PixelCode pixel, int choice)
  {
    const bool upper = choice >= kTakeUpperLeft && choice <= kTakeUpperRight;
    CodedPixel copied (pixel, upper ? Origin::kUpper : Origin::kLeft);
    copied.state |= static_cast<std::uint64_t> (choice + 1) << 16;
    return copied;
  }
  [[nodiscard]] constexpr bool valid () const { return state != 0; }
  /** Whether it was made by copy (..., choice). */
  [[nodiscard]] constexpr bool took (PixelChoice choice) const
  {
    return (state >> 16 & 0xff) == static_cast<std::uint64_t> (choice + 1);
  }
  [[nodiscard]] constexpr int origin () const { return static_cast<int> (state & 7); }
  /** The same, without a difference between predicted and corrected pixels. */
  [[nodiscard]] constexpr int kind () const { return static_cast<int> (state >> 8 & 3); }
  [[nodiscard]] constexpr Activity activity () const { return static_cast<Activity> (state >> 32); }
};

/** R, G, B codes to Y, Co, Cg and back without loss (YCoCg-R); back, they are cut to 0..maximum,
 *  because residuals may have been rounded. */
constexpr std::array<std::int32_t, 3>
to_luma_chroma (std::int32_t r, std::int32_t g, std::int32_t b)
{
  const std::int32_t co = r - b, t = b + (co >> 1), cg = g - t;
  return {t + (cg >> 1), co, cg};
}

constexpr std::array<std::int32_t, 3>
to_rgb (const Components &c, std::int32_t maximum)
{
  const std::int32_t t = c[1] - (c[3] >> 1), g = c[3] + t, b = t - (c[2] >> 1), r = b + c[2];
  return {std::clamp (r, 0, maximum), std::clamp (g, 0, maximum), std::clamp (b, 0, maximum)};
}

/** The four neighbours that a pixel may equal. */
struct Neighbours {
  CodedPixel left, upper_left, upper, upper_right;

  /** Goes on to the pixel on the right, whose upper right neighbour is `next`. */
  constexpr void move (const CodedPixel &coded, const CodedPixel &next)
  {
    left = coded;
    upper_left = upper;
    upper = upper_right;
    upper_right = next;
  }

  [[nodiscard]] constexpr bool any () const
  {
    return left.valid () || upper_left.valid () || upper.valid () || upper_right.valid ();
  }
};

/** What the neighbours let expect: depth on the plane through three of them, colour as their mean.
 *  `last` is the latest valid pixel of the slice, for pixels without a neighbour. */
constexpr Components
predict (const Neighbours &n, PixelCode last, std::int32_t last_depth)
{
  const bool l = n.left.valid (), u = n.upper.valid (), ur = n.upper_right.valid ();
  if (!l && !u) {
    const CodedPixel &ul = n.upper_left;
    return components_of (ul.valid () ? ul.code : ur ? n.upper_right.code : last);
  }
  const Components left = components_of (l ? n.left.code : n.upper.code);
  if (!l || !u)
    return left;
  const Components upper = components_of (n.upper.code);
  const Components right = components_of (ur ? n.upper_right.code : n.left.code);
  Components p;
  for (int i = 1; i < kComponents; i++)
    p[i] = (2 * left[i] + upper[i] + (ur ? right[i] : upper[i]) + 2) >> 2;
  p[0] = n.upper_left.valid () ? left[0] + upper[0] - components_of (n.upper_left.code)[0]
                               : (left[0] + upper[0] + 1) >> 1;
  p[0] = std::clamp (p[0], 0, last_depth);
  return p;
}

/** Whether predict () uses only pixels that were received. */
constexpr bool
can_predict (const Neighbours &n, PixelCode last)
{
  const auto known = [] (const CodedPixel &p) { return !p.valid () || p.code != kNoPixel; };
  const bool l = n.left.valid (), u = n.upper.valid (), ur = n.upper_right.valid ();
  if (!l && !u)
    return (n.upper_left.valid () ? n.upper_left.code : ur ? n.upper_right.code : last) != kNoPixel;
  if (!l || !u)
    return (l ? n.left : n.upper).code != kNoPixel;
  return known (n.left) && known (n.upper) && known (n.upper_left) && known (n.upper_right);
}

/** By how much one step of a residual changes each component. */
struct Steps {
  std::int32_t depth = 1;  ///< 1 to 65535
  std::int32_t luma = 1;   ///< 1 to 255
  std::int32_t chroma = 1; ///< 1 to 255

  [[nodiscard]] constexpr Components components () const { return {depth, luma, chroma, chroma}; }
};

/** Limits of the components. */
struct Limits {
  std::int32_t last_depth; ///< greatest depth code
  std::int32_t maximum;    ///< greatest colour code
};

/** A predicted pixel and its residual. Residuals lie within +-2^18. */
constexpr Components
correct (const Components &predicted, const Components &residual, const Components &steps,
    const Limits &limits)
{
  Components c;
  for (int i = 0; i < kComponents; i++) {
    const std::int64_t value = predicted[i] + std::int64_t{residual[i]} * steps[i];
    const std::int64_t most = i == 0 ? limits.last_depth : limits.maximum;
    c[i] = static_cast<std::int32_t> (std::clamp (value, i < 2 ? 0 : -most, most));
  }
  return c;
}

/** Residuals of greater size are damage: no pixel needs one. */
inline constexpr std::uint32_t kMaxResidual = 1u << 18;

constexpr Activity
activity_of (const Components &residual)
{
  Activity activity = 0;
  for (int i = 0; i < kComponents; i++)
    activity |= static_cast<Activity> (std::min (std::abs (residual[i]), 9)) << 8 * i;
  return activity;
}

/** Where the run that begins at `begin` ends, in a row of one byte a pixel, 0 = invalid. */
inline int
run_end (std::span<const std::uint8_t> row, int begin, bool valid)
{
  const auto at = static_cast<std::size_t> (begin);
  const void *end = std::memchr (row.data () + at, !valid, row.size () - at);
  return end ? static_cast<int> (static_cast<const std::uint8_t *> (end) - row.data ())
             : static_cast<int> (row.size ());
}

/** Bytes behind the slice header: u16 depth step, u8 luma step, u8 chroma step. */
inline constexpr std::size_t kStepsSize = 4;
inline constexpr std::size_t kEntropyHeaderSize = kSliceHeaderSize + kStepsSize;
/** Packed slices say also the orders of their codes of residual sizes, 0 to 15: four bits each. */
using GolombOrders = std::array<std::uint8_t, kComponents>;
inline constexpr std::size_t kOrdersSize = 2;
inline constexpr std::size_t kPackedHeaderSize = kEntropyHeaderSize + kOrdersSize;

} // namespace rangecast
