/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Milliseconds per frame set of the cylinder filter, beside two peers in the same run: the plain
 * rule of the method written straight down (maps, doubles, unit by unit), and a voxel grid, which
 * is what one does otherwise against overlap.
 * --help lists the options. */
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <rangecast/cylinder/cylinder_filter.hpp>
#include <string>
#include <unordered_map>
#include <vector>

#include "options.hpp"

using namespace rangecast;

namespace {

const char *const kUsage =
    "usage: cylinder_bench [--rounds N] [--only NAME] [--bunny DIR] [--picture FILE.png]\n"
    "  --rounds N      times are medians of so many (default 50)\n"
    "  --only NAME     only the scenes whose name begins so\n"
    "  --bunny DIR     also what pipelines/bunny-to-range.py wrote there\n"
    "  --picture FILE  draws the bunny (or the bust) from above, all points in a band of heights,\n"
    "                  coloured by view: before on the left, after on the right\n";

/** A frame set with its own pixels, which can be put back as they were. */
struct FrameSet {
  Rig rig;
  std::vector<std::vector<std::uint16_t>> depth, fresh;

  std::vector<RangeImage> images ()
  {
    std::vector<RangeImage> all;
    for (std::size_t i = 0; i < rig.views.size (); i++) {
      const View &v = rig.views[i];
      all.push_back ({v.id, {0, 0, v.width, v.height},
          {depth[i].data (), v.width, v.height, v.width * 2}, {}, 0});
    }
    return all;
  }
  void restore () { depth = fresh; }
};

struct Ball {
  Vec3 centre, radii;
};

double
first_hit (const std::vector<Ball> &balls, Vec3 origin, Vec3 ray)
{
  double nearest = INFINITY;
  for (const Ball &ball : balls) {
    const Vec3 r = ball.radii, f = origin - ball.centre;
    const Vec3 o{f.x / r.x, f.y / r.y, f.z / r.z}, d{ray.x / r.x, ray.y / r.y, ray.z / r.z};
    const double a = dot (d, d), b = dot (o, d), root = b * b - a * (dot (o, o) - 1);
    if (root >= 0)
      nearest = std::min (nearest, (-b - std::sqrt (root)) / a);
  }
  return nearest;
}

FrameSet
render (const std::vector<Ball> &balls, int views, int width, int height, double focal = 1)
{
  FrameSet set;
  for (int id = 0; id < views; id++) {
    const double a = 2 * M_PI * id / views, s = std::sin (a), c = std::cos (a);
    View view;
    view.id = id;
    view.width = width;
    view.height = height;
    view.intrinsics = {focal * width, focal * width, (width - 1) / 2.0, (height - 1) / 2.0};
    view.world_from_view = {{c, 0, -s, 0, -1, 0, -s, 0, -c}, {0.8 * s, 0, 0.8 * c}};
    std::vector<std::uint16_t> depth;
    std::uint32_t seed = 1;
    for (int v = 0; v < height; v++)
      for (int u = 0; u < width; u++) {
        const Vec3 ray = view.world_from_view.rotation * view.intrinsics.unproject (u, v, 1);
        const double z = first_hit (balls, view.world_from_view.translation, ray);
        seed = seed * 1664525 + 1013904223;
        const double noise_m = (double (seed >> 8) / (1 << 24) - 0.5) * 0.003;
        depth.push_back (z < 3 ? static_cast<std::uint16_t> ((z + noise_m) / 1e-4) : 0);
      }
    set.rig.views.push_back (view);
    set.depth.push_back (std::move (depth));
  }
  set.fresh = set.depth;
  return set;
}

const std::vector<Ball> kBust = {{{0, 0.06, 0}, {0.08, 0.12, 0.1}},
    {{0, -0.05, 0}, {0.06, 0.12, 0.06}}, {{0, -0.22, 0}, {0.2, 0.12, 0.11}},
    {{0, 0.05, 0.1}, {0.015, 0.025, 0.02}}};
/* A pillar, which fills the picture of a longer lens to its edges. */
const std::vector<Ball> kPillar = {{{0, 0, 0}, {0.25, 5, 0.25}}};
constexpr double kPillarFocal = 1.53;

bool
load_bunny (const std::string &folder, FrameSet &set)
{
  if (const Status status = load_rig (folder + "/rig.yaml", set.rig); !status.ok ()) {
    std::fprintf (stderr, "%s\n", status.message ().c_str ());
    return false;
  }
  for (const View &view : set.rig.views) {
    const std::string path = folder + "/view" + std::to_string (view.id) + "-depth.png";
    const cv::Mat depth = cv::imread (path, cv::IMREAD_UNCHANGED);
    if (depth.type () != CV_16UC1 || depth.cols != view.width || depth.rows != view.height) {
      std::fprintf (stderr, "%s: expected a 16-bit PNG of the rig's size\n", path.c_str ());
      return false;
    }
    set.depth.emplace_back (depth.begin<std::uint16_t> (), depth.end<std::uint16_t> ());
  }
  set.fresh = set.depth;
  return true;
}

/* ---- peers ---- */

struct Spot {
  int view, u, v;
  Vec3 point;
  double phi;
};

std::vector<Spot>
spots_of (FrameSet &set)
{
  std::vector<Spot> spots;
  for (const RangeImage &image : set.images ()) {
    const View &view = *set.rig.find (image.view_id);
    for (int v = 0; v < view.height; v++)
      for (int u = 0; u < view.width; u++)
        if (const int d = image.depth.at (u, v)) {
          const Vec3 p =
              view.world_from_view * view.intrinsics.unproject (u, v, d * view.depth_unit_m);
          spots.push_back ({image.view_id, u, v, p, 0});
        }
  }
  return spots;
}

/** The published rule as one would first write it: vertical axis through the origin, one slice
 * after another, points of a view sorted by phi, units in a map; neither layers nor neighbours. */
void
plain_rule (FrameSet &set)
{
  std::vector<RangeImage> images = set.images ();
  std::map<int, std::map<int, std::vector<Spot>>> slices; /* slice -> view -> points */
  std::vector<Spot> all = spots_of (set);
  Vec3 middle;
  for (const Spot &spot : all)
    middle = middle + 1.0 / double (all.size ()) * spot.point;
  for (Spot &spot : all) {
    const Vec3 p = spot.point - middle;
    spot.phi = std::atan2 (p.z, p.x) + M_PI;
    slices[int (std::floor (p.y / 0.004))][spot.view].push_back (spot);
  }
  struct Share {
    Vec3 tangent;
    std::vector<const Spot *> spots;
  };
  for (auto &[slice, views] : slices) {
    std::map<int, std::map<int, Share>> units; /* column -> view */
    for (auto &[view, spots] : views) {
      std::sort (spots.begin (), spots.end (), [] (auto &a, auto &b) { return a.phi < b.phi; });
      for (std::size_t i = 0; i < spots.size (); i++) {
        const Vec3 d = spots[(i + 1) % spots.size ()].point - spots[i].point;
        Share &share = units[int (spots[i].phi / (2 * M_PI) * 360)][view];
        share.tangent = share.tangent + 1 / (norm (d) + 1e-12) * d;
        share.spots.push_back (&spots[i]);
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
        const Mat3 &r = set.rig.views[view].world_from_view.rotation;
        if (const double s = std::abs (dot (tangent, {r[2], r[5], r[8]})); s < least)
          least = s, winner = view;
      }
      for (auto &[view, share] : shares)
        for (const Spot *spot : share.spots)
          if (view != winner)
            images[view].depth.at (spot->u, spot->v) = 0;
    }
  }
}

/** One point a cube of 4 mm: the first that comes. */
void
voxel_grid (FrameSet &set)
{
  std::vector<RangeImage> images = set.images ();
  std::unordered_map<std::uint64_t, bool> taken;
  for (const Spot &spot : spots_of (set)) {
    auto cell = [] (double v) { return std::uint64_t (std::floor (v / 0.004) + (1 << 20)); };
    const std::uint64_t key =
        cell (spot.point.x) << 42 | cell (spot.point.y) << 21 | cell (spot.point.z);
    if (!taken.try_emplace (key, true).second)
      images[spot.view].depth.at (spot.u, spot.v) = 0;
  }
}

/* ---- measuring ---- */

std::size_t
count (const FrameSet &set)
{
  std::size_t n = 0;
  for (const auto &depth : set.depth)
    n += depth.size () - std::count (depth.begin (), depth.end (), 0);
  return n;
}

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

template <typename Work>
double
median_ms (FrameSet &set, int rounds, const Work &work)
{
  std::vector<double> ms;
  for (int i = 0; i < rounds; i++) {
    set.restore ();
    const auto start = std::chrono::steady_clock::now ();
    work ();
    const std::chrono::duration<double, std::milli> took =
        std::chrono::steady_clock::now () - start;
    ms.push_back (took.count ());
  }
  std::nth_element (ms.begin (), ms.begin () + ms.size () / 2, ms.end ());
  return ms[ms.size () / 2];
}

void
measure (const std::string &name, FrameSet set, int rounds)
{
  const std::size_t before = count (set);
  auto line = [&] (const char *what, double ms) {
    std::printf (
        "%-26s %-22s %9.2f ms  %8zu -> %8zu points", name.c_str (), what, ms, before, count (set));
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
  CylinderSettings settings;
  run ("cylinder, 1 thread", settings);
  settings.threads = 0;
  run ("cylinder, all cores", settings);
  settings.hidden_gap_m = 0;
  run ("all losers go", settings);
  settings.units.smoothing_m = 0;
  run ("and smoothing 0", settings);
  const int few = std::max (3, rounds / 10);
  line ("plain rule", median_ms (set, few, [&] { plain_rule (set); }));
  line ("voxel grid 4 mm", median_ms (set, few, [&] { voxel_grid (set); }));
}

void
draw_half (FrameSet &set, cv::Mat &picture, int left, Vec3 middle)
{
  const cv::Vec3b colours[] = {{60, 60, 255}, {60, 255, 60}, {255, 120, 60}, {0, 220, 255},
      {255, 60, 255}, {255, 255, 60}, {200, 200, 200}, {0, 120, 255}};
  const double scale = picture.rows / 0.5;
  for (const Spot &spot : spots_of (set)) {
    const Vec3 p = spot.point - middle;
    const int x = left + picture.rows / 2 + int (p.x * scale);
    const int y = picture.rows / 2 + int (p.z * scale);
    if (std::abs (p.y) < 0.004 && x >= left && x < left + picture.rows && y >= 0 &&
        y < picture.rows)
      picture (cv::Rect (x, y, 2, 2) & cv::Rect (0, 0, picture.cols, picture.rows))
          .setTo (colours[spot.view % 8]);
  }
}

void
draw (FrameSet set, const std::string &path)
{
  CylinderFilter filter;
  CylinderResult result;
  if (!filter.set_rig (set.rig).ok () || !filter.process (set.images (), {}, result).ok ())
    return;
  FrameSet before = set;
  before.restore ();
  cv::Mat picture (900, 1800, CV_8UC3, cv::Scalar (0, 0, 0));
  draw_half (before, picture, 0, result.axis.position);
  draw_half (set, picture, 900, result.axis.position);
  cv::imwrite (path, picture);
  std::printf ("axis %.3f %.3f %.3f through %.3f %.3f %.3f\n", result.axis.direction.x,
      result.axis.direction.y, result.axis.direction.z, result.axis.position.x,
      result.axis.position.y, result.axis.position.z);
}

} // namespace

int
main (int argc, char **argv)
{
  int rounds = 50;
  std::string only, bunny, picture;
  Options options ("cylinder_bench", kUsage);
  options.number ("--rounds", rounds, 1, 100000);
  options.text ("--only", only);
  options.text ("--bunny", bunny);
  options.text ("--picture", picture);
  if (const auto status = options.parse (argc, argv))
    return *status;
  FrameSet scans;
  if (!bunny.empty () && !load_bunny (bunny, scans))
    return 1;
  if (!picture.empty ())
    draw (bunny.empty () ? render (kBust, 4, 320, 240) : scans, picture);
  auto wanted = [&] (const std::string &name) { return name.starts_with (only); };
  if (!bunny.empty () && wanted ("bunny"))
    measure ("bunny, 6 x 320x240", scans, rounds);
  for (int views : {4, 8})
    for (int width : {320, 640}) {
      const int height = width * 3 / 4;
      const std::string size =
          std::to_string (views) + " x " + std::to_string (width) + "x" + std::to_string (height);
      if (wanted ("bust, " + size))
        measure ("bust, " + size, render (kBust, views, width, height), rounds);
      if (wanted ("all pixels, " + size))
        measure (
            "all pixels, " + size, render (kPillar, views, width, height, kPillarFocal), rounds);
    }
  return 0;
}
