/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "truth_run.hpp"

#include <functional>
#include <rangecast/scene/scene.hpp>

#include "peers.hpp"
#include "picture.hpp"

using namespace rangecast;

namespace bench {

namespace {

constexpr double kBunnyScale = 3; ///< of tests/bench/bunny-to-range.py

struct Method {
  const char *name;
  std::function<void (FrameSet &)> work;
  bool once = false; ///< takes long
};

/* The filter as the element runs it by default, but on one thread. */
std::function<void (FrameSet &)>
cylinder (const Rig &rig, const CylinderSettings &settings)
{
  auto filter = std::make_shared<CylinderFilter> ();
  (void)filter->set_rig (rig).ok ();
  return [filter, settings] (FrameSet &set) {
    CylinderResult result;
    (void)filter->process (set.images (), settings, result).ok ();
  };
}

void
run_methods (FrameSet &set, const Judge &judge, TruthRow row, const TruthJob &job,
    std::vector<TruthRow> &rows)
{
  const Method methods[] = {{"before", [] (FrameSet &) {}, true},
      {"cylinder", cylinder (set.rig, job.settings)}, {"published rule", plain_rule, true},
      {"voxel grid 4 mm", voxel_grid, true}};
  double uncovered = 0, uncovered_6mm = 0;
  for (const Method &method : methods) {
    row.method = method.name;
    row.ms = median_ms (set, method.once ? 1 : job.rounds, [&] { method.work (set); });
    row.verdict = judge.judge (set);
    if (&method == &methods[0]) {
      uncovered = row.verdict.uncovered;
      uncovered_6mm = row.verdict.uncovered_6mm;
    }
    row.new_holes = row.verdict.uncovered - uncovered;
    row.new_holes_6mm = row.verdict.uncovered_6mm - uncovered_6mm;
    print_row (row);
    rows.push_back (row);
  }
}

Status
run_head (const TruthJob &job, const HeadSettings &settings, std::vector<TruthRow> &rows)
{
  Head head;
  if (Status s = make_head (settings, head); !s.ok ())
    return s;
  const Judge judge (
      head.set, *head.surface, visible_places (*head.surface, head.rig, head.depth), head.nose_y);
  TruthRow row;
  row.scene = !settings.model.empty () ? "head" : settings.dress ? "dressed" : "figure";
  row.views = settings.views;
  row.noise = name_of (settings.noise);
  row.pose_mm = settings.pose_mm;
  row.pose_deg = settings.pose_deg;
  run_methods (head.set, judge, row, job, rows);
  return {};
}

Status
run_bunny (const TruthJob &job, std::vector<TruthRow> &rows)
{
  FrameSet set;
  if (Status s = load_bunny (job.bunny, set); !s.ok ())
    return s;
  std::vector<Vec3> vertices;
  std::vector<Surface::Triangle> triangles;
  if (Status s = load_ply (job.mesh, kBunnyScale, vertices, triangles); !s.ok ())
    return s;
  const Surface surface (std::move (vertices), std::move (triangles));
  double y = 0;
  for (const Vec3 &v : surface.vertices ())
    y += v.y / double (surface.vertices ().size ());
  /* What the scans do not see is no hole of ours. */
  const std::vector<Sample> covered =
      Judge (set, surface, surface.samples (60000), y).covered (set);
  TruthRow row;
  row.scene = "bunny";
  row.views = int (set.rig.views.size ());
  row.noise = "scanner";
  run_methods (set, Judge (set, surface, covered, y), row, job, rows);
  return {};
}

} // namespace

std::vector<HeadSettings>
heads_of (const TruthJob &job)
{
  HeadSettings head;
  head.model = job.model;
  head.dress = job.dress.value_or (0);
  head.width = job.width;
  head.height = job.height;
  const double poses[][2] = {{0, 0}, {2, 0}, {5, 0}, {0, 0.5}};
  std::vector<HeadSettings> heads;
  for (int views : {4, 8})
    for (DepthNoise noise : {DepthNoise::kExact, DepthNoise::kSmooth, DepthNoise::kStereo})
      for (const auto &pose : poses) {
        head.views = job.views ? job.views : views;
        head.noise = job.noise.value_or (noise);
        const bool given = job.pose_mm >= 0 || job.pose_deg >= 0;
        head.pose_mm = given ? std::max (0.0, job.pose_mm) : pose[0];
        head.pose_deg = given ? std::max (0.0, job.pose_deg) : pose[1];
        const bool again = (job.views && views != 4) ||
                           (job.noise && noise != DepthNoise::kExact) ||
                           (given && &pose != &poses[0]);
        if (!again)
          heads.push_back (head);
      }
  return heads;
}

Status
run_truth (const TruthJob &job, std::vector<TruthRow> &rows)
{
  print_header ();
  if (!job.bunny.empty ())
    return run_bunny (job, rows);
  for (const HeadSettings &settings : heads_of (job))
    if (Status s = run_head (job, settings, rows); !s.ok ())
      return s;
  if (!job.model.empty () || job.dress || job.pose_mm >= 0 || job.pose_deg >= 0)
    return {};
  for (HeadSettings settings : heads_of (job)) { /* with the right rig alone */
    settings.dress = kDressAll;
    if (settings.pose_mm > 0 || settings.pose_deg > 0)
      continue;
    if (Status s = run_head (job, settings, rows); !s.ok ())
      return s;
  }
  return {};
}

Status
run_picture (const TruthJob &job, const std::string &path)
{
  Head head;
  if (!job.bunny.empty ()) {
    if (Status s = load_bunny (job.bunny, head.set); !s.ok ())
      return s;
    for (const Spot &spot : spots_of (head.set))
      head.nose_y += spot.point.y / double (head.set.count ());
  } else if (Status s = make_head (heads_of (job)[0], head); !s.ok ()) {
    return s;
  }
  cylinder (head.set.rig, job.settings) (head.set);
  return draw_slice (head.set, head.nose_y, path);
}

} // namespace bench
