/* SPDX-License-Identifier: LGPL-2.1-or-later */
#if defined __GNUC__ && !defined __clang__
/* Else GCC keeps pairs of a pixel's numbers in vectors, and takes an eighth more time. */
#pragma GCC optimize("no-tree-slp-vectorize")
#endif
#include "compact_decoder.hpp"

#include "entropy_code.hpp"
#include "packed_code.hpp"

namespace rangecast {
namespace {

/* An EntropyCode that looks like a PackedReader. */
class EntropyReader : public EntropyCode<EntropyReading> {
public:
  static constexpr bool kEarlierInRuns = false;

  EntropyReader (
      std::span<const std::uint8_t> bytes, EntropyModel &model, const EntropyModel &initial)
      : EntropyCode (EntropyReading (bytes.data (), bytes.size ()), model)
  {
    model = initial;
  }
  bool earlier (const Neighbours &n) { return EntropyCode::earlier (n, false); }
  template <bool Delta> int choice (const Neighbours &n)
  {
    return EntropyCode::choice<Delta> (n, -1);
  }
  [[nodiscard]] bool overrun () const { return coder ().overrun (); }
  [[nodiscard]] bool at_clean_end () const { return coder ().at_end (); }
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
template <class Code, bool Delta>
bool
CompactDecoder::decode_full (Code &code, const Neighbours &n, bool corrected,
    const CompactQuantisers &quantisers, std::size_t x)
{
  Components c = predict (n, last_, limits_.last_depth);
  Activity activity = 0;
  if (corrected) {
    Components residual;
    if (!code.residual (n, n.any (), residual))
      return false;
    c = correct (c, residual, steps_, limits_);
    activity = activity_of (residual);
  }
  const bool known = !Delta || can_predict (n, last_);
  row_.pixels[x + 1] = {known ? pack_components (c) : kNoPixel,
      corrected ? Origin::kCorrected : Origin::kPredicted, activity};
  row_.shown[x + 1] = known ? shown_as (c, quantisers) : 0;
  return true;
}

template <class Code>
bool
CompactDecoder::decode_motions (Code &code)
{
  BlockMotion expected;
  for (BlockMotion &m : motions_) {
    if (!code.motion (expected, m) || std::abs (m.dx) > kMaxMotion ||
        std::abs (m.dy) > kMaxMotion || std::abs (m.dz) > kMaxMotionDepth)
      return false;
    expected = m;
  }
  return true;
}

/* A pixel that equals the same one of the earlier frame set, if that was received. */
void
CompactDecoder::take_earlier (std::size_t x, const CompactQuantisers &quantisers)
{
  const PixelCode code = earlier_codes_[x];
  row_.pixels[x + 1] = CodedPixel::copy (code, kTakeEarlier);
  row_.shown[x + 1] = code == kNoPixel ? 0 : shown_as (components_of (code), quantisers);
}

/* Decodes a run of valid pixels. What the loop needs of this object it holds in variables of its
 * own, the code too, so that it stays in registers. */
template <class Code, bool Delta>
bool
CompactDecoder::decode_run (
    Code &slice_code, const CompactQuantisers &quantisers, std::size_t begin, std::size_t end)
{
  CodedPixel *const pixels = row_.pixels.data () + 1;
  const CodedPixel *const upper = upper_.pixels.data () + 1;
  std::uint64_t *const shown = row_.shown.data () + 1;
  const std::uint64_t *const upper_shown = upper_.shown.data () + 1;
  Neighbours n = {pixels[begin - 1], upper[begin - 1], upper[begin], upper[begin + 1]};
  Code code = slice_code;
  for (std::size_t x = begin; x < end; x++) {
    if constexpr (Delta) {
      bool earlier;
      if constexpr (Code::kEarlierInRuns)
        earlier = row_.earlier[x];
      else
        earlier = code.earlier (n);
      if (earlier) {
        take_earlier (x, quantisers);
        n.move (pixels[x], upper[x + 2]);
        continue;
      }
    }
    const int chosen = n.any () ? code.template choice<Delta> (n) : kCorrect;
    if (chosen == kTakeLeft) {
      if (!n.left.valid ())
        return false;
      pixels[x] =
          Delta ? CodedPixel::copy (n.left.code, chosen) : CodedPixel (n.left.code, Origin::kLeft);
      shown[x] = shown[x - 1];
    } else if (chosen >= kTakeUpperLeft && chosen <= kTakeUpperRight) {
      const std::size_t from = x + static_cast<std::size_t> (chosen) - kTakeUpper;
      if (!upper[from].valid ())
        return false;
      pixels[x] = Delta ? CodedPixel::copy (upper[from].code, chosen)
                        : CodedPixel (upper[from].code, Origin::kUpper);
      shown[x] = upper_shown[from];
    } else {
      if (chosen < 0)
        return false;
      Code copy = code;
      if (!decode_full<Code, Delta> (copy, Neighbours (n), chosen == kCorrect, quantisers, x))
        return false;
      code = copy;
    }
    n.move (pixels[x], upper[x + 2]);
  }
  last_ = n.left.code;
  slice_code = code;
  return true;
}

/* Reads which pixels of a row are valid. */
template <class Code>
bool
CompactDecoder::decode_runs (Code &code, int columns)
{
  const auto size = static_cast<std::size_t> (columns);
  const std::span<const std::uint8_t> upper (upper_.valid.data (), size);
  bool now = false;
  for (int x = 0; x < columns; now = !now) {
    std::int32_t later = 0;
    if (!code.run (now, later))
      return false;
    const int end = run_end (upper, x, now) + later;
    if (end > columns || end < x || (end == x && (x > 0 || now)))
      return false;
    std::fill (row_.valid.begin () + x, row_.valid.begin () + end, std::uint8_t{now});
    x = end;
  }
  return true;
}

/* Reads which pixels of a run of valid ones equal those of the earlier frame set. */
template <class Code>
bool
CompactDecoder::decode_earlier_runs (Code &code, std::size_t begin, std::size_t end)
{
  const std::span<const std::uint8_t> upper (upper_.earlier.data (), end);
  const int first = static_cast<int> (begin), last = static_cast<int> (end);
  bool now = false;
  for (int x = first; x < last; now = !now) {
    std::int32_t later = 0;
    if (!code.earlier_run (later))
      return false;
    const int to = run_end (upper, x, now) + later;
    if (to > last || to < x || (to == x && (x > first || now)))
      return false;
    std::fill (row_.earlier.begin () + x, row_.earlier.begin () + to, std::uint8_t{now});
    x = to;
  }
  return true;
}

template <class Code, bool Delta>
bool
CompactDecoder::decode_row (Code &code, const CompactQuantisers &quantisers, int columns)
{
  if (!decode_runs (code, columns))
    return false;
  const std::span<const std::uint8_t> valid (
      row_.valid.data (), static_cast<std::size_t> (columns));
  bool now = false;
  for (int x = 0; x < columns; now = !now) {
    const int end = run_end (valid, x, now);
    const auto first = static_cast<std::size_t> (x), behind = static_cast<std::size_t> (end);
    if (!now) {
      std::fill (&row_.pixels[first + 1], &row_.pixels[behind + 1], CodedPixel{});
      std::fill (&row_.shown[first + 1], &row_.shown[behind + 1], std::uint64_t{0});
    } else {
      if constexpr (Delta && Code::kEarlierInRuns)
        if (!decode_earlier_runs (code, first, behind))
          return false;
      if (!decode_run<Code, Delta> (code, quantisers, first, behind))
        return false;
    }
    x = end;
  }
  return true;
}

void
CompactDecoder::keep_row (std::uint64_t *kept, int columns) const
{
  for (int x = 0; x < columns; x++)
    kept[x] = row_.pixels[static_cast<std::size_t> (x) + 1].code;
}

/* Fills the pixels of a row that are unknown. */
void
CompactDecoder::show_older_row (const DecoderReference &reference, const SliceHeader &header,
    int row, const RangeImage &image) const
{
  for (int x = 0; x < header.columns; x++) {
    const auto at = static_cast<std::size_t> (x);
    if (row_.valid[at] && row_.pixels[at + 1].code == kNoPixel)
      show_older (reference, image, header.first_column + x, row);
  }
}

template <class Code, bool Delta>
bool
CompactDecoder::decode_rows (Code &code, const SliceHeader &header,
    const CompactQuantisers &quantisers, const DecoderReference &reference, const RangeImage &image,
    DecodedPixels &decoded)
{
  const auto columns = static_cast<std::size_t> (header.columns);
  for (Row *row : {&row_, &upper_}) {
    row->pixels.assign (columns + 3, {});
    row->shown.assign (columns + 2, 0);
    row->valid.assign (columns, 0);
    row->earlier.assign (columns, 0);
  }
  earlier_codes_.assign (Delta ? columns : 0, kNoPixel);
  if constexpr (Delta)
    motions_.assign (
        motion_blocks (header.roi.x + header.first_column, header.columns), BlockMotion{});
  limits_ = {quantisers.depth.codes () - 1, (1 << quantisers.colour.bits ()) - 1};
  last_ = pack_components ({limits_.last_depth / 2, limits_.maximum / 2, 0, 0});
  for (int y = 0; y < header.rows; y++) {
    const int image_row = header.first_row + y;
    if constexpr (Delta) {
      const int full_x = header.roi.x + header.first_column, full_y = header.roi.y + image_row;
      if ((y == 0 || full_y % kMotionBlock == 0) && !decode_motions (code))
        return false;
      if (reference.before)
        fetch_displaced (*reference.before, full_x, full_y, motions_, limits_.last_depth, 0,
            kMaxImageSide, earlier_codes_);
      std::ranges::fill (row_.earlier, std::uint8_t{0});
    }
    if (!decode_row<Code, Delta> (code, quantisers, header.columns) || code.overrun ())
      return false;
    const std::uint64_t points = write_row (row_.shown.data () + 1, header.columns,
        image.depth.row (image_row) + header.first_column,
        image.colour.row (image_row) + header.first_column);
    decoded.points += points;
    if constexpr (Delta) {
      const auto valid = std::ranges::count (row_.valid, std::uint8_t{1});
      const std::uint64_t unknown = static_cast<std::uint64_t> (valid) - points;
      decoded.unknown += unknown;
      if (unknown > 0)
        show_older_row (reference, header, image_row, image);
    }
    if (reference.now)
      keep_row (reference.now->row (image_row) + header.first_column, header.columns);
    std::swap (row_, upper_);
  }
  return code.at_clean_end ();
}

template <class Code>
bool
CompactDecoder::decode_code (Code code, const SliceHeader &header,
    const CompactQuantisers &quantisers, const DecoderReference &reference, const RangeImage &image,
    DecodedPixels &decoded)
{
  return header.key ? decode_rows<Code, false> (code, header, quantisers, reference, image, decoded)
                    : decode_rows<Code, true> (code, header, quantisers, reference, image, decoded);
}

bool
CompactDecoder::decode (std::span<const std::uint8_t> body, const SliceHeader &header,
    const CompactQuantisers &quantisers, const DecoderReference &reference, const RangeImage &image,
    DecodedPixels &decoded)
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
  if (!packed)
    return decode_code (
        EntropyReader (data, model_, header.key ? kInitialModel : kInitialDeltaModel), header,
        quantisers, reference, image, decoded);
  const auto order = [&] (std::size_t i) {
    return static_cast<std::uint8_t> (body[kStepsSize + i / 2] >> 4 * (i % 2) & 15);
  };
  return decode_code (
      PackedReader (data.data (), data.size (), {order (0), order (1), order (2), order (3)}),
      header, quantisers, reference, image, decoded);
}

} // namespace rangecast
