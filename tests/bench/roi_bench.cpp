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

namespace {

const char *const kUsage =
    "usage: roi_bench [--frames N] [--room NAME] [--depth range|stereo]\n"
    "  --frames N         with the person, 1.7 seconds apart (default 12)\n"
    "  --room NAME        only this one (default: all)\n"
    "  --depth WHICH      range (exact with noise) or stereo (default: both)\n"
    "columns: IoU of the valid pixels that are kept with the true mask (worst frame, mean), mean\n"
    "IoU of the decision, share of shadow pixels kept, pixels kept beside the person a frame,\n"
    "pixels a frame missed deeper than 1 pixel inside the silhouette, deepest of them\n";

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
  add ("deep shadow", [] (RoiTrial &t) { t.scene.cast_shadow = 0.7; });
  add ("light swings 25 %", [] (RoiTrial &t) { t.scene.light_drift = 0.25; });
  add ("other clothes", [] (RoiTrial &t) { t.scene.seed = 7; });
  add ("warm wall", [] (RoiTrial &t) { t.scene.wall_warmth = 1; });
  add ("warm plain wall", [] (RoiTrial &t) { t.scene.wall_warmth = 1, t.scene.wall_texture = 0; });
  add ("grey camera", [] (RoiTrial &t) { t.grey = true; });
  add ("exposure 60 %", [] (RoiTrial &t) { t.exposure = 0.6; });
  add ("exposure 150 %", [] (RoiTrial &t) { t.exposure = 1.5; });
  add ("three people", [] (RoiTrial &t) { t.scene.persons = 3, t.scene.distance_m = 1.2; });
  add ("wall out of reach", [] (RoiTrial &t) { t.scene.far_m = 1.3; });
  return all;
}

struct Job {
  int frames = 12;
  std::string room, depth;
};

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
  if (const Status s = run_roi_trial (stage, trial, score); !s.ok ()) {
    std::fprintf (stderr, "roi_bench: %s\n", s.message ().c_str ());
    std::exit (1);
  }
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
  options.text ("--room", job.room);
  options.text ("--depth", job.depth);
  if (const auto status = options.parse (argc, argv))
    return *status;
  std::printf ("%-18s %-7s %-7s %6s %6s %6s %9s %7s %7s %5s\n", "room", "depth", "cue", "worst",
      "IoU", "mask", "shadow", "beside", "eaten", "deep");
  for (const Room &room : rooms ())
    for (const bool stereo : {false, true})
      for (const Cue cue : {Cue::kBoth, Cue::kColour, Cue::kDepth})
        if ((job.room.empty () || job.room == room.name) &&
            (job.depth.empty () || job.depth == (stereo ? "stereo" : "range")))
          measure (room, stereo, cue, job);
  return 0;
}
