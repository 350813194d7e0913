/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* How well roiextract's segmentation finds the person of the test scene, for each cue, in several
 * rooms, beside the truth. --help lists the options. */
#include <cstdio>
#include <cstdlib>
#include <string>
#include <utility>
#include <vector>

#include "../lib/roi-scene.hpp"
#include "options.hpp"

using namespace rangecast;
using rangecast::testing::RoiScore;
using rangecast::testing::RoiStage;
using rangecast::testing::RoiTrial;
using rangecast::testing::RoomChange;

namespace {

const char *const kUsage =
    "usage: roi_bench [--frames N] [--room NAME] [--depth range|stereo] [--changes]\n"
    "  --frames N         with the person, 1.7 seconds apart (default 12)\n"
    "  --room NAME        only this one (default: all)\n"
    "  --depth WHICH      range (exact with noise) or stereo (default: both)\n"
    "columns: IoU of the valid pixels that are kept with the true mask (worst frame, mean), mean\n"
    "IoU of the decision, share of shadow pixels kept, pixels kept beside the person a frame,\n"
    "pixels a frame missed deeper than 1 pixel inside the silhouette, deepest of them\n"
    "--changes: the room changes after it was learnt. Columns, each 1, 5 and 20 seconds later: "
    "share\n"
    "of the changed pixels that is kept while nobody is there, the same beside a person, share of\n"
    "the person that is lost\n";

struct Room {
  const char *name;
  RoiTrial trial;
};

std::vector<Room>
rooms ()
{
  std::vector<Room> all;
  const auto add = [&] (const char *name, auto change) {
    Room room{name, RoiTrial::standard ()};
    change (room.trial);
    all.push_back (room);
  };
  add ("standard", [] (RoiTrial &) {});
  add ("from the side", [] (RoiTrial &t) { t.view = 1; });
  add ("plain wall", [] (RoiTrial &t) { t.scene.wall_texture = 0; });
  add ("more noise", [] (RoiTrial &t) { t.scene.noise_sigma = 6, t.depth_noise = 0.5; });
  add ("deep shadow", [] (RoiTrial &t) { t.cast_shadow = 0.7; });
  add ("light swings 25 %", [] (RoiTrial &t) { t.light_drift = 0.25; });
  add ("other clothes", [] (RoiTrial &t) { t.scene.seed = 7; });
  add ("warm wall", [] (RoiTrial &t) { t.scene.wall_warmth = 1; });
  add ("warm plain wall", [] (RoiTrial &t) { t.scene.wall_warmth = 1, t.scene.wall_texture = 0; });
  add ("grey camera", [] (RoiTrial &t) { t.grey = true; });
  add ("exposure 60 %", [] (RoiTrial &t) { t.exposure = 0.6; });
  add ("exposure 150 %", [] (RoiTrial &t) { t.exposure = 1.5; });
  add ("wall out of reach", [] (RoiTrial &t) { t.scene.far_m = 1.3; });
  return all;
}

/* Where the room changes, and how. */
struct Change {
  const char *name;
  cv::Rect at; ///< empty: the person leaves who stood in the learnt background
  RoomChange before, after;
};

void
paint (cv::Mat &colour, const cv::Mat &person, const cv::Rect &at, int disparity,
    const std::function<cv::Vec3d (int x, int y, const cv::Vec4b &old)> &look)
{
  for (int y = at.y; y < at.br ().y; y++)
    for (int x = at.x; x < at.br ().x; x++)
      if (const int to = x - disparity; to >= 0 && !person.at<std::uint8_t> (y, to)) {
        auto &pixel = colour.at<cv::Vec4b> (y, to);
        const cv::Vec3d rgb = look (x - at.x, y - at.y, pixel);
        for (int c = 0; c < 3; c++)
          pixel[c] = cv::saturate_cast<std::uint8_t> (rgb[c]);
      }
}

/* A board with a pattern, in front of the room. Its disparity is in whole pixels. */
RoomChange
board (const cv::Rect &at, int disparity, const cv::Vec3d &tint, bool plays = false)
{
  return [=] (cv::Mat &colour, cv::Mat &depth, const cv::Mat &person, double time_s,
             SceneCamera camera) {
    cv::RNG random (std::uint64_t (plays ? 1000 * time_s : disparity) + 1);
    cv::RNG noise (std::uint64_t (1e6 * time_s) + std::uint64_t (camera));
    cv::Mat pattern (at.size (), CV_32FC3);
    random.fill (pattern, cv::RNG::UNIFORM, -1, 1);
    cv::GaussianBlur (pattern, pattern, {}, plays ? 6 : 2);
    pattern *= plays ? 1000 : 200;
    const bool right = camera == SceneCamera::kRight;
    paint (colour, person, at, right ? disparity : 0, [&] (int x, int y, const cv::Vec4b &) {
      const auto grain = pattern.at<cv::Vec3f> (y, x);
      return tint + cv::Vec3d (grain) + cv::Vec3d::all (noise.gaussian (2.5));
    });
    constexpr double kFocalTimesBaseline = 320 * 0.1 / 1e-4;
    for (int y = at.y; !depth.empty () && y < at.br ().y; y++)
      for (int x = at.x; x < at.br ().x; x++)
        if (!person.at<std::uint8_t> (y, x))
          depth.at<std::uint16_t> (y, x) = std::uint16_t (kFocalTimesBaseline / disparity);
  };
}

/* Light on the wall, `speed` pixels a second to the right. */
RoomChange
light (const cv::Rect &at, const cv::Vec3d &gain, double speed = 0)
{
  return
      [=] (cv::Mat &colour, cv::Mat &, const cv::Mat &person, double time_s, SceneCamera camera) {
        constexpr int kWall = 11; /* its disparity, pixels */
        const cv::Rect now = at + cv::Point (int (speed * time_s), 0);
        paint (colour, person, now, camera == SceneCamera::kRight ? kWall : 0,
            [&] (int x, int y, const cv::Vec4b &old) {
              const double u = 2.0 * x / at.width - 1, v = 2.0 * y / at.height - 1;
              const cv::Vec3d rgb (old[0], old[1], old[2]);
              return u * u + v * v < 1 ? rgb.mul (gain) : rgb;
            });
      };
}

std::vector<Change>
changes ()
{
  const cv::Rect left (15, 60, 90, 150), right (225, 100, 80, 120), wall (20, 20, 100, 90),
      path (20, 20, 140, 90);
  const cv::Vec3d wood (150, 110, 70), grey (90, 95, 100), dark (25, 25, 30), pale (170, 180, 190),
      bright (130, 120, 150);
  return {{"person leaves", {}, {}, {}}, {"chair leaves", left, board (left, 23, wood), {}},
      {"chair's new place", right, board (left, 23, wood), board (right, 23, wood)},
      {"door opens", left, board (left, 14, wood), board (left, 11, grey)},
      {"door closes", left, board (left, 11, grey), board (left, 14, wood)},
      {"lamp", wall, {}, light (wall, {1.8, 1.5, 1.1})},
      {"monitor plays", left, board (left, 14, dark), board (left, 14, bright, true)},
      {"sun patch wanders", path, {}, light (wall, {2.2, 2.1, 1.8}, 2)},
      {"poster goes", left, board (left, 11, pale), board (left, 11, wood)}};
}

struct Job {
  int frames = 12;
  bool changes = false;
  std::string room, depth;
};

void
require (const Status &status)
{
  if (status.ok ())
    return;
  std::fprintf (stderr, "roi_bench: %s\n", status.message ().c_str ());
  std::exit (1);
}

double
percent (const cv::Mat &part, const cv::Mat &all)
{
  return 100.0 * cv::countNonZero (part & all) / std::max (cv::countNonZero (all), 1);
}

void
measure_change (const Change &change, bool stereo, Cue cue)
{
  constexpr double kAdaptTime = 30, kPeriod = 0.2; /* as of roiextract, seconds */
  RoiTrial trial = RoiTrial::standard ();
  trial.stereo = stereo;
  trial.settings.cue = cue;
  trial.before = change.before;
  trial.person_learnt = change.at.empty ();
  RoiStage stage (trial);
  require (stage.prepare ());
  require (stage.learn ());
  cv::Mat area = stage.truth () != 0;
  area (change.at) = 255;
  double kept[3], beside[3], lost[3];
  int column = 0;
  for (int i = 1; i <= 100; i++) {
    const double now = 2 + i * kPeriod;
    stage.take (now, true, change.after);
    require (stage.decide ());
    stage.adapt (kAdaptTime);
    if (i != 5 && i != 25 && i != 100)
      continue;
    require (stage.clear ());
    kept[column] = percent (stage.depth () > 0, area);
    stage.take (now + kPeriod / 2, false, change.after);
    require (stage.segment ());
    const cv::Mat person = stage.truth () != 0, found = stage.depth () > 0;
    beside[column] = percent (found, area & ~person);
    lost[column++] = percent (~found, person);
  }
  std::printf ("%-18s %-7s %-7s", change.name, stereo ? "stereo" : "range",
      cue == Cue::kBoth ? "both" : "depth");
  for (const auto &values : {kept, beside, lost})
    std::printf ("  %6.1f %6.1f %6.1f", values[0], values[1], values[2]);
  std::printf ("\n");
}

void
measure (const Room &room, bool stereo, Cue cue, const Job &job)
{
  static const char *const kCues[] = {"both", "colour", "depth"};
  RoiTrial trial = room.trial;
  trial.stereo = stereo;
  trial.settings.cue = cue;
  trial.frames = job.frames;
  RoiStage stage (trial);
  RoiScore score;
  require (run_roi_trial (stage, trial, score));
  std::printf ("%-18s %-7s %-7s %6.4f %6.4f %6.4f %7.2f %% %7.1f %7.1f %5.0f\n", room.name,
      stereo ? "stereo" : "range", kCues[int (cue)], score.worst_iou, score.mean_iou,
      score.mean_mask_iou, 100.0 * double (score.shadow_kept) / double (score.shadow_pixels + 1),
      double (score.outside_kept) / job.frames, double (score.eaten_deep) / job.frames,
      score.eaten);
}

} // namespace

