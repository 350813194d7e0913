/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "encoder.hpp"

#include "../../base/simd.hpp"
#include "entropy_code.hpp"
#include "packed_code.hpp"

namespace rangecast {
namespace {

/* Upper bounds of what a pixel and a run add to a slice of profile packed. */
constexpr std::size_t kMaxBytesOfPixel = 512, kMaxBytesOfRun = 64;

/* Price of a bit for choice=best; errors are squared, in units of the threshold. Found by
 * experiment.
 */
constexpr float kPriceOfBit = 0.2f;

/* Differences divided by steps, to the nearest. Steps are odd, so no quotient lies in the middle,
 * and differences are below 2^17, so float's 24 bits find the nearest for every step. Adding 1.5 x
 * 2^23 leaves the integer in the lowest bits. */
Components
rounded (Components difference, FloatComponents reciprocals)
{
  constexpr float kIntegers = 12582912;
  const FloatComponents sum =
      __builtin_convertvector(difference, FloatComponents) * reciprocals + kIntegers;
  return reinterpret_cast<Components> (sum) - std::bit_cast<std::int32_t> (kIntegers);
}

/* States of copies of a neighbour, left or above. */
constexpr PixelState kLeftState = state_of (Origin::kLeft), kUpperState = state_of (Origin::kUpper);

} // namespace

Steps
steps_within (int depth_threshold, int colour_threshold)
{
  /* A rounded residual is off by up to half its step. An error of Y changes R, G and B by as much;
   * errors of Co and Cg together, by the larger of them plus 1 (docs/formats/bitstream.md, "How an
   * encoder chooses"). Coarse depth steps save more than they cost; Y gets about a third of the
   * colour threshold, chroma the rest. */
  const int depth = (3 * depth_threshold + 2) / 4;
  const int luma = (9 * colour_threshold + 12) / 25;
  const int chroma = std::max (0, colour_threshold - luma - 1);
  const auto step = [] (int error, int max) { return std::min (2 * error + 1, max); };
  return {step (depth, 65535), step (luma, 255), step (chroma, 255)};
}

CompactSettings
finer_settings (const CompactSettings &settings)
{
  CompactSettings finer = settings;
  if (settings.fine) {
    finer.depth_threshold = (3 * settings.depth_threshold + 2) / 4;
    finer.colour_threshold = (3 * settings.colour_threshold + 2) / 4;
  }
  return finer;
}

/* ---- loading a row and choosing what its pixels become ---- */

/* Quantises the valid pixels of a row. */
inline void
CompactEncoder::load_row (const ConstRangeImage &image, int y)
{
  const std::uint16_t *depth = image.depth.row (y) + header_.first_column;
  const Rgbx *colour = image.colour.row (y) + header_.first_column;
  const DepthQuantiser &d = quantisers_->depth;
  const ColourQuantiser &c = quantisers_->colour;
  PixelKey *const own = own_.data ();
  const std::span<std::uint8_t> valid (row_.valid ());
  for (std::size_t x = 0; x < valid.size (); x++)
    valid[x] = d.valid (depth[x]);
  for (int run = run_end (valid, 0, false); run < columns_;) {
    const int run_after = run_end (valid, run, true);
    const auto begin = static_cast<std::size_t> (run), end = static_cast<std::size_t> (run_after);
    for (std::size_t x = begin; x < end; x++)
      own[x] = d.code (depth[x]);
    if (c.bits () < 8)
      for (std::size_t x = begin; x < end; x++)
        own[x] |= key_of (
            0, c.code (colour[x].r) | c.code (colour[x].g) << 8 | c.code (colour[x].b) << 16);
    else
      for (std::size_t x = begin; x < end; x++) {
        std::uint32_t rgbx = 0;
        std::memcpy (&rgbx, colour + x, sizeof rgbx);
        own[x] |= key_of (0, rgbx);
      }
    run = run_end (valid, run_after, false);
  }
}

/* Finds the motion of the blocks that begin or continue in row y. They refer to rows of their band
 * only, so that damage stays in it. */
void
CompactEncoder::find_motions (const ConstRangeImage &image, int y, const RowBand &band)
{
  const Roi &roi = header_.roi;
  const int first_x = roi.x + header_.first_column, end_x = first_x + columns_;
  const int first_y = roi.y + y, band_y = first_y / refresh_rows_ * refresh_rows_;
  const int block_end = (first_y / kMotionBlock + 1) * kMotionBlock;
  const int height = std::min (block_end, roi.y + band.first_row + band.rows) - first_y;
  const MotionSearch::Pictures pictures = {
      image, quantisers_->depth, quantisers_->colour, *reference_.before, scale_};
  BlockMotion near_by[2];                   /* to the left, above */
  if (header_.first_column >= kMotionBlock) /* another partition's, of the last frame set */
    near_by[0] = motion_memory_->before (first_x - kMotionBlock, first_y);
  for (std::size_t i = 0; i < motions_.size (); i++) {
    const int x = i == 0 ? first_x : (first_x / kMotionBlock + int (i)) * kMotionBlock;
    const int next = std::min ((x / kMotionBlock + 1) * kMotionBlock, end_x);
    near_by[1] = motions_[i];
    motions_[i] = search_.find (pictures, earlier_threshold_,
        {x, first_y, next - x, height, band_y, band_y + refresh_rows_}, near_by, *motion_memory_);
    near_by[0] = motions_[i];
  }
}

/* Finds the pixels that are within the thresholds of those of the earlier frame set. */
void
CompactEncoder::load_earlier (int y)
{
  const auto columns = static_cast<std::size_t> (columns_);
  const Roi &roi = header_.roi;
  const int full_y = roi.y + y, band_y = full_y / refresh_rows_ * refresh_rows_;
  fetch_displaced (*reference_.before, roi.x + header_.first_column, full_y, motions_, scale_,
      band_y, band_y + refresh_rows_, std::span (earlier_codes_).first (columns));
  std::uint8_t *const earlier = row_.earlier ().data ();
  const std::uint8_t *const valid = row_.valid ().data ();
  for (std::size_t x = 0; x < columns; x++) {
    earlier[x] = 0;
    if (!valid[x] || earlier_codes_[x] == kNoPixel)
      continue;
    earlier_keys_[x] = key_of (to_rgb (components_of (earlier_codes_[x]), limits_));
    earlier[x] = near_bits (own_[x], earlier_keys_[x], earlier_bias_) == kNearMask;
  }
}

/* Prediction, rounded residual and the decoder's result. */
inline CompactEncoder::FullPixel
CompactEncoder::make_full (PixelKey own, const Neighbours &n) const
{
  const Components expected = predict (n, last_, limits_.max);
  const Components residual = rounded (components_of_key (own) - expected, reciprocals_);
  const Components made = clamped (expected + residual * steps_, limits_.min, limits_.max);
  return {residual, pack_components (made), key_of (to_rgb (made, limits_))};
}

/* The choice of least cost (error and bits) among the pixels that are near enough: a neighbour, the
 * earlier frame set's if `earlier`, or kPredict for the pixel in full.
 * @param[out] full  the pixel in full, if that is the choice */
template <class Code, bool Delta>
inline int
CompactEncoder::best_choice (
    const Code &code, std::size_t x, const Neighbours &n, bool earlier, FullPixel &full)
{
  const PixelKey own = own_[x];
  const auto error = [&] (PixelKey other) {
    const auto d = [&] (int at, int mask) {
      return static_cast<std::int32_t> (own >> at & mask) -
             static_cast<std::int32_t> (other >> at & mask);
    };
    const std::int32_t z = d (0, 0xffff), r = d (32, 0xff), g = d (18, 0xff), b = d (50, 0xff);
    return depth_weight_ * float (z) * float (z) + colour_weight_ * float (r * r + g * g + b * b);
  };
  int best = kPredict;
  float min = kImpossible, before = 0; /* costs: the least, and of what comes before each choice */
  if constexpr (Delta && !Code::kEarlierInRuns) {
    before = kPriceOfBit * code.earlier_bits (n, false);
    if (earlier) {
      min = error (earlier_keys_[x]) + kPriceOfBit * code.earlier_bits (n, true);
      best = kTakeEarlier;
      if (min <= before)
        return best;
    }
  }
  if (n.left.valid () && near_bits (own, row_.shown ()[x - 1], bias_) == kNearMask) {
    const auto [yes, no] = code.left_bits (n);
    if (const float sum = before + kPriceOfBit * yes + error (row_.shown ()[x - 1]); sum < min) {
      best = kTakeLeft;
      min = sum;
    }
    if (min <= before + kPriceOfBit * no) /* the least that any other can cost */
      return best;
  }
  const ChoiceBits bits = code.template choice_bits<Delta> (n);
  for (std::size_t i = kTakeUpperLeft; i <= kTakeUpperRight; i++) {
    const float cost = before + kPriceOfBit * bits[i];
    if (bits[i] >= kImpossible || cost >= min)
      continue;
    const PixelKey other = upper_.shown ()[static_cast<std::ptrdiff_t> (x + i) - kTakeUpper];
    if (near_bits (own, other, bias_) != kNearMask)
      continue;
    if (const float sum = cost + error (other); sum < min) {
      best = static_cast<int> (i);
      min = sum;
    }
  }
  if (before + kPriceOfBit * std::min (bits[kPredict], bits[kCorrect]) >= min)
    return best;
  /* The residual, and those that have one component nearer to 0. */
  const bool has_neighbour = n.any ();
  const Components expected = predict (n, last_, limits_.max);
  const auto attempt = [&] (Components residual, bool is_first) {
    const Components made = clamped (expected + residual * steps_, limits_.min, limits_.max);
    const PixelKey key = key_of (to_rgb (made, limits_));
    if (!is_first && near_bits (own, key, bias_) != kNearMask)
      return false;
    const bool predicted = has_neighbour && is_zero (residual);
    const float sum = before + error (key) +
                      kPriceOfBit * (predicted ? bits[kPredict]
                                               : bits[kCorrect] + code.residual_bits (
                                                                      n, has_neighbour, residual));
    if (sum >= min)
      return false;
    best = kPredict;
    min = sum;
    full = {residual, pack_components (made), key};
    return true;
  };
  Components residual = rounded (components_of_key (own) - expected, reciprocals_);
  attempt (residual, true);
  for (int i = 0; i < kComponents; i++)
    if (residual[i] != 0) {
      Components smaller = residual;
      smaller[i] -= residual[i] > 0 ? 1 : -1;
      if (attempt (smaller, false))
        residual = smaller;
    }
  return best;
}

/* ---- writing the symbols of a row ---- */

/* Codes a pixel that no neighbour replaces. @return its state */
template <class Code>
inline PixelState
CompactEncoder::code_full (Code &code, const Neighbours &n, Components residual)
{
  const bool has_neighbour = n.any (), predicted = has_neighbour & is_zero (residual);
  result_.full_pixels++;
  code.full (n, has_neighbour, residual);
  const Components size = residual < 0 ? -residual : residual;
  size_sums_ += size + (size > 0);
  size_counts_ -= size > 0;
  const PixelState state = select (zero_mask (!predicted), state_of (Origin::kPredicted),
      state_of (Origin::kCorrected, Code::kUsesActivity ? activity_of (residual) : 0));
  return Code::kByRow ? with_choice (state, predicted ? kPredict : kCorrect) : state;
}

/* Codes a run of valid pixels, which follows an invalid one.
 *
 * The loop keeps what it needs of this object in local variables, the code too: it writes bytes,
 * and the compiler must assume that these may alias any member. */
template <class Code, bool Best, bool Delta>
inline void
CompactEncoder::code_run (Code &slice_code, std::size_t begin, std::size_t end)
{
  PixelCode *const codes = row_.codes ();
  PixelState *const states = row_.states ();
  PixelKey *const keys = row_.shown ();
  const PixelCode *const upper_codes = upper_.codes ();
  const PixelState *const upper_states = upper_.states ();
  const PixelKey *const upper_keys = upper_.shown (), *const own = own_.data ();
  [[maybe_unused]] const std::uint8_t *const earlier = row_.earlier ().data ();
  const PixelKey bias = bias_;
  CodedPixel left;
  PixelKey left_key = kInvalidKey;
  Code code = slice_code;
  for (std::size_t x = begin; x < end; x++) {
    const Neighbours n = {left, upper_codes + x, upper_states + x};
    FullPixel full{};
    [[maybe_unused]] int best = kPredict;
    if constexpr (Best)
      if (!Delta || !Code::kEarlierInRuns || !earlier[x])
        best = best_choice<Code, Delta> (code, x, n, Delta && earlier[x], full);
    if constexpr (Delta) {
      const bool is_earlier = Best && !Code::kEarlierInRuns ? best == kTakeEarlier : earlier[x];
      if (is_earlier) {
        codes[x] = left.code = earlier_codes_[x];
        states[x] = left.state = copy_state (kTakeEarlier);
        keys[x] = left_key = earlier_keys_[x];
        continue;
      }
    }
    /* Choose the neighbour that replaces the pixel, if any. */
    std::uint64_t other = 0, take_left = 0; /* the latter is a mask */
    if constexpr (Best) {
      other = static_cast<std::uint64_t> (best);
      take_left = zero_mask (other);
    } else {
      const auto near = [&] (PixelKey key) {
        return zero_mask (near_bits (own[x], key, bias) ^ kNearMask);
      };
      take_left = near (left_key);
      other = select (near (upper_keys[x + 1]), kTakeUpperRight, kPredict);
      other = select (near (upper_keys[x]), kTakeUpper, other);
      other =
          select (near (upper_keys[static_cast<std::ptrdiff_t> (x) - 1]), kTakeUpperLeft, other);
    }
    const std::uint64_t chosen = select (take_left, kTakeLeft, other);
    /* Write the choice, or the pixel in full. */
    if (chosen != kPredict) [[likely]] {
      code.choice (n, static_cast<int> (chosen));
      const auto from =
          static_cast<std::ptrdiff_t> (x + select (take_left, kTakeUpper, other)) - kTakeUpper;
      left_key = select (take_left, left_key, upper_keys[from]);
      left = {select (take_left, left.code, upper_codes[from]),
          Delta || Code::kByRow ? copy_state (chosen)
                                : select (take_left, kLeftState, kUpperState)};
    } else {
      if constexpr (!Best)
        full = make_full (own[x], n);
      left.state = code_full (code, n, full.residual);
      left.code = full.code;
      left_key = full.key;
    }
    codes[x] = left.code;
    states[x] = left.state;
    keys[x] = left_key;
  }
  last_ = left.code;
  slice_code = code;
}

/* Codes which pixels of the row are valid, and finds the ends of its runs. */
template <class Code>
void
CompactEncoder::code_runs (Code &code)
{
  const std::vector<std::uint8_t> &valid = row_.valid (), &upper = upper_.valid ();
  runs_.clear ();
  bool now = false;
  for (int x = 0; x < columns_; now = !now) {
    const int end = run_end (valid, x, now);
    code.run (now, end - run_end (upper, x, now));
    result_.points += now ? static_cast<std::uint64_t> (end - x) : 0;
    runs_.push_back (end);
    x = end;
  }
}

/* Codes which pixels of a run of valid ones equal those of the earlier frame set. */
template <class Code>
void
CompactEncoder::code_earlier_runs (Code &code, std::size_t begin, std::size_t end)
{
  const std::span<const std::uint8_t> own (row_.earlier ().data (), end),
      upper (upper_.earlier ().data (), end);
  bool now = false;
  for (auto x = static_cast<int> (begin); x < static_cast<int> (end); now = !now) {
    const int to = run_end (own, x, now);
    code.run (now, to - run_end (upper, x, now));
    x = to;
  }
}

/* @return false if the slice is too long now; the row must then be coded again */
template <class Code, bool Delta>
bool
CompactEncoder::code_row (Code &slice_code, [[maybe_unused]] bool begins_block)
{
  if constexpr (Delta)
    if (begins_block) {
      BlockMotion expected;
      for (BlockMotion &m : motions_) {
        (void)slice_code.motion (expected, m);
        expected = m;
      }
    }
  code_runs (slice_code);
  if constexpr (Code::kByRow)
    slice_code.begin_row (entropy_.row (runs_));
  std::size_t begin = 0;
  bool valid = false;
  for (int run : runs_) {
    const auto end = static_cast<std::size_t> (run);
    if constexpr (Delta && Code::kEarlierInRuns)
      if (valid)
        code_earlier_runs (slice_code, begin, end);
    if (!valid)
      row_.invalidate (begin, end, kInvalidKey);
    else if (settings_.best)
      for_this_cpu ([&] { code_run<Code, true, Delta> (slice_code, begin, end); });
    else
      for_this_cpu ([&] { code_run<Code, false, Delta> (slice_code, begin, end); });
    begin = end;
    valid = !valid;
  }
  if constexpr (Code::kByRow) {
    const EntropyRow row = entropy_.row (runs_);
    for_this_cpu ([&] {
      const PixelState *const states = row_.states ();
      for (int x = 0, n = columns_; x < n; x++) {
        row.classes[x] = class_of (states[x]);
        row.activities[x] = row.classes[x] != 0 ? 0 : kNoActivity;
      }
      slice_code.template row<Delta> (row);
    });
  }
  return slice_code.bound () + header_size () <=
         static_cast<std::size_t> (settings_.max_slice_size);
}

/* ---- slices ---- */

std::size_t
CompactEncoder::header_size () const
{
  return (header_.profile == Profile::kPacked ? kPackedHeaderSize : kEntropyHeaderSize) +
         !header_.key;
}

template <class Code, bool Delta>
Code
CompactEncoder::begin_slice (int first_row)
{
  /* The Golomb orders for the mean residuals of the last slice, the best guess for this one. */
  for (int i = 0; i < kComponents; i++)
    if (size_counts_[i] > 0) {
      const auto mean = static_cast<std::uint32_t> (size_sums_[i] / size_counts_[i]);
      orders_[static_cast<std::size_t> (i)] =
          static_cast<std::uint8_t> (std::min<int> (std::bit_width (mean + mean / 2), 15));
    }
  size_sums_ = size_counts_ = Components{};
  header_.first_row = first_row;
  header_.rows = 0;
  last_ = first_expected (limits_);
  if constexpr (Code::kByRow)
    return Code (entries_.data (), model_, initial_model (!Delta, steps_));
  else
    return Code (bytes_.data (), {orders_, is_zero (steps_ - 1)});
}

/* Makes room for a row's symbols. */
void
CompactEncoder::reserve_entries (EntropyWriter &code)
{
  const std::size_t most =
      code.coder ().entries () + EntropyWriter::max_entries (static_cast<std::size_t> (columns_));
  if (entries_.size () < most) {
    entries_.resize (2 * most);
    code.coder ().move_to (entries_.data ());
  }
}

template <class Code>
void
CompactEncoder::close_slice (Code &code, std::vector<std::uint8_t> &to)
{
  const std::size_t begin = to.size (), header_bytes = header_size ();
  std::size_t size;
  if constexpr (Code::kByRow)
    size = code.finish (bytes_.data ());
  else
    size = code.finish ();
  to.resize (begin + header_bytes + size);
  std::uint8_t *p = to.data () + begin;
  write_slice_header (header_, header_bytes + size, p);
  p += header_size_of (header_);
  *p++ = static_cast<std::uint8_t> (steps_[0]);
  *p++ = static_cast<std::uint8_t> (steps_[0] >> 8);
  *p++ = static_cast<std::uint8_t> (steps_[1]);
  *p++ = static_cast<std::uint8_t> (steps_[2]);
  if (header_.profile == Profile::kPacked) {
    *p++ = static_cast<std::uint8_t> (orders_[0] | orders_[1] << 4);
    *p++ = static_cast<std::uint8_t> (orders_[2] | orders_[3] << 4);
  }
  std::copy_n (bytes_.data (), size, p);
  result_.slices++;
  result_.delta_slices += !header_.key;
}

void
CompactEncoder::resize (int columns)
{
  columns_ = columns;
  const auto n = static_cast<std::size_t> (columns);
  const auto most = static_cast<std::size_t> (header_.roi.width); /* of later partitions */
  row_.reserve (most);
  upper_.reserve (most);
  row_.reset (n, kInvalidKey);
  upper_.reset (n, kInvalidKey);
  own_.resize (std::max (own_.size (), most));
  earlier_codes_.resize (own_.size ());
  earlier_keys_.resize (own_.size ());
  runs_.reserve (most + 1);
  motions_.reserve (most / kMotionBlock + 2);
  /* A row is coded completely before the size of its slice is checked. */
  const std::size_t size = static_cast<std::size_t> (settings_.max_slice_size) +
                           (kMaxBytesOfPixel + kMaxBytesOfRun) * (most + 1);
  bytes_.resize (std::max (bytes_.size (), size));
}

/* Codes all rows of a band in the header's columns.
 * @return false if one row is longer than a slice may be */
template <class Code, bool Delta>
bool
CompactEncoder::code_rows (
    const ConstRangeImage &image, const RowBand &band, std::vector<std::uint8_t> &to)
{
  resize (header_.columns);
  motions_.assign (
      motion_blocks (header_.roi.x + header_.first_column, header_.columns), BlockMotion{});
  if constexpr (Code::kByRow)
    entropy_.reset (
        static_cast<std::size_t> (columns_), static_cast<std::size_t> (header_.roi.width));
  Code code = begin_slice<Code, Delta> (band.first_row);
  for (int y = band.first_row; y < band.first_row + band.rows; y++) {
    for_this_cpu ([&] { load_row (image, y); });
    if constexpr (Delta) {
      if (y == band.first_row || (header_.roi.y + y) % kMotionBlock == 0)
        find_motions (image, y, band);
      load_earlier (y);
    }
    if constexpr (Code::kByRow)
      reserve_entries (code);
    const EncoderResult result = result_;
    const Components sums = size_sums_, counts = size_counts_;
    Code before = code;
    const bool begins_block = header_.rows == 0 || (header_.roi.y + y) % kMotionBlock == 0;
    if (!code_row<Code, Delta> (code, begins_block)) {
      if (header_.rows == 0)
        return false;
      result_ = result;
      size_sums_ = sums;
      size_counts_ = counts;
      close_slice (before, to);
      code = begin_slice<Code, Delta> (y);
      upper_.reset (static_cast<std::size_t> (columns_), kInvalidKey);
      if constexpr (Code::kByRow)
        entropy_.upper.reset (static_cast<std::size_t> (columns_));
      if (!code_row<Code, Delta> (code, true))
        return false;
    }
    if (reference_.now)
      reference_.now->keep (
          header_.roi.x + header_.first_column, header_.roi.y + y, row_.as_reference ());
    header_.rows++;
    std::swap (row_, upper_);
    if constexpr (Code::kByRow)
      std::swap (entropy_.now, entropy_.upper);
  }
  close_slice (code, to);
  return true;
}

bool
CompactEncoder::code_partition (const CompactPicture &picture, const RowBand &band,
    const SliceHeader &header, std::vector<std::uint8_t> &to, EncoderResult &result)
{
  reference_ = picture.reference;
  quantisers_ = &picture.quantisers;
  motion_memory_ = &picture.motions;
  refresh_rows_ = picture.refresh_rows;
  header_ = header;
  result_ = {};
  const auto bias = [] (int depth, int colour) {
    return near_bias (static_cast<std::uint32_t> (depth), static_cast<std::uint32_t> (colour));
  };
  const auto weight = [] (int threshold) {
    return 1 / ((float (threshold) + 0.5f) * (float (threshold) + 0.5f));
  };
  settings_ = finer_settings (picture.settings);
  const int depth = settings_.depth_threshold, colour = settings_.colour_threshold;
  const int earlier_depth = picture.settings.depth_threshold,
            earlier_colour = picture.settings.colour_threshold;
  bias_ = bias (depth, colour);
  earlier_bias_ = bias (earlier_depth, earlier_colour);
  earlier_threshold_ = Components{earlier_depth, earlier_colour, earlier_colour, earlier_colour};
  depth_weight_ = weight (depth);
  colour_weight_ = weight (colour);
  steps_ = steps_within (depth, colour).components ();
  reciprocals_ = 1.0f / __builtin_convertvector(steps_, FloatComponents);
  limits_ =
      PixelLimits (quantisers_->depth.codes () - 1, (1 << quantisers_->colour.bits ()) - 1, steps_);
  scale_ = MotionScale (steps_[0], limits_.max[0]);
  orders_ = {};
  size_sums_ = size_counts_ = Components{};
  const ConstRangeImage &image = picture.image;
  const bool packed = header.profile == Profile::kPacked;
  const bool fits = packed && band.key ? code_rows<PackedWriter, false> (image, band, to)
                    : packed           ? code_rows<PackedWriter, true> (image, band, to)
                    : band.key         ? code_rows<EntropyWriter, false> (image, band, to)
                                       : code_rows<EntropyWriter, true> (image, band, to);
  result += result_;
  return fits;
}

} // namespace rangecast
