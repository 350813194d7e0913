/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The cylinder filter beside its peers in the same run: milliseconds, and what is left against the
 * true surface. */
#include <cstdio>
#include <functional>
#include <opencv2/core/utils/logger.hpp>

#include "../options.hpp"
#include "colour.hpp"
#include "speed.hpp"
#include "truth_run.hpp"

using namespace rangecast;
using namespace bench;

namespace {

const char *const kUsage =
    "usage: cylinder_bench [--rounds N] [--only NAME] [--bunny DIR]\n"
    "       cylinder_bench --truth [--model FILE] [--views N] [--size WxH] [--noise KIND]\n"
    "                      [--pose-mm MM] [--pose-deg DEGREES] [--rounds N] [--json FILE]\n"
    "       cylinder_bench --truth --bunny DIR --mesh FILE [--rounds N] [--json FILE]\n"
    "       cylinder_bench --colour [as --truth] [--blend-width M]\n"
    "       cylinder_bench --picture FILE.png [as --truth or --colour]\n"
    "Without --truth: milliseconds of the filter, of the published rule written straight down, "
    "and\n"
    "of a voxel grid.\n"
    "  --rounds N      times are medians of so many (default 50; with --truth 5)\n"
    "  --only NAME     only the scenes whose name begins so\n"
    "  --bunny DIR     also what pipelines/bunny-to-range.py wrote there (--truth: that alone)\n"
    "With --truth: a head of known surface, seen by cameras on a ring, before and after.\n"
    "  --model FILE    glTF or OBJ (default: the built-in figure)\n"
    "  --dress PIECES  of the built-in figure: none, all, or hair, glasses, collar and hand with "
    "+\n"
    "                  between (default: none; --truth without a pose: then all, rig right)\n"
    "  --views N       cameras, 2 to 64 (default: 4, then 8)\n"
    "  --size WxH      of their pictures (default 320x240)\n"
    "  --noise KIND    of depth: exact; smooth, normal with 3 mm and alike over some 10 pixels;\n"
    "                  stereo, two pictures matched as stereodepth does (default: each in turn)\n"
    "  --pose-mm MM, --pose-deg DEGREES  what the rig is told wrong of each camera's place and\n"
    "                  direction (default: nothing, 2 mm, 5 mm and 0.5 degrees in turn)\n"
    "  --overlap PIXELS, --smoothing M  of the filter (default: its own)\n"
    "  --mesh FILE     the bunny's merged mesh, PLY\n"
    "  --json FILE     an array of objects. scene; views; noise; pose_mm; pose_deg; method;\n"
    "                  points: left; removed: share of the points that were there; units_double:\n"
    "                  share of the units (4 mm x 1 degree) where points of several views share a\n"
    "                  surface; thickness_mm, thickness95_mm: of the surface in a slice through "
    "the\n"
    "                  nose, 10 % to 90 % of heights in each 5 degrees, mean and 95 % of angles;\n"
    "                  distance_mm, distance95_mm: of what is left to the true surface, median "
    "and\n"
    "                  95 %; uncovered: share of the true visible surface with no point within 2\n"
    "                  pixels along it and 20 mm across it; new_holes: that, less what was\n"
    "                  before; uncovered_6mm, new_holes_6mm: no point within 6 mm across it, less\n"
    "                  than stereo's errors; strips, isolated: as\n"
    "                  striprender draws what is left; ms\n"
    "  --picture FILE  draws that slice, points in their views' colours, before and after; with\n"
    "                  --colour the head between two cameras: winner, balanced, and blended\n"
    "With --colour: the same head, by cameras that do not agree on colour (error: none; gains, up "
    "to\n"
    "10 % for each channel; light, the same before an sRGB curve; vignette, gains and 20 % darker\n"
    "corners), with 1 grey level of noise; times on one thread.\n"
    "  --blend-width M of mode=blend, metres (default 0.02)\n"
    "  --json FILE     scene; views; noise; pose_mm; pose_deg; error; method; psnr_db: of the "
    "points\n"
    "                  left, against their true colour; seam_levels: mean step in colour between\n"
    "                  points of two views within 4 mm, less the true step; seam_psnr_db: of "
    "points\n"
    "                  within 10 mm of another view's; balance_ms, filter_ms, blend_ms\n";

struct SpeedScene {
  std::string name;
  std::function<FrameSet ()> make;
};

std::vector<SpeedScene>
speed_scenes (const FrameSet *bunny)
{
  std::vector<SpeedScene> scenes;
  if (bunny)
    scenes.push_back ({"bunny, 6 x 320x240", [bunny] { return *bunny; }});
  const auto add = [&] (int views, int width) {
    const int height = width * 3 / 4;
    const std::string size =
        std::to_string (views) + " x " + std::to_string (width) + "x" + std::to_string (height);
    scenes.push_back ({"bust, " + size, [=] { return render_bust (views, width, height); }});
    scenes.push_back (
        {"all pixels, " + size, [=] { return render_pillar (views, width, height); }});
  };
  for (int views : {4, 8})
    for (int width : {320, 640})
      add (views, width);
  add (16, 320);
  return scenes;
}

/* @return what was expected of `only`, or nothing if some scene is meant */
std::string
run_speed (const std::string &only, const FrameSet *bunny, int rounds)
{
  std::string names;
  bool found = false;
  for (const SpeedScene &scene : speed_scenes (bunny)) {
    names += (names.empty () ? "'" : ", '") + scene.name + "'";
    if (!scene.name.starts_with (only))
      continue;
    found = true;
    measure_speed (scene.name, scene.make (), rounds);
  }
  return found ? "" : "the beginning of one of " + names;
}

std::string
take_noise (const std::string &value, std::optional<DepthNoise> &noise)
{
  for (DepthNoise kind : {DepthNoise::kExact, DepthNoise::kSmooth, DepthNoise::kStereo})
    if (value == name_of (kind)) {
      noise = kind;
      return {};
    }
  return "exact, smooth or stereo";
}

struct Job {
  TruthJob truth;
  bool want_truth = false, want_colour = false;
  double blend_width = 0;
  int rounds = 0;
  std::string only, json, picture;
};

Status
run_colours (const Job &job)
{
  const ColourJob colour{job.truth, job.blend_width};
  if (!job.picture.empty ())
    return draw_colours (colour, job.picture);
  std::vector<ColourRow> rows;
  if (Status s = run_colour (colour, rows); !s.ok ())
    return s;
  return job.json.empty () ? Status{} : write_json (job.json, rows);
}

Status
run (Job &job)
{
  TruthJob &truth = job.truth;
  if (job.want_colour)
    return run_colours (job);
  if (!job.picture.empty ())
    if (Status s = run_picture (truth, job.picture); !s.ok () || !job.want_truth)
      return s;
  if (job.want_truth) {
    truth.rounds = job.rounds ? job.rounds : truth.rounds;
    std::vector<TruthRow> rows;
    if (Status s = run_truth (truth, rows); !s.ok ())
      return s;
    return job.json.empty () ? Status{} : write_json (job.json, rows);
  }
  FrameSet bunny;
  if (!truth.bunny.empty ())
    if (Status s = load_bunny (truth.bunny, bunny); !s.ok ())
      return s;
  const std::string expected =
      run_speed (job.only, truth.bunny.empty () ? nullptr : &bunny, job.rounds ? job.rounds : 50);
  return expected.empty ()
             ? Status{}
             : Status{StatusCode::kBadValue, "--only " + job.only + ": expected " + expected};
}

/* An option that says something of a measurement which is not asked for; empty: there is none. */
std::string
idle_option (const Job &job)
{
  const TruthJob &truth = job.truth;
  const bool of_head = job.want_truth || job.want_colour || !job.picture.empty ();
  const std::pair<const char *, bool> of_heads[] = {{"--model", !truth.model.empty ()},
      {"--dress", truth.dress.has_value ()}, {"--views", truth.views != 0},
      {"--noise", truth.noise.has_value ()}, {"--pose-mm", truth.pose_mm >= 0},
      {"--pose-deg", truth.pose_deg >= 0}, {"--mesh", !truth.mesh.empty ()}};
  for (const auto &[name, given] : of_heads)
    if (given && !of_head)
      return std::string (name) + ": expected --truth, --colour or --picture, too";
  if (!job.only.empty () && of_head)
    return "--only: expected neither --truth, --colour nor --picture";
  return {};
}

/* Before what takes minutes. */
bool
can_write (const std::string &path)
{
  std::FILE *file = std::fopen (path.c_str (), "a");
  return file && std::fclose (file) == 0;
}

} // namespace

