/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "temporal.hpp"

#include <algorithm>

#include "../bitstream/symbols.hpp"

namespace rangecast {
namespace {

constexpr Components kInvalidComponents = {kNoDepthCode, 0, 0, 0};

/* A pixel as a ReferencePlane holds it: four numbers of 16 bits. */
std::uint64_t
kept (Components pixel)
{
  if (pixel[0] == kNoDepthCode)
    return ReferencePlane::kNone;
  std::uint64_t value = 0;
  for (int i = 0; i < 4; i++)
    value |= static_cast<std::uint64_t> (pixel[i]) << 16 * i;
  return value;
}

Components
components_of (std::uint64_t value)
{
  const auto part = [&] (int i) { return static_cast<std::int32_t> (value >> 16 * i & 0xffff); };
  return value == ReferencePlane::kNone ? kInvalidComponents
                                        : Components{part (0), part (1), part (2), part (3)};
}

} // namespace

/* ---- encoder ---- */

std::size_t
PlainTemporalEncoder::slice_size (std::size_t pixels, std::size_t full) const
{
  return header_size_of (header_) + symbol_bytes (pixels) +
         (full * static_cast<std::size_t> (bits_of_full ()) + 7) / 8;
}

/* Quantises a row, and fetches the earlier frame set's pixels at the same place. */
void
PlainTemporalEncoder::load_row (const ConstRangeImage &image, int y)
{
  const std::uint16_t *depth = image.depth.row (y) + header_.first_column;
  const Rgbx *colour = image.colour.row (y) + header_.first_column;
  for (int x = 0; x < header_.columns; x++) {
    Components &to = row_[static_cast<std::size_t> (x) + 1];
    to = kInvalidComponents;
    if (depth_->valid (depth[x]))
      to = Components{depth_->code (depth[x]), colour_->code (colour[x].r),
          colour_->code (colour[x].g), colour_->code (colour[x].b)};
    result_.points += to[0] != kNoDepthCode;
  }
  if (!header_.key)
    reference_.before->fetch (header_.roi.x + header_.first_column, header_.roi.y + y,
        std::span (earlier_).first (static_cast<std::size_t> (header_.columns)));
}

int
PlainTemporalEncoder::symbol_of (int x) const
{
  const auto at = static_cast<std::size_t> (x) + 1;
  const Components own = row_[at];
  if (own[0] == kNoDepthCode)
    return kInvalid;
  if (are_near (own, row_[at - 1], threshold_))
    return kLeft;
  for (std::size_t i = 0; i < 3; i++)
    if (are_near (own, upper_[at + i - 1], threshold_))
      return kUpperLeft + static_cast<int> (i);
  return !header_.key && are_near (own, components_of (earlier_[at - 1]), threshold_) ? kEarlier
                                                                                      : kFull;
}

/* Codes the row in place. @return the number of its full pixels */
std::size_t
PlainTemporalEncoder::code_row (std::size_t symbols_at, std::size_t full_at)
{
  const int c = header_.colour_bits, d = header_.depth_bits;
  std::uint8_t *symbols = symbols_.data () + symbols_at;
  std::uint64_t *full = full_.data () + full_at;
  for (int x = 0; x < header_.columns; x++) {
    const auto at = static_cast<std::size_t> (x) + 1;
    const int symbol = symbol_of (x);
    symbols[x] = static_cast<std::uint8_t> (symbol);
    if (symbol == kLeft)
      row_[at] = row_[at - 1];
    else if (symbol >= kUpperLeft && symbol <= kUpperRight)
      row_[at] = upper_[at + static_cast<std::size_t> (symbol) - kUpper];
    else if (symbol == kEarlier)
      row_[at] = components_of (earlier_[at - 1]);
    else if (symbol == kFull)
      *full++ = std::uint64_t (row_[at][0]) | std::uint64_t (row_[at][1]) << d |
                std::uint64_t (row_[at][2]) << (d + c) | std::uint64_t (row_[at][3]) << (d + 2 * c);
  }
  return static_cast<std::size_t> (full - (full_.data () + full_at));
}

void
PlainTemporalEncoder::begin_slice (int first_row)
{
  header_.first_row = first_row;
  header_.rows = 0;
  std::ranges::fill (upper_, kInvalidComponents);
}

void
PlainTemporalEncoder::close_slice (
    std::size_t pixels, std::size_t full, std::vector<std::uint8_t> &to)
{
  const std::size_t begin = to.size (), size = slice_size (pixels, full);
  constexpr std::size_t kBehind = 8; /* BitWriter's */
  to.resize (begin + size + kBehind);
  std::uint8_t *p = to.data () + begin;
  write_slice_header (header_, size, p);
  p += header_size_of (header_);
  BitWriter symbols (p);
  for (std::size_t i = 0; i < pixels; i++)
    symbols.put (symbols_[i], kSymbolBits);
  BitWriter pixel_bits (p + symbol_bytes (pixels));
  for (std::size_t i = 0; i < full; i++)
    pixel_bits.put (full_[i], bits_of_full ());
  to.resize (begin + size);
  result_.slices++;
  result_.delta_slices += !header_.key;
  result_.full_pixels += full;
}

void
PlainTemporalEncoder::code_partition (const ConstRangeImage &image, const RowBand &band,
    const CodingReference &reference, const DepthQuantiser &depth, const ColourQuantiser &colour,
    const PlainSettings &settings, const SliceHeader &header, std::vector<std::uint8_t> &to,
    EncoderResult &result)
{
  depth_ = &depth;
  colour_ = &colour;
  reference_ = reference;
  settings_ = settings;
  header_ = header;
  result_ = {};
  const int c = settings.colour_threshold;
  threshold_ = Components{settings.depth_threshold, c, c, c};
  const auto columns = static_cast<std::size_t> (header_.columns);
  row_.assign (columns + 2, kInvalidComponents);
  upper_.assign (columns + 2, kInvalidComponents);
  earlier_.resize (std::max (earlier_.size (), columns));
  kept_.resize (earlier_.size ());
  begin_slice (band.first_row);
  std::size_t pixels = 0, full = 0;
  for (int y = band.first_row; y < band.first_row + band.rows; y++) {
    symbols_.resize (std::max (symbols_.size (), pixels + columns));
    full_.resize (std::max (full_.size (), full + columns));
    const std::uint64_t points = result_.points;
    load_row (image, y);
    std::size_t more = code_row (pixels, full);
    if (header_.rows > 0 && slice_size (pixels + columns, full + more) >
                                static_cast<std::size_t> (settings_.max_slice_size)) {
      /* The row begins the next slice, where it has no upper neighbours. */
      close_slice (pixels, full, to);
      begin_slice (y);
      pixels = full = 0;
      result_.points = points;
      load_row (image, y);
      more = code_row (0, 0);
    }
    std::transform (row_.begin () + 1, row_.end () - 1, kept_.begin (), kept);
    reference_.now->keep (
        header_.roi.x + header_.first_column, header_.roi.y + y, std::span (kept_).first (columns));
    header_.rows++;
    pixels += columns;
    full += more;
    std::swap (row_, upper_);
  }
  close_slice (pixels, full, to);
  result += result_;
}

/* ---- decoder ---- */

namespace {

/* A decoded pixel: depth in bits 0 to 15, R, G, B above it. */
constexpr std::uint64_t kInvalidShown = 0, kUnknownShown = ReferencePlane::kNone;

/* Full pixels of one slice. */
struct FullPixels {
  BitReader bits;
  const DepthQuantiser &depth;
  const ColourQuantiser &colour;
  int depth_bits;

