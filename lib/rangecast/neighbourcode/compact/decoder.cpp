/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "decoder.hpp"

#include "../../base/simd.hpp"
#include "entropy_code.hpp"
#include "packed_code.hpp"

namespace rangecast {
namespace {

/* A pixel as it goes into the image: R, G, B in the lower half, depth in the upper. */
inline std::uint64_t
shown_as (PixelCode code, const CompactQuantisers &quantisers, const PixelLimits &limits)
{
  const Components c = to_rgb (components_of (code), limits);
  const std::uint64_t depth = quantisers.depth.depth (static_cast<std::uint16_t> (c[0]));
  std::uint32_t rgb = static_cast<std::uint32_t> (c[1] | c[2] << 8 | c[3] << 16);
  if (quantisers.colour.bits () < 8) {
    const auto value = [&] (int i) {
      return std::uint32_t{quantisers.colour.value (static_cast<std::uint8_t> (c[i]))};
    };
    rgb = value (1) | value (2) << 8 | value (3) << 16;
  }
  return rgb | depth << 32;
}

inline void
write_pixel (std::uint64_t shown, std::uint16_t &depth, Rgbx &colour)
{
  depth = static_cast<std::uint16_t> (shown >> 32);
  const auto rgbx = static_cast<std::uint32_t> (shown);
  std::memcpy (&colour.r, &rgbx, sizeof rgbx);
}

void
write_row (const std::uint64_t *row, std::size_t columns, std::uint16_t *depth, Rgbx *colour)
{
  for (std::size_t x = 0; x < columns; x++)
    write_pixel (row[x], depth[x], colour[x]);
}

} // namespace

/* ---- packed ---- */

/* A pixel that equals no neighbour. */
inline bool
CompactDecoder::decode_full (
    PackedReader &code, const Neighbours &n, bool corrected, CodedPixel &pixel)
{
  const Components expected = predict (n, last_, limits_.max);
  const bool known = can_predict (n, last_);
  if (!corrected) {
    pixel = {known ? pack_components (expected) : kNoPixel, state_of (Origin::kPredicted)};
    return true;
  }
  Components residual;
  if (!code.residual (residual))
    return false;
  const Components made = correct (expected, residual, steps_, limits_);
  pixel = {known ? pack_components (made) : kNoPixel, state_of (Origin::kCorrected)};
  return true;
}

/* Decodes a run of valid pixels, which follows an invalid one. The loop keeps what it needs of this
 * object in local variables, the code too, so that it stays in registers. */
template <bool Delta>
inline bool
CompactDecoder::decode_run (PackedReader &slice_code, const CompactQuantisers &quantisers,
    std::size_t begin, std::size_t end)
{
  PixelCode *const codes = row_.codes ();
  PixelState *const states = row_.states ();
  std::uint64_t *const shown = row_.shown ();
  const PixelCode *const upper_codes = upper_.codes ();
  const PixelState *const upper_states = upper_.states ();
  const std::uint64_t *const upper_shown = upper_.shown ();
  CodedPixel left;
  std::uint64_t left_shown = 0;
  PackedReader code = slice_code;
  for (std::size_t x = begin; x < end; x++) {
    const Neighbours n = {left, upper_codes + x, upper_states + x};
    if (Delta && row_.earlier ()[x]) {
      codes[x] = left.code = earlier_codes_[x];
      states[x] = left.state = copy_state (kTakeEarlier);
      shown[x] = left_shown = left.code == kNoPixel ? 0 : shown_as (left.code, quantisers, limits_);
      continue;
    }
    const auto chosen =
        static_cast<unsigned> (x > begin || n.any () ? code.choice (n) : int{kCorrect});
    if (chosen < kPredict) [[likely]] {
      const std::uint64_t take_left = zero_mask (chosen);
      const auto from =
          static_cast<std::ptrdiff_t> (x + select (take_left, kTakeUpper, chosen)) - kTakeUpper;
      left_shown = select (take_left, left_shown, upper_shown[from]);
      /* codes do not tell unknown pixels from invalid ones */
      if ((take_left ? left.state : upper_states[from]) == 0)
        return false;
      left = {select (take_left, left.code, upper_codes[from]), copy_state (chosen)};
    } else {
      if (chosen > kCorrect || !decode_full (code, n, chosen == kCorrect, left))
        return false;
      left_shown = left.code == kNoPixel ? 0 : shown_as (left.code, quantisers, limits_);
    }
    codes[x] = left.code;
    states[x] = left.state;
    shown[x] = left_shown;
  }
  last_ = left.code;
  slice_code = code;
  return true;
}

/* Reads the ends of alternating runs from begin to end, as rule R21 has it; the first may be empty.
 * @param expected  expected (x, value) is where the run from x on is expected to end
 * @param use       use (x, end, value) is called for each run */
template <class Code, class Expected, class Use>
[[gnu::always_inline]] inline bool
decode_runs (Code &code, int begin, int end, const Expected &expected, const Use &use)
{
  bool now = false;
  for (int x = begin; x < end; now = !now) {
    std::int32_t later = 0;
    if (!code.run (now, later))
      return false;
    const int to = expected (x, now) + later;
    if (to > end || to < x || (to == x && (x > begin || now)))
      return false;
    use (x, to, now);
    x = to;
  }
  return true;
}

/* Reads which pixels of a row are valid, and the ends of its runs. */
template <class Code>
bool
CompactDecoder::decode_valid (Code &slice_code, int columns)
{
  Code code = slice_code;
  runs_.clear ();
  const bool good = decode_runs (
      code, 0, columns, [&] (int x, bool value) { return run_end (upper_.valid (), x, value); },
      [&] (int x, int end, bool value) {
        std::fill_n (row_.valid ().begin () + x, end - x, std::uint8_t{value});
        runs_.push_back (end);
      });
  slice_code = code;
  return good;
}

/* Reads which pixels of a run of valid ones equal those of the earlier frame set. */
bool
CompactDecoder::decode_earlier_runs (PackedReader &code, std::size_t begin, std::size_t end)
{
  const std::span<const std::uint8_t> upper (upper_.earlier ().data (), end);
  return decode_runs (
      code, static_cast<int> (begin), static_cast<int> (end),
      [&] (int x, bool value) { return run_end (upper, x, value); },
      [&] (int x, int to, bool value) {
        std::fill_n (row_.earlier ().begin () + x, to - x, std::uint8_t{value});
      });
}

template <bool Delta>
bool
CompactDecoder::decode_packed_row (
    PackedReader &code, const CompactQuantisers &quantisers, int columns, std::uint64_t &points)
{
  if (!decode_valid (code, columns))
    return false;
  std::size_t begin = 0;
  bool valid = false;
  for (int run : runs_) {
    const auto end = static_cast<std::size_t> (run);
    if (!valid)
      row_.invalidate (begin, end, 0);
    else if ((Delta && !decode_earlier_runs (code, begin, end)) ||
             !for_this_cpu ([&] { return decode_run<Delta> (code, quantisers, begin, end); }))
      return false;
    points += valid ? end - begin : 0;
    begin = end;
    valid = !valid;
  }
  return !code.overrun ();
}

/* ---- entropy ---- */

/* Makes the pixels of a run of valid ones, which follows an invalid one, of their classes and
 * residuals. */
template <bool Delta>
inline bool
CompactDecoder::make_run (
    const EntropyRow &row, std::size_t begin, std::size_t end, const Components *&residuals)
{
  PixelCode *const codes = row_.codes ();
  const PixelCode *const upper = upper_.codes ();
  const PixelClass *const classes = row.classes, *const upper_classes = row.upper_classes;
  const Components steps = steps_;
  const PixelLimits limits = limits_;
  PixelCode left = kNoPixel;
  PixelClass left_class = 0;
  bool bad = classes[begin] == kTakeLeft + 1, unknown = false;
  for (std::size_t x = begin; x < end; x++) {
    const PixelClass now = classes[x];
    if (now <= kTakeUpperRight + 1) [[likely]] {
      const std::uint64_t take_left = zero_mask (now - kTakeLeft - 1u);
      /* For the left pixel, which is not there, the upper-left one's place. */
      const auto from = static_cast<std::ptrdiff_t> (x + now + (take_left & 1)) - 1 - kTakeUpper;
      if constexpr (Delta) /* codes do not tell unknown pixels from invalid ones */
        bad |= ((upper_classes[from] != 0) | (now == kTakeLeft + 1)) == 0;
      left = select (take_left, left, upper[from]);
    } else if (Delta && now == kEarlierClass) {
      left = earlier_codes_[x];
    } else {
      bad |= now > kCorrectedClass;
      const PixelClass *const around = upper_classes + x;
      const PixelState states[] = {around[-1], around[0], around[1]};
      const Neighbours n = {{left, left_class}, upper + x, states + 1};
      Components made = predict (n, last_, limits.max);
      const bool known = !Delta || can_predict (n, last_);
      if (now == kCorrectedClass)
        made = correct (made, *residuals++, steps, limits);
      left = known ? pack_components (made) : kNoPixel;
    }
    unknown |= left == kNoPixel;
    codes[x] = left;
    left_class = now;
  }
  last_ = left;
  return !bad && (Delta || !unknown);
}

template <bool Delta>
bool
CompactDecoder::decode_entropy_row (EntropyReader &code, const CompactQuantisers &quantisers,
    int columns, std::uint16_t *depth, Rgbx *colour, std::uint64_t &points)
{
  if (!decode_valid (code, columns))
    return false;
  const EntropyRow row = entropy_.row (runs_);
  return for_this_cpu ([&, width = static_cast<std::size_t> (columns)] {
    std::fill_n (row_.codes (), width, kNoPixel);
    std::fill_n (row.classes, width, PixelClass{0});
    std::fill_n (row.activities, width, kNoActivity);
    std::fill_n (depth, width, std::uint16_t{0});
    std::fill_n (colour, width, Rgbx{});
    if (!code.row<Delta> (row) || code.overrun ())
      return false;
    const Components *residuals = row.residuals;
    bool sound = true;
    for_valid_runs (row.runs, [&] (int first, int last) {
      const auto begin = static_cast<std::size_t> (first), end = static_cast<std::size_t> (last);
      sound = sound && make_run<Delta> (row, begin, end, residuals);
      if (!sound)
        return;
      points += end - begin;
      for (std::size_t x = begin; x < end; x++)
        if (!Delta || row_.codes ()[x] != kNoPixel)
          write_pixel (shown_as (row_.codes ()[x], quantisers, limits_), depth[x], colour[x]);
    });
    return sound;
  });
}

/* Reads the motion of the blocks that begin in row y of the slice, and fetches the pixels of the
 * earlier frame set that the row's may equal. */
template <class Code>
bool
CompactDecoder::load_earlier (
    Code &code, const SliceHeader &header, const CodingReference &reference, int y)
{
  const int full_x = header.roi.x + header.first_column;
  const int full_y = header.roi.y + header.first_row + y;
  const MotionScale scale (steps_[0], limits_.max[0]);
  if (y == 0 || full_y % kMotionBlock == 0) {
    BlockMotion expected;
    for (BlockMotion &m : motions_) {
      if (!code.motion (expected, m) || !is_sound (m, scale))
        return false;
      expected = m;
    }
  }
  if (reference.before)
    fetch_displaced (*reference.before, full_x, full_y, motions_, scale, -kMaxImageSide,
        2 * kMaxImageSide, earlier_codes_);
  std::ranges::fill (row_.earlier (), std::uint8_t{0});
  return true;
}

template <class Code, bool Delta>
bool
CompactDecoder::decode_rows (Code code, const SliceHeader &header,
    const CompactQuantisers &quantisers, const CodingReference &reference, const RangeImage &image,
    DecodedPixels &decoded)
{
  constexpr bool kIsEntropy = std::is_same_v<Code, EntropyReader>;
  const auto columns = static_cast<std::size_t> (header.columns);
  const auto most = static_cast<std::size_t> (header.roi.width); /* columns of other slices */
  if constexpr (kIsEntropy)
    entropy_.reset (columns, most);
  row_.reserve (most);
  upper_.reserve (most);
  row_.reset (columns, 0);
  upper_.reset (columns, 0);
  runs_.reserve (most + 1);
  if constexpr (Delta) {
    earlier_codes_.reserve (most);
    motions_.reserve (most / kMotionBlock + 2);
    earlier_codes_.assign (columns, kNoPixel);
    motions_.assign (
        motion_blocks (header.roi.x + header.first_column, header.columns), BlockMotion{});
  }
  limits_ =
      PixelLimits (quantisers.depth.codes () - 1, (1 << quantisers.colour.bits ()) - 1, steps_);
  last_ = first_expected (limits_);
  for (int y = 0; y < header.rows; y++) {
    if constexpr (Delta)
      if (!load_earlier (code, header, reference, y))
        return false;
    std::uint64_t points = 0, unknown = 0;
    const int image_row = header.first_row + y;
    std::uint16_t *const depth = image.depth.row (image_row) + header.first_column;
    Rgbx *const colour = image.colour.row (image_row) + header.first_column;
    if constexpr (kIsEntropy) {
      if (!decode_entropy_row<Delta> (code, quantisers, header.columns, depth, colour, points))
        return false;
    } else {
      if (!decode_packed_row<Delta> (code, quantisers, header.columns, points))
        return false;
      write_row (row_.shown (), columns, depth, colour);
    }
    if constexpr (Delta)
      for (int x = 0; x < header.columns; x++)
        unknown += row_.valid ()[static_cast<std::size_t> (x)] && row_.codes ()[x] == kNoPixel;
    decoded.points += points - unknown;
    decoded.unknown += unknown;
    if (reference.now)
      reference.now->keep (
          header.roi.x + header.first_column, header.roi.y + image_row, row_.as_reference ());
    std::swap (row_, upper_);
    if constexpr (kIsEntropy)
      std::swap (entropy_.now, entropy_.upper);
  }
  return code.at_clean_end ();
}

bool
CompactDecoder::decode (std::span<const std::uint8_t> body, const SliceHeader &header,
    const CompactQuantisers &quantisers, const CodingReference &reference, const RangeImage &image,
    DecodedPixels &decoded)
{
  const bool packed = header.profile == Profile::kPacked;
  const std::size_t own_header = packed ? kStepsSize + kOrdersSize : kStepsSize;
  if (body.size () < own_header)
    return false;
  const Steps steps = {body[0] | body[1] << 8, body[2], body[3]};
  if (steps.depth == 0 || steps.luma == 0 || steps.chroma == 0)
    return false;
  steps_ = steps.components ();
  const auto data = body.subspan (own_header);
  const auto decode_with = [&] (auto code) {
    using Code = decltype (code);
    return header.key
               ? decode_rows<Code, false> (code, header, quantisers, reference, image, decoded)
               : decode_rows<Code, true> (code, header, quantisers, reference, image, decoded);
  };
  if (!packed)
    return data.size () >= kRansHeaderSize &&
           decode_with (EntropyReader (data, model_, initial_model (header.key, steps_)));
  const auto order = [&] (std::size_t i) {
    return static_cast<std::uint8_t> (body[kStepsSize + i / 2] >> 4 * (i % 2) & 15);
  };
  bytes_.assign (data.begin (), data.end ());
  bytes_.resize (data.size () + PackedReader::kPadding);
  return decode_with (PackedReader (bytes_.data (), data.size (),
      {{order (0), order (1), order (2), order (3)}, is_zero (steps_ - 1)}));
}

} // namespace rangecast
