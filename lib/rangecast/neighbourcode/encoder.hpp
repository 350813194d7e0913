/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "../geometry/quantiser.hpp"
#include "../geometry/range_image.hpp"
#include "bitstream/encoder_result.hpp"
#include "bitstream/unit.hpp"
#include "compact/encoder.hpp"
#include "plain/encoder.hpp"
#include "reference_choice.hpp"

namespace rangecast {

/** The neighbour that replaces a pixel, of those that are near enough. */
enum class NeighbourChoice : std::uint8_t {
  kFirst, ///< the first: left, upper-left, upper, upper-right
  kBest,  ///< the one of least error and bits, or the pixel in full; profiles packed and entropy
};

struct EncoderSettings {
  int depth_bits = 12;       ///< 6 to 16
  int colour_bits = 8;       ///< 4 to 8
  int depth_threshold = 8;   ///< codes; 0 to 65535
  int colour_threshold = 5;  ///< codes of each of R, G, B; 0 to 255
  int max_slice_size = 1200; ///< bytes with all headers; 256 to 65535
  Profile profile = Profile::kPacked;
  NeighbourChoice choice = NeighbourChoice::kFirst;
  /** Pixels may also equal one of the frame set before; profiles packed and entropy. */
  bool temporal = false;
  /** Within this time every pixel is coded once without reference to earlier frame sets; 0: only in
   *  key frame sets. */
  std::uint64_t refresh_period_ns = 1'000'000'000;
  /** Time between frame sets, used where capture times do not grow. */
  std::uint64_t frame_interval_ns = 1'000'000'000 / 30;

  friend bool operator== (const EncoderSettings &, const EncoderSettings &) = default;
};

Status validate (const EncoderSettings &settings);

/** Memory to code partitions of any view, one after another. */
struct PartitionEncoder {
  PlainEncoder plain;
  CompactEncoder compact; ///< profiles packed and entropy
};

/** Codes range images of one view in independent partitions: their bytes do not depend on order,
 *  thread or PartitionEncoder. Keeps its memory. */
class ViewEncoder {
public:
  /** Sets the view and the settings. Builds tables only if something changed.
   *  @return validate()'s status, or kBadValue if depth cannot be quantised */
  Status configure (const View &view, const EncoderSettings &settings);
  /** Changes the thresholds only, codes; they must be in range. No tables are built. */
  void set_thresholds (int depth, int colour)
  {
    settings_.depth_threshold = depth;
    settings_.colour_threshold = colour;
  }

  /** Begins a range image and cuts it into partitions.
   *
   *  Pixels are scanned row by row. A valid one is compared with its left, upper-left, upper and
   *  upper-right neighbours, as they are after quantisation and replacement; the first that is near
   *  enough in depth and in each of R, G, B replaces it. Neighbours outside the slice do not exist.
   *  An empty ROI gives one slice without pixels. Depths outside near..far are invalid.
   *  @param image  must stay valid until all partitions are coded
   *  @return kBadSize if the ROI does not lie in the view's image */
  Status begin (const ConstRangeImage &image, std::uint32_t frame_number);

  struct PartitionId {
    std::size_t band, partition;
  };
  /** Calls visit (id) for each partition that has to be coded. */
  template <typename Visit> void for_open_partitions (const Visit &visit) const
  {
    for (std::size_t b = 0; b < band_count_; b++)
      for (std::size_t p = 0; bands_[b].is_open && p < bands_[b].count; p++)
        visit (PartitionId{b, p});
  }
  /** Codes a partition. Threads may code different ones concurrently. */
  void code (PartitionId id, PartitionEncoder &memory);
  /** To be called when all open partitions are coded. @return false if some bands had to be cut
   * into more partitions, or have to be coded the other way (see Trial): these are open now */
  bool finish ();

  /** Statistics of the range image. */
  [[nodiscard]] EncoderResult result () const;
  /** Calls visit (bytes) for each partition, in order; valid until the next begin(). */
  template <typename Visit> void for_coded_partitions (const Visit &visit) const
  {
    for (std::size_t b = 0; b < band_count_; b++)
      for (std::size_t p = 0; p < bands_[b].count; p++)
        visit (std::span<const std::uint8_t> (bands_[b].partitions[p].bytes));
  }

  /** The next range image is coded without reference to earlier ones. */
  void request_key () { references_.reset (); }

  [[nodiscard]] const DepthQuantiser &depth () const { return depth_; }

private:
  struct Partition {
    int first_column = 0, columns = 0; /* of the ROI */
    std::vector<std::uint8_t> bytes;
    EncoderResult result;
  };
  /* A band may be coded with a reference and without one, to see which is smaller. Later frame sets
   * refer to what is coded last, so the way that is expected to win comes second; if the first one
   * wins it is coded again. */
  enum class Trial : std::uint8_t { kNone, kFirst, kSecond, kAgain };
  struct Plan { /* of a band */
    RowBand rows;
    bool fine = false; /* see CompactSettings::fine */
    Trial trial = Trial::kNone;
  };
  struct Band {
    Plan plan;
    std::size_t first_bytes = 0;       /* of the first way of a trial */
    std::vector<Partition> partitions; /* those after the first `count` are spare memory */
    std::size_t count = 0;
    bool is_open = false;
    bool misfits = false; /* a row of a partition is longer than a slice may be */
  };
  void make_empty_slice ();
  void plan_references ();
  void cut_bands ();
  void cut (Band &band, int partitions);
  [[nodiscard]] int partitions_of (const Plan &plan) const;
  [[nodiscard]] CompactSettings compact_settings (bool fine) const;
  [[nodiscard]] static std::size_t bytes_of (const Band &band);
  [[nodiscard]] std::size_t pixels_of (const Band &band) const;
  bool continue_trial (Band &band);
  void record_bytes ();

  View view_;
  EncoderSettings settings_;
  bool configured_ = false;
  DepthQuantiser depth_;
  ColourQuantiser colour_;
  ReferencePair references_;
  RefreshSchedule refresh_;
  ReferenceChoice reference_choice_;
  MotionMemory motions_;
  double delta_bytes_per_pixel_ = 0; /* of the last bands with a reference; 0: there was none */

  /* Of the current range image. */
  ConstRangeImage image_;
  SliceHeader header_;
  CodingReference reference_;
  std::vector<RowBand> rows_, fine_, coarse_,
      both_;                /* see RefreshSchedule::plan(), ReferenceChoice::sort() */
  std::vector<Plan> plans_; /* from top to bottom */
  std::vector<Band> bands_; /* those after the first band_count_ are spare memory */
  std::size_t band_count_ = 0;
};

} // namespace rangecast
