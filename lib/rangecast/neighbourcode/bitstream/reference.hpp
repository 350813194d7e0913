/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <cstdlib>
#include <memory>
#include <span>
#include <vector>

#include "unit.hpp"

namespace rangecast {

/** The pixels of a view's last frame set, to which slices of the next one may refer. A pixel is a
 *  number whose meaning the profile defines. Coordinates are those of the view's full image. Rows
 *  take memory once they are written: 8 bytes for each pixel of the ROI. */
class ReferencePlane {
public:
  /** A pixel that is invalid, or was not received. */
  static constexpr std::uint64_t kNone = ~std::uint64_t{0};

  /** Begins a frame set: all pixels of the ROI are kNone. Keeps its memory. */
  void begin (const SliceHeader &header);
  void reset () { held_ = false; }

  [[nodiscard]] bool held () const { return held_; }
  /** Of the frame set that it holds. */
  [[nodiscard]] std::uint32_t frame_number () const { return header_.frame_number; }
  /** It holds the frame set that such a slice refers to, with the same meaning of pixels. */
  [[nodiscard]] bool serves (const SliceHeader &header) const;

  /** Stores pixels of a row from column x on. Threads may write different pixels concurrently. */
  void keep (int x, int y, std::span<const std::uint64_t> pixels);
  /** Pixels of a slice become kNone because it is damaged. Threads may write others meanwhile. */
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
  /** Pixels of a row from column x on; `outside` outside the ROI. */
  void fetch (int x, int y, std::span<std::uint64_t> to, std::uint64_t outside = kNone) const;

private:
  struct Free {
    void operator() (std::uint64_t *memory) const { std::free (memory); }
  };
  [[nodiscard]] std::uint64_t *row (int line) const
  {
    return pixels_.get () +
           static_cast<std::size_t> (line) * static_cast<std::size_t> (header_.roi.width);
  }

  bool held_ = false;
  SliceHeader header_;
  /* Inverted, so that kNone is 0: calloc() gives pages that take no memory until written. */
  std::unique_ptr<std::uint64_t, Free> pixels_;
  std::size_t capacity_ = 0;
  std::vector<std::uint8_t> written_; /* rows of the ROI */
};

/** The last frame set of a view and the one that is being coded or decoded. */
class ReferencePair {
public:
  /** Begins a frame set. One that is not newer than the latest is not kept. */
  void begin (const SliceHeader &header);
  void reset ();

  [[nodiscard]] const ReferencePlane &before () const { return planes_[1 - now_]; }
  /** The frame set that one of that number may refer to, begun or not: the latest with another
   *  number. */
  [[nodiscard]] const ReferencePlane &before (std::uint32_t frame_number) const
  {
    return now ().held () && now ().frame_number () != frame_number ? now () : before ();
  }
  /** Where to store the frame set that was begun; nullptr if it is not kept. */
  ReferencePlane *now_kept () { return keeps_ ? &planes_[now_] : nullptr; }
  [[nodiscard]] const ReferencePlane &now () const { return planes_[now_]; }

private:
  ReferencePlane planes_[2];
  int now_ = 0;
  bool keeps_ = false;
};

/** The frame set that slices may refer to, and where their own pixels are stored; or nullptr. */
struct CodingReference {
  const ReferencePlane *before = nullptr;
  ReferencePlane *now = nullptr;
};

/** Pixels of decoded slices. */
struct DecodedPixels {
  std::uint64_t points = 0;  ///< valid
  std::uint64_t unknown = 0; ///< valid, but they refer to pixels that were not received
};

} // namespace rangecast
