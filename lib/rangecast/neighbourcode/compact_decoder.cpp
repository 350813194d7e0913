/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "compact_decoder.hpp"

#include "entropy_code.hpp"
#include "packed_code.hpp"

namespace rangecast {
namespace {

/* Both codes as decode_rows() sees them. */
class EntropyReader {
public:
  EntropyReader (const std::uint8_t *from, std::size_t bytes)
      : code_ (EntropyReading (from, bytes)), clean_ (bytes == 0 || from[bytes - 1] != 0)
  {
  }
  bool row (std::span<std::uint8_t>, std::span<const std::uint8_t>) { return true; }
  bool valid (const Neighbours &n, bool) { return code_.valid (n, false); }
  int choice (const Neighbours &n) { return code_.choice (n, -1); }
  bool residual (const Neighbours &n, bool has_neighbour, Components &r)
  {
    return code_.residual (n, has_neighbour, r);
  }
  [[nodiscard]] bool at_clean_end () const { return clean_ && code_.coder ().at_end (); }

private:
  EntropyCode<EntropyReading> code_;
  bool clean_; /* an encoder leaves zeros at the end out */
};

std::uint64_t
shown_as (const Components &c, const CompactQuantisers &quantisers)
{
  const auto rgb = to_rgb (c, (1 << quantisers.colour.bits ()) - 1);
  std::uint64_t shown = quantisers.depth.depth (static_cast<std::uint16_t> (c[0]));
  for (int i = 0; i < 3; i++)
    shown |= std::uint64_t{quantisers.colour.value (
                 static_cast<std::uint8_t> (rgb[static_cast<std::size_t> (i)]))}
             << (16 + 8 * i);
  return shown;
}

std::uint64_t
write_row (const std::uint64_t *row, int columns, std::uint16_t *depth, Rgbx *colour)
{
  std::uint64_t points = 0;
  for (int x = 0; x < columns; x++) {
    const std::uint64_t p = row[x];
    depth[x] = static_cast<std::uint16_t> (p);
    colour[x] = {static_cast<std::uint8_t> (p >> 16), static_cast<std::uint8_t> (p >> 24),
        static_cast<std::uint8_t> (p >> 32), 0};
    points += p != 0;
  }
  return points;
}

} // namespace

/* A pixel that equals no neighbour. */
template <class Code>
bool
CompactDecoder::decode_full (Code &code, const Neighbours &n, bool corrected,
    const CompactQuantisers &quantisers, std::size_t x)
{
  Components c = predict (n, last_, limits_.last_depth);
  CodedPixel &pixel = row_.pixels[x + 1];
  pixel = {0, {}, corrected ? Origin::kCorrected : Origin::kPredicted};
  if (corrected) {
    Components residual;
    if (!code.residual (n, n.any (), residual))
      return false;
    c = correct (c, residual, steps_, limits_);
    pixel.activity = activity_of (residual);
  }
  pixel.code = pack_components (c);
  row_.shown[x + 1] = shown_as (c, quantisers);
  return true;
}

template <class Code>
bool
CompactDecoder::decode_row (Code &code, const CompactQuantisers &quantisers, std::size_t columns)
{
  if (!code.row ({row_.valid.data (), columns}, {upper_.valid.data (), columns}))
    return false;
  for (std::size_t x = 0; x < columns; x++) {
    CodedPixel &pixel = row_.pixels[x + 1];
    const Neighbours n = {
        row_.pixels[x], upper_.pixels[x], upper_.pixels[x + 1], upper_.pixels[x + 2]};
    if (!code.valid (n, row_.valid[x])) {
      pixel = {};
      row_.shown[x + 1] = 0;
      continue;
    }
    const int chosen = n.any () ? code.choice (n) : kCorrect;
    if (chosen == kTakeLeft) {
      pixel = {n.left.code, {}, Origin::kLeft};
      row_.shown[x + 1] = row_.shown[x];
    } else if (chosen >= kTakeUpperLeft && chosen <= kTakeUpperRight) {
      const std::size_t at = x + static_cast<std::size_t> (chosen) - kTakeUpperLeft;
      pixel = {upper_.pixels[at].code, {}, Origin::kUpper};
      row_.shown[x + 1] = upper_.shown[at];
    } else if (chosen < 0 || !decode_full (code, n, chosen == kCorrect, quantisers, x)) {
      return false;
    }
    if (pixel.code == kNoPixel) /* equals an invalid one */
      return false;
    last_ = pixel.code;
  }
  return true;
}

template <class Code>
bool
CompactDecoder::decode_rows (Code &code, const SliceHeader &header,
    const CompactQuantisers &quantisers, const RangeImage &image, std::uint64_t &points)
{
  const auto columns = static_cast<std::size_t> (header.columns);
  for (Row *row : {&row_, &upper_}) {
    row->pixels.assign (columns + 2, {});
    row->shown.assign (columns + 2, 0);
    row->valid.assign (columns, 0);
  }
  limits_ = {quantisers.depth.codes () - 1, (1 << quantisers.colour.bits ()) - 1};
  last_ = pack_components ({limits_.last_depth / 2, limits_.maximum / 2, 0, 0});
  for (int y = 0; y < header.rows; y++) {
    if (!decode_row (code, quantisers, columns))
      return false;
    const int image_row = header.first_row + y;
    points += write_row (row_.shown.data () + 1, header.columns,
        image.depth.row (image_row) + header.first_column,
        image.colour.row (image_row) + header.first_column);
    std::swap (row_, upper_);
  }
  return code.at_clean_end ();
}

bool
CompactDecoder::decode (std::span<const std::uint8_t> body, const SliceHeader &header,
    const CompactQuantisers &quantisers, const RangeImage &image, std::uint64_t &points)
{
  const bool packed = header.profile == Profile::kPacked;
  const std::size_t own_header = packed ? kStepsSize + kOrdersSize : kStepsSize;
  if (body.size () < own_header)
    return false;
  const Steps steps = {body[0] | body[1] << 8, body[2], body[3]};
  if (steps.depth == 0 || steps.luma == 0 || steps.chroma == 0)
    return false;
  steps_ = steps.components ();
  const auto data = body.subspan (own_header);
  if (!packed) {
    EntropyReader code (data.data (), data.size ());
    return decode_rows (code, header, quantisers, image, points);
  }
  const auto order = [&] (std::size_t i) {
    return static_cast<std::uint8_t> (body[kStepsSize + i / 2] >> 4 * (i % 2) & 15);
  };
  PackedReader code (data.data (), data.size (), {order (0), order (1), order (2), order (3)});
  return decode_rows (code, header, quantisers, image, points);
}

} // namespace rangecast
