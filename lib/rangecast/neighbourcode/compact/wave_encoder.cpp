/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* CompactEncoder in waves: key slices, the first neighbour that is near enough. */
#include "../../base/simd.hpp"
#include "encoder.hpp"

namespace rangecast {
namespace {

std::int32_t
reciprocal (std::int32_t step)
{
  return std::min ((32768 + step / 2) / step, 32767);
}

} // namespace

bool
CompactEncoder::can_do_waves (const CompactPicture &picture, bool key) const
{
  return key && !settings_.best && !picture.reference.now &&
         settings_.depth_threshold <= kMaxWaveNumber && steps_[0] <= kMaxWaveNumber &&
         wave_functions (cpu_level ());
}

void
CompactEncoder::begin_waves ()
{
  columns_ = header_.columns;
  const auto of_steps = [&] (std::int32_t (*f) (std::int32_t)) {
    return wave_code (Components{f (steps_[0]), f (steps_[1]), f (steps_[2]), f (steps_[3])});
  };
  const auto maximum = static_cast<unsigned> (limits_.max[1]);
  const auto last_depth = static_cast<unsigned> (limits_.max[0]);
  waves_.steps = {wave_code (steps_), wave_code (steps_ / 2), of_steps (reciprocal),
      wave_pixel (limits_.min), wave_pixel (limits_.max), kWaveDepthSign,
      plain_pixel (maximum, maximum, maximum, last_depth) ^ kWaveDepthSign,
      limits_.max[0] > kMaxWaveNumber};
  const auto colour = static_cast<unsigned> (settings_.colour_threshold);
  waves_.threshold =
      plain_pixel (colour, colour, colour, static_cast<unsigned> (settings_.depth_threshold));
  const auto fill_bits = [&] (PixelBits &bits) {
    bits.reserve (bit_words (static_cast<std::size_t> (header_.roi.width)));
    bits.assign (bit_words (static_cast<std::size_t> (columns_)), 0);
  };
  const auto fill = [&] (auto &numbers, std::size_t padding, auto value, std::size_t each = 1) {
    numbers.reserve ((static_cast<std::size_t> (header_.roi.width) + padding) * each);
    numbers.assign ((static_cast<std::size_t> (columns_) + padding) * each, value);
  };
  constexpr std::size_t kPadding = kPixelsBefore + kPixelsBehind, kBytePadding = 4 * kWaveWord;
  for (std::size_t y = 0; y < waves_.rows.size (); y++) {
    fill (waves_.rows[y].symbols, kBytePadding, std::uint8_t{kInvalid});
    std::vector<PlainPixel> &pixels = waves_.rows[y].pixels;
    fill (pixels, kPadding, PlainPixel{0}); /* outside pixels would seem to equal each other */
    for (std::size_t x = 0; x < pixels.size (); x++)
      pixels[x] = invalid_plain_pixel (static_cast<int> (x), static_cast<int> (y));
  }
  fill (waves_.outside, kPadding, kOutsidePixel);
  fill (waves_.upper, kPadding, kOutsidePixel);
  fill (waves_.upper_codes, kPadding, WaveCode{0});
  fill (waves_.residuals, kPadding, WaveCode{0}, kWaveRows);
  fill (waves_.codes, kBytePadding, std::uint64_t{0});
  fill (waves_.contexts, kBytePadding, std::uint16_t{0});
  for (auto *row : {&waves_.now, &waves_.above}) {
    fill (row->kinds, kBytePadding, std::uint8_t{0});
    fill_bits (row->valid);
  }
  fill_bits (waves_.full);
  if (header_.profile == Profile::kEntropy)
    entropy_.reset (
        static_cast<std::size_t> (columns_), static_cast<std::size_t> (header_.roi.width));
  runs_.reserve (static_cast<std::size_t> (header_.roi.width) + 1);
  reserve_bytes ();
}

/* Quantises rows. @return how many of those from y on can be coded at once: a row whose first pixel
 * has no neighbour depends on the end of the row above it. */
int
CompactEncoder::load_wave (const CompactPicture &picture, int y, int end)
{
  const PlainFunctions &functions = plain_functions (cpu_level ());
  const auto row_of = [&] (int i) -> EncoderWaveMemory::Row & {
    return waves_.rows[static_cast<std::size_t> (i % kWaveRows)];
  };
  int rows = 0;
  for (; rows < kWaveRows && y + rows < end; rows++) {
    const int at = y + rows;
    auto &row = row_of (at);
    if (at >= waves_.loaded) {
      const PlainQuantising how = {picture.codes.near, picture.codes.far,
          picture.codes.codes.data (), picture.codes.is_offset, picture.codes.colour, at};
      PlainPixel *const pixels = row.pixels.data () + kPixelsBefore;
      row.span = functions.make_pixels (how, picture.image.depth.row (at) + header_.first_column,
          picture.image.colour.row (at) + header_.first_column, columns_, pixels);
      waves_.loaded = at + 1;
    }
    if (rows == 0 || row.span.valid == 0)
      continue;
    const PlainPixel *const upper = row_of (at - 1).pixels.data () + kPixelsBefore + row.span.begin;
    if ((upper[-1] & upper[0] & upper[1] & kInvalidPixelBit) != 0)
      break;
  }
  return rows;
}

/* Chooses what the pixels of rows become. */
void
CompactEncoder::run_wave (int y, int rows)
{
  EncoderWave &wave = waves_.wave;
  wave.begin = columns_;
  wave.end = 0;
  for (int i = 0; i < kWaveRows; i++) {
    auto &row = waves_.rows[static_cast<std::size_t> ((y + i) % kWaveRows)];
    wave.rows[i] = (i < rows ? row.pixels : waves_.outside).data () + kPixelsBefore;
    wave.symbols[i] = row.symbols.data () + kWaveWord;
    wave.latest[i] = waves_.latest;
    if (i >= rows)
      continue;
    std::ranges::fill (row.symbols, std::uint8_t{kInvalid});
    if (row.span.valid == 0)
      continue;
    wave.begin = std::min (wave.begin, row.span.begin);
    wave.end = std::max (wave.end, row.span.end);
  }
  wave.last_row = rows - 1;
  wave.upper = waves_.upper.data () + kPixelsBefore;
  wave.upper_codes = waves_.upper_codes.data () + kPixelsBefore;
  wave.threshold = waves_.threshold;
  wave.residuals = waves_.residuals.data ();
  wave.overflow = false;
  if (wave.end > 0)
    wave_functions (cpu_level ())->encode (waves_.steps, wave);
  else
    wave.begin = 0;
  std::fill (wave.upper - 1, wave.upper + wave.begin, kOutsidePixel);
  std::fill (wave.upper + wave.end, wave.upper + columns_ + 1, kOutsidePixel);
  for (int i = 0; i < rows; i++)
    if (waves_.rows[static_cast<std::size_t> ((y + i) % kWaveRows)].span.valid > 0)
      waves_.latest = wave.latest[i];
}

/* Finds contexts and codes the runs of a row. */
template <class Code>
WaveRow
CompactEncoder::code_wave_runs (Code &slice_code, int y)
{
  auto &memory = waves_.rows[static_cast<std::size_t> (y % kWaveRows)];
  WaveRowMemory &now = waves_.now;
  const WaveRowMemory &above = waves_.above;
  std::ranges::fill (now.kinds, std::uint8_t{0});
  std::ranges::fill (now.valid, std::uint32_t{0});
  const int begin = memory.span.begin / kWaveWord * kWaveWord, end = memory.span.end;
  const WaveRow known = {memory.symbols.data () + kWaveWord, above.kinds.data () + kWaveWord,
      now.kinds.data () + kWaveWord, waves_.contexts.data (), waves_.full.data (),
      now.valid.data (), begin, end};
  if (memory.span.valid > 0)
    wave_functions (cpu_level ())->find_contexts (known);
  bool is_valid = false;
  runs_.clear ();
  for (int x = 0; x < columns_; is_valid = !is_valid) {
    const int to = bits_end (now.valid, x, is_valid, columns_);
    slice_code.run (is_valid, to - bits_end (above.valid, x, is_valid, columns_));
    runs_.push_back (to);
    x = to;
  }
  result_.points += static_cast<std::uint64_t> (memory.span.valid);
  return known;
}

void
CompactEncoder::code_wave_row (PackedWriter &slice_code, int y, int row)
{
  const WaveRow known = code_wave_runs (slice_code, y);
  if (runs_.size () == 1) /* of invalid pixels */
    return;
  const PackedRow pixels = {known.contexts, waves_.wave.residuals_of (row), known.full,
      waves_.codes.data (), known.begin, known.end};
  ResidualSizes sizes;
  for_this_cpu ([&] {
    PackedWriter code = slice_code; /* stays in registers */
    result_.full_pixels += code.row (pixels, sizes);
    slice_code = code;
  });
  size_sums_ += sizes.sums;
  size_counts_ += sizes.counts;
}

void
CompactEncoder::code_wave_row (EntropyWriter &slice_code, int y, int number)
{
  const WaveRow known = code_wave_runs (slice_code, y);
  const EntropyRow row = entropy_.row (runs_);
  for_this_cpu ([&, columns = static_cast<std::size_t> (columns_)] {
    std::fill_n (row.classes, columns, PixelClass{0});
    std::fill_n (row.activities, columns, kNoActivity);
    if (runs_.size () == 1) /* of invalid pixels */
      return;
    for_valid_runs (runs_, [&] (int begin, int end) {
      for (int x = begin; x < end; x++)
        row.classes[x] = known.symbols[x] + PixelClass{1};
      std::fill (row.activities + begin, row.activities + end, Activity{0});
    });
    const WaveCode *const residuals = waves_.wave.residuals_of (number);
    Components *residual = row.residuals;
    for (int begin = known.begin; begin < known.end; begin += kWaveWord)
      for (std::uint32_t bits = known.full[begin / kWaveWord]; bits != 0; bits &= bits - 1) {
        const int x = begin + std::countr_zero (bits);
        const WaveCode code = residuals[kWaveRows * x];
        result_.full_pixels++;
        if (code == 0 && (row.classes[x - 1] != 0 || !is_alone (row.upper_classes + x)))
          continue; /* kPredict */
        row.classes[x] = kCorrectedClass;
        *residual++ = components_of_wave (code);
      }
    slice_code.row<false> (row);
  });
  std::swap (entropy_.now, entropy_.upper);
}

/* @return what code_rows() returns, or nothing if rows must be coded by that */
template <class Code>
std::optional<bool>
CompactEncoder::code_waves (
    const CompactPicture &picture, const RowBand &band, std::vector<std::uint8_t> &to)
{
  begin_waves ();
  waves_.loaded = band.first_row;
  waves_.latest = wave_pixel (components_of (first_expected (limits_)));
  Code code = begin_slice<Code, false> (band.first_row);
  for (int y = band.first_row, end = y + band.rows; y < end;) {
    const int rows = load_wave (picture, y, end);
    run_wave (y, rows);
    if (waves_.wave.overflow)
      return {};
    for (int row = 0; row < rows; row++, y++) {
      const EncoderResult result = result_;
      const Components sums = size_sums_, counts = size_counts_;
      if constexpr (Code::kByRow)
        reserve_entries (code);
      Code before = code;
      code_wave_row (code, y, row);
      if (code.bound () + header_size () > static_cast<std::size_t> (settings_.max_slice_size)) {
        if (header_.rows == 0)
          return false;
        result_ = result;
        size_sums_ = sums;
        size_counts_ = counts;
        close_slice (before, to);
        code = begin_slice<Code, false> (y);
        waves_.latest = wave_pixel (components_of (first_expected (limits_)));
        std::ranges::fill (waves_.upper, kOutsidePixel);
        std::ranges::fill (waves_.above.kinds, std::uint8_t{0});
        std::ranges::fill (waves_.above.valid, std::uint32_t{0});
        if constexpr (Code::kByRow)
          entropy_.upper.reset (static_cast<std::size_t> (columns_));
        break; /* the rows from y on depend on those of the slice before */
      }
      header_.rows++;
      std::swap (waves_.now, waves_.above);
    }
  }
  close_slice (code, to);
  return true;
}

template std::optional<bool> CompactEncoder::code_waves<PackedWriter> (
    const CompactPicture &, const RowBand &, std::vector<std::uint8_t> &);
template std::optional<bool> CompactEncoder::code_waves<EntropyWriter> (
    const CompactPicture &, const RowBand &, std::vector<std::uint8_t> &);

} // namespace rangecast
