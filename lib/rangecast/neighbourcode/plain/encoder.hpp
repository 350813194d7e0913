/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "../../geometry/quantiser.hpp"
#include "../../geometry/range_image.hpp"
#include "../bitstream/encoder_result.hpp"
#include "../bitstream/symbols.hpp"
#include "../bitstream/unit.hpp"
#include "functions.hpp"

namespace rangecast {

struct PlainSettings {
  int depth_threshold, colour_threshold; ///< codes
  int max_slice_size;                    ///< bytes
};

/** The codes of depths and colours, as tables. */
struct PlainCodes {
  void set (const DepthQuantiser &depth, const ColourQuantiser &colour);

  std::uint16_t near = 1, far = 0;  ///< of valid depths
  std::vector<std::uint16_t> codes; ///< of all depths
  ColourQuantiser colour;
};

/** Codes partitions of range images in profile plain, each independently of those before. Keeps its
 *  memory. */
class PlainEncoder {
public:
  /** Appends the slices of a partition: all rows of some columns of the ROI.
   *  @param header  of all slices: bits, ROI, columns, times
   *  @param[in,out] result  is added to */
  void code_partition (const ConstRangeImage &image, const PlainCodes &codes,
      const PlainSettings &settings, const SliceHeader &header, std::vector<std::uint8_t> &to,
      EncoderResult &result);

private:
  void resize (int columns);
  PlainRow code_row (const PlainSpan &span);
  void add_row (const PlainRow &row, std::span<PlainPixel> full);
  void begin_slice (int first_row);
  void close_slice (std::vector<std::uint8_t> &to);
  [[nodiscard]] std::size_t slice_size (int rows, std::size_t full) const;
  [[nodiscard]] int bits_of_full () const { return header_.depth_bits + 3 * header_.colour_bits; }

  PlainSettings settings_{};
  SliceHeader header_;          /* of the open slice */
  std::size_t full_pixels_ = 0; /* of the open slice */
  EncoderResult result_;

  std::vector<PlainPixel> row_, upper_; /* the first pixel is at kPixelsBefore */
  std::vector<std::uint8_t> row_symbols_;
  std::vector<PlainPixel> row_full_;
  std::vector<std::uint8_t> symbols_, full_; /* of the open slice */
};

} // namespace rangecast