  /* kInvalidShown if the depth code does not exist or the data ends. */
  std::uint64_t next ()
  {
    const std::uint64_t value = bits.get (depth_bits + 3 * colour.bits ());
    const auto code = static_cast<std::uint32_t> (value & ((1u << depth_bits) - 1));
    if (code >= static_cast<std::uint32_t> (depth.codes ()) || bits.exhausted ())
      return kInvalidShown;
    const unsigned mask = (1u << colour.bits ()) - 1;
    std::uint64_t shown = depth.depth (static_cast<std::uint16_t> (code));
    for (int i = 0; i < 3; i++)
      shown |= std::uint64_t{colour.value (
                   static_cast<std::uint8_t> (value >> (depth_bits + i * colour.bits ()) & mask))}
               << (16 + 8 * i);
    return shown;
  }
};

/* Decodes one row into `row` (columns pixels, one invalid pixel before and after).
 * @param earlier  its pixels in the earlier frame set; nullptr in key slices */
bool
decode_row (BitReader &symbols, FullPixels &full, const std::uint64_t *upper,
    const std::uint64_t *earlier, std::uint64_t *row, int columns)
{
  for (int x = 0; x < columns; x++) {
    const auto symbol = static_cast<int> (symbols.get (kSymbolBits));
    if (symbol == kInvalid) {
      row[x] = kInvalidShown;
      continue;
    }
    if (symbol > kEarlier || (symbol == kEarlier && !earlier))
      return false;
    row[x] = symbol == kLeft      ? row[x - 1]
             : symbol == kFull    ? full.next ()
             : symbol == kEarlier ? earlier[x]
                                  : upper[x + symbol - kUpper];
    if (row[x] == kInvalidShown) /* refers to an invalid pixel, or the data is damaged */
      return false;
  }
  return true;
}

/* Writes a row into the image; unknown pixels are taken from reference.older. */
void
write_row (const std::uint64_t *row, const SliceHeader &header, int y, const RangeImage &image,
    const DecoderReference &reference, DecodedPixels &decoded)
{
  std::uint16_t *depth = image.depth.row (y) + header.first_column;
  Rgbx *colour = image.colour.row (y) + header.first_column;
  for (int x = 0; x < header.columns; x++) {
    const bool unknown = row[x] == kUnknownShown;
    const std::uint64_t p = unknown ? kInvalidShown : row[x];
    depth[x] = static_cast<std::uint16_t> (p);
    colour[x] = {static_cast<std::uint8_t> (p >> 16), static_cast<std::uint8_t> (p >> 24),
        static_cast<std::uint8_t> (p >> 32), 0};
    decoded.points += p != kInvalidShown;
    decoded.unknown += unknown;
    if (unknown)
      show_older (reference, image, header.first_column + x, y);
  }
}

} // namespace

bool
PlainTemporalDecoder::decode (std::span<const std::uint8_t> body, const SliceHeader &header,
    const DepthQuantiser &depth, const ColourQuantiser &colour, const DecoderReference &reference,
    const RangeImage &image, DecodedPixels &decoded)
{
  const auto columns = static_cast<std::size_t> (header.columns);
  const std::size_t symbols_size = symbol_bytes (static_cast<std::size_t> (header.rows) * columns);
  BitReader symbols (body.data (), symbols_size);
  FullPixels full = {BitReader (body.data () + symbols_size, body.size () - symbols_size), depth,
      colour, header.depth_bits};
  rows_.resize (std::max (rows_.size (), 2 * (columns + 2)));
  std::fill_n (rows_.begin (), 2 * (columns + 2), kInvalidShown);
  earlier_.assign (columns, ReferencePlane::kNone);
  kept_.resize (std::max (kept_.size (), columns));
  std::uint64_t *row = rows_.data () + 1, *upper = row + columns + 2;
  for (int y = 0; y < header.rows; y++) {
    const int image_row = header.first_row + y;
    if (reference.before)
      reference.before->fetch (
          header.roi.x + header.first_column, header.roi.y + image_row, earlier_);
    if (!decode_row (
            symbols, full, upper, header.key ? nullptr : earlier_.data (), row, header.columns))
      return false;
    write_row (row, header, image_row, image, reference, decoded);
    if (reference.now) {
      std::transform (row, row + columns, kept_.begin (),
          [] (std::uint64_t p) { return p == kInvalidShown ? ReferencePlane::kNone : p; });
      reference.now->keep (header.roi.x + header.first_column, header.roi.y + image_row,
          std::span (kept_).first (columns));
    }
    std::swap (row, upper);
  }
  return symbols.at_clean_end () && full.bits.at_clean_end ();
}

} // namespace rangecast
