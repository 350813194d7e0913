/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <vector>

#include "../../geometry/quantiser.hpp"
#include "../../geometry/range_image.hpp"
#include "../bitstream/encoder_result.hpp"
#include "../bitstream/refresh.hpp"
#include "entropy_code.hpp"
#include "packed_code.hpp"
#include "pixel_key.hpp"
#include "row.hpp"

namespace rangecast {

struct CompactSettings {
  int depth_threshold, colour_threshold; ///< codes
  int max_slice_size;                    ///< bytes
  bool best; ///< choose the neighbour of least error and bits, not the first that is near enough
  bool fine; ///< finer than the thresholds ask, so that later frame sets can reuse pixels longer
};

struct CompactQuantisers {
  const DepthQuantiser &depth;
  const ColourQuantiser &colour;
};

/** The coarsest residual steps that keep every pixel within the thresholds (codes); all 1 for
 *  thresholds of 0. */
Steps steps_within (int depth_threshold, int colour_threshold);
/** Thresholds of pixels that are not taken from an earlier frame set. */
CompactSettings finer_settings (const CompactSettings &settings);

/** A range image and what is common to the coding of its partitions. */
struct CompactPicture {
  const ConstRangeImage &image;
  CodingReference reference;
  CompactQuantisers quantisers;
  CompactSettings settings;
  MotionMemory &motions; ///< of the view
  int refresh_rows;      ///< of the bands of its full image that refer to their own pixels only
};

/** Codes partitions of range images in the profiles packed and entropy, each independently of those
 *  before. Keeps its memory. */
class CompactEncoder {
public:
  /** Appends the slices of a partition.
   *  @param band    its rows
   *  @param header  of all slices: profile, bits, ROI, columns, times, reference
   *  @param[in,out] result  is added to
   *  @return false if one row is longer than a slice may be: partitions must be narrower */
  bool code_partition (const CompactPicture &picture, const RowBand &band,
      const SliceHeader &header, std::vector<std::uint8_t> &to, EncoderResult &result);

private:
  /* A pixel that no neighbour replaces, as the decoder will have it. */
  struct FullPixel {
    Components residual;
    PixelCode code;
    PixelKey key;
  };

  template <class Code, bool Delta>
  bool code_rows (const ConstRangeImage &image, const RowBand &band, std::vector<std::uint8_t> &to);
  template <class Code, bool Delta> bool code_row (Code &slice_code, bool begins_block);
  template <class Code> void code_runs (Code &code);
  template <class Code> void code_earlier_runs (Code &code, std::size_t begin, std::size_t end);
  template <class Code, bool Best, bool Delta>
  [[gnu::always_inline]] void code_run (Code &slice_code, std::size_t begin, std::size_t end);
  template <class Code>
  [[gnu::always_inline]] PixelState code_full (
      Code &code, const Neighbours &n, Components residual);
  template <class Code, bool Delta> Code begin_slice (int first_row);
  template <class Code> void close_slice (Code &code, std::vector<std::uint8_t> &to);
  template <class Code, bool Delta>
  [[gnu::always_inline]] int best_choice (
      const Code &code, std::size_t x, const Neighbours &n, bool earlier, FullPixel &full);
  [[nodiscard, gnu::always_inline]] FullPixel make_full (PixelKey own, const Neighbours &n) const;
  [[gnu::always_inline]] void load_row (const ConstRangeImage &image, int y);
  void load_earlier (int y);
  void find_motions (const ConstRangeImage &image, int y, const RowBand &band);
  void resize (int columns);
  void reserve_entries (EntropyWriter &code);
  [[nodiscard]] std::size_t header_size () const;

  CompactSettings settings_{};
  const CompactQuantisers *quantisers_ =
      nullptr; /* this and the next while code_partition() runs */
  MotionMemory *motion_memory_ = nullptr;
  SliceHeader header_;
  EncoderResult result_;
  Components steps_{};
  FloatComponents reciprocals_{};
  PixelLimits limits_;
  MotionScale scale_;
  PixelKey bias_ = 0, earlier_bias_ = 0; /* of the thresholds */
  Components earlier_threshold_{};
  CodingReference reference_;
  float depth_weight_ = 0, colour_weight_ = 0;

  CompactRow row_, upper_;
  std::vector<PixelKey> own_;            /* the quantised row */
  std::vector<PixelCode> earlier_codes_; /* the row in the earlier frame set */
  std::vector<PixelKey> earlier_keys_;
  std::vector<BlockMotion> motions_; /* of the blocks that the row touches */
  MotionSearch search_;
  PixelCode last_ = kNoPixel;
  int refresh_rows_ = 1;
  int columns_ = 0;
  std::vector<int> runs_; /* ends of the row's runs */
  EntropyModel model_{};
  EntropyRowMemory entropy_;
  std::vector<std::uint32_t> entries_;     /* of the open entropy slice */
  std::vector<std::uint8_t> bytes_;        /* of the open slice, after its header */
  Components size_sums_{}, size_counts_{}; /* of its residuals */
  GolombOrders orders_{};
};

} // namespace rangecast
