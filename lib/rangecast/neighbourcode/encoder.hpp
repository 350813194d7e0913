/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "../geometry/quantiser.hpp"
#include "../geometry/range_image.hpp"
#include "compact_encoder.hpp"
#include "plain_encoder.hpp"
#include "plain_temporal.hpp"
#include "reference_choice.hpp"
#include "unit.hpp"

namespace rangecast {

/** Which of the neighbours that are near enough replaces a pixel, if any. */
enum class NeighbourChoice : std::uint8_t {
  kFirst, ///< the first: left, upper-left, upper, upper-right
  kBest,  ///< what costs least in error and bits, in full too; profiles packed and entropy
};

struct EncoderSettings {
  int depth_bits = 12;       ///< 6 to 16
  int colour_bits = 8;       ///< 4 to 8
  int depth_threshold = 8;   ///< codes; 0 to 65535
  int colour_threshold = 10; ///< codes of each of R, G, B; 0 to 255
  int max_slice_size = 1200; ///< bytes with all headers; 256 to 65535
  Profile profile = Profile::kPlain;
  NeighbourChoice choice = NeighbourChoice::kFirst;
  DepthScale depth_scale = DepthScale::kLinear;
  /** A pixel may equal the same one of the frame set before, too. */
  bool temporal = false;
  /** Within this time every pixel is coded without reference to earlier frame sets; 0: only in key
   * frame sets. */
  std::uint64_t refresh_period_ns = 1'000'000'000;
  /** Of frame sets whose capture times do not grow. */
  std::uint64_t frame_interval_ns = 1'000'000'000 / 30;

  friend bool operator== (const EncoderSettings &, const EncoderSettings &) = default;
};

Status validate (const EncoderSettings &settings);

/** What one view came to. */
struct EncoderResult {
  std::uint64_t points = 0;      ///< valid pixels
  std::uint64_t full_pixels = 0; ///< of these, written in full
  std::uint64_t slices = 0;
  std::uint64_t delta_slices = 0; ///< of these, with reference to an earlier frame set
  std::uint64_t raw_bits = 0;     ///< points x (depth bits + 3 x colour bits) + 1 for each pixel

  EncoderResult &operator+= (const EncoderResult &other)
  {
    points += other.points;
    full_pixels += other.full_pixels;
    slices += other.slices;
    delta_slices += other.delta_slices;
    raw_bits += other.raw_bits;
    return *this;
  }
};

/** Codes range images of one view and keeps its memory from frame to frame. */
class ViewEncoder {
public:
  /** Sets up for a view. Builds tables only if something changed. */
  Status configure (const View &view, const EncoderSettings &settings);
  /** Changes nothing but the thresholds: at no cost. They must be within their ranges. */
  void set_thresholds (int depth, int colour)
  {
    settings_.depth_threshold = depth;
    settings_.colour_threshold = colour;
  }

  /** Appends the slices of one range image.
   *
   *  Pixels are scanned row by row. A valid one is compared with its left, upper-left, upper and
   *  upper-right neighbours, as they are after quantisation and replacement; the first that is near
   *  enough in depth and in each of R, G, B replaces it. Neighbours outside the slice do not exist.
   *  An empty ROI gives one slice without pixels. Depths outside near..far are invalid.
   *  @return kBadSize if the ROI does not lie in the view's image */
  Status encode (const ConstRangeImage &image, std::uint32_t frame_number,
      std::vector<std::uint8_t> &to, EncoderResult &result);

  /** The next range image is coded without reference to earlier ones. */
  void request_key () { references_.forget (); }

  [[nodiscard]] const DepthQuantiser &depth () const { return depth_; }

private:
  /* What all bands of a frame set share. */
  struct Frame {
    const ConstRangeImage &image;
    SliceHeader header;
    CodingReference reference;
    std::vector<std::uint8_t> &to;
  };
  [[nodiscard]] SliceHeader make_header (
      const ConstRangeImage &image, std::uint32_t frame_number) const;
  CodingReference plan_references (SliceHeader &header);
  EncoderResult code_bands (const Frame &frame, std::span<const RowBand> bands, bool fine);
  EncoderResult code_fine_bands (const Frame &frame);
  EncoderResult code_both_ways (const Frame &frame, RowBand band);

  View view_;
  EncoderSettings settings_;
  bool configured_ = false;
  DepthQuantiser depth_;
  ColourQuantiser colour_;
  PlainEncoder plain_;
  PlainTemporalEncoder plain_temporal_;
  CompactEncoder compact_; /* profiles packed and entropy */
  ReferencePair references_;
  RefreshSchedule refresh_;
  ReferenceChoice reference_choice_;
  std::vector<RowBand> bands_, fine_, coarse_, both_;
  std::vector<std::size_t> costs_; /* bytes of fine_ */
};

} // namespace rangecast
