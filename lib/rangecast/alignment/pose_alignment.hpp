/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "../geometry/range_image.hpp"
#include "../geometry/rig.hpp"
#include "surface_planes.hpp"
#include "view_pairs.hpp"

namespace rangecast {

/** One view of a frame set, to be aligned. */
struct AlignedView {
  RangeImage image;
  const SurfacePlanes *planes = nullptr;
  /** Factors of its colours in comparisons; without, they are not compared. */
  std::optional<std::array<float, 3>> gains;
};

/** A small motion of a view: a point X of its surface goes to X + translation + rotation x
 *  (X - centre), the centre being that of the scene. */
struct PoseCorrection {
  Vec3 translation; ///< metres
  Vec3 rotation;    ///< axis times angle, radians

  /** How far it moves the scene's surface, metres. */
  [[nodiscard]] double size () const;
};

/** Statistics of two views' agreement; older frames count less. */
struct PairAgreement {
  double points = 0; ///< of one that were projected into the other
  /** Those that can be compared: the other one sees the same surface, or sees through them, to a
   *  farther surface or to the background. */
  double comparable = 0;
  double same = 0; ///< those on one surface, of one colour

  /** 0 .. 1; 1 where nothing can be compared */
  [[nodiscard]] double share () const { return comparable > 0 ? same / comparable : 1; }
  PairAgreement &operator+= (const PairAgreement &other)
  {
    points += other.points;
    comparable += other.comparable;
    same += other.same;
    return *this;
  }
};

/** Estimates the errors of a rig's poses from surfaces that several views see.
 *
 *  A grid of pixels of each view (another grid in each frame) is projected into the other views
 *  (projective data association, Blais and Levine 1995); where both see the same surface, the
 *  distance of the point from the other's tangent plane is the error (point-to-plane, Chen and
 *  Medioni 1991). All views are solved together (as Pulli 1999 does with pairs), Gauss-Newton with
 *  Tukey's biweight. The normal equations of each pair of views are kept, and older frames fade, so
 *  noise averages out. A prior of no motion keeps directions in place that the surface does not
 *  show, such as the turn of a ball about itself. Only differences between views can be seen, so
 *  the median of the corrections of all views that share a surface with another one is 0 in each
 *  component: the world stays, and one view that is off is the one that moves. A view that shares
 *  none has no correction.
 *
 *  The same comparison measures how consistent views are: see agreement(). */
class PoseAlignment {
public:
  /** Limits, each for itself, of a correction's translation, metres, and rotation, radians. */
  static constexpr double kMaxTranslation = 0.012, kMaxRotation = 0.012;

  /** Sets the cameras and resets. */
  void set_rig (const Rig &rig);
  /** Discards the corrections and all comparisons. */
  void reset ();

  /** Compares the views, and improves the corrections. Nothing is allocated once all views have
   *  been seen together. @param views  of known cameras, view-ids different */
  void learn (std::span<const AlignedView> views);

  /** Correction of a view; none as long as it is unknown. */
  [[nodiscard]] PoseCorrection correction (int view_id) const
  {
    return corrections_[static_cast<std::size_t> (view_id)];
  }
  /** Error of depth: the distances between views after correction, metres (root mean square,
   *  weighted by points). */
  [[nodiscard]] double depth_error () const { return depth_error_; }
  /** The pose of a view with a correction. */
  [[nodiscard]] Pose corrected (const Pose &world_from_view, const PoseCorrection &by) const;

  /** How two views see each other's points. */
  [[nodiscard]] PairAgreement agreement (int first, int second) const;

private:
  struct Pair {
    int first = 0, second = 0;
    std::array<double, 21> matrix{}; /* lower triangle, of jacobians' products */
    std::array<double, 6> right{};
    double weight = 0; /* of what was added */
    double square = 0; /* of errors with no correction at all */
    double points = 0, same = 0, through = 0, other_colour = 0;
  };

  struct Comparison;
  /* With its correction. */
  [[nodiscard]] const View &camera_of (int view_id) const
  {
    return now_.views[static_cast<std::size_t> (index_[static_cast<std::size_t> (view_id)])];
  }
  void compare_pair (const AlignedView &from, const AlignedView &to, int samples);
  void solve ();
  [[nodiscard]] double variance (const Pair &pair) const;
  void set_gauge (std::uint64_t views, std::uint64_t linked);
  static void fade (Pair &pair, double kept);
  void find_centre (std::span<const AlignedView> views);

  Rig rig_, now_;                      /* nominal, and corrected */
  std::array<int, kMaxViews> index_{}; /* in rig_.views, by view-id */
  std::array<PoseCorrection, kMaxViews> corrections_{};
  ViewPairs<Pair> pairs_;
  Vec3 centre_;
  double depth_error_ = 0;
  bool started_ = false;
  std::uint32_t frame_ = 0;
  std::vector<double> matrix_, right_, sorted_;
};

} // namespace rangecast
