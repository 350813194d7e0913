/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "../../geometry/range_image.hpp"
#include "encoder.hpp"
#include "packed_code.hpp"
#include "row.hpp"

namespace rangecast {

/** Decodes slices of the profiles packed and entropy. Keeps its memory. */
class CompactDecoder {
public:
  /** Writes only pixels of the slice's rows and columns, whatever the bytes are.
   *  @param body    the bytes after the slice header
   *  @param header  checked, with at least one row; its ROI is the image's
   *  @param[in,out] decoded  is added to
   *  @return false for damage: the pixels may then be partly written */
  bool decode (std::span<const std::uint8_t> body, const SliceHeader &header,
      const CompactQuantisers &quantisers, const CodingReference &reference,
      const RangeImage &image, DecodedPixels &decoded);

private:
  template <class Code, bool Delta>
  bool decode_rows (Code code, const SliceHeader &header, const CompactQuantisers &quantisers,
      const CodingReference &reference, const RangeImage &image, DecodedPixels &decoded);
  template <class Code>
  bool load_earlier (
      Code &code, const SliceHeader &header, const CodingReference &reference, int y);
  bool decode_earlier_runs (PackedReader &code, std::size_t begin, std::size_t end);
  template <class Code> bool decode_valid (Code &code, int columns);
  template <bool Delta>
  bool decode_packed_row (
      PackedReader &code, const CompactQuantisers &quantisers, int columns, std::uint64_t &points);
  template <bool Delta>
  [[gnu::always_inline]] bool decode_run (PackedReader &slice_code,
      const CompactQuantisers &quantisers, std::size_t begin, std::size_t end);
  template <bool Delta>
  [[gnu::always_inline]] bool make_run (
      const EntropyRow &row, std::size_t begin, std::size_t end, const Components *&residuals);
  template <bool Delta>
  bool decode_entropy_row (EntropyReader &code, const CompactQuantisers &quantisers, int columns,
      std::uint16_t *depth, Rgbx *colour, std::uint64_t &points);
  [[gnu::always_inline]] bool decode_full (
      PackedReader &code, const Neighbours &n, bool corrected, CodedPixel &pixel);

  CompactRow row_, upper_;
  std::vector<int> runs_;                /* ends of the row's runs */
  std::vector<PixelCode> earlier_codes_; /* pixels of the earlier frame set for the row */
  std::vector<BlockMotion> motions_;     /* of the blocks that the row touches */
  std::vector<std::uint8_t> bytes_;      /* of the slice, and padding */
  EntropyModel model_{};
  EntropyRowMemory entropy_;
  Components steps_{};
  PixelLimits limits_;
  PixelCode last_ = kNoPixel;
};

} // namespace rangecast
