/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "../base/status.hpp"
#include "colour_balance.hpp"
#include "contradicted_points.hpp"
#include "pose_alignment.hpp"

namespace rangecast {

struct AlignmentSettings {
  bool poses = true;   ///< PoseAlignment
  bool views = true;   ///< skip views that contradict the others
  bool points = true;  ///< ContradictedPoints; compares colours, so it needs `colours`
  bool colours = true; ///< ColourBalance
  int threads = 1;     ///< views at a time; 0 = number of cores
};

/** Result for one view. */
struct ViewConsistency {
  PoseCorrection correction; ///< in use
  double consistency = 1;    ///< share of its comparable points that agree with the others, 0 .. 1
  bool skipped = false;
};

/** Makes the views of a frame set agree before they are drawn together: corrects the rig, clears
 *  points that other views contradict and a view that contradicts the others, and balances colours.
 *
 *  A view is skipped if other views contradict more than kMaxContradicted of its points, if less
 *  than kMinConsistency of its comparable points agree with theirs, and if some of the others
 *  confirm each other (kGoodPair); it returns at half of that, or at kConsistentAgain. Comparisons
 *  of about 20 frame sets count, so views do not come and go. Of two views that contradict each
 *  other both stay. */
class ViewAlignment {
public:
  static constexpr double kMaxContradicted = 0.08, kMinConsistency = 0.35, kConsistentAgain = 0.55,
                          kGoodPair = 0.6;

  /** Sets the cameras and resets. */
  Status set_rig (const Rig &rig);
  /** Discards the corrections and all comparisons, and brings skipped views back. */
  void reset ();
  /** Discards the gains of colours: people and light are different, cameras stay where they are. */
  void reset_colours () { balance_.reset (); }

  /** Changes colours and depth in place: points that other views contradict and all pixels of a
   *  view that is skipped become invalid. Nothing is allocated once all views have been seen
   *  together, but when the rig changes.
   *  @return kNotFound for a view that the rig has not, kBadSize for more than kMaxViews images,
   *  kNoSpace without memory */
  Status process (std::span<const RangeImage> images, const AlignmentSettings &settings);

  /** The rig of set_rig(), uncorrected. */
  [[nodiscard]] const Rig &nominal_rig () const { return nominal_; }
  /** The rig with the present corrections. */
  [[nodiscard]] const Rig &rig () const { return rig_; }
  /** Whether process() changed it in the last call. */
  [[nodiscard]] bool rig_changed () const { return rig_changed_; }
  /** Points that process() cleared in the last call because another view contradicts them. */
  [[nodiscard]] std::size_t contradicted_points () const { return contradicted_points_; }
  /** Of a view-id of the rig. */
  [[nodiscard]] const ViewConsistency &view (int view_id) const
  {
    return of_[static_cast<std::size_t> (view_id)];
  }

private:
  void learn (std::span<const RangeImage> images, const AlignmentSettings &settings);
  void correct_rig (bool poses, bool was_evaluated);
  void evaluate_views (std::span<const RangeImage> images);
  [[nodiscard]] PairAgreement agreement_among (int id, std::uint64_t trusted) const;
  [[nodiscard]] double contradictions_of (std::uint64_t views) const;
  [[nodiscard]] bool has_good_pair (std::uint64_t trusted) const;
  [[nodiscard]] const View &view_of (const RangeImage &image) const;
  [[nodiscard]] std::optional<ColourBalance::Gains> gains_of (int view_id, bool balanced) const;
  void clear_contradicted (std::span<const RangeImage> images, int threads);
  void work (std::span<const RangeImage> images, const AlignmentSettings &settings);

  Rig nominal_, rig_;
  std::array<int, kMaxViews> index_{}; /* in both rigs, by view-id */
  std::array<ViewConsistency, kMaxViews> of_;
  PoseAlignment poses_;
  ColourBalance balance_;
  std::uint32_t frame_ = 0, changed_at_ = 0;
  bool rig_changed_ = false, corrected_ = false, evaluated_ = false;
  /* Of the present frame. */
  std::vector<AlignedView> aligned_;
  std::vector<BalancedView> balanced_;
  std::array<SurfacePlanes, kMaxViews> planes_;            /* by number of the image */
  std::array<ContradictedPoints, kMaxViews> contradicted_; /* by number of the image */
  std::size_t contradicted_points_ = 0;
};

} // namespace rangecast
