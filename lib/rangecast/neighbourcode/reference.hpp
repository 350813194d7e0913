/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "unit.hpp"

namespace rangecast {

/** The pixels of a view's last frame set, to which slices of the next one may refer. A pixel is one
 *  number, made as the profile pleases. */
class ReferencePlane {
public:
  /** Of pixels that are invalid, or were not received. */
  static constexpr std::uint64_t kNone = ~std::uint64_t{0};

  /** Begins a frame set: all pixels of the ROI are kNone. Keeps its memory. */
  void begin (const SliceHeader &header);
  void forget () { held_ = false; }

  [[nodiscard]] bool held () const { return held_; }
  /** Of the frame set that it holds. */
  [[nodiscard]] std::uint32_t frame_number () const { return header_.frame_number; }
  /** It is what such a slice refers to, pixels mean the same in both. */
  [[nodiscard]] bool serves (const SliceHeader &header) const;

  /** A row of the ROI. */
  std::uint64_t *row (int y)
  {
    return pixels_.data () +
           static_cast<std::size_t> (y) * static_cast<std::size_t> (header_.roi.width);
  }
  /** Of the view's full image; kNone outside the ROI. */
  [[nodiscard]] std::uint64_t at (int x, int y) const
  {
    const int column = x - header_.roi.x, line = y - header_.roi.y;
    if (column < 0 || line < 0 || column >= header_.roi.width || line >= header_.roi.height)
      return kNone;
    return pixels_[static_cast<std::size_t> (line) * static_cast<std::size_t> (header_.roi.width) +
                   static_cast<std::size_t> (column)];
  }
  /** Pixels of a row of the view's full image from column x on; kNone outside the ROI. */
  void fetch (int x, int y, std::span<std::uint64_t> to) const;
  /** Pixels of the slice become kNone: it turned out to be damaged. */
  void clear (const SliceHeader &slice);

private:
  bool held_ = false;
  SliceHeader header_;
  std::vector<std::uint64_t> pixels_;
};

/** The last frame set of a view and the one that is being coded or decoded. */
class ReferencePair {
public:
  /** Begins a frame set. One that was begun before, of the same number, is begun anew. */
  void begin (const SliceHeader &header);
  void forget ();

  [[nodiscard]] const ReferencePlane &before () const { return planes_[1 - now_]; }
  /** What a frame set of that number may refer to, whether it was begun or not: the latest one that
   * is of another. */
  [[nodiscard]] const ReferencePlane &before (std::uint32_t frame_number) const
  {
    return now ().held () && now ().frame_number () != frame_number ? now () : before ();
  }
  ReferencePlane &now () { return planes_[now_]; }
  [[nodiscard]] const ReferencePlane &now () const { return planes_[now_]; }

private:
  ReferencePlane planes_[2];
  int now_ = 0;
};

/** What slices may refer to, and where their pixels are kept; nullptr = nothing, nowhere. */
struct CodingReference {
  const ReferencePlane *before = nullptr;
  ReferencePlane *now = nullptr;
};

/** The same for a decoder. */
struct DecoderReference {
  const ReferencePlane *before = nullptr;
  ReferencePlane *now = nullptr;
  /** What is shown of unknown pixels; may be nullptr or have another ROI. */
  const ConstRangeImage *older = nullptr;
};

/** What came of a slice. */
struct DecodedPixels {
  std::uint64_t points = 0;  ///< valid ones
  std::uint64_t unknown = 0; ///< valid, but they refer to pixels that were not received
};

/** Fills a pixel of an image (column and row of its ROI) from `older`, if that has it. */
void show_older (const DecoderReference &reference, const RangeImage &image, int x, int y);

} // namespace rangecast
