/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "compact_encoder.hpp"

#include <cmath>

#include "entropy_code.hpp"
#include "packed_code.hpp"

namespace rangecast {
namespace {

/* What one pixel may add to a slice at most, whatever its code; and one run. */
constexpr std::size_t kMostBytesOfPixel = 512, kMostBytesOfRun = 64;

/* About as wide as high, so that few pixels lack their upper neighbours: a slice has so many
 * columns for each byte^(1/2) of its size. */
constexpr double kColumnsOfSlice = 2.8;

/* How full slices with a reference are meant to be: then few of them break in their band. */
constexpr double kFillOfDeltaSlice = 0.8;

/* What choice=best weighs. An error counts in thresholds squared. Bits are what choices and
 * residuals come to on average in recordings; their price was found by trying. */
constexpr float kPriceOfBit = 0.2f;
constexpr float kBitsOfChoice[] = {0.7f, 3.5f, 2.5f, 3.5f};

float
bits_of (const Components &residual)
{
  constexpr float kBitsOfZero[] = {0.4f, 0.4f, 0.25f, 0.25f};
  constexpr float kBitsOfSign[] = {2.5f, 2.5f, 3, 3};
  float bits = 2.5f;
  if (residual == Components{})
    return bits;
  for (std::size_t i = 0; i < kComponents; i++) {
    const auto size = static_cast<std::uint32_t> (std::abs (residual[i]));
    bits += size == 0 ? kBitsOfZero[i] : kBitsOfSign[i] + 2 * float (std::bit_width (size) - 1);
  }
  return bits;
}

/* The first neighbour that is near enough, or kPredict; `above` is the pixel above. */
inline int
first_near (Lanes own, const Lanes &left, const Lanes *above, Lanes threshold)
{
  if (are_near (own, left, threshold))
    return kTakeLeft;
  for (int i = 0; i < 3; i++)
    if (are_near (own, above[i - 1], threshold))
      return kTakeUpperLeft + i;
  return kPredict;
}

/* An EntropyCode that looks like a PackedWriter. */
class EntropyWriter : public EntropyCode<EntropyWriting> {
public:
  static constexpr bool kEarlierInRuns = false;

