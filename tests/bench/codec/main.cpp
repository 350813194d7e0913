/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The neighbour code beside RVL + JPEG, on the same pixels in the same run.
 * docs/guide/settings.md says how to read it. */
#include <cstdio>
#include <opencv2/core/utils/logger.hpp>

#include "../options.hpp"
#include "measure.hpp"

using namespace rangecast;
using namespace bench;

namespace {

const char *const kUsage =
    "usage: codec_bench --color FILE --depth FILE [--mask FILE] [--color FILE --depth FILE ...]\n"
    "                   [--sequence] [--depth-unit METRES] [--near METRES] [--far METRES]\n"
    "       codec_bench --recording FILE [--skip N] [--frames N]\n"
    "       codec_bench [--model FILE] [--size WxH] [--frames N] [--noise LEVELS]\n"
    "                   [--depth-noise MM]\n"
    "       with any of them: [--rounds N] [--try \"PROPERTY=VALUE ...\"] [--only TEXT]\n"
    "                         [--json FILE]\n"
    "Codes frame sets with every profile of the neighbour code and with its peer, and prints\n"
    "size, quality and time of each. Frame sets are pictures, a recording, or rendered.\n"
    "  --color FILE       colour picture; what follows it belongs to the same view\n"
    "  --depth FILE       its depth: 16 bits, one channel, 0 = none\n"
    "  --mask FILE        8 bits, non-zero = keep (default: all pixels that have depth)\n"
    "  --sequence         the pairs are frame sets of one view in order of time; without it, they\n"
    "                     are the views of one frame set. Only where there are several frame sets\n"
    "                     (this, --recording, --frames) temporal profiles run, too: they refer to\n"
    "                     the frame set before, the first one is a key one\n"
    "  --depth-unit M     metres that a depth of 1 is (default 0.001)\n"
    "  --near M, --far M  depths outside are cleared, and depth codes lie between (default: the\n"
    "                     least and the greatest depth of the pictures)\n"
    "  --recording FILE   recording of neighbourcodeenc, coded without loss for "
    "preference:\n"
    "                     depth-bits=16 depth-threshold=0 colour-threshold=0\n"
    "  --skip N           frame sets at its beginning to leave out (default 0)\n"
    "  --model FILE       glTF model to render (default: the built-in figure)\n"
    "  --size WxH         of each of its four views (default 320x240)\n"
    "  --noise LEVELS     of its colours, standard deviation in grey levels (default 1.5)\n"
    "  --depth-noise MM   of its depth, standard deviation (default 0)\n"
    "  --frames N         frame sets to render, 30 a second (default 1), or to read of a "
    "recording\n"
    "                     (default all). With temporal, take 30 or more: the first costs most, "
    "and\n"
    "                     all pixels are refreshed within a second\n"
    "  --rounds N         times are medians of so many (default 11)\n"
    "  --try \"P=V ...\"    also run these properties of neighbourcodeenc, as in "
    "\"profile=entropy\n"
    "                     temporal=true\"; may be repeated\n"
    "  --only TEXT        only codecs with TEXT in their names (temporal: ', temporal'), and\n"
    "                     RVL + JPEG; \"RVL + JPEG\": nothing else\n"
    "  --json FILE        also write all rows as an array of objects\n"
    "Sizes and times are of a frame set, all views, one thread, means over frame sets.\n";

struct Job {
  FileSettings files;
  SceneSettings scene;
  std::string recording, json, only;
  std::vector<EncoderSettings> tries;
  double depth_noise_mm = 0;
  int skip = 0, frames = 0, rounds = 11;
};

/* A name of a file for the pair it belongs to: the first of its kind after another begins a new one
 */
Options::Take
pair_taker (std::vector<PictureFiles> &pairs, std::string PictureFiles::*which)
{
  return [&pairs, which] (const std::string &value) -> std::string {
    if (value.empty ())
      return "a file";
    if (pairs.empty () || !(pairs.back ().*which).empty ())
      pairs.emplace_back ();
    pairs.back ().*which = value;
    return {};
  };
}

void
add_options (Options &options, Job &job)
{
  options.value ("--color", pair_taker (job.files.pairs, &PictureFiles::colour));
  options.value ("--depth", pair_taker (job.files.pairs, &PictureFiles::depth));
  options.value ("--mask", pair_taker (job.files.pairs, &PictureFiles::mask));
  options.flag ("--sequence", job.files.sequence);
  options.number ("--depth-unit", job.files.depth_unit_m, 1e-6, 1.0);
  options.number ("--near", job.files.near_m, 1e-6, 1e5);
  options.number ("--far", job.files.far_m, 1e-6, 1e5);
  options.text ("--recording", job.recording);
  options.text ("--model", job.scene.model);
  options.size ("--size", job.scene.width, job.scene.height, 16, 4096);
  options.number ("--noise", job.scene.noise_sigma, 0.0, 20.0);
  options.number ("--depth-noise", job.depth_noise_mm, 0.0, 1000.0);
  options.number ("--skip", job.skip, 0, 1000000);
  options.number ("--frames", job.frames, 1, 10000);
  options.number ("--rounds", job.rounds, 1, 100000);
  options.text ("--only", job.only);
  options.text ("--json", job.json);
  options.value ("--try", [&job] (const std::string &value) {
    return read_settings (value, job.tries.emplace_back ());
  });
}

/* @return what is wrong with the options together */
std::string
find_contradiction (const Job &job)
{
  const FileSettings &files = job.files;
  for (const PictureFiles &pair : files.pairs) {
    const std::string &name = !pair.colour.empty ()  ? pair.colour
                              : !pair.depth.empty () ? pair.depth
                                                     : pair.mask;
    if (pair.colour.empty () || pair.depth.empty ())
      return name + ": expected --color and --depth in pairs, then the --mask of the pair";
  }
  if (!files.pairs.empty () + !job.recording.empty () + !job.scene.model.empty () > 1)
    return "expected one of --color with --depth, --recording, and --model";
  if (files.pairs.empty () && (files.sequence || files.near_m > 0 || files.far_m > 0))
    return "--sequence, --near and --far: expected together with --color and --depth";
  if (!files.pairs.empty () && job.frames)
    return "--frames: expected with --recording, --model or nothing; pictures come one by one";
  if (job.skip && job.recording.empty ())
    return "--skip: expected with --recording";
  if (files.near_m > 0 && files.far_m > 0 && files.near_m + files.depth_unit_m > files.far_m)
    return "--near and --far: expected --far to be greater, by a --depth-unit or more";
  if (files.far_m > 65535 * files.depth_unit_m)
    return "--far: expected at most 65535 times --depth-unit";
  return {};
}

Status
load (const Job &job, Input &input)
{
  if (!job.files.pairs.empty ())
    return load_pictures (job.files, input);
  if (!job.recording.empty ())
    return load_recording (job.recording, job.skip, job.frames ? job.frames : 10000, input);
  return render_input (job.scene, job.frames ? job.frames : 1, job.depth_noise_mm, input);
}

/* @return what is wrong with --only, if anything */
std::string
check_only (const Job &job, const Codecs &codecs)
{
  std::string names;
  for (std::size_t i = 0; i < codecs.size (); i++) {
    const std::string &name = codecs[i]->name ();
    if (name.find (job.only) != std::string::npos)
      return {};
    if (i == 0 || name != codecs[i - 1]->name ())
      names += (names.empty () ? "'" : ", '") + name + "'";
  }
  return "--only " + job.only + ": no such codec, expected part of one of " + names;
}

Status
make_codecs (const Job &job, const Input &input, Codecs &codecs)
{
  const Rig &rig = input.rig;
  add_peers (codecs);
  if (Status s = add_profiles (rig, input.sets.size () > 1, codecs); !s.ok ())
    return s;
  if (const std::string wrong = check_only (job, codecs); !wrong.empty ())
    return {StatusCode::kUnsupported, wrong};
  std::erase_if (codecs, [&] (const std::unique_ptr<Codec> &codec) {
    return codec->name ().find (job.only) == std::string::npos &&
           !codec->name ().starts_with (kPeerName);
  });
  for (const EncoderSettings &settings : job.tries)
    if (Status s = make_neighbour_code (rig, settings, codecs.emplace_back ()); !s.ok ())
      return s;
  return {};
}

Status
run (const Job &job)
{
  Input input;
  if (Status s = load (job, input); !s.ok ())
    return s;
  const View &first = input.rig.views[0];
  const auto sets = double (input.sets.size ());
  std::printf (
      "%s: frame sets: %zu, views: %zu of %dx%d, valid pixels a frame set: %.0f, depth %.4g to "
      "%.4g m in units of %g mm\n",
      input.name.c_str (), input.sets.size (), input.rig.views.size (), first.width, first.height,
      double (count_points (input)) / sets, first.near_m, first.far_m, first.depth_unit_m * 1e3);
  Codecs codecs;
  if (Status s = make_codecs (job, input, codecs); !s.ok ())
    return s;
  std::fflush (stdout);
  std::vector<Row> rows;
  if (Status s = measure (input, codecs, job.rounds, rows); !s.ok ())
    return s;
  print_rows (rows);
  return job.json.empty () ? Status{} : write_json (job.json, rows);
}

} // namespace

int
main (int argc, char **argv)
{
  cv::utils::logging::setLogLevel (cv::utils::logging::LOG_LEVEL_SILENT); /* we say it ourselves */
  Job job;
  job.scene.noise_sigma = 1.5;
  Options options ("codec_bench", kUsage);
  add_options (options, job);
  if (const auto status = options.parse (argc, argv))
    return *status;
  if (const std::string wrong = find_contradiction (job); !wrong.empty ())
    return options.refuse (wrong);
  if (const Status s = run (job); !s.ok ()) {
    std::fprintf (stderr, "codec_bench: %s\n", s.message ().c_str ());
    return s.message ().starts_with ("--only") ? 2 : 1;
  }
  return 0;
}
