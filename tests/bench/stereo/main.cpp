/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* stereodepth's way from a pair to depth, beside OpenCV's matchers alone in the same run. */
#include <cmath>
#include <cstdio>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "../options.hpp"
#include "matchers.hpp"
#include "plain.hpp"
#include "scene.hpp"
#include "truth.hpp"

using namespace rangecast;
using namespace bench;

namespace {

const char *const kUsage =
    "usage: stereo_bench --left FILE --right FILE [--ground-truth FILE] [--scale S]\n"
    "                    --focal-length PX --baseline M [--doffs PX]\n"
    "                    [--near M] [--far M] [--rounds N]\n"
    "       stereo_bench --scene [--model FILE] [--size WxH] [--distance M] [--noise LEVELS]\n"
    "                    [--frames N]\n"
    "       stereo_bench --plain [--size WxH] [--noise LEVELS] [--rounds N]\n"
    "Matches a pair of pictures as stereodepth does, and with OpenCV's BM, SGBM and\n"
    "3-way SGBM in the same run. Prints, for the pixels whose truth is known: density, the share\n"
    "that has a disparity; and of those bad-1.0 and bad-2.0, the shares further off than 1 and 2\n"
    "pixels, and the median error.\n"
    "  --ground-truth FILE  true disparities of the left picture: NPZ or a grey picture; 0\n"
    "                       and not finite = unknown\n"
    "  --scale S            its values per pixel of disparity (default 1)\n"
    "  --focal-length PX    of both rectified pictures, pixels\n"
    "  --baseline M         between the cameras, metres\n"
    "  --doffs PX           by how much the right principal point lies further right (default 0)\n"
    "  --near M, --far M    where to look, metres (default: where the ground truth lies, to the\n"
    "                       next 16 disparities; else disparities up to a quarter of the width)\n"
    "  --rounds N           times are processor times, the least of so many (default 12)\n"
    "  --scene              render pictures instead, of one person in a room, and match them "
    "whole,\n"
    "                       in the person's ROI alone, and with a third camera; prints the share "
    "of\n"
    "                       the person that has depth, the share of valid pixels more than 5 cm "
    "from\n"
    "                       the true surface, and errors, beside OpenCV at the same settings\n"
    "  --plain              render a pair of plain surfaces, with texture below the noise, "
    "instead\n"
    "  --model FILE         glTF model to render (default: the built-in figure)\n"
    "  --size WxH           (default 320x240)\n"
    "  --distance M         from the cameras, 0.5 to 1.2 (default 0.8; at 1.1 the person's ROI is "
    "a\n"
    "                       quarter of the picture)\n"
    "  --noise LEVELS       standard deviation of sensor noise, grey levels (default 1.5)\n"
    "  --frames N           that are measured (default 20)\n"
    "  --threads N          of ours (default 0: one a core)\n";

struct Job {
  std::string left, right, truth;
  int rounds = 12;
  double focal = 0, baseline = 0, offset = 0, scale = 1, near_m = 0, far_m = 0;
  bool scene = false, plain = false;
  SceneJob rendered;
};

void
add_options (Options &options, Job &job)
{
  options.text ("--left", job.left);
  options.text ("--right", job.right);
  options.text ("--ground-truth", job.truth);
  options.number ("--scale", job.scale, 1e-6, 1e6);
  options.number ("--focal-length", job.focal, 1.0, 1e6);
  options.number ("--baseline", job.baseline, 1e-4, 1e3);
  options.number ("--doffs", job.offset, -1e4, 1e4);
  options.number ("--near", job.near_m, 1e-3, 1e5);
  options.number ("--far", job.far_m, 1e-3, 1e5);
  options.number ("--rounds", job.rounds, 1, 100000);
  options.flag ("--scene", job.scene);
  options.flag ("--plain", job.plain);
  SceneSettings &s = job.rendered.scene;
  options.text ("--model", s.model);
  options.size ("--size", s.width, s.height, 64, 4096);
  options.number ("--distance", s.distance_m, 0.5, 1.2);
  options.number ("--noise", s.noise_sigma, 0.0, 20.0);
  options.number ("--frames", job.rendered.frames, 1, 1000);
  options.number ("--threads", job.rendered.n_threads, 0, 64);
}

/* What is wrong with the options together, or nothing. */
std::string
complaint (const Job &job)
{
  if (job.scene || job.plain)
    return job.left.empty () && job.right.empty () && job.scene != job.plain
               ? ""
               : "--scene or --plain renders the pictures: omit the other, --left and --right";
  if (job.left.empty () || job.right.empty ())
    return "expected --left and --right";
  if (job.focal <= 0 || job.baseline <= 0)
    return "expected --focal-length and --baseline";
  if (job.near_m > 0 && job.far_m > 0 && job.near_m >= job.far_m)
    return "--far: expected more than --near";
  return {};
}

Status
read_pictures (const Job &job, Pair &pair)
{
  for (int i = 0; i < 2; i++) {
    const std::string &path = i ? job.right : job.left;
    const cv::Mat picture = cv::imread (path);
    if (picture.empty ())
      return {StatusCode::kNotFound, path + ": cannot be read, expected a picture"};
    cv::cvtColor (picture, i ? pair.right : pair.left, cv::COLOR_BGR2RGBA);
  }
  const auto expect_size = [&] (const std::string &path, cv::Size size) -> Status {
    if (size == pair.left.size ())
      return {};
    return {StatusCode::kBadSize, path + ": " + std::to_string (size.width) + "x" +
                                      std::to_string (size.height) + " pixels, expected " +
                                      std::to_string (pair.left.cols) + "x" +
                                      std::to_string (pair.left.rows) + " as " + job.left};
  };
  if (Status s = expect_size (job.right, pair.right.size ()); !s.ok ())
    return s;
  if (job.truth.empty ())
    return {};
  if (Status s = read_truth (job.truth, job.scale, pair.truth); !s.ok ())
    return s;
  return expect_size (job.truth, pair.truth.size ());
}

/* Near and far if the options do not say them. */
void
choose_range (const Job &job, const Pair &pair, View &view)
{
  double least = 0, most = pair.left.cols / 4.0 - 1;
  if (!pair.truth.empty ()) {
    cv::minMaxLoc (pair.truth, &least, &most, nullptr, nullptr, pair.truth > 0);
    least = 16 * std::floor (least / 16);
    most = 16 * std::ceil (most / 16) - 1;
  }
  const double focal_baseline = job.focal * job.baseline;
  view.far_m = focal_baseline / std::max (1.0, least + job.offset);
  view.near_m = focal_baseline / std::max (2.0, most + job.offset);
}

Status
make_view (const Job &job, const Pair &pair, View &view)
{
  view.width = pair.left.cols;
  view.height = pair.left.rows;
  view.intrinsics = {job.focal, job.focal, (view.width - 1) / 2.0, (view.height - 1) / 2.0};
  PartnerCamera partner{view.intrinsics, {}, {}};
  partner.intrinsics.cx += job.offset;
  partner.partner_from_left.translation.x = -job.baseline;
  view.right = partner;
  choose_range (job, pair, view);
  if (job.near_m > 0)
    view.near_m = job.near_m;
  if (job.far_m > 0)
    view.far_m = job.far_m;
  view.depth_unit_m = view.far_m / 65000;
  return validate ({{view}});
}

void
print_rows (const std::vector<Row> &rows, bool has_truth)
{
  std::printf (
      "%-28s %9s %9s %9s %9s %9s\n", "matcher", "density", "bad-1.0", "bad-2.0", "median px", "ms");
  for (const Row &r : rows) {
    std::printf ("%-28s %7.2f %%", r.matcher.c_str (), 100 * r.density);
    if (has_truth)
      std::printf (" %7.2f %% %7.2f %% %9.3f", 100 * r.bad1, 100 * r.bad2, r.median_px);
    else
      std::printf (" %9s %9s %9s", "-", "-", "-");
    std::printf (" %9.1f\n", r.ms);
  }
}

Status
measure (const Job &job, const Pair &pair)
{
  std::vector<Row> rows (1);
  if (Status s = run_ours (pair, job.rendered.n_threads, job.rounds, rows[0]); !s.ok ())
    return s;
  for (const Row &row : run_peers (pair, job.rounds))
    rows.push_back (row);
  print_rows (rows, !pair.truth.empty ());
  return {};
}

Status
run (const Job &job)
{
  if (job.scene) {
    std::vector<SceneRow> rows;
    const Status s = run_scene (job.rendered, rows);
    if (s.ok ())
      print_scene_rows (rows);
    return s;
  }
  Pair pair;
  if (job.plain)
    render_plain ({job.rendered.scene.width, job.rendered.scene.height},
        job.rendered.scene.noise_sigma, pair);
  else if (Status s = read_pictures (job, pair); !s.ok ())
    return s;
  if (Status s = make_view (job, pair, pair.view); !s.ok ())
    return s;
  try {
    if (Status s = prepare (pair); !s.ok ())
      return s;
    return measure (job, pair);
  } catch (const cv::Exception &e) {
    return {StatusCode::kBadValue, "OpenCV refuses the pair: " + e.err};
  }
}

} // namespace

int
main (int argc, char **argv)
{
  cv::utils::logging::setLogLevel (cv::utils::logging::LOG_LEVEL_SILENT);
  Job job;
  job.rendered.scene.noise_sigma = 1.5;
  Options options ("stereo_bench", kUsage);
  add_options (options, job);
  if (const auto status = options.parse (argc, argv))
    return *status;
  if (const std::string wrong = complaint (job); !wrong.empty ())
    return options.refuse (wrong);
  if (job.plain) {
    job.focal = job.rendered.scene.width;
    job.baseline = 0.1;
  }
  if (const Status s = run (job); !s.ok ()) {
    std::fprintf (stderr, "stereo_bench: %s\n", s.message ().c_str ());
    return 1;
  }
  return 0;
}
