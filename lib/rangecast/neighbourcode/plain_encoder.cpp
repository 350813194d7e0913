/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "plain_encoder.hpp"

#include <algorithm>
#include <cstring>

#include "symbols.hpp"

namespace rangecast {
namespace {

Lanes
load (const std::int32_t *from)
{
  Lanes lanes;
  std::memcpy (&lanes, from, sizeof lanes);
  return lanes;
}

void
store (std::int32_t *to, Lanes lanes)
{
  std::memcpy (to, &lanes, sizeof lanes);
}

void
invalidate (std::int32_t *pixel)
{
  store (pixel, Lanes{kNoDepthCode, 0, 0, 0});
}

} // namespace

std::size_t
PlainEncoder::slice_size (std::size_t pixels, std::size_t full) const
{
  const auto full_bits = static_cast<std::size_t> (header_.depth_bits + 3 * header_.colour_bits);
  return kSliceHeaderSize + symbol_bytes (pixels) + (full * full_bits + 7) / 8;
}

/* Quantises a row into row_. */
void
PlainEncoder::load_row (const ConstRangeImage &image, int y)
{
  const std::uint16_t *depth = image.depth.row (y) + header_.first_column;
  const Rgbx *colour = image.colour.row (y) + header_.first_column;
  std::int32_t *to = row_.data () + 4;
  for (int x = 0; x < header_.columns; x++, to += 4) {
    if (!depth_->valid (depth[x])) {
      invalidate (to);
      continue;
    }
    to[0] = depth_->code (depth[x]);
    to[1] = colour_->code (colour[x].r);
    to[2] = colour_->code (colour[x].g);
    to[3] = colour_->code (colour[x].b);
  }
}

/* Codes row_ against upper_, in place, into symbols_ and full_. @return full pixels of the row */
std::size_t
PlainEncoder::code_row (bool has_upper, std::size_t symbols_at, std::size_t full_at)
{
  const Lanes threshold = {settings_.depth_threshold, settings_.colour_threshold,
      settings_.colour_threshold, settings_.colour_threshold};
  const int c = header_.colour_bits, d = header_.depth_bits;
  std::uint8_t *symbol = symbols_.data () + symbols_at;
  std::uint64_t *full = full_.data () + full_at;
  for (int x = 0; x < header_.columns; x++) {
    std::int32_t *pixel = row_.data () + 4 * (x + 1);
    const Lanes own = load (pixel);
    if (pixel[0] == kNoDepthCode) {
      *symbol++ = kInvalid;
      continue;
    }
    const std::int32_t *upper = upper_.data () + 4 * (x + 1);
    const std::int32_t *chosen = nullptr;
    if (are_near (own, load (pixel - 4), threshold)) {
      *symbol++ = kLeft;
      chosen = pixel - 4;
    } else if (has_upper) {
      for (int i = 0; i < 3 && !chosen; i++)
        if (are_near (own, load (upper + 4 * (i - 1)), threshold)) {
          *symbol++ = static_cast<std::uint8_t> (kUpperLeft + i);
          chosen = upper + 4 * (i - 1);
        }
    }
    if (chosen) {
      store (pixel, load (chosen));
      continue;
    }
    *symbol++ = kFull;
    *full++ = std::uint64_t (pixel[0]) | std::uint64_t (pixel[1]) << d |
              std::uint64_t (pixel[2]) << (d + c) | std::uint64_t (pixel[3]) << (d + 2 * c);
  }
  return static_cast<std::size_t> (full - (full_.data () + full_at));
}

void
PlainEncoder::close_slice (std::size_t pixels, std::size_t full, std::vector<std::uint8_t> &to)
{
  const std::size_t begin = to.size (), size = slice_size (pixels, full);
  to.resize (begin + size);
  std::uint8_t *p = to.data () + begin;
  write_slice_header (header_, size, p);
  BitWriter symbols (p + kSliceHeaderSize);
  for (std::size_t i = 0; i < pixels; i++)
    symbols.put (symbols_[i], kSymbolBits);
  BitWriter pixel_bits (symbols.finish ());
  const int bits = header_.depth_bits + 3 * header_.colour_bits;
  for (std::size_t i = 0; i < full; i++)
    pixel_bits.put (full_[i], bits);
  pixel_bits.finish ();
  result_.slices++;
  result_.full_pixels += full;
}

/* Codes all rows of some columns of the ROI, in as many slices as their size asks for. */
void
PlainEncoder::code_piece (
    const ConstRangeImage &image, int first_column, int columns, std::vector<std::uint8_t> &to)
{
  const auto limit = static_cast<std::size_t> (settings_.max_slice_size);
  const auto padded = static_cast<std::size_t> (columns + 2) * 4;
  row_.resize (std::max (row_.size (), padded));
  upper_.resize (std::max (upper_.size (), padded));
  for (auto *row : {&row_, &upper_}) {
    invalidate (row->data ());
    invalidate (row->data () + 4 * (columns + 1));
  }
  header_.first_column = first_column;
  header_.columns = columns;
  header_.first_row = 0;
  header_.rows = 0;
  std::size_t pixels = 0, full = 0;
  for (int y = 0; y < image.roi.height; y++) {
    const auto need = pixels + static_cast<std::size_t> (columns);
    symbols_.resize (std::max (symbols_.size (), need));
    full_.resize (std::max (full_.size (), full + static_cast<std::size_t> (columns)));
    load_row (image, y);
    std::size_t more = code_row (header_.rows > 0, pixels, full);
    if (header_.rows > 0 && slice_size (need, full + more) > limit) {
      /* The row begins the next slice, where it has no upper neighbours. */
      close_slice (pixels, full, to);
      header_.first_row = y;
      header_.rows = 0;
      pixels = full = 0;
      load_row (image, y);
      more = code_row (false, 0, 0);
    }
    header_.rows++;
    pixels += static_cast<std::size_t> (columns);
    full += more;
    std::swap (row_, upper_);
  }
  close_slice (pixels, full, to);
}

PlainResult
PlainEncoder::encode (const ConstRangeImage &image, const DepthQuantiser &depth,
    const ColourQuantiser &colour, const PlainSettings &settings, SliceHeader header,
    std::vector<std::uint8_t> &to)
{
  depth_ = &depth;
  colour_ = &colour;
  settings_ = settings;
  header_ = header;
  result_ = {};
  /* As many columns as fit in one row even if every pixel of it is written in full. */
  const int bits = kSymbolBits + header.depth_bits + 3 * header.colour_bits;
  const int most = (settings.max_slice_size - int (kSliceHeaderSize) - 2) * 8 / bits;
  const int width = image.roi.width, pieces = (width + most - 1) / most;
  for (int i = 0; i < pieces; i++) {
    const int begin = width * i / pieces, end = width * (i + 1) / pieces;
    code_piece (image, begin, end - begin, to);
  }
  depth_ = nullptr;
  colour_ = nullptr;
  return result_;
}

} // namespace rangecast
