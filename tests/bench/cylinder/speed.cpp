/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "speed.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>
#include <rangecast/alignment/view_agreement.hpp>
#include <rangecast/overlap/cylinder_filter.hpp>
#include <unordered_map>

#include "peers.hpp"

using namespace rangecast;

namespace bench {

namespace {

struct Quality {
  double
      hole_mm; ///< of the points there were, all but 1 in 1000 have one left this near; 10 at most
  double mixed_percent; ///< of the points left, those with one of another view within 3 mm
};

Quality
quality_of (FrameSet &set)
{
  constexpr double kCell = 0.01;
  auto key = [] (Vec3 p, int k) {
    auto cell = [] (double v) { return std::uint64_t (std::floor (v / kCell) + (1 << 20)); };
    return (cell (p.x) + k % 3 - 1) << 42 | (cell (p.y) + k / 3 % 3 - 1) << 21 |
           (cell (p.z) + k / 9 - 1);
  };
  const std::vector<Spot> left = spots_of (set);
  std::unordered_map<std::uint64_t, std::vector<const Spot *>> cells;
  for (const Spot &spot : left)
    cells[key (spot.point, 13)].push_back (&spot);
  auto nearest = [&] (const Spot &spot, bool of_another_view) {
    double least = kCell;
    for (int k = 0; k < 27; k++)
      if (auto found = cells.find (key (spot.point, k)); found != cells.end ())
        for (const Spot *other : found->second)
          if (!of_another_view || other->view != spot.view)
            least = std::min (least, norm (other->point - spot.point));
    return least;
  };
  FrameSet before = set;
  before.restore ();
  std::vector<double> far;
  for (const Spot &spot : spots_of (before))
    far.push_back (nearest (spot, false) * 1000);
  std::sort (far.begin (), far.end ());
  std::size_t mixed = 0;
  for (const Spot &spot : left)
    mixed += nearest (spot, true) < 0.003;
  return {far.empty () ? 0 : far[far.size () * 999 / 1000],
      100.0 * double (mixed) / double (std::max<std::size_t> (1, left.size ()))};
}

} // namespace

void
measure_speed (const std::string &name, FrameSet set, int rounds)
{
  const std::size_t before = set.count ();
  auto line = [&] (const char *what, double ms) {
    std::printf (
        "%-26s %-22s %9.2f ms  %8zu -> %8zu points", name.c_str (), what, ms, before, set.count ());
    if (before < 150000) { /* takes long */
      const Quality q = quality_of (set);
      std::printf ("  holes %5.2f mm, %4.1f %% mixed", q.hole_mm, q.mixed_percent);
    }
    std::printf ("\n");
  };
  const auto run = [&] (const char *what, const CylinderSettings &settings) {
    CylinderFilter filter;
    CylinderResult result;
    if (!filter.set_rig (set.rig).ok ())
      return;
    line (what, median_ms (set, rounds,
                    [&] { (void)filter.process (set.images (), settings, result).ok (); }));
  };
  if (set.fresh_colour.empty ()) { /* all are unlike: of what others see farther all is compared */
    std::minstd_rand random;
    for (const auto &depth : set.fresh)
      for (auto &colour = set.fresh_colour.emplace_back (depth.size ()); Rgbx & c : colour)
        c = {std::uint8_t (random ()), std::uint8_t (random ()), std::uint8_t (random ()), 0};
    set.restore ();
  }
  /* Mean times: poses are compared in each third frame set only. */
  const auto agree = [&] (const char *what, const AgreementSettings &settings) {
    ViewAgreement agreement;
    if (!agreement.set_rig (set.rig).ok ())
      return;
    for (const View &view : set.rig.views)
      agreement.set_gains (view.id, std::array<float, 3>{1, 1, 1});
    (void)agreement.process (set.images (), settings).ok (); /* the first takes longer */
    line (what, 1.0 / 3 * median_ms (set, rounds, [&] {
      for (int i = 0; i < 3; i++)
        (void)agreement.process (set.images (), settings).ok ();
    }));
  };
  agree ("poses + views, 1 thread", {true, false, true, false, 1});
  agree ("poses + views + points, 1 thread", {true, false, true, true, 1});
  agree ("all of agree, 1 thread", {true, true, true, true, 1});
  CylinderSettings settings;
  run ("cylinder, 1 thread", settings);
  settings.threads = 0;
  run ("cylinder, all cores", settings);
  settings.cells.smoothing_m = 0;
  run ("and smoothing 0", settings);
  const int few = std::max (3, rounds / 10);
  line ("plain rule", median_ms (set, few, [&] { plain_rule (set); }));
  line ("voxel grid 4 mm", median_ms (set, few, [&] { voxel_grid (set); }));
  line ("most frontal camera", median_ms (set, few, [&] { frontal_camera (set); }));
}

} // namespace bench
