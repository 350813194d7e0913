/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>

#include "../geometry/quantiser.hpp"
#include "../geometry/range_image.hpp"
#include "bitstream/unit.hpp"
#include "compact/decoder.hpp"
#include "plain/decoder.hpp"

namespace rangecast {

/** Memory to decode slices, one after another. */
struct SliceMemory {
  PlainDecoder plain;
  CompactDecoder compact; ///< profiles packed and entropy
};

/** Decodes slices into range images; keeps quantiser tables between them. */
class SliceDecoder {
public:
  /** Sets the rig whose views are decoded. Forgets the tables. @return validate()'s status */
  Status set_rig (const Rig &rig);
  [[nodiscard]] const Rig &rig () const { return rig_; }

  /** Reads a slice's header and checks that its view is in the rig and its ROI in that view. */
  Status read_header (std::span<const std::uint8_t> unit, SliceHeader &header) const;

  /** Builds the tables for slices of this view and these bits, unless they exist. Threads may
   * prepare different views concurrently. */
  void prepare (const SliceHeader &header);

  /** Decodes one slice, after prepare(), into the planes of its view. Writes only pixels of its own
   * rows and columns; where it returns an error, those may be partly written. Threads may decode
   * slices that share no pixel concurrently, each with its own memory.
   *  @param unit    the whole unit
   *  @param header  from read_header()
   *  @param image   has the slice's ROI
   *  @param reference  of this view; pixels that refer to missing ones become invalid
   *  @param[in,out] pixels  is added to
   *  @return kBadData or kTruncated for damaged symbols, kBadSize for another ROI */
  Status decode (std::span<const std::uint8_t> unit, const SliceHeader &header,
      const CodingReference &reference, const RangeImage &image, DecodedPixels &pixels,
      SliceMemory &memory) const;

  /** Bytes of a slice all of whose pixels are invalid or equal a neighbour; no slice has fewer. */
  static std::size_t smallest_size (const SliceHeader &header);

private:
  struct ViewTables {
    DepthQuantiser depth;
    int depth_bits = 0;
  };
  [[nodiscard]] const DepthQuantiser *depth_of (const SliceHeader &header) const;

  Rig rig_;
  std::array<std::unique_ptr<ViewTables>, kMaxViews> views_;
  std::array<ColourQuantiser, 5> colours_{ColourQuantiser (4), ColourQuantiser (5),
      ColourQuantiser (6), ColourQuantiser (7), ColourQuantiser (8)};
};

} // namespace rangecast
