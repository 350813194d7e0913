/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "compact_encoder.hpp"

#include <cmath>

#include "entropy_code.hpp"
#include "packed_code.hpp"

namespace rangecast {
namespace {

/* What one pixel may add to a slice at most, whatever its code. */
constexpr std::size_t kMostBytesOfPixel = 512;
/* And one row of a packed slice for its runs: one a pixel. */
constexpr std::size_t kMostBytesOfRun = 5;

/* A slice needs a side of this many pixels for each byte^(1/2) of its size: then it is about as
 * wide as high, and few of its pixels lack their upper neighbours. */
constexpr double kColumnsOfSlice = 2.8;

/* EntropyCode as a PackedWriter looks. */
class EntropyWriter {
public:
  EntropyWriter (std::uint8_t *to, const GolombOrders &) : code_ (EntropyWriting (to)) {}
  void row (std::span<const std::uint8_t>, std::span<const std::uint8_t>) {}
  void valid (const Neighbours &n, bool is_valid) { code_.valid (n, is_valid); }
  void choice (const Neighbours &n, int chosen) { code_.choice (n, chosen); }
  void residual (const Neighbours &n, bool has_neighbour, Components r)
  {
    (void)code_.residual (n, has_neighbour, r);
  }
  [[nodiscard]] std::size_t bound () const { return code_.coder ().bound (); }
  std::size_t finish () { return code_.coder ().finish (); }

private:
  EntropyCode<EntropyWriting> code_;
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

CompactResult
CompactEncoder::encode (const ConstRangeImage &image, const CompactQuantisers &quantisers,
    const CompactSettings &settings, SliceHeader header, std::vector<std::uint8_t> &to)
{
  settings_ = settings;
  quantisers_ = &quantisers;
  header_ = header;
  result_ = {};
  limits_ = {quantisers.depth.codes () - 1, (1 << quantisers.colour.bits ()) - 1};
  steps_ = steps_within (settings.depth_threshold, settings.colour_threshold).components ();
  for (std::size_t i = 0; i < kComponents; i++)
    reciprocals_[i] = reciprocal_of (steps_[i]);
  const int c = settings.colour_threshold;
  threshold_ = Lanes{settings.depth_threshold, c, c, c};

  const int width = image.roi.width;
  const double side = kColumnsOfSlice * std::sqrt (settings.max_slice_size);
  const std::size_t begin = to.size ();
  for (int pieces = std::max (1, int (std::lround (width / side)));; pieces *= 2) {
    pieces = std::min (pieces, width);
    bool fits = true;
    orders_ = {};
    for (int i = 0; i < pieces && fits; i++) {
      const int first = width * i / pieces, columns = width * (i + 1) / pieces - first;
      fits = header.profile == Profile::kPacked
                 ? code_piece<PackedWriter> (image, first, columns, to)
                 : code_piece<EntropyWriter> (image, first, columns, to);
    }
    if (fits)
      break;
    to.resize (begin); /* a row alone was too long: narrower pieces */
    result_ = {};
  }
  return result_;
}

std::size_t
CompactEncoder::header_size () const
{
  return header_.profile == Profile::kPacked ? kPackedHeaderSize : kEntropyHeaderSize;
}

void
CompactEncoder::resize (int columns, int max_slice_size)
{
  columns_ = columns;
  const auto n = static_cast<std::size_t> (columns);
  for (Row *row : {&row_, &upper_}) {
    row->pixels.assign (n + 2, {});
    row->colours.assign (n + 2, Lanes{kNoDepthCode, 0, 0, 0});
    row->valid.assign (n, 0);
  }
  own_.resize (std::max (own_.size (), n));
  bytes_.resize (std::max (bytes_.size (),
      static_cast<std::size_t> (max_slice_size) + kMostBytesOfPixel + kMostBytesOfRun * (n + 1)));
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

/* The first neighbour that is near enough to own_[x], or kPredict for none. */
int
CompactEncoder::near_neighbour (std::size_t x) const
{
  const Lanes own = own_[x];
  if (are_near (own, row_.colours[x], threshold_))
    return kTakeLeft;
  for (std::size_t i = 0; i < 3; i++)
    if (are_near (own, upper_.colours[x + i], threshold_))
      return kTakeUpperLeft + static_cast<int> (i);
  return kPredict;
}

/* The one that differs least, in parts of the thresholds. */
int
CompactEncoder::nearest_neighbour (std::size_t x) const
{
  const Lanes own = own_[x];
  const float depth_weight = 2 / ((float (threshold_[0]) + 0.5f) * (float (threshold_[0]) + 0.5f));
  const float colour_weight = 1 / ((float (threshold_[1]) + 0.5f) * (float (threshold_[1]) + 0.5f));
  int best = kPredict;
  float least = 0;
  for (std::size_t i = 0; i < 4; i++) {
    const Lanes other = i == 0 ? row_.colours[x] : upper_.colours[x + i - 1];
    if (!are_near (own, other, threshold_))
      continue;
    const Lanes d = own - other;
    const float distance = depth_weight * float (d[0]) * float (d[0]) +
                           colour_weight * float (d[1] * d[1] + d[2] * d[2] + d[3] * d[3]);
    if (best == kPredict || distance < least) {
      best = static_cast<int> (i);
      least = distance;
    }
  }
  return best;
}

/* Sets pixel x + 1 of the row to what the decoder will make of a prediction and a residual. */
void
CompactEncoder::write_full (std::size_t x, const Neighbours &n, Components &residual)
{
  const Components expected = predict (n, last_, limits_.last_depth);
  const Lanes own = own_[x];
  const auto colour = to_luma_chroma (own[1], own[2], own[3]);
  const Components wanted = {own[0], colour[0], colour[1], colour[2]};
  for (std::size_t i = 0; i < kComponents; i++)
    residual[i] = rounded (wanted[i] - expected[i], steps_[i], reciprocals_[i]);
  const Components made = correct (expected, residual, steps_, limits_);
  const auto rgb = to_rgb (made, limits_.maximum);
  CodedPixel &pixel = row_.pixels[x + 1];
  pixel.code = pack_components (made);
  pixel.activity = activity_of (residual);
  pixel.origin = residual == Components{} ? Origin::kPredicted : Origin::kCorrected;
  row_.colours[x + 1] = Lanes{made[0], rgb[0], rgb[1], rgb[2]};
}

template <class Code>
void
CompactEncoder::code_pixel (Code &code, std::size_t x)
{
  CodedPixel &pixel = row_.pixels[x + 1];
  const Neighbours n = {
      row_.pixels[x], upper_.pixels[x], upper_.pixels[x + 1], upper_.pixels[x + 2]};
  code.valid (n, row_.valid[x]);
  if (!row_.valid[x]) {
    pixel = {};
    row_.colours[x + 1] = own_[x];
    return;
  }
  int chosen = settings_.best ? nearest_neighbour (x) : near_neighbour (x);
  if (chosen != kPredict) {
    code.choice (n, chosen);
    const bool left = chosen == kTakeLeft;
    const auto at = x + static_cast<std::size_t> (chosen) - kTakeUpperLeft;
    row_.colours[x + 1] = left ? row_.colours[x] : upper_.colours[at];
    pixel = {
        left ? n.left.code : upper_.pixels[at].code, {}, left ? Origin::kLeft : Origin::kUpper};
  } else {
    Components residual;
    write_full (x, n, residual);
    const bool has_neighbour = n.any ();
    chosen = pixel.origin == Origin::kPredicted ? kPredict : kCorrect;
    if (has_neighbour)
      code.choice (n, chosen);
    if (!has_neighbour || chosen == kCorrect) {
      pixel.origin = Origin::kCorrected;
      code.residual (n, has_neighbour, residual);
      for (std::size_t i = 0; i < kComponents; i++) {
        size_sums_[i] += static_cast<std::uint64_t> (std::max (std::abs (residual[i]) - 1, 0));
        size_counts_[i] += residual[i] != 0;
      }
    }
    result_.full_pixels++;
  }
  last_ = pixel.code;
}

/* @return false if the slice has become too long; the row is then to be coded again */
template <class Code>
bool
CompactEncoder::code_row (Code &code)
{
  const auto columns = static_cast<std::size_t> (columns_);
  const std::size_t limit = static_cast<std::size_t> (settings_.max_slice_size) - header_size ();
  code.row ({row_.valid.data (), columns}, {upper_.valid.data (), columns});
  for (std::size_t x = 0; x < columns && code.bound () <= limit; x++)
    code_pixel (code, x);
  return code.bound () <= limit;
}

template <class Code>
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
  return Code (bytes_.data (), orders_);
}

template <class Code>
void
CompactEncoder::close_slice (Code &code, std::vector<std::uint8_t> &to)
{
  const std::size_t begin = to.size (), header_bytes = header_size (), size = code.finish ();
  to.resize (begin + header_bytes + size);
  std::uint8_t *p = to.data () + begin;
  write_slice_header (header_, header_bytes + size, p);
  p += kSliceHeaderSize;
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
}

/* Codes all rows of some columns. @return false if one row alone is longer than a slice may be */
template <class Code>
bool
CompactEncoder::code_piece (
    const ConstRangeImage &image, int first_column, int columns, std::vector<std::uint8_t> &to)
{
  header_.first_column = first_column;
  header_.columns = columns;
  resize (columns, settings_.max_slice_size);
  size_sums_ = size_counts_ = {};
  Code code = begin_slice<Code> (0);
  for (int y = 0; y < image.roi.height; y++) {
    load_row (image, y);
    Code before = code;
    const CompactResult result = result_;
    if (!code_row (code)) {
      if (header_.rows == 0)
        return false;
      result_ = result;
      close_slice (before, to);
      code = begin_slice<Code> (y);
      if (!code_row (code))
        return false;
    }
    header_.rows++;
    std::swap (row_, upper_);
  }
  close_slice (code, to);
  return true;
}

} // namespace rangecast
