/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "view_alignment.hpp"

#include <algorithm>
#include <bit>
#include <limits>
#include <string>

#include "../base/guarded.hpp"
#include "../base/parallel.hpp"

namespace rangecast {

namespace {

constexpr std::uint32_t kLearnEvery = 3; ///< frame sets
/* Errors of stereo are alike in large parts of an image, so a pose may seem wrong by as much as
 * depth is: a rig is not corrected until a view needs more than this, metres, and this many
 * standard errors of depth. */
constexpr double kNeedsCorrection = 0.001, kErrorsOff = 3;
constexpr double kStaysCorrected = 0.6; ///< share of that
/* A new rig makes downstream renegotiate: not for a smaller change than this, metres, nor more
 * often than once in this many frame sets. */
constexpr double kMinChange = 0.0004;
constexpr std::uint32_t kChangeEvery = 15;
constexpr double kConfirmed = 30; ///< points of a pair that confirm both views
constexpr double kMaxContradictedAgain = 0.04;

/* Whether a view contradicts those that it is compared with. */
bool
contradicts (const PairAgreement &sum, bool skipped)
{
  const double max = skipped ? kMaxContradictedAgain : ViewAlignment::kMaxContradicted,
               min = skipped ? ViewAlignment::kConsistentAgain : ViewAlignment::kMinConsistency;
  return sum.comparable - sum.same > max * sum.points && sum.share () < min;
}

} // namespace

Status
ViewAlignment::set_rig (const Rig &rig)
{
  return guarded ("rig", [&] () -> Status {
    if (Status status = validate (rig); !status.ok ())
      return status;
    nominal_ = rig;
    index_.fill (-1);
    for (std::size_t i = 0; i < rig.views.size (); i++)
      index_[static_cast<std::size_t> (rig.views[i].id)] = static_cast<int> (i);
    poses_.set_rig (rig);
    balance_.set_rig (rig);
    reset ();
    return {};
  });
}

void
ViewAlignment::reset ()
{
  rig_ = nominal_;
  poses_.reset ();
  balance_.set_rig (rig_);
  balance_.reset ();
  of_.fill ({});
  frame_ = changed_at_ = 0;
  evaluated_ = corrected_ = rig_changed_ = false;
}

const View &
ViewAlignment::view_of (const RangeImage &image) const
{
  const int index = index_[static_cast<std::size_t> (image.view_id)];
  return rig_.views[static_cast<std::size_t> (index)];
}

/* Corrects the rig by the poses that are known, if that makes a difference.
 * @param was_evaluated  before this frame set; the first correction need not wait */
void
ViewAlignment::correct_rig (bool poses, bool was_evaluated)
{
  if (was_evaluated && frame_ - changed_at_ < kChangeEvery)
    return;
  double largest = 0, change = 0;
  for (const View &view : nominal_.views)
    largest = std::max (largest, poses_.correction (view.id).size ());
  const double needed = kNeedsCorrection + kErrorsOff * poses_.depth_error ();
  const bool corrects = poses && largest > (corrected_ ? kStaysCorrected * needed : needed);
  const auto wanted = [&] (int id) { return corrects ? poses_.correction (id) : PoseCorrection{}; };
  for (const View &view : nominal_.views) {
    const PoseCorrection by = wanted (view.id),
                         &used = of_[static_cast<std::size_t> (view.id)].correction;
    change = std::max (change,
        PoseCorrection{by.translation - used.translation, by.rotation - used.rotation}.size ());
  }
  if (change < kMinChange)
    return;
  for (std::size_t i = 0; i < nominal_.views.size (); i++) {
    const View &view = nominal_.views[i];
    PoseCorrection &used = of_[static_cast<std::size_t> (view.id)].correction;
    used = wanted (view.id);
    rig_.views[i].world_from_view =
        corrects ? poses_.corrected (view.world_from_view, used) : view.world_from_view;
  }
  if (!validate (rig_).ok ()) /* never: corrections are small, rotations orthonormal */
    rig_ = nominal_;
  balance_.set_rig (rig_);
  corrected_ = corrects;
  changed_at_ = frame_;
  rig_changed_ = true;
}

PairAgreement
ViewAlignment::agreement_among (int id, std::uint64_t trusted) const
{
  PairAgreement sum;
  for (std::uint64_t rest = trusted & ~(std::uint64_t{1} << id); rest; rest &= rest - 1)
    sum += poses_.agreement (id, std::countr_zero (rest));
  return sum;
}

/* Points of these views that contradict each other; each pair counts twice. */
double
ViewAlignment::contradictions_of (std::uint64_t views) const
{
  double sum = 0;
  for (std::uint64_t rest = views; rest; rest &= rest - 1) {
    const PairAgreement pairs = agreement_among (std::countr_zero (rest), views);
    sum += pairs.comparable - pairs.same;
  }
  return sum;
}

/* Whether two of these views confirm each other. */
bool
ViewAlignment::has_good_pair (std::uint64_t trusted) const
{
  for (std::uint64_t a = trusted; a; a &= a - 1)
    for (std::uint64_t b = a & (a - 1); b; b &= b - 1) {
      const PairAgreement pair = poses_.agreement (std::countr_zero (a), std::countr_zero (b));
      if (pair.same >= kConfirmed && pair.share () > kGoodPair)
        return true;
    }
  return false;
}

/* Finds the views to skip: of those that are contradicted, first the one without which the
 * others contradict each other least. */
void
ViewAlignment::evaluate_views (std::span<const RangeImage> images)
{
  std::uint64_t all = 0;
  for (const RangeImage &image : images)
    all |= std::uint64_t{1} << image.view_id;
  std::uint64_t trusted = all;
  for (;;) {
    std::uint64_t rest_of_best = 0;
    double min = std::numeric_limits<double>::max ();
    for (std::uint64_t rest = trusted; rest; rest &= rest - 1) {
      const int id = std::countr_zero (rest);
      if (!contradicts (agreement_among (id, trusted), of_[static_cast<std::size_t> (id)].skipped))
        continue;
      const std::uint64_t others = trusted & ~(std::uint64_t{1} << id);
      if (const double left = contradictions_of (others); left < min && has_good_pair (others))
        min = left, rest_of_best = others;
    }
    if (!rest_of_best)
      break;
    trusted = rest_of_best;
  }
  /* A view whose only disagreement was with a bad one is kept. */
  for (std::uint64_t rest = all & ~trusted; rest; rest &= rest - 1) {
    const int id = std::countr_zero (rest);
    if (!contradicts (agreement_among (id, trusted), of_[static_cast<std::size_t> (id)].skipped))
      trusted |= std::uint64_t{1} << id;
  }
  for (std::uint64_t rest = all; rest; rest &= rest - 1) {
    const int id = std::countr_zero (rest);
    ViewConsistency &view = of_[static_cast<std::size_t> (id)];
    view.consistency = agreement_among (id, trusted).share ();
    view.skipped = !(trusted >> id & 1);
  }
}

/* Colours of two views are compared only if both have gains: cameras that are not balanced see one
 * colour differently. */
std::optional<ColourBalance::Gains>
ViewAlignment::gains_of (int view_id, bool balanced) const
{
  return balanced && balance_.has_gains (view_id) ? std::optional (balance_.gains (view_id))
                                                  : std::nullopt;
}

void
ViewAlignment::clear_contradicted (std::span<const RangeImage> images, int threads)
{
  balanced_.clear ();
  for (const RangeImage &image : images)
    balanced_.push_back ({image, PixelRays (view_of (image)), PixelLookup (view_of (image)),
        gains_of (image.view_id, true)});
  in_parallel (
      images.size (), threads, [&] (std::size_t i) { contradicted_[i].find (balanced_, i); });
  for (std::size_t i = 0; i < images.size (); i++)
    contradicted_points_ += contradicted_[i].clear (images[i]);
}

void
ViewAlignment::learn (std::span<const RangeImage> images, const AlignmentSettings &settings)
{
  in_parallel (images.size (), settings.threads, [&] (std::size_t i) {
    planes_[i].make (images[i], static_cast<float> (view_of (images[i]).intrinsics.fx));
  });
  aligned_.clear ();
  for (std::size_t i = 0; i < images.size (); i++)
    aligned_.push_back ({images[i], &planes_[i], gains_of (images[i].view_id, settings.colours)});
  poses_.learn (aligned_);
  evaluate_views (images);
  evaluated_ = true;
}

/* Colours last: the corrected rig finds the same places in other views, and what a view is compared
 * by here are the gains of the frame before. */
void
ViewAlignment::work (std::span<const RangeImage> images, const AlignmentSettings &settings)
{
  const bool several = images.size () > 1, was_evaluated = evaluated_;
  if (several && (settings.poses || settings.views) && frame_ % kLearnEvery == 0)
    learn (images, settings);
  correct_rig (settings.poses, was_evaluated);
  frame_ += evaluated_;
  if (!several || !settings.views)
    for (ViewConsistency &view : of_)
      view.skipped = false;
  for (const RangeImage &image : images)
    for (int y = 0; y < image.depth.height && view (image.view_id).skipped; y++)
      std::fill_n (image.depth.row (y), image.depth.width, kInvalidDepth);
  if (several && settings.points && settings.colours)
    clear_contradicted (images, settings.threads);
  if (settings.colours)
    balance_.process (images, settings.threads);
}

Status
ViewAlignment::process (std::span<const RangeImage> images, const AlignmentSettings &settings)
{
  rig_changed_ = false;
  contradicted_points_ = 0;
  if (images.size () > kMaxViews)
    return {StatusCode::kBadSize, "frame set: more than 64 views"};
  for (const RangeImage &image : images)
    if (image.view_id < 0 || image.view_id >= kMaxViews ||
        index_[static_cast<std::size_t> (image.view_id)] < 0)
      return {StatusCode::kNotFound,
          "rig: no view " + std::to_string (image.view_id) + ", which the frame set has"};
  return guarded ("views", [&] () -> Status {
    work (images, settings);
    return {};
  });
}

} // namespace rangecast
