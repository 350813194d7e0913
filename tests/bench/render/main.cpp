/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* striprender's pictures and their cost, in all modes, beside peers in the same run. */
#include <gst/gl/gl.h>
#include <gst/gl/gstglfuncs.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <list>
#include <opencv2/imgcodecs.hpp>
#include <optional>

#include "../options.hpp"
#include "report.hpp"
#include "target.hpp"
#include "truth.hpp"

using namespace rangecast;
using namespace bench;

namespace {

const char *const kUsage =
    "usage: render_bench [--model FILE] [--size WxH] [--rounds N] [--json FILE] "
    "[--pictures DIR]\n"
    "Draws four views of the test scene in 640x480, as striprender does, in each mode, and judges\n"
    "the pictures by the scene rendered from the same places: 0, 20 and 45 degrees off the "
    "nearest\n"
    "camera, four places each. Depth is exact; or stereo: matched, freed of the background, coded\n"
    "and decoded, filtered by the cylinder, as in the demo; or noise: exact and 3 mm of smooth\n"
    "noise. Modes with -software draw on the CPU, all others with OpenGL. Mode strips-merged: "
    "strips of exact depth through the neighbour code, whose runs of\n"
    "equal pixels (colour threshold 8) become longer pieces; blend-held: strips of a frame set "
    "that\n"
    "is there already, as the second eye's, or while a stream stalls. Peers: grid, a plain grid\n"
    "surface, and point-cloud, GL points; both from a vertex buffer that the CPU unprojects into.\n"
    "  ms      one picture from depth and colour until the GPU has finished, median\n"
    "  CPU ms  processor time of all threads for it, median: what a busy machine changes less\n"
    "Truth and picture lie over mid-grey by their own coverage; what no camera sees does not "
    "count:\n"
    "  SSIM all  over the figure, its outline and everything drawn beside it\n"
    "  holes   share of the figure's seen pixels that are not drawn\n"
    "  edge    distance between the outlines, both ways, pixels: mean, and what 95 % keep within\n"
    "  PSNR, SSIM  3 pixels and more inside of both outlines\n"
    "  seam    gradients inside that the truth has not, over those that it has\n"
    "  bad     share of the pixels inside that are more than 40 levels off\n"
    "  spill   pixels drawn beside the figure, as a share of the figure's\n"
    "  --model FILE    glTF model (default: the built-in figure)\n"
    "  --size WxH      of the range images (default 320x240)\n"
    "  --rounds N      times are medians of so many (default 15)\n"
    "  --overlap PIXELS  of the cylinder (default: the element's)\n"
    "  --mode NAME     only that row of the table\n"
    "  --depth KIND    only that depth\n"
    "  --motion        instead: films of the figure, still and in motion, by two and three "
    "cameras\n"
    "                  a view, drawn in software: SSIM all; flicker, pixels inside that change by\n"
    "                  over 20 levels more than the truth; outline, pixels that come or go and in\n"
    "                  the truth do not\n"
    "  --json FILE     writes the rows (but noise) there\n"
    "  --pictures DIR  writes truth, picture and difference there, as PNG\n";

using Clock = std::chrono::steady_clock;

double
ms_since (Clock::time_point start)
{
  return std::chrono::duration<double, std::milli> (Clock::now () - start).count ();
}

/* Of all threads, those of a renderer in software too. */
double
processor_ms ()
{
  timespec now;
  clock_gettime (CLOCK_PROCESS_CPUTIME_ID, &now);
  return 1e3 * double (now.tv_sec) + 1e-6 * double (now.tv_nsec);
}

double
median (std::vector<double> values)
{
  std::ranges::nth_element (values, values.begin () + std::ptrdiff_t (values.size () / 2));
  return values[values.size () / 2];
}

/* striprender's own ways, beside the peers. */
constexpr std::pair<const char *, StripMode> kModes[] = {{"blend", StripMode::kBlend},
    {"strips", StripMode::kStrips}, {"rectangles", StripMode::kRectangles},
    {"points", StripMode::kPoints}};

struct Job {
  SceneSettings scene;
  std::string scene_name;
  int rounds = 15;
  CylinderSettings cylinder;
  std::string json, pictures, mode, depth; /* mode, depth: empty, or the only one */
  std::vector<RenderRow> rows;
  GstGLContext *context = nullptr;
  SurfacePainter painter, held_painter;
  Status status;
};

/* Frame sets of one kind of depth, and the ways that draw them. */
struct Kind {
  const char *depth;
  FrameSet set, coded;
  std::vector<std::unique_ptr<Way>> ways;
};

Status
make_ways (Job &job, Kind &kind)
{
  const auto strips = [&] (const char *name, const FrameSet &set, StripMode mode) {
    StripSettings settings;
    settings.mode = mode;
    kind.ways.push_back (make_strip_way (name, &job.painter, set, settings));
    kind.ways.push_back (make_strip_way (std::string (name) + "-software", nullptr, set, settings));
  };
  for (const auto &[name, mode] : kModes)
    strips (name, kind.set, mode);
  if (!kind.coded.images.empty ()) { /* of exact depth */
    strips ("strips-merged", kind.coded, StripMode::kStrips);
    StripSettings settings;
    kind.ways.push_back (
        make_strip_way ("blend-held", &job.held_painter, kind.set, settings, true));
  }
  for (auto [name, peer] : {std::pair{"grid", Peer::kGrid}, {"point-cloud", Peer::kPoints}}) {
    GError *error = nullptr;
    kind.ways.push_back (make_peer (name, peer, job.context, kind.set, &error));
    if (!kind.ways.back ()) {
      const std::string why = error ? error->message : "no shader";
      g_clear_error (&error);
      return {StatusCode::kUnsupported, why};
    }
  }
  return {};
}

/* A frame set of one kind of depth, and of exact depth also what the neighbour code makes of it. */
Status
make_kind (Job &job, const char *depth, Kind &kind)
{
  const std::string name = kind.depth = depth;
  Status status = name == "stereo" ? stereo_frames (job.scene, job.cylinder, kind.set)
                                   : exact_frames (job.scene, kind.set);
  if (status.ok () && name == "exact") {
    EncoderSettings settings;
    settings.colour_threshold = 8;
    status = exact_frames (job.scene, kind.coded);
    if (status.ok ())
      status = code (kind.coded, settings);
  }
  if (status.ok () && name == "noise")
    add_smooth_noise (kind.set, 0.003);
  return status.ok () ? make_ways (job, kind) : status;
}

/* In turns, so that whatever else the machine does hits all of them alike. */
void
time_all (
    Job &job, const Kind &kind, Target &target, double azimuth_deg, std::vector<RenderRow> &rows)
{
  const SurfacePicture picture = make_picture (kind.set, azimuth_deg);
  std::vector<std::vector<double>> processor (rows.size ()), total (rows.size ());
  for (int round = -1; round < job.rounds; round++) /* the first one allocates */
    for (std::size_t i = 0; i < rows.size (); i++) {
      Way &way = *kind.ways[i];
      const auto begin = Clock::now ();
      const double processor_begin = processor_ms ();
      way.build (orbit_at (azimuth_deg));
      rows[i].bytes = target.draw (way, picture);
      if (round < 0)
        continue;
      processor[i].push_back (processor_ms () - processor_begin);
      total[i].push_back (ms_since (begin));
    }
  for (std::size_t i = 0; i < rows.size (); i++) {
    rows[i].ms = median (total[i]);
    rows[i].processor_ms = median (processor[i]);
    rows[i].vertices = kind.ways[i]->vertices ();
    rows[i].triangles = kind.ways[i]->triangles ();
  }
}

void
judge (Job &job, const Kind &kind, Target &target, const std::vector<Shot> &shots, std::size_t i,
    RenderRow &row)
{
  Score score;
  for (const Shot &shot : shots) {
    kind.ways[i]->build (orbit_at (shot.azimuth_deg));
    target.draw (*kind.ways[i], make_picture (kind.set, shot.azimuth_deg));
    const cv::Mat rgba = target.read (*kind.ways[i]);
    score.add (shot, rgba);
    const std::string path = job.pictures + "/" + row.depth + "-" + row.mode + "-" +
                             std::to_string (int (shot.azimuth_deg)) + ".png";
    if (!job.pictures.empty () && !cv::imwrite (path, comparison (shot, rgba)))
      job.status = {StatusCode::kNotFound, "--pictures: " + path + " cannot be written"};
  }
  row.score = score;
}

void
measure (Job &job, const Kind &kind, Target &target, int angle_deg, const std::vector<Shot> &shots)
{
  std::vector<RenderRow> rows;
  for (const auto &way : kind.ways) {
    rows.emplace_back ();
    rows.back ().scene = job.scene_name;
    rows.back ().mode = way->name ();
    rows.back ().depth = kind.depth;
    rows.back ().angle_deg = angle_deg;
  }
  time_all (job, kind, target, shots[0].azimuth_deg, rows);
  for (std::size_t i = 0; i < rows.size (); i++) {
    judge (job, kind, target, shots, i, rows[i]);
    print_row (rows[i]);
    if (rows[i].depth != std::string ("noise"))
      job.rows.push_back (rows[i]);
  }
}

Status
run_scene (Job &job)
{
  std::list<Kind> kinds; /* which stay where they are */
  std::vector<Shot> shots[std::size (kAngles)];
  Status status;
  for (const char *depth : {"exact", "stereo", "noise"})
    if (status.ok () && (job.depth.empty () || job.depth == depth))
      status = make_kind (job, depth, kinds.emplace_back ());
  FrameSet cameras;
  if (status.ok ())
    status = exact_frames (job.scene, cameras);
  for (std::size_t i = 0; i < std::size (kAngles) && status.ok (); i++)
    status = make_truth (job.scene, cameras, kAngles[i], shots[i]);
  Target target (job.context);
  if (status.ok () && !target.usable ())
    status = {StatusCode::kUnsupported, "OpenGL has no framebuffer to draw into"};
  for (Kind &kind : kinds)
    std::erase_if (kind.ways,
        [&] (const auto &way) { return !job.mode.empty () && job.mode != way->name (); });
  for (const Kind &kind : kinds)
    for (std::size_t i = 0; i < std::size (kAngles) && status.ok (); i++)
      measure (job, kind, target, kAngles[i], shots[i]);
  return status;
}

Status
run (Job &job)
{
  GError *error = nullptr;
  if (!job.painter.start (job.context, &error) || !job.held_painter.start (job.context, &error)) {
    const std::string why = error ? error->message : "no shader";
    g_clear_error (&error);
    return {StatusCode::kUnsupported, why};
  }
  print_head ();
  job.scene_name = job.scene.model.empty () ? "figure" : "model";
  return run_scene (job);
}

/* A film of a still or moving figure, by two or three cameras a view. */
Status
run_film (SceneSettings settings, bool moves, bool with_third)
{
  constexpr int kBefore = 6, kPictures = 5;
  settings.motion = moves;
  MotionScore scores[std::size (kAngles)];
  std::vector<Shot> shots[std::size (kAngles)];
  Film film;
  Status status = film.start (settings, with_third);
  for (int i = -kBefore; i < kPictures && status.ok (); i++) {
    const double time_s = kMoment + (i + kBefore) / 15.0;
    FrameSet set, cameras;
    status = film.next (time_s, set);
    for (std::size_t k = 0; k < std::size (kAngles) && i >= 0 && status.ok (); k++) {
      if (i == 0 || moves) {
        shots[k].clear ();
        status = exact_frames (settings, cameras, time_s);
        if (status.ok ())
          status = make_truth (settings, cameras, kAngles[k], shots[k], time_s);
      }
      const auto way = make_strip_way ("blend", nullptr, set, {});
      for (const Shot &shot : shots[k]) {
        way->build (orbit_at (shot.azimuth_deg));
        way->draw (make_picture (set, shot.azimuth_deg));
        scores[k].add (int (shot.azimuth_deg), shot, *way->own_picture ());
      }
    }
  }
  if (!status.ok ())
    return status;
  for (std::size_t k = 0; k < std::size (kAngles); k++)
    std::printf ("%-7s %7d %5d %9.4f %7.2f %% %7.2f %%\n", moves ? "moving" : "still",
        with_third ? 3 : 2, kAngles[k], scores[k].ssim_all (), 100 * scores[k].flicker (),
        100 * scores[k].outline ());
  return {};
}

/* Films of still and moving figures. */
Status
run_films (const SceneSettings &settings)
{
  std::printf (
      "%-7s %7s %5s %9s %9s %9s\n", "film", "cameras", "angle", "SSIM all", "flicker", "outline");
  for (const bool moves : {false, true})
    for (const bool with_third : {false, true})
      if (Status status = run_film (settings, moves, with_third); !status.ok ())
        return status;
  return {};
}

/* Whether an argument is one of some names; if not, says so. */
bool
is_one_of (const char *option, const std::string &value, const std::vector<const char *> &names)
{
  std::string expected;
  for (const char *name : names) {
    if (value.empty () || value == name)
      return true;
    expected += (expected.empty () ? "" : ", ") + std::string (name);
  }
  std::fprintf (stderr, "render_bench: %s %s: expected one of %s\n", option, value.c_str (),
      expected.c_str ());
  return false;
}

void
run_in_gl_thread (GstGLContext *, gpointer data)
{
  auto &job = *static_cast<Job *> (data);
  const Status status = run (job);
  if (!status.ok ())
    job.status = status;
  job.painter.stop ();
  job.held_painter.stop ();
}

} // namespace

