/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Pixels of the profiles packed and entropy as encoder and decoder hold them, and their prediction.
 * The specification is docs/formats/bitstream.md. */
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <span>

#include "../bitstream/components.hpp"
#include "../bitstream/reference.hpp"

namespace rangecast {

/** How a pixel was coded. Contexts depend on it. */
enum class Origin : std::uint8_t {
  kNone = 0,      ///< invalid, or outside the slice
  kLeft = 1,      ///< equals the left pixel
  kUpper = 2,     ///< equals one of the three above
  kPredicted = 3, ///< equals the prediction from its neighbours
  kCorrected = 4, ///< prediction and residual
};

/** What a slice of these profiles holds for one pixel. The first four are the neighbours.
 *  kTakeEarlier, a pixel of an earlier frame set, is coded apart from the others. */
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

/** What each choice of a pixel would cost, bits: up to kTakeUpperRight alone, of kCorrect without
 * the residual. Greater than any sum where a choice cannot be written. */
using ChoiceBits = std::array<float, kChoices>;
inline constexpr float kImpossible = 1e9f;

/** Depth code and colour of a pixel as one number that can be compared: from bit 0 upwards, 16 bits
 *  each, depth, Y, Co, Cg. */
using PixelCode = std::uint64_t;

typedef std::int16_t ComponentHalves __attribute__ ((vector_size (16)));
typedef std::uint64_t ComponentPairs __attribute__ ((vector_size (16)));

inline Components
components_of (PixelCode code)
{
  const auto halves = reinterpret_cast<ComponentHalves> (ComponentPairs{code, 0});
  const auto doubled = __builtin_shufflevector (halves, halves, 0, 0, 1, 1, 2, 2, 3, 3);
  return reinterpret_cast<Components> (doubled) >> 16 & Components{0xffff, -1, -1, -1};
}

inline PixelCode
pack_components (Components c)
{
  const auto halves = reinterpret_cast<ComponentHalves> (c);
  const auto packed = __builtin_shufflevector (halves, halves, 0, 2, 4, 6, 0, 2, 4, 6);
  return reinterpret_cast<ComponentPairs> (packed)[0];
}

inline Components
clamped (Components c, Components min, Components max)
{
  c = c < min ? min : c;
  return c > max ? max : c;
}

/** The code of an invalid pixel, and of a valid one that refers to data that was not received. No
 *  other pixel has it, because Y is not negative. */
inline constexpr PixelCode kNoPixel = ReferencePlane::kNone;

/** An invalid pixel of an earlier frame set, as a ReferencePlane holds it. Unlike kNoPixel, a
 * reader knows that there is none. */
inline constexpr PixelCode kEmptyPixel = kNoPixel ^ 1 << 16;

/** Magnitudes of a residual's components, at most 21 each, one a byte from the least significant; 0
 *  for copies. */
using Activity = std::uint32_t;

/** A pixel as contexts see it: its origin, from bit 8 its kind, from bit 16 its choice plus one
 * (see copy_state()), from bit 32 its activity. 0 for invalid pixels only. Sums of several do not
 *  overflow their fields. */
using PixelState = std::uint64_t;

constexpr PixelState
state_of (Origin origin, Activity activity = 0)
{
  return static_cast<PixelState> (origin) |
         static_cast<PixelState> (std::min (static_cast<int> (origin), 3)) << 8 |
         PixelState{activity} << 32;
}

/** State of a pixel that equals another, in a slice that refers to an earlier frame set, where
 *  contexts depend on which one that is. */
constexpr PixelState
copy_state (std::uint64_t choice)
{
  const bool upper = choice >= kTakeUpperLeft && choice <= kTakeUpperRight;
  return state_of (upper ? Origin::kUpper : Origin::kLeft) | (choice + 1) << 16;
}

/** The state of a pixel, with its choice. */
constexpr PixelState
with_choice (PixelState state, PixelChoice choice)
{
  return state | static_cast<PixelState> (choice + 1) << 16;
}

/** All bits set if `v`, which is below 2^63, is 0; else none. */
[[gnu::always_inline]] inline std::uint64_t
zero_mask (std::uint64_t v)
{
  auto mask = static_cast<std::uint64_t> (static_cast<std::int64_t> (v - 1) >> 63);
  asm("" : "+r"(mask)); /* keeps compilers from making it a condition and a jump */
  return mask;
}

/** `a` where the mask is set, else `b`; without a jump, which would be unpredictable. */
constexpr std::uint64_t
select (std::uint64_t mask, std::uint64_t a, std::uint64_t b)
{
  return b ^ ((a ^ b) & mask);
}

struct CodedPixel {
  PixelCode code = kNoPixel;
  PixelState state = 0;

  [[nodiscard]] constexpr bool valid () const { return state != 0; }
};

/** Limits of the components, and of depth, R, G, B. */
struct PixelLimits {
  Components min{}, max{};   ///< of depth, Y, Co, Cg
  Components max_rgb{};      ///< of depth, R, G, B; the minima are 0
  Components max_residual{}; ///< in steps: enough to move a component across its range

