/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "encoder.hpp"

#include <algorithm>
#include <cstring>

#include "symbols.hpp"

namespace rangecast {
namespace {

/* Depth, R, G, B of a pixel side by side; compilers make vector code of it where there is some. */
typedef std::int32_t Lanes __attribute__ ((vector_size (16)));
typedef std::int64_t Halves __attribute__ ((vector_size (16)));

/* The depth of an invalid pixel: further than any threshold from every valid one. */
constexpr std::int32_t kNoDepth = -(1 << 24);

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

bool
is_near (Lanes a, Lanes b, Lanes threshold)
{
  const Lanes difference = a - b;
  const Lanes beyond = (difference > threshold) | (difference < -threshold);
  const Halves halves = reinterpret_cast<Halves> (beyond);
  return (halves[0] | halves[1]) == 0;
}

void
invalidate (std::int32_t *pixel)
{
  store (pixel, Lanes{kNoDepth, 0, 0, 0});
}

} // namespace

Status
validate (const EncoderSettings &s)
{
  const auto bad = [] (const char *what) { return Status{StatusCode::kBadValue, what}; };
  if (s.depth_bits < 6 || s.depth_bits > 16)
    return bad ("encoder: depth bits, expected 6 to 16");
  if (s.colour_bits < 4 || s.colour_bits > 8)
    return bad ("encoder: colour bits, expected 4 to 8");
  if (s.depth_threshold < 0 || s.depth_threshold > 65535 || s.colour_threshold < 0 ||
      s.colour_threshold > 255)
    return bad ("encoder: thresholds, expected 0 to 65535 for depth and 0 to 255 for colour");
  if (s.max_slice_size < 256 || s.max_slice_size > int (kMaxUnitSize))
    return bad ("encoder: maximum slice size, expected 256 to 65535 bytes");
  if (s.profile > Profile::kEntropy)
    return bad ("encoder: profile, expected plain, packed or entropy");
  return {};
}

Status
ViewEncoder::configure (const View &view, const EncoderSettings &settings)
{
  const bool same_view = configured_ && encode_rig ({{view}}) == encode_rig ({{view_}});
  if (same_view && settings == settings_)
    return {};
  if (Status s = validate (settings); !s.ok ())
    return s;
  if (Status s = depth_.set (view, settings.depth_bits); !s.ok ())
    return s;
  colour_ = ColourQuantiser (settings.colour_bits);
  view_ = view;
  settings_ = settings;
  configured_ = true;
  return {};
}

std::size_t
ViewEncoder::slice_size (std::size_t pixels, std::size_t full) const
{
  const auto full_bits =
      static_cast<std::size_t> (settings_.depth_bits + 3 * settings_.colour_bits);
  return kSliceHeaderSize + symbol_bytes (pixels) + (full * full_bits + 7) / 8;
}

/* Quantises a row into row_. */
void
ViewEncoder::load_row (const ConstRangeImage &image, int y, int first_column, int columns)
{
  const std::uint16_t *depth = image.depth.row (y) + first_column;
  const Rgbx *colour = image.colour.row (y) + first_column;
  std::int32_t *to = row_.data () + 4;
  for (int x = 0; x < columns; x++, to += 4) {
    if (!depth_.valid (depth[x])) {
      invalidate (to);
      continue;
    }
    to[0] = depth_.code (depth[x]);
    to[1] = colour_.code (colour[x].r);
    to[2] = colour_.code (colour[x].g);
    to[3] = colour_.code (colour[x].b);
  }
}

/* Codes row_ against upper_, in place, into symbols_ and full_. @return full pixels of the row */
std::size_t
ViewEncoder::code_row (bool has_upper, std::size_t symbols_at, std::size_t full_at)
{
  const Lanes threshold = {settings_.depth_threshold, settings_.colour_threshold,
      settings_.colour_threshold, settings_.colour_threshold};
  const int c = settings_.colour_bits, d = settings_.depth_bits;
  std::uint8_t *symbol = symbols_.data () + symbols_at;
  std::uint64_t *full = full_.data () + full_at;
  for (int x = 0; x < columns_; x++) {
    std::int32_t *pixel = row_.data () + 4 * (x + 1);
    const Lanes own = load (pixel);
    if (pixel[0] == kNoDepth) {
      *symbol++ = kInvalid;
      continue;
    }
    const std::int32_t *upper = upper_.data () + 4 * (x + 1);
    const std::int32_t *chosen = nullptr;
    if (is_near (own, load (pixel - 4), threshold)) {
      *symbol++ = kLeft;
      chosen = pixel - 4;
    } else if (has_upper) {
      for (int i = 0; i < 3 && !chosen; i++)
        if (is_near (own, load (upper + 4 * (i - 1)), threshold)) {
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
ViewEncoder::close_slice (const SliceHeader &header, std::size_t pixels, std::size_t full,
    std::vector<std::uint8_t> &to, EncoderResult &result)
{
  const std::size_t begin = to.size (), size = slice_size (pixels, full);
  to.resize (begin + size);
  std::uint8_t *p = to.data () + begin;
  write_slice_header (header, size, p);
  BitWriter symbols (p + kSliceHeaderSize);
  for (std::size_t i = 0; i < pixels; i++)
    symbols.put (symbols_[i], kSymbolBits);
  BitWriter pixel_bits (symbols.finish ());
  const int bits = settings_.depth_bits + 3 * settings_.colour_bits;
  for (std::size_t i = 0; i < full; i++)
    pixel_bits.put (full_[i], bits);
  pixel_bits.finish ();
  result.slices++;
  result.full_pixels += full;
}

/* Codes all rows of some columns of the ROI, in as many slices as their size asks for. */
void
ViewEncoder::code_piece (const ConstRangeImage &image, int first_column, int columns,
    SliceHeader header, std::vector<std::uint8_t> &to, EncoderResult &result)
{
  const auto limit = static_cast<std::size_t> (settings_.max_slice_size);
  columns_ = columns;
  const auto padded = static_cast<std::size_t> (columns + 2) * 4;
  row_.resize (std::max (row_.size (), padded));
  upper_.resize (std::max (upper_.size (), padded));
  for (auto *row : {&row_, &upper_}) {
    invalidate (row->data ());
    invalidate (row->data () + 4 * (columns + 1));
  }
  header.first_column = first_column;
  header.columns = columns;
  header.first_row = 0;
  header.rows = 0;
  std::size_t pixels = 0, full = 0;
  for (int y = 0; y < image.roi.height; y++) {
    const auto need = pixels + static_cast<std::size_t> (columns);
    symbols_.resize (std::max (symbols_.size (), need));
    full_.resize (std::max (full_.size (), full + static_cast<std::size_t> (columns)));
    load_row (image, y, first_column, columns);
    std::size_t more = code_row (header.rows > 0, pixels, full);
    if (header.rows > 0 && slice_size (need, full + more) > limit) {
      /* The row begins the next slice, where it has no upper neighbours. */
      close_slice (header, pixels, full, to, result);
      header.first_row = y;
      header.rows = 0;
      pixels = full = 0;
      load_row (image, y, first_column, columns);
      more = code_row (false, 0, 0);
    }
    header.rows++;
    pixels += static_cast<std::size_t> (columns);
    full += more;
    std::swap (row_, upper_);
  }
  close_slice (header, pixels, full, to, result);
}

Status
ViewEncoder::encode (const ConstRangeImage &image, std::uint32_t frame_number,
    std::vector<std::uint8_t> &to, EncoderResult &result)
{
  const Roi &roi = image.roi;
  if (!configured_)
    return {StatusCode::kBadValue, "encoder: not configured"};
  if (!roi.empty () && (roi.x < 0 || roi.y < 0 || roi.x + roi.width > view_.width ||
                           roi.y + roi.height > view_.height))
    return {StatusCode::kBadSize,
        "view " + std::to_string (view_.id) + ": the ROI does not lie in the view's image"};
  SliceHeader header;
  header.view_id = static_cast<std::uint8_t> (view_.id);
  header.depth_bits = static_cast<std::uint8_t> (settings_.depth_bits);
  header.colour_bits = static_cast<std::uint8_t> (settings_.colour_bits);
  header.profile = settings_.profile;
  header.frame_number = frame_number;
  header.capture_time_ns = image.capture_time_ns;
  if (roi.empty ()) {
    close_slice (header, 0, 0, to, result);
    return {};
  }
  header.roi = roi;
  if (settings_.profile != Profile::kPlain) {
    const CompactSettings compact = {settings_.depth_threshold, settings_.colour_threshold,
        settings_.max_slice_size, settings_.choice == NeighbourChoice::kBest};
    const CompactResult done = compact_.encode (image, {depth_, colour_}, compact, header, to);
    result.slices += done.slices;
    result.full_pixels += done.full_pixels;
    add_points (done.points, roi, result);
    return {};
  }
  /* As many columns as fit in one row even if every pixel of it is written in full. */
  const int bits = kSymbolBits + settings_.depth_bits + 3 * settings_.colour_bits;
  const int most = (settings_.max_slice_size - int (kSliceHeaderSize) - 2) * 8 / bits;
  const int pieces = (roi.width + most - 1) / most;
  for (int i = 0; i < pieces; i++) {
    const int begin = roi.width * i / pieces, end = roi.width * (i + 1) / pieces;
    code_piece (image, begin, end - begin, header, to, result);
  }
  count_points (image, result);
  return {};
}

void
ViewEncoder::count_points (const ConstRangeImage &image, EncoderResult &result) const
{
  const Roi &roi = image.roi;
  std::uint64_t points = 0;
  for (int y = 0; y < roi.height; y++) {
    const std::uint16_t *row = image.depth.row (y);
    for (int x = 0; x < roi.width; x++)
      points += depth_.valid (row[x]);
  }
  add_points (points, roi, result);
}

void
ViewEncoder::add_points (std::uint64_t points, const Roi &roi, EncoderResult &result) const
{
  result.points += points;
  result.raw_bits +=
      points * static_cast<std::uint64_t> (settings_.depth_bits + 3 * settings_.colour_bits) +
      static_cast<std::uint64_t> (roi.width) * static_cast<std::uint64_t> (roi.height);
}

} // namespace rangecast