  EntropyWriter (
      std::uint8_t *to, EntropyModel &model, const EntropyModel &initial, const GolombOrders &)
      : EntropyCode (EntropyWriting (to), model)
  {
    model = initial;
  }
  void run (bool valid, std::int32_t later) { (void)EntropyCode::run (valid, later); }
  void residual (const Neighbours &n, bool has_neighbour, Components r)
  {
    (void)EntropyCode::residual (n, has_neighbour, r);
  }
  [[nodiscard]] std::size_t bound () const { return coder ().bound (); }
  std::size_t finish () { return coder ().finish (); }
};

/* Residuals are divided by multiplication: with this reciprocal it is exact for all there are. */
constexpr int kReciprocalBits = 40;

std::uint64_t
reciprocal_of (std::int32_t step)
{
  return (std::uint64_t{1} << kReciprocalBits) / static_cast<std::uint64_t> (step) + 1;
}

std::int32_t
rounded (std::int32_t difference, std::int32_t step, std::uint64_t reciprocal)
{
  const auto size = static_cast<std::uint64_t> (std::abs (difference) + step / 2);
  const auto quotient = static_cast<std::int32_t> (size * reciprocal >> kReciprocalBits);
  return difference < 0 ? -quotient : quotient;
}

/* Order of the exponential Golomb code that suits sizes of this mean. */
std::uint8_t
golomb_order (std::uint64_t sum, std::uint64_t count)
{
  const std::uint64_t mean = count > 0 ? sum / count : 0;
  return static_cast<std::uint8_t> (std::min<int> (std::bit_width (mean + mean / 2), 15));
}

} // namespace

Steps
steps_within (int depth_threshold, int colour_threshold)
{
  /* A rounded residual may be wrong by half its step. A wrong Y changes R, G and B as much; wrong
   * Co and Cg together, by the larger of them plus 1 (docs/bitstream.md, "How an encoder chooses").
   * Coarse depth steps save more than they cost; a third for Y leaves chroma the rest. */
  const int depth = (3 * depth_threshold + 2) / 4;
  const int luma = (9 * colour_threshold + 12) / 25;
  const int chroma = std::max (0, colour_threshold - luma - 1);
  const auto step = [] (int error, int most) { return std::min (2 * error + 1, most); };
  return {step (depth, 65535), step (luma, 255), step (chroma, 255)};
}

void
CompactEncoder::set_thresholds (const CompactSettings &settings, bool is_reference)
{
  const int d = settings.depth_threshold, c = settings.colour_threshold;
  earlier_threshold_ = Lanes{d, c, c, c};
  /* Pixels to which later frame sets refer are made finer than need be: they can then be taken
   * again for longer. */
  const auto finer = [&] (int threshold) {
    return is_reference ? (3 * threshold + 2) / 4 : threshold;
  };
  settings_ = settings;
  settings_.depth_threshold = finer (d);
  settings_.colour_threshold = finer (c);
  const int colour = settings_.colour_threshold;
  threshold_ = Lanes{settings_.depth_threshold, colour, colour, colour};
  steps_ = steps_within (settings_.depth_threshold, colour).components ();
  for (std::size_t i = 0; i < kComponents; i++)
    reciprocals_[i] = reciprocal_of (steps_[i]);
  const auto weight = [] (int threshold) {
    return 1 / ((float (threshold) + 0.5f) * (float (threshold) + 0.5f));
  };
  depth_weight_ = weight (settings_.depth_threshold);
  colour_weight_ = weight (colour);
}

CompactResult
CompactEncoder::encode (const ConstRangeImage &image, std::span<const RowBand> bands,
    const CodingReference &reference, const CompactQuantisers &quantisers,
    const CompactSettings &settings, const SliceHeader &header, std::vector<std::uint8_t> &to)
{
  reference_ = reference;
  quantisers_ = &quantisers;
  header_ = header;
  result_ = {};
  limits_ = {quantisers.depth.codes () - 1, (1 << quantisers.colour.bits ()) - 1};
  set_thresholds (settings, reference.now != nullptr);

  std::size_t delta_bytes = 0, delta_pixels = 0;
  for (const RowBand &band : bands) {
    const std::size_t begin = to.size ();
    header_.key = band.key;
    header_.reference_distance = band.key ? std::uint8_t{0} : header.reference_distance;
    code_band (image, band, to);
    if (!band.key) {
      delta_bytes += to.size () - begin;
      delta_pixels +=
          static_cast<std::size_t> (band.rows) * static_cast<std::size_t> (image.roi.width);
    }
  }
  if (delta_pixels > 0)
    delta_bytes_per_pixel_ = double (delta_bytes) / double (delta_pixels);
  return result_;
}

/* Slices about as wide as high; but with a reference they are as high as their band, if last time
 * is anything to go by. */
int
CompactEncoder::pieces_of (const RowBand &band, int width) const
{
  double side = kColumnsOfSlice * std::sqrt (settings_.max_slice_size);
  if (!band.key && delta_bytes_per_pixel_ > 0) {
    const double columns =
        kFillOfDeltaSlice * settings_.max_slice_size / (delta_bytes_per_pixel_ * band.rows);
    side = std::clamp (columns, side, double (std::max (width, int (side) + 1)));
  }
  return std::clamp (int (std::lround (width / side)), 1, width);
}

void
CompactEncoder::code_band (
    const ConstRangeImage &image, const RowBand &band, std::vector<std::uint8_t> &to)
{
  const int width = image.roi.width;
  const std::size_t begin = to.size ();
  const CompactResult before = result_;
  const bool packed = header_.profile == Profile::kPacked;
  for (int pieces = pieces_of (band, width);; pieces = std::min (2 * pieces, width)) {
    bool fits = true;
    orders_ = {};
    for (int i = 0; i < pieces && fits; i++) {
      header_.first_column = width * i / pieces;
      header_.columns = width * (i + 1) / pieces - header_.first_column;
      if (band.key)
        fits = packed ? code_piece<PackedWriter, false> (image, band, to)
                      : code_piece<EntropyWriter, false> (image, band, to);
      else
        fits = packed ? code_piece<PackedWriter, true> (image, band, to)
                      : code_piece<EntropyWriter, true> (image, band, to);
    }
    if (fits)
      return;
    to.resize (begin); /* a row alone was too long: narrower pieces */
    result_ = before;
  }
}

std::size_t
CompactEncoder::header_size () const
{
  return (header_.profile == Profile::kPacked ? kPackedHeaderSize : kEntropyHeaderSize) +
         !header_.key;
}

void
CompactEncoder::resize (int columns)
{
  columns_ = columns;
  const auto n = static_cast<std::size_t> (columns);
  for (Row *row : {&row_, &upper_}) {
    row->pixels.assign (n + 3, {});
    row->colours.assign (n + 2, Lanes{kNoDepthCode, 0, 0, 0});
    row->valid.assign (n, 0);
    row->earlier.assign (n, 0);
  }
  own_.resize (std::max (own_.size (), n));
  earlier_codes_.resize (std::max (earlier_codes_.size (), n));
  earlier_colours_.resize (std::max (earlier_colours_.size (), n));
  const std::size_t most = static_cast<std::size_t> (settings_.max_slice_size) + kMostBytesOfPixel +
                           kMostBytesOfRun * (n + 1);
  bytes_.resize (std::max (bytes_.size (), most));
}

void
CompactEncoder::load_row (const ConstRangeImage &image, int y)
{
  const std::uint16_t *depth = image.depth.row (y) + header_.first_column;
  const Rgbx *colour = image.colour.row (y) + header_.first_column;
  const DepthQuantiser &d = quantisers_->depth;
  const ColourQuantiser &c = quantisers_->colour;
  for (int x = 0; x < columns_; x++) {
    const auto at = static_cast<std::size_t> (x);
    const bool valid = d.valid (depth[x]);
    row_.valid[at] = valid;
    own_[at] = valid ? Lanes{d.code (depth[x]), c.code (colour[x].r), c.code (colour[x].g),
                           c.code (colour[x].b)}
                     : Lanes{kNoDepthCode, 0, 0, 0};
  }
}

/* Motion of the blocks that begin in row y, or go on there. They refer to rows of their band only,
 * so that damage stays in it. */
void
CompactEncoder::find_motions (const ConstRangeImage &image, int y, const RowBand &band)
{
  const Roi &roi = header_.roi;
  const int first_x = roi.x + header_.first_column, end_x = first_x + columns_;
  const int first_y = roi.y + y, band_y = roi.y + band.first_row, end_y = band_y + band.rows;
  const int height = std::min ((first_y / kMotionBlock + 1) * kMotionBlock, end_y) - first_y;
  BlockMotion near_by[2];
  for (std::size_t i = 0; i < motions_.size (); i++) {
    const int x = i == 0 ? first_x : (first_x / kMotionBlock + int (i)) * kMotionBlock;
    const int next = std::min ((x / kMotionBlock + 1) * kMotionBlock, end_x);
    near_by[1] = motions_[i];
    motions_[i] = search_.find (image, quantisers_->depth, quantisers_->colour, *reference_.before,
        earlier_threshold_, {x, first_y, next - x, height, band_y, end_y}, near_by);
    near_by[0] = motions_[i];
  }
}

/* Finds the pixels that equal those of the earlier frame set, as far as thresholds go. */
void
CompactEncoder::load_earlier (int y, const RowBand &band)
{
  const auto columns = static_cast<std::size_t> (columns_);
  const Roi &roi = header_.roi;
  const int band_y = roi.y + band.first_row;
  fetch_displaced (*reference_.before, roi.x + header_.first_column, roi.y + y, motions_,
      limits_.last_depth, band_y, band_y + band.rows, std::span (earlier_codes_).first (columns));
  for (std::size_t x = 0; x < columns; x++) {
    row_.earlier[x] = 0;
    if (!row_.valid[x] || earlier_codes_[x] == kNoPixel)
      continue;
    const Components c = components_of (earlier_codes_[x]);
    const auto rgb = to_rgb (c, limits_.maximum);
    earlier_colours_[x] = Lanes{c[0], rgb[0], rgb[1], rgb[2]};
    row_.earlier[x] = are_near (own_[x], earlier_colours_[x], earlier_threshold_);
  }
}

/* Makes pixel x what the decoder will make of a prediction and a residual. @return that residual */
Components
CompactEncoder::make_full (std::size_t x, const Neighbours &n)
{
  const Components expected = predict (n, last_, limits_.last_depth);
  const Lanes own = own_[x];
  const auto colour = to_luma_chroma (own[1], own[2], own[3]);
  const Components wanted = {own[0], colour[0], colour[1], colour[2]};
  Components residual;
  for (std::size_t i = 0; i < kComponents; i++)
    residual[i] = rounded (wanted[i] - expected[i], steps_[i], reciprocals_[i]);
  const Components made = correct (expected, residual, steps_, limits_);
  const auto rgb = to_rgb (made, limits_.maximum);
  row_.pixels[x + 1] = {pack_components (made), Origin::kCorrected, activity_of (residual)};
  row_.colours[x + 1] = Lanes{made[0], rgb[0], rgb[1], rgb[2]};
  return residual;
}

/* The neighbour with the least sum of error and price, or kPredict if the pixel in full has less.
 * @param[out] residual  of the pixel in full, which make_full() made */
int
CompactEncoder::best_choice (std::size_t x, const Neighbours &n, Components &residual)
{
  const Lanes own = own_[x];
  const auto error = [&] (Lanes other) {
    const Lanes d = own - other;
    return depth_weight_ * float (d[0]) * float (d[0]) +
           colour_weight_ * float (d[1] * d[1] + d[2] * d[2] + d[3] * d[3]);
  };
  residual = make_full (x, n);
  int best = kPredict;
  float least = error (row_.colours[x + 1]) + kPriceOfBit * bits_of (residual);
  const PixelCode codes[] = {n.left.code, n.upper_left.code, n.upper.code, n.upper_right.code};
  for (std::size_t i = 0; i < 4; i++) {
    const Lanes other = i == 0 ? row_.colours[x] : upper_.colours[x + i - 1];
    /* Profile entropy cannot name one that equals an earlier one. */
    if (!are_near (own, other, threshold_) || std::find (codes, codes + i, codes[i]) != codes + i)
      continue;
    const float sum = error (other) + kPriceOfBit * kBitsOfChoice[i];
    if (sum < least) {
      best = static_cast<int> (i);
      least = sum;
    }
  }
  return best;
}

/* Codes a pixel that no neighbour replaces. */
template <class Code, bool Delta>
void
CompactEncoder::code_full (
    Code &code, const Neighbours &n, std::size_t x, const Components &residual)
{
  const bool has_neighbour = n.any (), predicted = has_neighbour && residual == Components{};
  result_.full_pixels++;
  if (has_neighbour)
    code.template choice<Delta> (n, predicted ? kPredict : kCorrect);
  if (predicted) {
    row_.pixels[x + 1] = {row_.pixels[x + 1].code, Origin::kPredicted};
    return;
  }
  code.residual (n, has_neighbour, residual);
  for (std::size_t i = 0; i < kComponents; i++) {
    size_sums_[i] += static_cast<std::uint64_t> (std::max (std::abs (residual[i]) - 1, 0));
    size_counts_[i] += residual[i] != 0;
  }
}

/* Codes a run of valid pixels. @return false if the slice has become too long
 *
 * What the loop needs of this object it holds in variables of its own, the code too: bytes are
 * written in it, and for all that the compiler knows any byte may be one of this object's. */
template <class Code, bool Delta>
bool
CompactEncoder::code_run (Code &slice_code, std::size_t begin, std::size_t end)
{
  const std::size_t limit = static_cast<std::size_t> (settings_.max_slice_size) - header_size ();
  CodedPixel *const pixels = row_.pixels.data () + 1;
  const CodedPixel *const upper = upper_.pixels.data () + 1;
  Lanes *const colours = row_.colours.data () + 1;
  const Lanes *const upper_colours = upper_.colours.data () + 1;
  const Lanes *const own = own_.data ();
  const Lanes threshold = threshold_;
  const bool best = settings_.best;
  Neighbours n = {pixels[begin - 1], upper[begin - 1], upper[begin], upper[begin + 1]};
  Code code = slice_code;
  std::size_t x = begin;
  for (; x < end && code.bound () <= limit; x++) {
    if constexpr (Delta) {
      const bool earlier = row_.earlier[x];
      if constexpr (!Code::kEarlierInRuns)
        (void)code.earlier (n, earlier);
      if (earlier) {
        colours[x] = earlier_colours_[x];
        pixels[x] = CodedPixel::copy (earlier_codes_[x], kTakeEarlier);
        n.move (pixels[x], upper[x + 2]);
        continue;
      }
    }
    Components residual;
    const int chosen = best ? best_choice (x, Neighbours (n), residual)
                            : first_near (own[x], colours[x - 1], upper_colours + x, threshold);
    if (chosen == kTakeLeft) {
      code.template choice<Delta> (n, chosen);
      colours[x] = colours[x - 1];
      pixels[x] =
          Delta ? CodedPixel::copy (n.left.code, chosen) : CodedPixel (n.left.code, Origin::kLeft);
    } else if (chosen != kPredict) {
      code.template choice<Delta> (n, chosen);
      const std::size_t from = x + static_cast<std::size_t> (chosen) - kTakeUpper;
      colours[x] = upper_colours[from];
      pixels[x] = Delta ? CodedPixel::copy (upper[from].code, chosen)
                        : CodedPixel (upper[from].code, Origin::kUpper);
    } else {
      Code copy = code;
      const Neighbours near = n;
      code_full<Code, Delta> (copy, near, x, best ? Components (residual) : make_full (x, near));
      code = copy;
    }
    n.move (pixels[x], upper[x + 2]);
  }
  last_ = n.left.code;
  slice_code = code;
  return code.bound () <= limit;
}

/* Codes which pixels of the row are valid. */
template <class Code>
void
CompactEncoder::code_runs (Code &code)
{
  const auto columns = static_cast<std::size_t> (columns_);
  const std::span<const std::uint8_t> valid (row_.valid.data (), columns),
      upper (upper_.valid.data (), columns);
  bool now = false;
  for (int x = 0; x < columns_; now = !now) {
    const int end = run_end (valid, x, now);
    code.run (now, end - run_end (upper, x, now));
    x = end;
  }
}

/* Codes which pixels of a run of valid ones equal those of the earlier frame set. */
template <class Code>
void
CompactEncoder::code_earlier_runs (Code &code, std::size_t begin, std::size_t end)
{
  const std::span<const std::uint8_t> own (row_.earlier.data (), end),
      upper (upper_.earlier.data (), end);
  bool now = false;
  for (auto x = static_cast<int> (begin); x < static_cast<int> (end); now = !now) {
    const int to = run_end (own, x, now);
    code.earlier_run (to - run_end (upper, x, now));
    x = to;
  }
}

template <class Code>
void
CompactEncoder::code_motions (Code &code)
{
  BlockMotion expected;
  for (BlockMotion &m : motions_) {
    (void)code.motion (expected, m);
    expected = m;
  }
}

/* @return false if the slice has become too long; the row is then to be coded again */
template <class Code, bool Delta>
bool
CompactEncoder::code_row (Code &slice_code, bool begins_block)
{
  if constexpr (Delta)
    if (begins_block)
      code_motions (slice_code);
  code_runs (slice_code);
  const auto columns = static_cast<std::size_t> (columns_);
  const std::span<const std::uint8_t> valid (row_.valid.data (), columns);
  bool now = false;
  for (int x = 0; x < columns_; now = !now) {
    const int end = run_end (valid, x, now);
    const auto first = static_cast<std::size_t> (x), behind = static_cast<std::size_t> (end);
    if (!now) {
      std::fill (&row_.pixels[first + 1], &row_.pixels[behind + 1], CodedPixel{});
      std::fill (&row_.colours[first + 1], &row_.colours[behind + 1], Lanes{kNoDepthCode, 0, 0, 0});
    } else {
      if constexpr (Delta && Code::kEarlierInRuns)
        code_earlier_runs (slice_code, first, behind);
      if (!code_run<Code, Delta> (slice_code, first, behind))
        return false;
    }
    x = end;
  }
  return slice_code.bound () <=
         static_cast<std::size_t> (settings_.max_slice_size) - header_size ();
}

template <class Code, bool Delta>
Code
CompactEncoder::begin_slice (int first_row)
{
  for (std::size_t i = 0; i < kComponents; i++) /* the last slice is the best guess for this one */
    if (size_counts_[i] > 0)
      orders_[i] = golomb_order (size_sums_[i], size_counts_[i]);
  size_sums_ = size_counts_ = {};
  header_.first_row = first_row;
  header_.rows = 0;
  last_ = pack_components ({limits_.last_depth / 2, limits_.maximum / 2, 0, 0});
  std::ranges::fill (upper_.pixels, CodedPixel{});
  std::ranges::fill (upper_.colours, Lanes{kNoDepthCode, 0, 0, 0});
  std::ranges::fill (upper_.valid, std::uint8_t{0});
  std::ranges::fill (upper_.earlier, std::uint8_t{0});
  return Code (bytes_.data (), model_, Delta ? kInitialDeltaModel : kInitialModel, orders_);
}

template <class Code>
void
CompactEncoder::close_slice (Code &code, std::vector<std::uint8_t> &to)
{
  const std::size_t begin = to.size (), header_bytes = header_size (), size = code.finish ();
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

/* Codes all rows of a band in the columns that the header says.
 * @return false if one row alone is longer than a slice may be */
template <class Code, bool Delta>
bool
CompactEncoder::code_piece (
    const ConstRangeImage &image, const RowBand &band, std::vector<std::uint8_t> &to)
{
  resize (header_.columns);
  motions_.assign (
      motion_blocks (header_.roi.x + header_.first_column, header_.columns), BlockMotion{});
  size_sums_ = size_counts_ = {};
  Code code = begin_slice<Code, Delta> (band.first_row);
  for (int y = band.first_row; y < band.first_row + band.rows; y++) {
    load_row (image, y);
    const bool begins_block = (header_.roi.y + y) % kMotionBlock == 0;
    if constexpr (Delta) {
      if (begins_block || y == band.first_row)
        find_motions (image, y, band);
      load_earlier (y, band);
    }
    const CompactResult result = result_;
    Code before = code;
    model_before_ = model_;
    if (!code_row<Code, Delta> (code, begins_block || header_.rows == 0)) {
      if (header_.rows == 0)
        return false;
      result_ = result;
      close_slice (before, to);
      code = begin_slice<Code, Delta> (y);
      if (!code_row<Code, Delta> (code, true))
        return false;
    }
    if (reference_.now) {
      std::uint64_t *kept = reference_.now->row (y) + header_.first_column;
      for (int x = 0; x < columns_; x++)
        kept[x] = row_.pixels[static_cast<std::size_t> (x) + 1].code;
    }
    header_.rows++;
    std::swap (row_, upper_);
  }
  close_slice (code, to);
  return true;
}

} // namespace rangecast
