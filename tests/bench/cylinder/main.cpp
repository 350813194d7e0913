/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The cylinder filter beside its peers in the same run: milliseconds, and what is left against the
 * true surface. */
#include <cstdio>
#include <opencv2/core/utils/logger.hpp>

#include "../options.hpp"
#include "truth_run.hpp"

using namespace rangecast;
using namespace bench;

namespace {

const char *const kUsage =
    "usage: cylinder_bench [--model FILE] [--views N] [--size WxH] [--noise KIND]\n"
    "                      [--pose-mm MM] [--pose-deg DEGREES] [--rounds N] [--json FILE]\n"
    "       cylinder_bench --bunny DIR --mesh FILE [--rounds N] [--json FILE]\n"
    "       cylinder_bench --picture FILE.png [--model FILE ...]\n"
    "A head of known surface, seen by cameras on a ring, before and after the filter, the "
    "published\n"
    "rule written straight down, and a voxel grid.\n"
    "  --model FILE    glTF or OBJ (default: the built-in figure)\n"
    "  --dress PIECES  of the built-in figure: none, all, or hair, glasses, collar and hand with "
    "+\n"
    "                  between (default: none; without a pose then all, rig right)\n"
    "  --views N       cameras, 2 to 64 (default: 4, then 8)\n"
    "  --size WxH      of their pictures (default 320x240)\n"
    "  --noise KIND    of depth: exact; smooth, normal with 3 mm and alike over some 10 pixels;\n"
    "                  stereo, two pictures matched as stereodepth does (default: each in turn)\n"
    "  --pose-mm MM, --pose-deg DEGREES  what the rig is told wrong of each camera's place and\n"
    "                  direction (default: nothing, 2 mm, 5 mm and 0.5 degrees in turn)\n"
    "  --overlap PIXELS  of the filter (default 1)\n"
    "  --bunny DIR     what tests/bench/bunny-to-range.py wrote there, instead of a head\n"
    "  --mesh FILE     the bunny's merged mesh, PLY\n"
    "  --rounds N      times are medians of so many (default 5)\n"
    "  --json FILE     an array of objects. scene; views; noise; pose_mm; pose_deg; method;\n"
    "                  points: left; removed: share of the points that were there; cells_double:\n"
    "                  share of the cells (4 mm x 1 degree) where points of several views share a\n"
    "                  surface; thickness_mm, thickness95_mm: of the surface in a slice through "
    "the\n"
    "                  nose, 10 % to 90 % of heights in each 5 degrees, mean and 95 % of angles;\n"
    "                  distance_mm, distance95_mm: of what is left to the true surface, median "
    "and\n"
    "                  95 %; uncovered: share of the true visible surface with no point within 2\n"
    "                  pixels along it and 20 mm across it; new_holes: that, less what was "
    "before;\n"
    "                  uncovered_6mm, new_holes_6mm: no point within 6 mm across it; strips,\n"
    "                  isolated: as striprender draws what is left; ms\n"
    "  --picture FILE  draws that slice, points in their views' colours, before and after\n";

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
  TruthJob job;
  std::string json, picture;
  Options options ("cylinder_bench", kUsage);
  options.number ("--rounds", job.rounds, 1, 100000);
  options.text ("--bunny", job.bunny);
  options.text ("--picture", picture);
  options.text ("--model", job.model);
  options.dress ("--dress", job.dress);
  options.text ("--mesh", job.mesh);
  options.number ("--views", job.views, 2, kMaxViews);
  options.size ("--size", job.width, job.height, 64, 4096);
  options.value (
      "--noise", [&] (const std::string &value) { return take_noise (value, job.noise); });
  options.number ("--pose-mm", job.pose_mm, 0.0, 100.0);
  options.number ("--pose-deg", job.pose_deg, 0.0, 20.0);
  options.number ("--overlap", job.settings.overlap, 0.0, kMaxOverlap);
  options.text ("--json", json);
  if (const auto status = options.parse (argc, argv))
    return *status;
  if (picture.empty () && job.bunny.empty () != job.mesh.empty ())
    return options.refuse ("--bunny needs --mesh, and --mesh needs --bunny");
  if (!json.empty () && !can_write (json)) {
    std::fprintf (stderr, "cylinder_bench: --json %s: cannot be written\n", json.c_str ());
    return 1;
  }
  std::vector<TruthRow> rows;
  Status status = picture.empty () ? run_truth (job, rows) : run_picture (job, picture);
  if (status.ok () && !json.empty ())
    status = write_json (json, rows);
  if (!status.ok ())
    std::fprintf (stderr, "cylinder_bench: %s\n", status.message ().c_str ());
  return status.ok () ? 0 : 1;
}
