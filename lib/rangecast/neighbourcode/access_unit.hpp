/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <span>
#include <vector>

#include "../base/parallel.hpp"
#include "decoder.hpp"
#include "encoder.hpp"

namespace rangecast {

/** Codes whole frame sets; their views and partitions in parallel. */
class AccessUnitEncoder {
public:
  /** Sets the rig and the settings. @return kBadValue for a setting out of range */
  Status configure (const Rig &rig, const EncoderSettings &settings);
  /** Changes the thresholds only, codes, without new tables or memory; they must be in range. The
   *  next configure() replaces them by its own. */
  void set_thresholds (int depth, int colour);

  /** Codes a frame set. Its bytes are those of parts() in order, valid until the next call.
   *  @param threads  partitions coded in parallel; 0 = number of cores. The bytes do not depend on
   * it
   *  @param[in,out] result  is added to
   *  @return kNotFound for a view that is not in the rig, kBadData for one that appears twice,
   *  kBadSize for a ROI outside its view */
  Status encode (std::span<const RangeImage> images, std::uint32_t frame_number, int threads,
      EncoderResult &result);

  /** The next frame set is coded without reference to earlier ones. */
  void request_key ();

  /** The coded frame set in parts of one or more whole slices. */
  [[nodiscard]] std::span<const std::span<const std::uint8_t>> parts () const { return parts_; }
  [[nodiscard]] std::size_t size () const;
  /** A copy of all parts together. */
  [[nodiscard]] std::vector<std::uint8_t> bytes () const;
  /** Greatest difference between a decoded depth and the original over all views, metres:
   *  quantisation, threshold and rounded residuals together. */
  [[nodiscard]] double max_depth_error_m () const { return max_depth_error_m_; }

private:
  struct Job {
    ViewEncoder *view;
    ViewEncoder::PartitionId partition;
  };
  void find_max_depth_error ();
  Status check_views (std::span<const RangeImage> images);

  Rig rig_;
  EncoderSettings settings_;
  double max_depth_error_m_ = 0;
  std::array<ViewEncoder, kMaxViews> views_; /* by view-id */
  std::array<Status, kMaxViews> begun_;      /* by image of the frame set */
  std::vector<Job> jobs_;
  WorkerMemory<PartitionEncoder> memory_;
  std::vector<std::span<const std::uint8_t>> parts_;
};

struct DecoderResult {
  std::uint64_t slices = 0; ///< decoded
  /** Damaged, too short, of another rig or version, or inconsistent or overlapping with others. */
  std::uint64_t bad_slices = 0;
  std::uint64_t missing_pixels = 0; ///< of the views' ROIs, in slices that did not arrive
  std::uint64_t points = 0;         ///< valid pixels
  /** Pixels of intact slices that are invalid only because they refer to pixels of an earlier frame
   *  set that were not received. */
  std::uint64_t unknown_pixels = 0;
  std::uint64_t raw_bits = 0; ///< points x (depth bits + 3 x colour bits) + 1 for each pixel

  DecoderResult &operator+= (const DecoderResult &other)
  {
    slices += other.slices;
    bad_slices += other.bad_slices;
    missing_pixels += other.missing_pixels;
    points += other.points;
    unknown_pixels += other.unknown_pixels;
    raw_bits += other.raw_bits;
    return *this;
  }
};

/** Decodes whole frame sets in two steps: plan() finds the views and their sizes, so that the
 * caller can allocate images; decode() fills them, views and slices in parallel. No input makes it
 * write outside the images, and a damaged slice costs only that slice. */
class AccessUnitDecoder {
public:
  struct PlannedView {
    int view_id = 0;
    Roi roi;
    std::uint64_t capture_time_ns = 0;
    std::size_t first_slice = 0, slice_count = 0; ///< those to decode; they share no pixel
    SliceHeader reference;                        ///< of the first slice that agrees with most
    std::uint64_t coded_pixels = 0;               ///< pixels of the ROI in the slice headers
    std::uint64_t held_pixels = 0;                ///< pixels of the slices to decode
  };

  Status set_rig (const Rig &rig);
  [[nodiscard]] const Rig &rig () const { return decoder_.rig (); }
  /** Forgets earlier frame sets, after a discontinuity. */
  void reset_references ();

  /** Reads all headers. Views are sorted by view-id. ROI, bits and frame number of a view are those
   *  of most of its slices (on a tie, those that arrived first); slices that differ are counted as
   *  bad and ignored. `bytes` must stay valid until decode() returns.
   *  @param whole_rois  false: a ROI of which nearly nothing arrived shrinks to the bounding box of
   *  its slices, as all other pixels would be invalid, so that a few bytes do not claim a large
   *  image */
  void plan (std::span<const std::uint8_t> bytes, DecoderResult &result, bool whole_rois = true);
  [[nodiscard]] std::span<const PlannedView> views () const { return {planned_.data (), count_}; }
  /** Pixels of a view's coded ROI that no slice holds. */
  [[nodiscard]] std::uint64_t missing_pixels (std::size_t view) const
  {
    return planned_[view].coded_pixels - planned_[view].held_pixels;
  }

  /** Fills all pixels of `images`. Pixels without an intact slice are invalid.
   *  @param images  one for each of views(), in that order, with its ROI
   *  @param threads  slices decoded in parallel; 0 = number of cores. The result does not depend on
   * it
   *  @param[in,out] result  is added to
   *  @return kBadSize, with nothing decoded, if the images are not those of views() */
  Status decode (std::span<const RangeImage> images, int threads, DecoderResult &result);

private:
  struct PlannedSlice {
    std::span<const std::uint8_t> unit;
    SliceHeader header;
    std::size_t arrival; /* number in the access unit */
    bool too_short;      /* shorter than its symbols: small units must not cost much time */
  };
  struct Job { /* some slices of a view */
    std::size_t view;
    std::size_t first, count;
    DecoderResult result;
  };

  bool read_slices (std::span<const std::uint8_t> bytes, DecoderResult &result);
  void plan_view (std::span<const PlannedSlice> slices, DecoderResult &result);
  void drop_overlapping (PlannedView &planned, DecoderResult &result);
  void crop_to_slices (PlannedView &planned);
  void begin_view (std::size_t index, const RangeImage &image);
  void add_jobs (std::size_t view);
  void run (Job &job, const RangeImage &image, SliceMemory &memory);
  [[nodiscard]] DecoderResult sum_up (std::size_t index) const;

  SliceDecoder decoder_;
  std::array<ReferencePair, kMaxViews> references_; /* by view-id */
  std::array<PlannedView, kMaxViews> planned_;
  std::size_t count_ = 0;
  std::vector<PlannedSlice> slices_;
  std::vector<int> column_ends_; /* while drop_overlapping() runs */
  std::vector<Job> jobs_;
  WorkerMemory<SliceMemory> memory_;
};

} // namespace rangecast