int
main (int argc, char **argv)
{
  Job job;
  bool motion = false;
  Options options ("render_bench", kUsage);
  options.text ("--model", job.scene.model);
  options.size ("--size", job.scene.width, job.scene.height, 16, 1920);
  options.number ("--rounds", job.rounds, 1, 100000);
  options.number ("--overlap", job.cylinder.overlap, 0.0, kMaxOverlap);
  options.flag ("--motion", motion);
  options.text ("--mode", job.mode);
  options.text ("--depth", job.depth);
  options.text ("--json", job.json);
  options.text ("--pictures", job.pictures);
  if (const auto status = options.parse (argc, argv))
    return *status;
  std::vector<const char *> modes{"strips-merged", "strips-merged-software", "blend-held", "grid",
      "point-cloud", "blend-software", "strips-software", "rectangles-software", "points-software"};
  for (const auto &[name, mode] : kModes)
    modes.push_back (name);
  if (!is_one_of ("--mode", job.mode, modes) ||
      !is_one_of ("--depth", job.depth, {"exact", "stereo", "noise"}))
    return 2;
  if (motion) {
    const Status status = run_films (job.scene);
    if (!status.ok ())
      std::fprintf (stderr, "render_bench: %s\n", status.message ().c_str ());
    return status.ok () ? 0 : 1;
  }
  if (!g_getenv ("DISPLAY") && !g_getenv ("WAYLAND_DISPLAY")) { /* software, if nothing is chosen */
    g_setenv ("GST_GL_PLATFORM", "egl", FALSE);
    g_setenv ("GST_GL_WINDOW", "egl-device", FALSE);
  }
  gst_init (nullptr, nullptr);
  GstGLDisplay *display = gst_gl_display_new ();
  job.context = gst_gl_context_new (display);
  GError *error = nullptr;
  if (!gst_gl_context_create (job.context, nullptr, &error)) {
    std::fprintf (stderr, "render_bench: OpenGL cannot be used: %s\n", error->message);
    return 1;
  }
  gst_gl_memory_init_once ();
  gst_gl_context_thread_add (job.context, run_in_gl_thread, &job);
  if (job.status.ok () && !job.json.empty ())
    job.status = write_json (job.json, job.rows);
  if (!job.status.ok ())
    std::fprintf (stderr, "render_bench: %s\n", job.status.message ().c_str ());
  gst_object_unref (job.context);
  gst_object_unref (display);
  return job.status.ok () ? 0 : 1;
}
