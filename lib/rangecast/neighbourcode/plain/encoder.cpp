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
  row_.assign (padded, kOutsidePixel);
  upper_.assign (padded, kOutsidePixel);
  const auto size = static_cast<std::size_t> (columns);
  row_symbols_.resize (std::max (row_symbols_.size (), symbol_bytes (size) + 2 * kGroup));
  row_full_.resize (std::max (row_full_.size (), size + kGroup));
  const auto size_with_padding = static_cast<std::size_t> (settings_.max_slice_size) + 16;
  symbols_.resize (std::max (symbols_.size (), size_with_padding));
  full_.resize (std::max (full_.size (), size_with_padding));
}

/* Codes row_. */
PlainRow
PlainEncoder::code_row (const PlainSpan &span)
{
  const PlainRow row = {row_.data () + kPixelsBefore, upper_.data () + kPixelsBefore, span,
      plain_pixel (settings_.colour_threshold, settings_.colour_threshold,
          settings_.colour_threshold, settings_.depth_threshold),
      row_symbols_.data ()};
  code_plain_row (row);
  std::fill (row.upper - 1, row.upper + span.begin, kOutsidePixel);
  std::fill (row.upper + span.end, row.upper + header_.columns + 1, kOutsidePixel);
  return row;
}

/* Appends a coded row to the slice. */
void
PlainEncoder::add_row (const PlainRow &row, std::span<PlainPixel> full)
{
  const auto pixels_before =
      static_cast<std::size_t> (header_.rows) * static_cast<std::size_t> (header_.columns);
  BitWriter symbols (symbols_.data (), pixels_before * kSymbolBits);
  put_invalid (symbols, row.span.begin);
  std::size_t bit = 0;
  for (int left = row.span.end - row.span.begin; left > 0; left -= kGroup, bit += kGroupBits)
    symbols.put (plain_group (row.symbols, bit, left), std::min (left, kGroup) * kSymbolBits);
  put_invalid (symbols, header_.columns - row.span.end);

  const int bits = bits_of_full ();
  pack_plain_pixels (full.data (), full.size (), header_.depth_bits, header_.colour_bits);
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

void
PlainEncoder::code_partition (const ConstRangeImage &image, const PlainCodes &codes,
    const PlainSettings &settings, const SliceHeader &header, std::vector<std::uint8_t> &to,
    EncoderResult &result)
{
  settings_ = settings;
  header_ = header;
  result_ = {};
  resize (header.columns);
  begin_slice (0);
  for (int y = 0; y < image.roi.height; y++) {
    const PlainSpan span =
        make_plain_pixels ({codes.near, codes.far, codes.codes.data (), codes.colour, y},
            image.depth.row (y) + header_.first_column, image.colour.row (y) + header_.first_column,
            header_.columns, row_.data () + kPixelsBefore);
    result_.points += static_cast<std::uint64_t> (span.valid);
    const auto full_of = [&] (const PlainRow &row) {
      return std::span (row_full_.data (), gather_full (row, row_full_.data ()));
    };
    PlainRow row = code_row (span);
    std::span<PlainPixel> full = full_of (row);
    if (header_.rows > 0 && slice_size (header_.rows + 1, full_pixels_ + full.size ()) >
                                static_cast<std::size_t> (settings_.max_slice_size)) {
      close_slice (to); /* the row begins the next one, where it has no upper neighbours */
      begin_slice (y);
      row = code_row (span);
      full = full_of (row);
    }
    add_row (row, full);
  }
  close_slice (to);
  result += result_;
}

} // namespace rangecast
