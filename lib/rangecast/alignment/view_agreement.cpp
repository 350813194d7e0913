/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "view_agreement.hpp"

#include <algorithm>
#include <bit>
#include <limits>
#include <string>

#include "../base/guarded.hpp"

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
contradicts (const PairAgreement &sum, bool left_out)
{
  const double max = left_out ? kMaxContradictedAgain : ViewAgreement::kMaxContradicted,
               min = left_out ? ViewAgreement::kConsistentAgain : ViewAgreement::kMinConsistency;
  return sum.comparable - sum.same > max * sum.points && sum.share () < min;
}

} // namespace

Status
ViewAgreement::set_rig (const Rig &rig)
{
  return guarded ("rig", [&] () -> Status {
    if (Status status = validate (rig); !status.ok ())
      return status;
    nominal_ = rig;
    index_.fill (-1);
    for (std::size_t i = 0; i < rig.views.size (); i++)
      index_[static_cast<std::size_t> (rig.views[i].id)] = static_cast<int> (i);
    poses_.set_rig (rig);
    reset ();
    return {};
  });
}

void
ViewAgreement::reset ()
{
  rig_ = nominal_;
  poses_.reset ();
  of_.fill ({});
  gains_.fill (std::nullopt);
  frame_ = changed_at_ = 0;
  evaluated_ = corrected_ = rig_changed_ = false;
}

const View &
ViewAgreement::view_of (const RangeImage &image) const
{
  const int index = index_[static_cast<std::size_t> (image.view_id)];
  return rig_.views[static_cast<std::size_t> (index)];
}

/* Corrects the rig by the poses that are known, if that makes a difference. */
void
ViewAgreement::correct_rig (bool poses)
{
  if (evaluated_ && frame_ - changed_at_ < kChangeEvery)
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
  corrected_ = corrects;
  changed_at_ = frame_;
  rig_changed_ = true;
}

PairAgreement
ViewAgreement::agreement_among (int id, std::uint64_t trusted) const
{
  PairAgreement sum;
  for (std::uint64_t rest = trusted & ~(std::uint64_t{1} << id); rest; rest &= rest - 1)
    sum += poses_.agreement (id, std::countr_zero (rest));
  return sum;
}

/* Points of these views that contradict each other; each pair counts twice. */
double
ViewAgreement::contradictions_of (std::uint64_t views) const
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
ViewAgreement::has_good_pair (std::uint64_t trusted) const
{
  for (std::uint64_t a = trusted; a; a &= a - 1)
    for (std::uint64_t b = a & (a - 1); b; b &= b - 1) {
      const PairAgreement pair = poses_.agreement (std::countr_zero (a), std::countr_zero (b));
      if (pair.same >= kConfirmed && pair.share () > kGoodPair)
        return true;
    }
  return false;
}

/* Finds the views to leave out: of those that are contradicted, first the one without which the
 * others contradict each other least. */
void
ViewAgreement::evaluate_views (std::span<const RangeImage> images)
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
      if (!contradicts (agreement_among (id, trusted), of_[static_cast<std::size_t> (id)].left_out))
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
    if (!contradicts (agreement_among (id, trusted), of_[static_cast<std::size_t> (id)].left_out))
      trusted |= std::uint64_t{1} << id;
  }
  for (std::uint64_t rest = all; rest; rest &= rest - 1) {
    const int id = std::countr_zero (rest);
    ViewConsistency &view = of_[static_cast<std::size_t> (id)];
    view.consistency = agreement_among (id, trusted).share ();
    view.left_out = !(trusted >> id & 1);
  }
}

/* Clears contradicted points, and moves depth of one surface together. */
void
ViewAgreement::fuse (std::span<const RangeImage> images, const AgreementSettings &settings)
{
  fused_.clear ();
  for (std::size_t i = 0; i < images.size (); i++) {
    const View &view = view_of (images[i]);
    fused_.push_back ({images[i], &planes_[i], PixelRays (view), PixelLookup (view),
        static_cast<float> (view.intrinsics.fx), static_cast<float> (view.depth_unit_m),
        gains_[static_cast<std::size_t> (images[i].view_id)]});
  }
  if (settings.points) {
    in_parallel (images.size (), settings.threads,
        [&] (std::size_t i) { contradicted_[i].find (fused_, i); });
    for (std::size_t i = 0; i < images.size (); i++)
      contradicted_points_ += contradicted_[i].clear (images[i], planes_[i]);
  }
  if (!settings.depth)
    return;
  workers_.reserve (workers_for (images.size (), settings.threads));
  in_parallel (images.size (), settings.threads,
      [&] (std::size_t i, std::size_t worker) { workers_.of (worker).process (fused_, i); });
}

void
ViewAgreement::work (std::span<const RangeImage> images, const AgreementSettings &settings)
{
  const bool several = images.size () > 1,
             learns = several && (settings.poses || settings.views) && frame_ % kLearnEvery == 0;
  if (learns || (several && settings.depth))
    in_parallel (images.size (), settings.threads, [&] (std::size_t i) {
      planes_[i].make (images[i], static_cast<float> (view_of (images[i]).intrinsics.fx));
    });
  if (learns) {
    aligned_.clear ();
    for (std::size_t i = 0; i < images.size (); i++)
      aligned_.push_back (
          {images[i], &planes_[i], gains_[static_cast<std::size_t> (images[i].view_id)]});
    poses_.learn (aligned_);
    evaluate_views (images);
  }
  correct_rig (settings.poses);
  evaluated_ = evaluated_ || learns;
  frame_ += evaluated_;
  if (!several || !settings.views)
    for (ViewConsistency &view : of_)
      view.left_out = false;
  for (std::size_t i = 0; i < images.size (); i++) {
    if (!of_[static_cast<std::size_t> (images[i].view_id)].left_out)
      continue;
    for (int y = 0; y < images[i].depth.height; y++)
      std::fill_n (images[i].depth.row (y), images[i].depth.width, kInvalidDepth);
    planes_[i].clear ();
  }
  if (several && (settings.points || settings.depth))
    fuse (images, settings);
}

Status
ViewAgreement::process (std::span<const RangeImage> images, const AgreementSettings &settings)
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
