/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "../../geometry/quantiser.hpp"
#include "../../geometry/range_image.hpp"
#include "../bitstream/symbols.hpp"
#include "../bitstream/unit.hpp"
#include "functions.hpp"

namespace rangecast {

/** Decodes slices of profile plain. Keeps its memory. */
class PlainDecoder {
public:
  /** Writes only pixels of the slice's rows and columns, whatever the bytes are.
   *  @param body    the bytes after the slice header; not shorter than its symbols
   *  @param header  checked, with at least one row; its ROI is the image's
   *  @param[in,out] points  the number of valid pixels is added
   *  @return false for damage: the pixels may then be partly written */
  bool decode (std::span<const std::uint8_t> body, const SliceHeader &header,
      const DepthQuantiser &depth, const ColourQuantiser &colour, const RangeImage &image,
      std::uint64_t &points);

private:
  std::vector<ShownPixel> rows_; /* the current row and the one above it, padded */
  std::vector<ShownPixel> full_; /* pixels of the slice, and one more that may be read */
};

} // namespace rangecast
