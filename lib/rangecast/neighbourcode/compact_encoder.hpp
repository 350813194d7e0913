/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <vector>

#include "../geometry/quantiser.hpp"
#include "../geometry/range_image.hpp"
#include "entropy_code.hpp"
#include "pixel_lanes.hpp"
#include "refresh.hpp"

namespace rangecast {

struct CompactSettings {
  int depth_threshold, colour_threshold; ///< codes
  int max_slice_size;                    ///< bytes
  bool best; ///< what costs least in error and bits, not the first that is near enough
};

struct CompactResult {
  std::uint64_t slices = 0;
  std::uint64_t delta_slices = 0; ///< of these, with reference to an earlier frame set
  std::uint64_t full_pixels = 0;  ///< those without a neighbour that is near enough
};

struct CompactQuantisers {
  const DepthQuantiser &depth;
  const ColourQuantiser &colour;
};

/** The steps of residuals that keep every pixel within the thresholds; all 1 for thresholds of 0.
 */
Steps steps_within (int depth_threshold, int colour_threshold);

/** Codes range images in the profiles packed and entropy. Keeps its memory. */
class CompactEncoder {
public:
  /** Makes room for motion in a view of this size. */
  void set_size (int width, int height) { search_.resize (width, height); }

  /** Appends the slices of one range image whose ROI is not empty.
   *  @param bands  that make up the ROI
   *  @param header  of all slices: profile, bits, ROI, times, distance of the reference */
  CompactResult encode (const ConstRangeImage &image, std::span<const RowBand> bands,
      const CodingReference &reference, const CompactQuantisers &quantisers,
      const CompactSettings &settings, const SliceHeader &header, std::vector<std::uint8_t> &to);

private:
  void set_thresholds (const CompactSettings &settings, bool is_reference);
  void code_band (const ConstRangeImage &image, const RowBand &band, std::vector<std::uint8_t> &to);
  [[nodiscard]] int pieces_of (const RowBand &band, int width) const;
  template <class Code, bool Delta>
  bool code_piece (
      const ConstRangeImage &image, const RowBand &band, std::vector<std::uint8_t> &to);
  template <class Code, bool Delta> bool code_row (Code &slice_code, bool begins_block);
  template <class Code> void code_runs (Code &code);
  template <class Code> void code_earlier_runs (Code &code, std::size_t begin, std::size_t end);
  template <class Code, bool Delta>
  bool code_run (Code &slice_code, std::size_t begin, std::size_t end);
  template <class Code, bool Delta>
  void code_full (Code &code, const Neighbours &n, std::size_t x, const Components &residual);
  template <class Code, bool Delta> Code begin_slice (int first_row);
  template <class Code> void close_slice (Code &code, std::vector<std::uint8_t> &to);
  int best_choice (std::size_t x, const Neighbours &n, Components &residual);
  Components make_full (std::size_t x, const Neighbours &n);
  void load_row (const ConstRangeImage &image, int y);
  void load_earlier (int y, const RowBand &band);
  void find_motions (const ConstRangeImage &image, int y, const RowBand &band);
  template <class Code> void code_motions (Code &code);
  void resize (int columns);
  [[nodiscard]] std::size_t header_size () const;

  CompactSettings settings_{};
  CodingReference reference_;
  double delta_bytes_per_pixel_ = 0; /* of the last bands with a reference; 0: there was none */
  const CompactQuantisers *quantisers_ = nullptr; /* while encode() runs */
  SliceHeader header_;
  CompactResult result_;
  Components steps_{};
  std::array<std::uint64_t, kComponents> reciprocals_{};
  Limits limits_{};
  Lanes threshold_{}, earlier_threshold_{};
  float depth_weight_ = 0, colour_weight_ = 0;

  /* One invalid pixel before and one behind the row, which `pixels` and `colours` count; pixels one
   * more, because Neighbours look ahead. */
  struct Row {
    std::vector<CodedPixel> pixels;
    std::vector<Lanes> colours; /* depth, R, G, B as decoded */
    std::vector<std::uint8_t> valid;
    std::vector<std::uint8_t> earlier; /* pixels that equal those of the earlier frame set */
  };
  Row row_, upper_;
  std::vector<PixelCode> earlier_codes_; /* the row in the earlier frame set */
  std::vector<Lanes> earlier_colours_;
  std::vector<BlockMotion> motions_; /* of the blocks that the row touches */
  MotionSearch search_;
  std::vector<Lanes> own_; /* the row as it is to be coded */
  PixelCode last_ = kNoPixel;
  int columns_ = 0;
  EntropyModel model_{}, model_before_{};
  std::vector<std::uint8_t> bytes_; /* of the open slice, behind its header */
  std::array<std::uint64_t, kComponents> size_sums_{}, size_counts_{}; /* of its residuals */
  GolombOrders orders_{};
};

} // namespace rangecast
