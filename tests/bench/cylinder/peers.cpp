/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "peers.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <unordered_map>

using namespace rangecast;

namespace bench {

void
plain_rule (FrameSet &set)
{
  struct Place {
    Spot spot;
    double phi;
  };
  const std::vector<RangeImage> images = set.images ();
  std::map<int, std::map<int, std::vector<Place>>> slices; /* slice -> view -> points */
  const std::vector<Spot> all = spots_of (set);
  Vec3 middle;
  for (const Spot &spot : all)
    middle = middle + 1.0 / double (all.size ()) * spot.point;
  for (const Spot &spot : all) {
    const Vec3 p = spot.point - middle;
    slices[int (std::floor (p.y / 0.004))][spot.view].push_back (
        {spot, std::atan2 (p.z, p.x) + M_PI});
  }
  struct Share {
    Vec3 tangent;
    std::vector<const Spot *> spots;
  };
  for (auto &[slice, views] : slices) {
    std::map<int, std::map<int, Share>> units; /* column -> view */
    for (auto &[view, places] : views) {
      std::sort (places.begin (), places.end (), [] (auto &a, auto &b) { return a.phi < b.phi; });
      for (std::size_t i = 0; i < places.size (); i++) {
        const Vec3 d = places[(i + 1) % places.size ()].spot.point - places[i].spot.point;
        Share &share = units[int (places[i].phi / (2 * M_PI) * 360)][view];
        share.tangent = share.tangent + 1 / (norm (d) + 1e-12) * d;
        share.spots.push_back (&places[i].spot);
      }
    }
    for (auto &[column, shares] : units) {
      if (shares.size () < 2)
        continue;
      Vec3 tangent;
      for (auto &[view, share] : shares)
        tangent = tangent + share.tangent;
      int winner = -1;
      double least = INFINITY;
      for (auto &[view, share] : shares) {
        const Mat3 &r = set.rig.views[std::size_t (view)].world_from_view.rotation;
        if (const double s = std::abs (dot (tangent, {r[2], r[5], r[8]})); s < least)
          least = s, winner = view;
      }
      for (auto &[view, share] : shares)
        for (const Spot *spot : share.spots)
          if (view != winner)
            images[std::size_t (view)].depth.at (spot->u, spot->v) = 0;
    }
  }
}

void
voxel_grid (FrameSet &set)
{
  const std::vector<RangeImage> images = set.images ();
  std::unordered_map<std::uint64_t, bool> taken;
  for (const Spot &spot : spots_of (set)) {
    auto cell = [] (double v) { return std::uint64_t (std::floor (v / 0.004) + (1 << 20)); };
    const std::uint64_t key =
        cell (spot.point.x) << 42 | cell (spot.point.y) << 21 | cell (spot.point.z);
    if (!taken.try_emplace (key, true).second)
      images[std::size_t (spot.view)].depth.at (spot.u, spot.v) = 0;
  }
}

namespace {

constexpr double kSamePlace = 0.015; ///< metres

/* How squarely a view sees each of its pixels, 0 to 1: the normal of the surface through the
 * neighbouring pixels, times the ray. */
std::vector<float>
facing_of (const View &view, const ImageView<const std::uint16_t> &depth)
{
  std::vector<float> facing (std::size_t (view.width) * view.height);
  const auto point = [&] (int u, int v) {
    return view.intrinsics.unproject (u, v, depth.at (u, v) * view.depth_unit_m);
  };
  /* The neighbour on one side or the other that belongs to the same surface. */
  const auto step = [&] (int u, int v, int du, int dv, Vec3 &d) {
    for (int side : {1, -1}) {
      const int x = u + side * du, y = v + side * dv;
      if (x < 0 || y < 0 || x >= view.width || y >= view.height || !depth.at (x, y))
        continue;
      d = double (side) * (point (x, y) - point (u, v));
      if (std::abs (d.z) < kSamePlace)
        return true;
    }
    return false;
  };
  for (int v = 0; v < view.height; v++)
    for (int u = 0; u < view.width; u++) {
      Vec3 across, down;
      if (!depth.at (u, v) || !step (u, v, 1, 0, across) || !step (u, v, 0, 1, down))
        continue;
      const Vec3 n = cross (across, down), ray = point (u, v);
      facing[std::size_t (v) * view.width + u] =
          float (std::abs (dot (n, ray)) / (norm (n) * norm (ray) + 1e-30));
    }
  return facing;
}

} // namespace

void
frontal_camera (FrameSet &set)
{
  const std::vector<Spot> spots = spots_of (set);
  const std::vector<RangeImage> images = set.images ();
  std::vector<std::vector<float>> facing;
  std::vector<Pose> view_from_world;
  for (std::size_t i = 0; i < images.size (); i++) {
    facing.push_back (facing_of (set.rig.views[i], images[i].depth));
    view_from_world.push_back (set.rig.views[i].world_from_view.inverse ());
  }
  std::vector<const Spot *> losers;
  for (const Spot &spot : spots) {
    const float own = facing[std::size_t (spot.view)]
                            [std::size_t (spot.v) * set.rig.views[std::size_t (spot.view)].width +
                                std::size_t (spot.u)];
    for (std::size_t i = 0; i < images.size (); i++) {
      if (int (i) == spot.view)
        continue;
      const View &view = set.rig.views[i];
      const Vec3 p = view_from_world[i] * spot.point;
      const double u = view.intrinsics.fx * p.x / p.z + view.intrinsics.cx,
                   v = view.intrinsics.fy * p.y / p.z + view.intrinsics.cy;
      if (!(p.z > 0.01 && u > -0.5 && v > -0.5 && u < view.width - 0.5 && v < view.height - 0.5))
        continue;
      const int x = int (std::lround (u)), y = int (std::lround (v));
      const double there = images[i].depth.at (x, y) * view.depth_unit_m;
      if (there > 0 && std::abs (there - p.z) < kSamePlace &&
          facing[i][std::size_t (y) * view.width + x] > own) {
        losers.push_back (&spot);
        break;
      }
    }
  }
  for (const Spot *spot : losers)
    images[std::size_t (spot->view)].depth.at (spot->u, spot->v) = 0;
}

} // namespace bench
