/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <vector>

#include "../../geometry/quantiser.hpp"
#include "../../geometry/range_image.hpp"
#include "../bitstream/components.hpp"
#include "../bitstream/encoder_result.hpp"
#include "../bitstream/unit.hpp"

namespace rangecast {

struct PlainSettings {
  int depth_threshold, colour_threshold; ///< codes
  int max_slice_size;                    ///< bytes
};

/** Codes partitions of range images in profile plain, each independently of those before. Keeps its
 *  memory. */
class PlainEncoder {
public:
  /** Appends the slices of a partition: all rows of some columns of the ROI.
   *  @param header  of all slices: bits, ROI, columns, times
   *  @param[in,out] result  is added to */
  void code_partition (const ConstRangeImage &image, const DepthQuantiser &depth,
      const ColourQuantiser &colour, const PlainSettings &settings, const SliceHeader &header,
      std::vector<std::uint8_t> &to, EncoderResult &result);

private:
  struct Pixel {
    Components codes;
  };
  void code_row (const std::uint16_t *depth, const Rgbx *colour, const DepthQuantiser &depths,
      const ColourQuantiser &colours);
  void add_row ();
  void begin_slice (int first_row);
  void close_slice (std::vector<std::uint8_t> &to);
  [[nodiscard]] std::size_t slice_size (int rows, std::size_t full) const;
  [[nodiscard]] int bits_of_full () const { return header_.depth_bits + 3 * header_.colour_bits; }

  PlainSettings settings_{};
  SliceHeader header_;          /* of the open slice */
  std::size_t full_pixels_ = 0; /* of the open slice */
  EncoderResult result_;

  std::vector<Pixel> upper_;              /* the last row as coded, and one pixel behind it */
  std::vector<std::uint8_t> row_symbols_; /* of the last row */
  std::vector<std::uint64_t> row_full_;
  std::size_t row_points_ = 0;
  std::vector<std::uint8_t> symbols_, full_; /* of the open slice */
};

} // namespace rangecast