int
main (int argc, char **argv)
{
  cv::utils::logging::setLogLevel (cv::utils::logging::LOG_LEVEL_SILENT);
  Job job;
  TruthJob &truth = job.truth;
  Options options ("cylinder_bench", kUsage);
  options.number ("--rounds", job.rounds, 1, 100000);
  options.text ("--only", job.only);
  options.text ("--bunny", truth.bunny);
  options.text ("--picture", job.picture);
  options.flag ("--truth", job.want_truth);
  options.flag ("--colour", job.want_colour);
  options.number ("--blend-width", job.blend_width, 0.001, 1.0);
  options.text ("--model", truth.model);
  options.dress ("--dress", truth.dress);
  options.text ("--mesh", truth.mesh);
  options.number ("--views", truth.views, 2, kMaxViews);
  options.size ("--size", truth.width, truth.height, 64, 4096);
  options.value (
      "--noise", [&] (const std::string &value) { return take_noise (value, truth.noise); });
  options.number ("--pose-mm", truth.pose_mm, 0.0, 100.0);
  options.number ("--pose-deg", truth.pose_deg, 0.0, 20.0);
  options.number ("--overlap", truth.settings.overlap, 0.0, kMaxOverlap);
  options.number ("--smoothing", truth.settings.cells.smoothing_m, 0.0, 1.0);
  options.text ("--json", job.json);
  if (const auto status = options.parse (argc, argv))
    return *status;
  if (job.want_truth && truth.bunny.empty () != truth.mesh.empty ())
    return options.refuse ("--truth with --bunny: expected --mesh, too, and only then");
  if (!job.want_truth && !job.want_colour && !job.json.empty ())
    return options.refuse ("--json: expected --truth or --colour, too");
  if (job.want_colour && (job.want_truth || !truth.bunny.empty ()))
    return options.refuse ("--colour: expected neither --truth nor --bunny");
  if (const std::string wrong = idle_option (job); !wrong.empty ())
    return options.refuse (wrong);
  if (!job.json.empty () && !can_write (job.json)) {
    std::fprintf (stderr,
        "cylinder_bench: --json %s: cannot be written, expected a file to write\n",
        job.json.c_str ());
    return 1;
  }
  if (const Status s = run (job); !s.ok ()) {
    std::fprintf (stderr, "cylinder_bench: %s\n", s.message ().c_str ());
    return 1;
  }
  return 0;
}
