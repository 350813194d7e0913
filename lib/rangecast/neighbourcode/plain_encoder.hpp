/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <vector>

#include "../geometry/quantiser.hpp"
#include "../geometry/range_image.hpp"
#include "pixel_lanes.hpp"
#include "unit.hpp"

namespace rangecast {

struct PlainSettings {
  int depth_threshold, colour_threshold; ///< codes
  int max_slice_size;                    ///< bytes
};

struct PlainResult {
  std::uint64_t slices = 0;
  std::uint64_t full_pixels = 0;
};

/** Codes range images in profile plain. Keeps its memory. */
class PlainEncoder {
public:
  /** Appends the slices of one range image whose ROI is not empty.
   *  @param header  of all slices: bits, ROI, times */
  PlainResult encode (const ConstRangeImage &image, const DepthQuantiser &depth,
      const ColourQuantiser &colour, const PlainSettings &settings, SliceHeader header,
      std::vector<std::uint8_t> &to);

private:
  void load_row (const ConstRangeImage &image, int y);
  std::size_t code_row (bool has_upper, std::size_t symbols_at, std::size_t full_at);
  void code_piece (
      const ConstRangeImage &image, int first_column, int columns, std::vector<std::uint8_t> &to);
  void close_slice (std::size_t pixels, std::size_t full, std::vector<std::uint8_t> &to);
  [[nodiscard]] std::size_t slice_size (std::size_t pixels, std::size_t full) const;

  PlainSettings settings_{};
  const DepthQuantiser *depth_ = nullptr; /* while encode() runs */
  const ColourQuantiser *colour_ = nullptr;
  SliceHeader header_; /* of the open slice */
  PlainResult result_;

  /* Rows as four int32 a pixel (depth, R, G, B), with one invalid pixel on each side. */
  std::vector<std::int32_t> row_, upper_;
  std::vector<std::uint8_t> symbols_; /* of the open slice, one a byte */
  std::vector<std::uint64_t> full_;   /* of the open slice */
};

} // namespace rangecast
