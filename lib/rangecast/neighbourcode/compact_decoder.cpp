/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "compact_decoder.hpp"

#include "entropy_code.hpp"
#include "packed_code.hpp"

namespace rangecast {
namespace {

/* An EntropyCode that looks like a PackedReader. */
class EntropyReader : public EntropyCode<EntropyReading> {
public:
  EntropyReader (std::span<const std::uint8_t> bytes, EntropyModel &model)
      : EntropyCode (EntropyReading (bytes.data (), bytes.size ()), model)
  {
    model = kInitialModel;
  }
  int choice (const Neighbours &n) { return EntropyCode::choice (n, kNoSymbol); }
  [[nodiscard]] bool overrun () const { return coder ().overrun (); }
  [[nodiscard]] bool at_clean_end () const { return coder ().at_end (); }
};

/* As it goes into the image: R, G, B in the lower half, depth in the upper. */
inline std::uint64_t
shown_as (PixelCode code, const CompactQuantisers &quantisers, const Limits &limits)
{
  const Components c = to_rgb (components_of (code), limits);
  const std::uint64_t depth = quantisers.depth.depth (static_cast<std::uint16_t> (c[0]));
  std::uint32_t rgb = static_cast<std::uint32_t> (c[1] | c[2] << 8 | c[3] << 16);
  if (quantisers.colour.bits () < 8) {
    const auto value = [&] (int i) {
      return std::uint32_t{quantisers.colour.value (static_cast<std::uint8_t> (c[i]))};
    };
    rgb = value (1) | value (2) << 8 | value (3) << 16;
  }
  return rgb | depth << 32;
}

void
write_row (const std::uint64_t *row, std::size_t columns, std::uint16_t *depth, Rgbx *colour)
{
  for (std::size_t x = 0; x < columns; x++)
    depth[x] = static_cast<std::uint16_t> (row[x] >> 32);
  for (std::size_t x = 0; x < columns; x++) {
    auto rgbx = static_cast<std::uint32_t> (row[x]);
    if constexpr (std::endian::native == std::endian::big)
      rgbx = __builtin_bswap32 (rgbx);
    std::memcpy (&colour[x].r, &rgbx, sizeof rgbx);
  }
}

constexpr PixelState kLeftState = state_of (Origin::kLeft), kUpperState = state_of (Origin::kUpper);

} // namespace

/* A pixel that equals no neighbour. */
template <class Code>
inline bool
CompactDecoder::decode_full (Code &code, const Neighbours &n, bool corrected, CodedPixel &pixel)
{
  const Components expected = predict (n, last_, limits_.most);
  if (!corrected) {
    pixel = {pack_components (expected), state_of (Origin::kPredicted)};
    return true;
  }
  Components residual;
  if (!code.residual (n, n.any (), residual))
    return false;
  pixel = {pack_components (correct (expected, residual, steps_, limits_)),
      state_of (Origin::kCorrected, Code::kUsesActivity ? activity_of (residual) : 0)};
  return true;
}

/* Decodes a run of valid pixels, behind an invalid one. What the loop needs of this object it holds
 * in variables of its own, the code too, so that it stays in registers. */
template <class Code>
inline bool
CompactDecoder::decode_run (
    Code &slice_code, const CompactQuantisers &quantisers, std::size_t begin, std::size_t end)
{
  PixelCode *const codes = row_.codes ();
  PixelState *const states = row_.states ();
  std::uint64_t *const shown = row_.shown ();
  const PixelCode *const upper_codes = upper_.codes ();
  const PixelState *const upper_states = upper_.states ();
  const std::uint64_t *const upper_shown = upper_.shown ();
  CodedPixel left;
  std::uint64_t left_shown = 0;
  Code code = slice_code;
  for (std::size_t x = begin; x < end; x++) {
    const Neighbours n = {left, upper_codes + x, upper_states + x};
    const auto chosen =
        static_cast<unsigned> (x > begin || n.any () ? code.choice (n) : int{kCorrect});
    if (chosen < kPredict) [[likely]] {
      const std::size_t from = x + chosen - kTakeUpper;
      const std::uint64_t take_left = mask_of_zero (chosen);
      left_shown = either (take_left, left_shown, upper_shown[from]);
      left = {either (take_left, left.code, upper_codes[from]),
          either (take_left, kLeftState, kUpperState)};
    } else {
      if (chosen > kCorrect || !decode_full (code, n, chosen == kCorrect, left))
        return false;
      left_shown = shown_as (left.code, quantisers, limits_);
    }
    if (left.code == kNoPixel) /* equals an invalid one */
      return false;
    codes[x] = left.code;
    states[x] = left.state;
    shown[x] = left_shown;
  }
  last_ = left.code;
  slice_code = code;
  return true;
}

template <class Code>
bool
CompactDecoder::decode_run_every (
    Code &code, const CompactQuantisers &quantisers, std::size_t begin, std::size_t end)
{
  return decode_run (code, quantisers, begin, end);
}

template <class Code>
bool
CompactDecoder::decode_run_v3 (
    Code &code, const CompactQuantisers &quantisers, std::size_t begin, std::size_t end)
{
  return decode_run (code, quantisers, begin, end);
}

/* Reads which pixels of a row are valid, and where its runs end. */
template <class Code>
bool
CompactDecoder::decode_runs (Code &code, int columns)
{
  const std::vector<std::uint8_t> &upper = upper_.valid ();
  std::vector<std::uint8_t> &valid = row_.valid ();
  runs_.clear ();
  bool now = false;
  for (int x = 0; x < columns; now = !now) {
    std::int32_t later = 0;
    if (!code.run (now, later))
      return false;
    const int end = run_end (upper, x, now) + later;
    if (end > columns || end < x || (end == x && (x > 0 || now)))
      return false;
    std::fill (valid.begin () + x, valid.begin () + end, std::uint8_t{now});
    runs_.push_back (end);
    x = end;
  }
  return true;
}

template <class Code>
bool
CompactDecoder::decode_row (
    Code &code, const CompactQuantisers &quantisers, int columns, std::uint64_t &points)
{
  if (!decode_runs (code, columns))
    return false;
  std::size_t begin = 0;
  bool valid = false;
  for (int run : runs_) {
    const auto end = static_cast<std::size_t> (run);
    if (!valid)
      row_.invalidate (begin, end, 0);
    else if (!(has_v3_ ? decode_run_v3 (code, quantisers, begin, end)
                       : decode_run_every (code, quantisers, begin, end)))
      return false;
    points += valid ? end - begin : 0;
    begin = end;
    valid = !valid;
  }
  return !code.overrun ();
}

template <class Code>
bool
CompactDecoder::decode_rows (Code &code, const SliceHeader &header,
    const CompactQuantisers &quantisers, const RangeImage &image, std::uint64_t &points)
{
  const auto columns = static_cast<std::size_t> (header.columns);
  row_.reset (columns, 0);
  upper_.reset (columns, 0);
  runs_.reserve (columns + 1);
  limits_ = Limits (quantisers.depth.codes () - 1, (1 << quantisers.colour.bits ()) - 1, steps_);
  last_ = first_expected (limits_);
  for (int y = 0; y < header.rows; y++) {
    std::uint64_t more = 0;
    if (!decode_row (code, quantisers, header.columns, more))
      return false;
    const int image_row = header.first_row + y;
    write_row (row_.shown (), columns, image.depth.row (image_row) + header.first_column,
        image.colour.row (image_row) + header.first_column);
    points += more;
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
    EntropyReader code (data, model_);
    return decode_rows (code, header, quantisers, image, points);
  }
  const auto order = [&] (std::size_t i) {
    return static_cast<std::uint8_t> (body[kStepsSize + i / 2] >> 4 * (i % 2) & 15);
  };
  bytes_.assign (data.begin (), data.end ());
  bytes_.resize (data.size () + PackedReader::kPadding);
  PackedReader code (bytes_.data (), data.size (), {order (0), order (1), order (2), order (3)});
  return decode_rows (code, header, quantisers, image, points);
}

} // namespace rangecast
