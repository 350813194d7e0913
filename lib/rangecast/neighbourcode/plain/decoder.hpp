/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "../../geometry/quantiser.hpp"
#include "../../geometry/range_image.hpp"
#include "../bitstream/unit.hpp"

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
  struct alignas (8) Pixel { /* aligned, so that one load copies it */
    std::uint16_t depth = 0;
    Rgbx colour{};
  };
  std::vector<Pixel> upper_; /* the row above, and one pixel behind it */
};

} // namespace rangecast
