/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "../geometry/quantiser.hpp"
#include "../geometry/range_image.hpp"
#include "plain_functions.hpp"
#include "symbols.hpp"
#include "unit.hpp"

namespace rangecast {

struct PlainSettings {
  int depth_threshold, colour_threshold; ///< codes
  int max_slice_size;                    ///< bytes
};

struct PlainResult {
  std::uint64_t slices = 0;
  std::uint64_t delta_slices = 0; ///< of these, with reference to an earlier frame set
  std::uint64_t full_pixels = 0;
  std::uint64_t points = 0; ///< valid pixels
};

/** Codes range images in profile plain. Keeps its memory. */
class PlainEncoder {
public:
  /** The codes of depths and colours from now on. */
  void set_codes (const DepthQuantiser &depth, const ColourQuantiser &colour);

  /** Appends the slices of one range image whose ROI is not empty.
   *  @param header  of all slices: bits, ROI, times */
  PlainResult encode (const ConstRangeImage &image, const PlainSettings &settings,
      SliceHeader header, std::vector<std::uint8_t> &to);

private:
  /* A row that waits to be coded. */
  struct Row {
    std::vector<PlainPixel> pixels; /* from kPixelsBefore before its first one on */
    PlainSpan span;
  };
  void resize (int columns);
  void load_row (const ConstRangeImage &image, int y, Row &row);
  PlainSpan code_band (int rows);
  [[nodiscard]] PlainRow coded_row (int row, const PlainSpan &span) const;
  void add_row (const PlainRow &row, const PlainSpan &span, std::span<PlainPixel> full);
  void code_piece (
      const ConstRangeImage &image, int first_column, int columns, std::vector<std::uint8_t> &to);
  int add_band (int rows, std::vector<std::uint8_t> &to);
  void begin_slice (int first_row);
  void close_slice (std::vector<std::uint8_t> &to);
  [[nodiscard]] std::size_t slice_size (int rows, std::size_t full) const;
  [[nodiscard]] std::size_t pixels_of (int rows) const;
  [[nodiscard]] int bits_of_full () const { return header_.depth_bits + 3 * header_.colour_bits; }

  PlainSettings settings_{};
  const PlainFunctions *functions_ = nullptr;
  std::uint16_t near_ = 1, far_ = 0; /* of valid depths */
  std::vector<std::uint16_t> codes_; /* of all depths */
  ColourQuantiser colour_;
  SliceHeader header_;          /* of the open slice */
  std::size_t full_pixels_ = 0; /* of the open slice */
  PlainResult result_;

  std::array<Row, kBandRows> rows_;
  std::vector<PlainPixel> upper_, outside_;
  std::array<std::vector<std::uint8_t>, kBandRows> row_symbols_;
  std::vector<PlainPixel> row_full_;
  std::vector<std::uint8_t> symbols_, full_; /* of the open slice */
};

} // namespace rangecast
