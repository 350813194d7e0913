/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "encoder.hpp"

#include <algorithm>
#include <bit>
#include <cstring>
#include <tuple>

#include "../bitstream/symbols.hpp"

namespace rangecast {
namespace {

/* Inlined, so that the writer stays in registers. */
[[gnu::always_inline]] inline void
put_invalid (BitWriter &bits, int count)
{
  for (; count >= kGroup; count -= kGroup)
    bits.put (kInvalidGroup, kGroupBits);
  if (count > 0)
    bits.put (kInvalidGroup & ((std::uint64_t{1} << count * kSymbolBits) - 1), count * kSymbolBits);
}

} // namespace

/* Valid depths are one interval; its ends have the first and the last code, in either order, or are
 * close to depths that do. */
void
PlainCodes::set (const DepthQuantiser &depth, const ColourQuantiser &colours)
{
  colour = colours;
  const auto last = static_cast<std::uint16_t> (depth.codes () - 1);
  std::tie (near, far) = std::minmax ({depth.depth (0), depth.depth (last)});
  while (near > 1 && depth.valid (static_cast<std::uint16_t> (near - 1)))
    near--;
  while (far < 65535 && depth.valid (static_cast<std::uint16_t> (far + 1)))
    far++;
  is_offset = depth.is_offset ();
  codes.assign (65536, 0);
  for (std::size_t d = near; d <= far; d++)
    codes[d] = depth.code (static_cast<std::uint16_t> (d));
}

std::size_t
PlainEncoder::slice_size (int rows, std::size_t full) const
{
  return kSliceHeaderSize +
         symbol_bytes (
             static_cast<std::size_t> (rows) * static_cast<std::size_t> (header_.columns)) +
         (full * static_cast<std::size_t> (bits_of_full ()) + 7) / 8;
}

/* Makes room for partitions of so many columns. */
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
  const auto size_with_padding = static_cast<std::size_t> (settings_.max_slice_size) + 16;
  symbols_.resize (std::max (symbols_.size (), size_with_padding));
  full_.resize (std::max (full_.size (), size_with_padding));
}

/* Codes the first rows of rows_. @return the columns with valid pixels */
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

/* Appends a coded row to the slice. */
void
PlainEncoder::add_row (const PlainRow &row, const PlainSpan &span, std::span<PlainPixel> full)
{
  const auto pixels_before =
      static_cast<std::size_t> (header_.rows) * static_cast<std::size_t> (header_.columns);
  BitWriter symbols (symbols_.data (), pixels_before * kSymbolBits);
  put_invalid (symbols, span.begin);
  std::size_t bit = row.first_bit;
  for (int left = row.columns; left > 0; left -= kGroup, bit += kGroupBits)
    symbols.put (plain_group (row.symbols, bit, left), std::min (left, kGroup) * kSymbolBits);
  put_invalid (symbols, header_.columns - span.end);

  const int bits = bits_of_full ();
  functions_->pack_pixels (full.data (), full.size (), header_.depth_bits, header_.colour_bits);
  BitWriter pixels (full_.data (), full_pixels_ * static_cast<std::size_t> (bits));
  for (const std::uint64_t pixel : full)
    pixels.put (pixel, bits);
  full_pixels_ += full.size ();
  header_.rows++;
}

void
PlainEncoder::begin_slice (int first_row)
{
  header_.first_row = first_row;
  header_.rows = 0;
  full_pixels_ = 0;
  std::ranges::fill (upper_, kOutsidePixel);
}

void
PlainEncoder::close_slice (std::vector<std::uint8_t> &to)
{
  const std::size_t symbols = symbol_bytes (
      static_cast<std::size_t> (header_.rows) * static_cast<std::size_t> (header_.columns));
  const std::size_t begin = to.size (), size = slice_size (header_.rows, full_pixels_);
  to.resize (begin + size);
  std::uint8_t *const p = to.data () + begin;
  write_slice_header (header_, size, p);
  std::memcpy (p + kSliceHeaderSize, symbols_.data (), symbols);
  std::memcpy (p + kSliceHeaderSize + symbols, full_.data (), size - kSliceHeaderSize - symbols);
  result_.slices++;
  result_.full_pixels += full_pixels_;
}

/* Codes the first rows of rows_ and appends them to the open slice while they fit. When it is full
 * opens the next one, whose first row has no upper neighbours. @return rows appended */
int
PlainEncoder::add_band (int rows, std::vector<std::uint8_t> &to)
{
  const PlainSpan span = code_band (rows);
  const auto limit = static_cast<std::size_t> (settings_.max_slice_size);
  for (int i = 0; i < rows; i++) {
    const auto at = static_cast<std::size_t> (i);
    const PlainRow row = {row_symbols_[at].data (),
        at * static_cast<std::size_t> (functions_->skip_bits),
        rows_[at].pixels.data () + kPixelsBefore + span.begin, span.end - span.begin};
    const std::span<PlainPixel> full (
        row_full_.data (), functions_->gather_full (row, row_full_.data ()));
    if (header_.rows > 0 && slice_size (header_.rows + 1, full_pixels_ + full.size ()) > limit) {
      close_slice (to);
      begin_slice (header_.first_row + header_.rows);
      return i;
    }
    add_row (row, span, full);
  }
  return rows;
}

void
PlainEncoder::code_partition (const ConstRangeImage &image, const PlainCodes &codes,
    const PlainSettings &settings, const SliceHeader &header, std::vector<std::uint8_t> &to,
    EncoderResult &result)
{
  codes_ = &codes;
  settings_ = settings;
  header_ = header;
  result_ = {};
  functions_ = &plain_functions (cpu_level ());
  resize (header.columns);
  begin_slice (0);
  int waiting = 0;
  for (int done = 0; done < image.roi.height;) {
    for (; waiting < functions_->band_rows && done + waiting < image.roi.height; waiting++) {
      const int y = done + waiting;
      Row &row = rows_[static_cast<std::size_t> (waiting)];
      row.span = functions_->make_pixels (
          {codes_->near, codes_->far, codes_->codes.data (), codes_->is_offset, codes_->colour, y},
          image.depth.row (y) + header_.first_column, image.colour.row (y) + header_.first_column,
          header_.columns, row.pixels.data () + kPixelsBefore);
      result_.points += static_cast<std::uint64_t> (row.span.valid);
    }
    const int more = add_band (waiting, to);
    std::rotate (rows_.begin (), rows_.begin () + more, rows_.end ());
    waiting -= more;
    done += more;
  }
  close_slice (to);
  result += result_;
}

} // namespace rangecast
