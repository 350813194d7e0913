/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "../geometry/range_image.hpp"
#include "compact_encoder.hpp"
#include "entropy_code.hpp"

namespace rangecast {

/** Decodes slices of the profiles packed and entropy. Keeps its memory. */
class CompactDecoder {
public:
  /** Writes only pixels of the slice's rows and columns, whatever the bytes are.
   *  @param body    what is behind the slice header
   *  @param header  checked, and not empty; its ROI is the image's
   *  @param[out] pixels  grows
   *  @return false for damage: the pixels may then be partly written */
  bool decode (std::span<const std::uint8_t> body, const SliceHeader &header,
      const CompactQuantisers &quantisers, const DecoderReference &reference,
      const RangeImage &image, DecodedPixels &pixels);

private:
  template <class Code, bool Delta>
  bool decode_rows (Code &code, const SliceHeader &header, const CompactQuantisers &quantisers,
      const DecoderReference &reference, const RangeImage &image, DecodedPixels &decoded);
  template <class Code>
  bool decode_code (Code code, const SliceHeader &header, const CompactQuantisers &quantisers,
      const DecoderReference &reference, const RangeImage &image, DecodedPixels &decoded);
  void keep_row (std::uint64_t *kept, int columns) const;
  void show_older_row (const DecoderReference &reference, const SliceHeader &header, int row,
      const RangeImage &image) const;
  template <class Code> bool decode_runs (Code &code, int columns);
  template <class Code> bool decode_earlier_runs (Code &code, std::size_t begin, std::size_t end);
  template <class Code, bool Delta>
  bool decode_row (Code &code, const CompactQuantisers &quantisers, int columns);
  template <class Code, bool Delta>
  bool decode_run (
      Code &slice_code, const CompactQuantisers &quantisers, std::size_t begin, std::size_t end);
  template <class Code> bool decode_motions (Code &code);
  void take_earlier (std::size_t x, const CompactQuantisers &quantisers);
  template <class Code, bool Delta>
  bool decode_full (Code &code, const Neighbours &n, bool corrected,
      const CompactQuantisers &quantisers, std::size_t x);

  /* One invalid pixel before and one behind the row, which `pixels` and `shown` count; pixels one
   * more, because Neighbours look ahead. */
  struct Row {
    std::vector<CodedPixel> pixels;
    std::vector<std::uint64_t> shown; /* depth, then R, G, B, as they go into the image */
    std::vector<std::uint8_t> valid;
    std::vector<std::uint8_t> earlier; /* pixels that equal those of the earlier frame set */
  };
  Row row_, upper_;
  std::vector<PixelCode> earlier_codes_; /* what its pixels may equal in the earlier frame set */
  std::vector<BlockMotion> motions_;     /* of the blocks that the row touches */
  EntropyModel model_{};
  Components steps_{};
  Limits limits_{};
  PixelCode last_ = kNoPixel;
};

} // namespace rangecast
