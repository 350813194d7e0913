/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <vector>

#include "../geometry/quantiser.hpp"
#include "../geometry/range_image.hpp"
#include "compact_row.hpp"
#include "entropy_code.hpp"
#include "isa.hpp"
#include "pixel_key.hpp"

namespace rangecast {

struct CompactSettings {
  int depth_threshold, colour_threshold; ///< codes
  int max_slice_size;                    ///< bytes
  bool best; ///< what costs least in error and bits, not the first that is near enough
};

struct CompactResult {
  std::uint64_t slices = 0;
  std::uint64_t points = 0;      ///< valid pixels
  std::uint64_t full_pixels = 0; ///< those without a neighbour that is near enough
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
  /** Appends the slices of one range image whose ROI is not empty.
   *  @param header  of all slices: profile, bits, ROI, times */
  CompactResult encode (const ConstRangeImage &image, const CompactQuantisers &quantisers,
      const CompactSettings &settings, SliceHeader header, std::vector<std::uint8_t> &to);

private:
  typedef float Reciprocals __attribute__ ((vector_size (16)));
  /* What a pixel becomes that no neighbour replaces. */
  struct FullPixel {
    Components residual;
    PixelCode code;
    PixelKey key;
  };

  template <class Code>
  bool code_piece (
      const ConstRangeImage &image, int first_column, int columns, std::vector<std::uint8_t> &to);
  template <class Code> bool code_row (Code &slice_code);
  template <class Code> void code_runs (Code &code);
  template <class Code, bool Best>
  [[gnu::always_inline]] void code_run (Code &slice_code, std::size_t begin, std::size_t end);
  template <class Code, bool Best>
  [[RANGECAST_EVERY_CPU]] void code_run_every (Code &code, std::size_t begin, std::size_t end);
  template <class Code, bool Best>
  [[RANGECAST_X86_64_V3]] void code_run_v3 (Code &code, std::size_t begin, std::size_t end);
  template <class Code, bool Best>
  void code_run_here (Code &code, std::size_t begin, std::size_t end);
  template <class Code>
  [[gnu::always_inline]] PixelState code_full (
      Code &code, const Neighbours &n, Components residual);
  template <class Code> Code begin_slice (int first_row);
  template <class Code> void close_slice (Code &code, std::vector<std::uint8_t> &to);
  int best_choice (std::size_t x, const Neighbours &n, FullPixel &full);
  [[nodiscard, gnu::always_inline]] FullPixel make_full (PixelKey own, const Neighbours &n) const;
  [[gnu::always_inline]] void load_row (const ConstRangeImage &image, int y);
  [[RANGECAST_EVERY_CPU]] void load_row_every (const ConstRangeImage &image, int y);
  [[RANGECAST_X86_64_V3]] void load_row_v3 (const ConstRangeImage &image, int y);
  [[gnu::always_inline]] void find_upper (std::size_t begin, std::size_t end);
  void resize (int columns);
  [[nodiscard]] std::size_t header_size () const;
  [[nodiscard]] bool fits (std::size_t bytes) const;

  const bool has_v3_ = has_x86_64_v3 ();
  CompactSettings settings_{};
  const CompactQuantisers *quantisers_ = nullptr; /* while encode() runs */
  SliceHeader header_;
  CompactResult result_;
  Components steps_{}, half_steps_{};
  Reciprocals reciprocals_{};
  Limits limits_;
  PixelKey bias_ = 0; /* of the thresholds */
  float depth_weight_ = 0, colour_weight_ = 0;

  CompactRow row_, upper_;
  std::vector<PixelKey> own_;         /* the row as it is to be coded */
  std::vector<std::uint64_t> others_; /* for each pixel, the first of those above that is near */
  PixelCode last_ = kNoPixel;
  int columns_ = 0;
  std::vector<int> runs_; /* ends of the row's runs */
  EntropyModel model_{}, model_before_{};
  std::vector<std::uint8_t> bytes_;        /* of the open slice, behind its header */
  Components size_sums_{}, size_counts_{}; /* of its residuals */
  GolombOrders orders_{};
};

} // namespace rangecast
