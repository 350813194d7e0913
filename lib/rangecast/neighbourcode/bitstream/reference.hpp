/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <cstdlib>
#include <memory>
#include <span>
#include <vector>

#include "unit.hpp"

namespace rangecast {

/** The pixels of a view's last frame set, to which slices of the next one may refer. A pixel is one
 *  number, made as the profile pleases. Places are those of the view's full image. Memory is taken
 *  for the rows that are written: 8 bytes for each pixel of the ROI in them. */
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
  /** It holds the frame set of such a slice, or the other slices of it. */
  [[nodiscard]] bool is_of (const SliceHeader &header) const;

  /** Takes pixels of a row, from column x on. Different pixels may be written at the same
   *  time. */
  void keep (int x, int y, std::span<const std::uint64_t> pixels);
  /** Pixels of the slice become kNone: it turned out to be damaged. Others may be written at the
   *  same time. */
  void clear (const SliceHeader &slice);

  /** kNone outside the ROI. */
  [[nodiscard]] std::uint64_t at (int x, int y) const
  {
    const int column = x - header_.roi.x, line = y - header_.roi.y;
    if (!held_ || column < 0 || line < 0 || column >= header_.roi.width ||
        line >= header_.roi.height)
      return kNone;
    return ~row (line)[column];
  }
  /** Pixels of a row from column x on; kNone outside the ROI. */
  void fetch (int x, int y, std::span<std::uint64_t> to) const;

private:
  struct Free {
    void operator() (std::uint64_t *memory) const { std::free (memory); }
  };
  [[nodiscard]] std::uint64_t *row (int line) const
  {
    return pixels_.get () +
           static_cast<std::size_t> (line) * static_cast<std::size_t> (header_.roi.width);
  }
  [[nodiscard]] bool is_written (int line);
  [[nodiscard]] bool means_the_same (const SliceHeader &header) const;

  bool held_ = false;
  SliceHeader header_;
  /* Inverted, so that kNone is 0: of memory that was never written there is none. */
  std::unique_ptr<std::uint64_t, Free> pixels_;
  std::size_t capacity_ = 0;
  std::vector<std::uint8_t> written_; /* rows of the ROI */
};

/** The last frame set of a view and the one that is being coded or decoded. */
class ReferencePair {
public:
  /** Begins a frame set. One of the same number goes on; one that is older is not kept. */
  void begin (const SliceHeader &header);
  void forget ();

  [[nodiscard]] const ReferencePlane &before () const { return planes_[1 - now_]; }
  /** What a frame set of that number may refer to, whether it was begun or not: the latest one that
   * is of another. */
  [[nodiscard]] const ReferencePlane &before (std::uint32_t frame_number) const
  {
    return now ().held () && now ().frame_number () != frame_number ? now () : before ();
  }
  /** Takes the pixels of the frame set that was begun; nullptr if it is not kept. */
  ReferencePlane *now_kept () { return keeps_ ? &planes_[now_] : nullptr; }
  [[nodiscard]] const ReferencePlane &now () const { return planes_[now_]; }

private:
  ReferencePlane planes_[2];
  int now_ = 0;
  bool keeps_ = false;
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
