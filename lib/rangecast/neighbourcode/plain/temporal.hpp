/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Profile plain where frame sets refer to one another. It handles one pixel at a time: streams that
 * refer to earlier frame sets mostly use the other profiles, which save more. */
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "../../geometry/quantiser.hpp"
#include "../../geometry/range_image.hpp"
#include "../bitstream/components.hpp"
#include "../bitstream/reference.hpp"
#include "../bitstream/refresh.hpp"
#include "encoder.hpp"

namespace rangecast {

/** Codes partitions of range images that are kept as references. Keeps its memory. */
class PlainTemporalEncoder {
public:
  /** Appends the slices of a partition.
   *  @param band    its rows
   *  @param header  of all slices: bits, ROI, columns, times, reference
   *  @param[in,out] result  is added to */
  void code_partition (const ConstRangeImage &image, const RowBand &band,
      const CodingReference &reference, const DepthQuantiser &depth, const ColourQuantiser &colour,
      const PlainSettings &settings, const SliceHeader &header, std::vector<std::uint8_t> &to,
      EncoderResult &result);

private:
  void load_row (const ConstRangeImage &image, int y);
  [[nodiscard]] int symbol_of (int x) const;
  std::size_t code_row (std::size_t symbols_at, std::size_t full_at);
  void begin_slice (int first_row);
  void close_slice (std::size_t pixels, std::size_t full, std::vector<std::uint8_t> &to);
  [[nodiscard]] std::size_t slice_size (std::size_t pixels, std::size_t full) const;
  [[nodiscard]] int bits_of_full () const { return header_.depth_bits + 3 * header_.colour_bits; }

  const DepthQuantiser *depth_ = nullptr; /* while code_partition() runs */
  const ColourQuantiser *colour_ = nullptr;
  CodingReference reference_;
  PlainSettings settings_{};
  Components threshold_{};
  SliceHeader header_; /* of the open slice */
  EncoderResult result_;

  std::vector<Components> row_, upper_; /* with an invalid pixel on each side */
  std::vector<std::uint64_t> earlier_, kept_;
  std::vector<std::uint8_t> symbols_; /* of the open slice, one a byte */
  std::vector<std::uint64_t> full_;
};

/** Decodes slices that are kept as references or refer to one. Keeps its memory. */
class PlainTemporalDecoder {
public:
  /** Writes only pixels of the slice's rows and columns, whatever the bytes are.
   *  @param body    the bytes after the slice header; not shorter than its symbols
   *  @param header  checked, with at least one row; its ROI is the image's
   *  @param[in,out] decoded  is added to
   *  @return false for damage: the pixels may then be partly written */
  bool decode (std::span<const std::uint8_t> body, const SliceHeader &header,
      const DepthQuantiser &depth, const ColourQuantiser &colour, const DecoderReference &reference,
      const RangeImage &image, DecodedPixels &decoded);

private:
  std::vector<std::uint64_t> rows_; /* the current row and the one above it, padded */
  std::vector<std::uint64_t> earlier_, kept_;
};

} // namespace rangecast
