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
    std::map<int, std::map<int, Share>> cells; /* column -> view */
    for (auto &[view, places] : views) {
      std::sort (places.begin (), places.end (), [] (auto &a, auto &b) { return a.phi < b.phi; });
      for (std::size_t i = 0; i < places.size (); i++) {
        const Vec3 d = places[(i + 1) % places.size ()].spot.point - places[i].spot.point;
        Share &share = cells[int (places[i].phi / (2 * M_PI) * 360)][view];
        share.tangent = share.tangent + 1 / (norm (d) + 1e-12) * d;
        share.spots.push_back (&places[i].spot);
      }
    }
    for (auto &[column, shares] : cells) {
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

} // namespace bench
