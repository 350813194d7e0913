/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "encoder.hpp"

#include <algorithm>
#include <cstring>

#include "../bitstream/symbols.hpp"

namespace rangecast {
namespace {

/* No pixel: farther from each pixel than any threshold. */
constexpr Components kNoPixel = {-(1 << 20), 0, 0, 0};

} // namespace

std::size_t
PlainEncoder::slice_size (int rows, std::size_t full) const
{
  return kSliceHeaderSize +
         symbol_bytes (
             static_cast<std::size_t> (rows) * static_cast<std::size_t> (header_.columns)) +
         (full * static_cast<std::size_t> (bits_of_full ()) + 7) / 8;
}

/* See "How an encoder chooses" in docs/formats/bitstream.md. */
void
PlainEncoder::code_row (const std::uint16_t *depth, const Rgbx *colour,
    const DepthQuantiser &depths, const ColourQuantiser &colours)
{
  const int c = settings_.colour_threshold, colour_bits = header_.colour_bits;
  const Components threshold = {settings_.depth_threshold, c, c, c};
  Components left = kNoPixel, upper_left = kNoPixel;
  row_full_.clear ();
  row_points_ = 0;
  for (int x = 0; x < header_.columns; x++) {
    Pixel *const upper = upper_.data () + x;
    Components pixel = kNoPixel;
    Symbol symbol = kInvalid;
    if (depths.valid (depth[x])) {
      const Components own = {depths.code (depth[x]), colours.code (colour[x].r),
          colours.code (colour[x].g), colours.code (colour[x].b)};
      const Components *const neighbours[] = {&left, &upper_left, &upper[0].codes, &upper[1].codes};
      symbol = kLeft;
      while (symbol < kFull && !are_near (own, *neighbours[symbol], threshold))
        symbol = static_cast<Symbol> (symbol + 1);
      pixel = symbol < kFull ? *neighbours[symbol] : own;
      row_points_++;
    }
    if (symbol == kFull) {
      std::uint64_t bits = 0;
      for (int i = kComponents - 1; i > 0; i--)
        bits = bits << colour_bits | static_cast<std::uint64_t> (pixel[i]);
      row_full_.push_back (bits << header_.depth_bits | static_cast<std::uint64_t> (pixel[0]));
    }
    row_symbols_[static_cast<std::size_t> (x)] = symbol;
    upper_left = upper->codes;
    upper->codes = left = pixel;
  }
}

/* Appends the last row to the slice. */
void
PlainEncoder::add_row ()
{
  BitWriter symbols (symbols_.data (),
      static_cast<std::size_t> (header_.rows) * row_symbols_.size () * std::size_t{kSymbolBits});
  for (const std::uint8_t symbol : row_symbols_)
    symbols.put (symbol, kSymbolBits);
  BitWriter full (full_.data (), full_pixels_ * static_cast<std::size_t> (bits_of_full ()));
  for (const std::uint64_t pixel : row_full_)
    full.put (pixel, bits_of_full ());
  full_pixels_ += row_full_.size ();
  result_.points += row_points_;
  header_.rows++;
}

void
PlainEncoder::begin_slice (int first_row)
{
  header_.first_row = first_row;
  header_.rows = 0;
  full_pixels_ = 0;
  upper_.assign (row_symbols_.size () + 1, {kNoPixel});
}

void
PlainEncoder::close_slice (std::vector<std::uint8_t> &to)
{
  const std::size_t symbols =
      symbol_bytes (static_cast<std::size_t> (header_.rows) * row_symbols_.size ());
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
PlainEncoder::code_partition (const ConstRangeImage &image, const DepthQuantiser &depth,
    const ColourQuantiser &colour, const PlainSettings &settings, const SliceHeader &header,
    std::vector<std::uint8_t> &to, EncoderResult &result)
{
  const auto size_with_padding = static_cast<std::size_t> (settings.max_slice_size) + 16;
  settings_ = settings;
  header_ = header;
  result_ = {};
  row_symbols_.resize (static_cast<std::size_t> (header.columns));
  symbols_.resize (std::max (symbols_.size (), size_with_padding));
  full_.resize (std::max (full_.size (), size_with_padding));
  begin_slice (0);
  for (int y = 0; y < image.roi.height; y++) {
    const auto code = [&] {
      code_row (image.depth.row (y) + header_.first_column,
          image.colour.row (y) + header_.first_column, depth, colour);
    };
    code ();
    if (header_.rows > 0 && slice_size (header_.rows + 1, full_pixels_ + row_full_.size ()) >
                                static_cast<std::size_t> (settings_.max_slice_size)) {
      close_slice (to); /* the row begins the next one, where it has no upper neighbours */
      begin_slice (y);
      code ();
    }
    add_row ();
  }
  close_slice (to);
  result += result_;
}

} // namespace rangecast