  PixelLimits () = default;
  /** @param last_depth, maximum  greatest codes of depth and colour */
  PixelLimits (std::int32_t last_depth, std::int32_t maximum, Components steps)
      : min{0, 0, -maximum, -maximum}, max{last_depth, maximum, maximum, maximum}, max_rgb (max),
        max_residual ((1 << 17) / steps + 1)
  {
  }
};

/** The pixel that predicts the first one of a slice. */
inline PixelCode
first_expected (const PixelLimits &limits)
{
  return pack_components (Components{limits.max[0] / 2, limits.max[1] / 2, 0, 0});
}

/** Depth, R, G, B of depth and YCoCg-R; clamped to the limits, because residuals may have been
 * rounded.
 */
inline Components
to_rgb (Components c, const PixelLimits &limits)
{
  const Components half =
      c >> 1; /* t = Y - half of Cg; G = t + Cg; B = t - half of Co; R = B + Co */
  const Components base =
      __builtin_shufflevector (c, c, 0, 1, 1, 1) -
      (__builtin_shufflevector (half, half, 3, 3, 3, 3) & Components{0, -1, -1, -1});
  const Components plus = __builtin_shufflevector (c, c, 2, 2, 3, 3) & Components{0, -1, -1, 0};
  const Components minus =
      __builtin_shufflevector (half, half, 2, 2, 2, 2) & Components{0, -1, 0, -1};
  return clamped (base + plus - minus, Components{}, limits.max_rgb);
}

/** The four neighbours that a pixel may equal: the left one, and pointers to the row above. */
struct Neighbours {
  CodedPixel left;
  const PixelCode *codes;   ///< of the row above, at the upper pixel
  const PixelState *states; ///< the same

  [[nodiscard]] CodedPixel upper_left () const { return {codes[-1], states[-1]}; }
  [[nodiscard]] CodedPixel upper () const { return {codes[0], states[0]}; }
  [[nodiscard]] CodedPixel upper_right () const { return {codes[1], states[1]}; }
  [[nodiscard]] bool any () const { return (left.state | states[-1] | states[0] | states[1]) != 0; }
  /** kind (L) + 4 kind (U) + 16 kind (UR). */
  [[nodiscard]] std::size_t kinds () const
  {
    return (left.state + (states[0] << 2) + (states[1] << 4)) >> 8 & 63;
  }
};

/** Prediction from the neighbours: depth on the plane through three of them, colour as their mean.
 *  @param last  the latest valid pixel of the slice, for pixels without a neighbour
 *  @param max   of depth, Y, Co, Cg */
inline Components
predict (const Neighbours &n, PixelCode last, Components max)
{
  const bool l = n.left.valid (), u = n.states[0] != 0, ur = n.states[1] != 0;
  if (!l && !u)
    return components_of (n.states[-1] != 0 ? n.codes[-1] : ur ? n.codes[1] : last);
  const Components left = components_of (l ? n.left.code : n.codes[0]);
  if (!l || !u)
    return left;
  const Components upper = components_of (n.codes[0]), right = components_of (n.codes[ur]);
  const Components mean = (2 * left + upper + right + 2) >> 2;
  const Components plane =
      n.states[-1] != 0 ? left + upper - components_of (n.codes[-1]) : (left + upper + 1) >> 1;
  const Components depth_only = {-1, 0, 0, 0};
  return (mean & ~depth_only) | (clamped (plane, Components{}, max) & depth_only);
}

/** Whether predict () uses only pixels that were received. */
inline bool
can_predict (const Neighbours &n, PixelCode last)
{
  const auto known = [&] (int i) { return n.states[i] == 0 || n.codes[i] != kNoPixel; };
  const bool l = n.left.valid (), u = n.states[0] != 0, ur = n.states[1] != 0;
  if (!l && !u)
    return (n.states[-1] != 0 ? n.codes[-1] : ur ? n.codes[1] : last) != kNoPixel;
  if (!l || !u)
    return (l ? n.left.code : n.codes[0]) != kNoPixel;
  return n.left.code != kNoPixel && known (-1) && known (0) && known (1);
}

/** Quantiser steps of a residual: what one unit changes in each component, codes. */
struct Steps {
  std::int32_t depth = 1;  ///< 1 to 65535
  std::int32_t luma = 1;   ///< 1 to 255
  std::int32_t chroma = 1; ///< 1 to 255

  [[nodiscard]] Components components () const { return Components{depth, luma, chroma, chroma}; }
};

/** A predicted pixel plus its residual; the residual may be any number. */
inline Components
correct (Components predicted, Components residual, Components steps, const PixelLimits &limits)
{
  const Components bounded = clamped (residual, -limits.max_residual, limits.max_residual);
  return clamped (predicted + bounded * steps, limits.min, limits.max);
}

inline Activity
activity_of (Components residual)
{
  const Components size = residual < 0 ? -residual : residual;
  const Components max = {21, 21, 21, 21}, bounded = size > max ? max : size;
  const auto pairs = reinterpret_cast<ComponentPairs> (bounded << Components{0, 8, 0, 8});
  const auto low = pairs[0] | pairs[0] >> 32, high = pairs[1] | pairs[1] >> 32;
  return static_cast<Activity> ((low & 0xffff) | (high & 0xffff) << 16);
}

/** End of the run of pixels that begins at `begin`, in a row of one byte a pixel, 0 = invalid. */
inline int
run_end (std::span<const std::uint8_t> row, int begin, bool valid)
{
  const auto at = static_cast<std::size_t> (begin);
  const void *end = std::memchr (row.data () + at, !valid, row.size () - at);
  return end ? static_cast<int> (static_cast<const std::uint8_t *> (end) - row.data ())
             : static_cast<int> (row.size ());
}

/** Bytes after the slice header: u16 depth step, u8 luma step, u8 chroma step. */
inline constexpr std::size_t kStepsSize = 4;
inline constexpr std::size_t kEntropyHeaderSize = kSliceHeaderSize + kStepsSize;
/** Packed slices also carry the orders of their Golomb codes of residuals, 0 to 15: four bits each.
 */
using GolombOrders = std::array<std::uint8_t, kComponents>;
inline constexpr std::size_t kOrdersSize = 2;
inline constexpr std::size_t kPackedHeaderSize = kEntropyHeaderSize + kOrdersSize;

} // namespace rangecast
