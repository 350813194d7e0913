/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "plain_encoder.hpp"

#include <algorithm>
#include <bit>
#include <cstring>
#include <tuple>

#include "symbols.hpp"

namespace rangecast {
namespace {

/* Up to sixteen symbols from bit `at` on; what is behind them is 0. */
std::uint64_t
group_at (const std::uint8_t *symbols, std::size_t at, int count)
{
  const std::uint64_t group = load_little_endian (symbols + at / 8) >> (at % 8) & kGroupMask;
  return count < kGroup ? group & ((std::uint64_t{1} << count * kSymbolBits) - 1) : group;
}

/* A pixel as it is written: D bits of depth, then C each of R, G and B. */
std::uint64_t
as_written (PlainPixel pixel, int depth_bits, int colour_bits)
{
  return pixel >> 48 | (pixel & 0xff) << depth_bits |
         (pixel >> 16 & 0xff) << (depth_bits + colour_bits) |
         (pixel >> 32 & 0xff) << (depth_bits + 2 * colour_bits);
}

void
put_invalid (BitWriter &bits, int count)
{
  for (; count >= kGroup; count -= kGroup)
    bits.put (kInvalidGroup, kGroupBits);
  if (count > 0)
    bits.put (kInvalidGroup & ((std::uint64_t{1} << count * kSymbolBits) - 1), count * kSymbolBits);
}

} // namespace

std::size_t
PlainEncoder::slice_size (std::size_t pixels, std::size_t full) const
{
  return kSliceHeaderSize + symbol_bytes (pixels) +
         (full * static_cast<std::size_t> (bits_of_full ()) + 7) / 8;
}

/* Valid depths are one interval; whichever way codes go, its ends have the first and the last. */
void
PlainEncoder::set_depths (const DepthQuantiser &depth)
{
  const auto last = static_cast<std::uint16_t> (depth.codes () - 1);
  std::tie (near_, far_) = std::minmax ({depth.depth (0), depth.depth (last)});
  codes_.assign (65536, 0);
  for (std::size_t d = near_; d <= far_; d++)
    codes_[d] = depth.code (static_cast<std::uint16_t> (d));
}

/* Makes room for pieces of so many columns. */
void
PlainEncoder::resize (int columns)
{
  const auto padded = static_cast<std::size_t> (kPixelsBefore + columns + kPixelsBehind);
  for (Row &row : rows_)
    row.pixels.assign (padded, kOutsidePixel);
  upper_.assign (padded, kOutsidePixel);
  outside_.assign (padded, kOutsidePixel);
  const auto size = static_cast<std::size_t> (columns);
  for (auto &symbols : row_symbols_)
    symbols.resize (std::max (symbols.size (), symbol_bytes (size) + kSymbolBytesBehind));
  row_full_.resize (std::max (row_full_.size (), size + kGroup));
  const auto most = static_cast<std::size_t> (settings_.max_slice_size) + 16;
  symbols_.resize (std::max (symbols_.size (), most));
  full_.resize (std::max (full_.size (), most));
}

void
PlainEncoder::load_row (const ConstRangeImage &image, int y, Row &row)
{
  const PlainQuantising how = {near_, far_, codes_.data (), header_.colour_bits, y};
  row.span = functions_->make_pixels (how, image.depth.row (y) + header_.first_column,
      image.colour.row (y) + header_.first_column, header_.columns,
      row.pixels.data () + kPixelsBefore);
  result_.points += static_cast<std::uint64_t> (row.span.valid);
}

/* Codes the first rows that wait. @return where they have valid pixels */
PlainSpan
PlainEncoder::code_band (int rows)
{
  PlainBand band;
  band.upper = upper_.data () + kPixelsBefore;
  PlainSpan span = {header_.columns, 0, 0};
  for (int i = 0; i < kBandRows; i++) {
    const auto at = static_cast<std::size_t> (i);
    band.rows[i] = (i < rows ? rows_[at].pixels : outside_).data () + kPixelsBefore;
    band.symbols[i] = row_symbols_[at].data ();
    if (i >= rows || rows_[at].span.valid == 0)
      continue;
    span.begin = std::min (span.begin, rows_[at].span.begin);
    span.end = std::max (span.end, rows_[at].span.end);
  }
  if (span.end == 0)
    span.begin = 0;
  band.begin = span.begin;
  band.end = span.end;
  band.threshold = plain_pixel (settings_.colour_threshold, settings_.colour_threshold,
      settings_.colour_threshold, settings_.depth_threshold);
  if (span.end > 0)
    functions_->code_band (band);
  std::fill (band.upper - 1, band.upper + span.begin, kOutsidePixel);
  std::fill (band.upper + span.end, band.upper + header_.columns + 1, kOutsidePixel);
  return span;
}

/* Gathers a coded row's full pixels in row_full_. @return how many */
std::size_t
PlainEncoder::find_full (int row, const PlainSpan &span)
{
  const auto at = static_cast<std::size_t> (row);
  const PlainPixel *pixels = rows_[at].pixels.data () + kPixelsBefore + span.begin;
  const std::uint8_t *const symbols = row_symbols_[at].data ();
  auto bit = at * static_cast<std::size_t> (functions_->skip_bits);
  std::uint64_t *to = row_full_.data ();
  for (int left = span.end - span.begin; left > 0;
       left -= kGroup, bit += kGroupBits, pixels += kGroup) {
    const std::uint64_t group = group_at (symbols, bit, left);
    for (std::uint64_t full = group >> 2 & ~(group >> 1) & ~group & kGroupLowBits; full;
         full &= full - 1)
      *to++ = pixels[std::countr_zero (full) / kSymbolBits];
  }
  return static_cast<std::size_t> (to - row_full_.data ());
}

/* Appends a coded row and the pixels in row_full_ to the slice. */
void
PlainEncoder::add_row (int row, const PlainSpan &span, std::size_t full)
{
  const auto at = static_cast<std::size_t> (row);
  const std::uint8_t *const symbols = row_symbols_[at].data ();
  auto bit = at * static_cast<std::size_t> (functions_->skip_bits);
  BitWriter out = slice_.symbols;
  put_invalid (out, span.begin);
  for (int left = span.end - span.begin; left > 0; left -= kGroup, bit += kGroupBits)
    out.put (group_at (symbols, bit, left), std::min (left, kGroup) * kSymbolBits);
  put_invalid (out, header_.columns - span.end);
  slice_.symbols = out;

  BitWriter pixels = slice_.full;
  const int depth_bits = header_.depth_bits, colour_bits = header_.colour_bits;
  for (std::size_t i = 0; i < full; i++)
    pixels.put (as_written (row_full_[i], depth_bits, colour_bits), depth_bits + 3 * colour_bits);
  slice_.full = pixels;
  slice_.full_pixels += full;
  header_.rows++;
}

void
PlainEncoder::begin_slice (int first_row)
{
  header_.first_row = first_row;
  header_.rows = 0;
  slice_ = {BitWriter (symbols_.data ()), BitWriter (full_.data ()), 0};
  std::ranges::fill (upper_, kOutsidePixel);
}

void
PlainEncoder::close_slice (std::vector<std::uint8_t> &to)
{
  const std::size_t symbols = slice_.symbols.size (), full = slice_.full.size ();
  const std::size_t begin = to.size (), size = kSliceHeaderSize + symbols + full;
  to.resize (begin + size);
  std::uint8_t *const p = to.data () + begin;
  write_slice_header (header_, size, p);
  std::memcpy (p + kSliceHeaderSize, symbols_.data (), symbols);
  std::memcpy (p + kSliceHeaderSize + symbols, full_.data (), full);
  result_.slices++;
  result_.full_pixels += slice_.full_pixels;
}

/* Codes the first rows that wait, as far as the open slice has room for them. Where it has not, the
 * next slice is open then, and its first row is without upper neighbours. @return rows done */
int
PlainEncoder::add_band (int rows, std::vector<std::uint8_t> &to)
{
  const PlainSpan span = code_band (rows);
  const auto limit = static_cast<std::size_t> (settings_.max_slice_size);
  for (int i = 0; i < rows; i++) {
    const std::size_t full = find_full (i, span);
    const auto pixels =
        static_cast<std::size_t> (header_.rows + 1) * static_cast<std::size_t> (header_.columns);
    if (header_.rows > 0 && slice_size (pixels, slice_.full_pixels + full) > limit) {
      close_slice (to);
      begin_slice (header_.first_row + header_.rows);
      return i;
    }
    add_row (i, span, full);
  }
  return rows;
}

/* Codes all rows of some columns of the ROI, in as many slices as their size asks for. */
void
PlainEncoder::code_piece (
    const ConstRangeImage &image, int first_column, int columns, std::vector<std::uint8_t> &to)
{
  header_.first_column = first_column;
  header_.columns = columns;
  resize (columns);
  begin_slice (0);
  int waiting = 0;
  for (int done = 0; done < image.roi.height;) {
    for (; waiting < kBandRows && done + waiting < image.roi.height; waiting++)
      load_row (image, done + waiting, rows_[static_cast<std::size_t> (waiting)]);
    const int more = add_band (waiting, to);
    std::ranges::rotate (rows_, rows_.begin () + more);
    waiting -= more;
    done += more;
  }
  close_slice (to);
}

PlainResult
PlainEncoder::encode (const ConstRangeImage &image, const PlainSettings &settings,
    SliceHeader header, std::vector<std::uint8_t> &to)
{
  settings_ = settings;
  header_ = header;
  result_ = {};
  functions_ = &plain_functions (cpu_level ());
  /* As many columns as fit in one row even if every pixel of it is written in full. */
  const int bits = kSymbolBits + bits_of_full ();
  const int most = (settings.max_slice_size - int (kSliceHeaderSize) - 2) * 8 / bits;
  const int width = image.roi.width, pieces = (width + most - 1) / most;
  for (int i = 0; i < pieces; i++) {
    const int begin = width * i / pieces, end = width * (i + 1) / pieces;
    code_piece (image, begin, end - begin, to);
  }
  return result_;
}

} // namespace rangecast
