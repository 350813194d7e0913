/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <span>
#include <vector>

#include "../base/parallel.hpp"
#include "decoder.hpp"
#include "encoder.hpp"

namespace rangecast {

/** Codes whole frame sets; views and partitions of each in parallel. */
class AccessUnitEncoder {
public:
  Status configure (const Rig &rig, const EncoderSettings &settings);
  /** Changes nothing but the thresholds, without new tables or memory. They must be within their
   *  ranges; configure() sets those of its settings again. */
  void set_thresholds (int depth, int colour);

  /** Codes a frame set. Its bytes are those of parts() in order, valid until the next call.
   *  @param threads  partitions at a time; 0 = number of cores. The bytes do not depend on it
   *  @return kNotFound for a view that the rig has not, kBadData for one that is there twice,
   *  kBadSize for a ROI outside its view */
  Status encode (std::span<const RangeImage> images, std::uint32_t frame_number, int threads,
      EncoderResult &result);

  /** The next frame set is coded without reference to earlier ones. */
  void request_key ();

  /** Whole slices each, one or more. */
  [[nodiscard]] std::span<const std::span<const std::uint8_t>> parts () const { return parts_; }
  [[nodiscard]] std::size_t size () const;
  /** A copy of all parts together. */
  [[nodiscard]] std::vector<std::uint8_t> bytes () const;
  /** Metres by which a decoded depth differs from the one that was coded at most, over all views:
   *  quantisation, threshold and rounded residuals together. */
  [[nodiscard]] double max_depth_error_m () const { return max_depth_error_m_; }

private:
  struct Job {
    ViewEncoder *view;
    ViewEncoder::PartitionId partition;
  };
  void find_max_depth_error ();
  Status check_views (std::span<const RangeImage> images);
  Status begin_views (std::span<const RangeImage> images, std::uint32_t frame_number, int threads);
  void add_jobs (ViewEncoder &view);

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
  std::uint64_t slices = 0;     ///< decoded; a repeated one counts once
  std::uint64_t bad_slices = 0; ///< damaged, of another rig or version, or at odds with the others
  std::uint64_t missing_pixels = 0; ///< of the views' ROIs, in slices that did not come
  std::uint64_t points = 0;         ///< valid pixels
  /** Pixels of sound slices that are invalid only because they refer to ones of an earlier frame
   * set that were not received. */
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

/** Decodes whole frame sets in two steps: plan() finds which views there are and how large, so that
 *  the caller can make room; decode() fills it, views and slices of each in parallel. No input
 *  makes it write outside the images, and a damaged slice costs that slice. */
class AccessUnitDecoder {
public:
  struct PlannedView {
    int view_id = 0;
    Roi roi;
    std::uint64_t capture_time_ns = 0;
    std::size_t first_slice = 0, slice_count = 0; ///< those that agree; by column, row, arrival
    SliceHeader reference;                        ///< of these the first that came
    std::uint64_t coded_pixels = 0;               ///< of the ROI as the slices have it
    std::uint64_t held_pixels = 0;                ///< of all slices that are long enough
    bool overlaps = false;                        ///< two slices have a pixel in common
  };

  Status set_rig (const Rig &rig);
  [[nodiscard]] const Rig &rig () const { return rig_; }
  /** What comes next does not continue what was decoded last. */
  void reset_references ();

  /** Reads all headers. Views are sorted by view-id. ROI, bits and frame number of a view are those
   *  that most of its slices have (of two as frequent: those that came first); slices that differ
   *  are bad and take no further part. `bytes` must live until decode() is done.
   *  @param whole_rois  false: ROIs of which nearly nothing came shrink to the box around their
   *  slices, beyond which all pixels would be invalid, so that a few bytes do not claim a large
   *  image; pass true with older images to decode() */
  void plan (std::span<const std::uint8_t> bytes, DecoderResult &result, bool whole_rois = true)
  {
    plan (std::span (&bytes, 1), result, whole_rois);
  }
  /** The same for an access unit in several pieces of whole units. What follows damage, also in
   *  later pieces, is not read. */
  void plan (std::span<const std::span<const std::uint8_t>> pieces, DecoderResult &result,
      bool whole_rois = true);
  [[nodiscard]] std::span<const PlannedView> views () const { return {planned_.data (), count_}; }
  /** Pixels of a view's coded ROI that no slice holds; where slices overlap a guess, at least 1. */
  [[nodiscard]] std::uint64_t missing_pixels (std::size_t view) const;

  /** Fills all pixels of `images`. Those that no sound slice gives become what they are in `older`,
   *  or invalid. Where slices overlap, the later by column, then row, replaces the earlier.
   *  @param images  one for each of views(), in that order, with its ROI
   *  @param threads  slices at a time, those of a view that overlap one by one; 0 = number of
   *  cores. What comes out does not depend on it
   *  @param older  earlier images of any views, also with other ROIs; none: invalid pixels
   *  @return kBadSize, with nothing decoded, if the images are not those of views() */
  Status decode (std::span<const RangeImage> images, int threads, DecoderResult &result,
      std::span<const RangeImage> older = {});

private:
  struct PlannedSlice {
    std::span<const std::uint8_t> unit;
    SliceHeader header;
    std::size_t arrival; /* number in the access unit */
    bool too_short;      /* for its symbols, or far beyond the ROI's pixels: it writes nothing, or
                            small units would cost much time */
  };
  enum class Place : std::uint8_t { kNothing, kDamaged, kSound };
  struct Coverage { /* of a view whose slices overlap; a bit for each pixel of its ROI */
    std::vector<bool> seen, valid;
    std::uint64_t seen_pixels, points;
  };
  struct Job { /* some slices of a view, and all others of their places */
    std::size_t view;
    std::size_t first, count;
    DecoderResult result;
  };

  bool read_slices (std::span<const std::uint8_t> bytes, DecoderResult &result);
  void plan_view (std::span<const PlannedSlice> slices, DecoderResult &result);
  void limit_pixels (const PlannedView &planned);
  void crop_to_slices (PlannedView &planned);
  void find_overlaps (PlannedView &planned);
  [[nodiscard]] static bool is_tiled (const PlannedView &planned);
  static void cover (Coverage &covered, Place place, const Roi &part, const RangeImage &image);
  void begin_view (std::size_t index, const RangeImage &image, const ConstRangeImage &older);
  void add_jobs (std::size_t view);
  void run (Job &job, const RangeImage &image, const ConstRangeImage &older, SliceMemory &memory);
  [[nodiscard]] DecoderResult sum_up (std::size_t index) const;
  Place decode_place (std::span<const PlannedSlice> same, const RangeImage &image,
      const ConstRangeImage &older, DecoderResult &result, SliceMemory &memory);

  Rig rig_;
  SliceDecoder decoder_;
  std::array<ReferencePair, kMaxViews> references_; /* by view-id */
  std::array<PlannedView, kMaxViews> planned_;
  std::array<Coverage, kMaxViews> covered_; /* by planned view */
  std::size_t count_ = 0;
  std::vector<PlannedSlice> slices_;
  std::vector<int> row_ends_; /* while find_overlaps() runs */
  std::vector<Job> jobs_;
  WorkerMemory<SliceMemory> memory_;
};

/** Fills part of an image (rows and columns of its ROI) from an older one of the same view: where
 *  their ROIs overlap its pixels, elsewhere invalid ones. */
void fill_from (const ConstRangeImage &older, const RangeImage &image, const Roi &part);
/** The same for the whole image. */
void fill_from (const ConstRangeImage &older, const RangeImage &image);

} // namespace rangecast