int
main (int argc, char **argv)
{
  Job job;
  Options options ("roi_bench", kUsage);
  options.number ("--frames", job.frames, 1, 1000);
  options.flag ("--changes", job.changes);
  options.text ("--room", job.room);
  options.text ("--depth", job.depth);
  if (const auto status = options.parse (argc, argv))
    return *status;
  const auto chosen = [&job] (const char *name, bool stereo) {
    return (job.room.empty () || job.room == name) &&
           (job.depth.empty () || job.depth == (stereo ? "stereo" : "range"));
  };
  if (job.changes) {
    std::printf ("%-18s %-7s %-7s  %-22s%-22s%s\n", "change", "depth", "cue", "kept, %: 1, 5, 20 s",
        "beside a person, %", "person lost, %");
    for (const Change &change : changes ())
      for (const bool stereo : {false, true})
        for (const Cue cue : {Cue::kBoth, Cue::kDepth})
          if (chosen (change.name, stereo))
            measure_change (change, stereo, cue);
    return 0;
  }
  std::printf ("%-18s %-7s %-7s %6s %6s %6s %9s %7s %7s %5s\n", "room", "depth", "cue", "worst",
      "IoU", "mask", "shadow", "beside", "eaten", "deep");
  for (const Room &room : rooms ())
    for (const bool stereo : {false, true})
      for (const Cue cue : {Cue::kBoth, Cue::kColour, Cue::kDepth})
        if (chosen (room.name, stereo))
          measure (room, stereo, cue, job);
  return 0;
}
