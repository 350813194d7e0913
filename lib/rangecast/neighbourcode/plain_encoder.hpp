/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <cstdint>
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
  /** Appends the slices of one range image whose ROI is not empty.
   *  @param header  of all slices: bits, ROI, times */
  PlainResult encode (const ConstRangeImage &image, const DepthQuantiser &depth,
      const PlainSettings &settings, SliceHeader header, std::vector<std::uint8_t> &to);

private:
  /* A row that waits to be coded. */
  struct Row {
    std::vector<PlainPixel> pixels; /* from kPixelsBefore before its first one on */
    PlainSpan span;
  };
  /* What a slice holds so far. */
  struct Slice {
    BitWriter symbols{nullptr}, full{nullptr};
    std::size_t full_pixels = 0;
  };

  void find_depths (const DepthQuantiser &depth);
  void resize (int columns);
  void load_row (const ConstRangeImage &image, int y, Row &row);
  PlainSpan code_band (int rows);
  std::size_t find_full (int row, const PlainSpan &span);
  void add_row (int row, const PlainSpan &span, std::size_t full);
  void code_piece (
      const ConstRangeImage &image, int first_column, int columns, std::vector<std::uint8_t> &to);
  int add_band (int rows, std::vector<std::uint8_t> &to);
  void begin_slice (int first_row);
  void close_slice (std::vector<std::uint8_t> &to);
  [[nodiscard]] std::size_t slice_size (std::size_t pixels, std::size_t full) const;
  [[nodiscard]] int bits_of_full () const { return header_.depth_bits + 3 * header_.colour_bits; }

  PlainSettings settings_{};
  const PlainFunctions *functions_ = nullptr;
  const DepthQuantiser *depth_ = nullptr; /* while encode() runs */
  std::uint16_t near_ = 1, far_ = 0;
  SliceHeader header_; /* of the open slice */
  Slice slice_;
  PlainResult result_;

  std::array<Row, kBandRows> rows_;
  std::vector<PlainPixel> upper_, outside_;
  std::vector<std::uint16_t> codes_;
  std::array<std::vector<std::uint8_t>, kBandRows> row_symbols_;
  std::vector<std::uint64_t> row_full_;
  std::vector<std::uint8_t> symbols_, full_; /* of the open slice */
};

} // namespace rangecast
