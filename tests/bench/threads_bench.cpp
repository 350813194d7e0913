/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What n-threads of the neighbour code saves on one view: its pieces and slices in parallel. */
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <rangecast/neighbourcode/access_unit.hpp>

#include "codec/input.hpp"
#include "options.hpp"

using namespace rangecast;
using namespace bench;

namespace {

const char *const kUsage =
    "usage: threads_bench [--model FILE] [--size WxH] [--threads N] [--rounds N]\n"
    "Codes one rendered view with one thread and with several, in turns, and prints how long that\n"
    "took by the clock. Other work on the machine counts, too: compare what took least.\n"
    "  --model FILE   glTF or OBJ model to render (default: the built-in figure)\n"
    "  --size WxH     of the view (default 640x480)\n"
    "  --threads N    to compare with one (default 2)\n"
    "  --rounds N     times are the least and the medians of so many (default 101)\n";

struct Job {
  SceneSettings scene;
  int threads = 2, rounds = 101;
};

struct Times {
  std::vector<double> encode_ms, decode_ms;
};

double
now_ms ()
{
  return std::chrono::duration<double, std::milli> (
      std::chrono::steady_clock::now ().time_since_epoch ())
      .count ();
}

/* An encoder and a decoder with so many threads. */
class Coder {
public:
  Coder (const EncoderSettings &settings, int threads) : settings_ (settings), threads_ (threads) {}

  Status set_rig (const Rig &rig)
  {
    if (Status s = encoder_.configure (rig, settings_); !s.ok ())
      return s;
    return decoder_.set_rig (rig);
  }

  Status run (ViewPictures &view, Times &times)
  {
    const RangeImage image = view.person.image (view.view_id, view.roi);
    EncoderResult result;
    const double begin = now_ms ();
    if (Status s = encoder_.encode ({&image, 1}, frame_number_++, threads_, result); !s.ok ())
      return s;
    times.encode_ms.push_back (now_ms () - begin);
    bytes_.clear ();
    for (const auto part : encoder_.parts ())
      bytes_.insert (bytes_.end (), part.begin (), part.end ());
    Picture shown (view.roi.width, view.roi.height);
    const RangeImage decoded = shown.image (view.view_id, view.roi);
    DecoderResult counted;
    const double decode_begin = now_ms ();
    decoder_.plan (bytes_, counted);
    if (Status s = decoder_.decode ({&decoded, 1}, threads_, counted); !s.ok ())
      return s;
    times.decode_ms.push_back (now_ms () - decode_begin);
    return {};
  }

private:
  AccessUnitEncoder encoder_;
  AccessUnitDecoder decoder_;
  EncoderSettings settings_;
  int threads_;
  std::uint32_t frame_number_ = 0;
  std::vector<std::uint8_t> bytes_;
};

void
print_row (const char *name, const char *what, std::vector<double> one, std::vector<double> several)
{
  std::ranges::sort (one);
  std::ranges::sort (several);
  const double a = one[0], b = several[0], c = one[one.size () / 2],
               d = several[several.size () / 2];
  std::printf (
      "%-18s %-6s %9.3f %9.3f %6.2f %12.3f %9.3f %6.2f\n", name, what, a, b, a / b, c, d, c / d);
}

Status
measure (const Job &job, Input &input, const EncoderSettings &settings, const char *name)
{
  Coder one (settings, 1), several (settings, job.threads);
  for (Coder *coder : {&one, &several})
    if (Status s = coder->set_rig (input.rig); !s.ok ())
      return s;
  Times of_one, of_several;
  for (int round = 0; round < job.rounds; round++)
    for (FrameSet &set : input.sets) {
      if (Status s = one.run (set[0], of_one); !s.ok ())
        return s;
      if (Status s = several.run (set[0], of_several); !s.ok ())
        return s;
    }
  print_row (name, "encode", of_one.encode_ms, of_several.encode_ms);
  print_row (name, "decode", of_one.decode_ms, of_several.decode_ms);
  return {};
}

Status
run (const Job &job)
{
  Input input;
  if (Status s = render_input (job.scene, 2, 0, input); !s.ok ())
    return s;
  std::printf ("%-18s %-6s %29s %29s\n%-25s %9s %6d %9s %12s %6d %9s\n", "", "", "least ms",
      "median ms", "threads", "1", job.threads, "times", "1", job.threads, "times");
  const char *const names[] = {"plain", "packed", "entropy"};
  for (const bool temporal : {false, true})
    for (int i = 0; i < 3; i++) {
      EncoderSettings settings;
      settings.profile = static_cast<Profile> (i);
      settings.temporal = temporal;
      const std::string name = names[i] + std::string (temporal ? ", temporal" : "");
      if (Status s = measure (job, input, settings, name.c_str ()); !s.ok ())
        return s;
    }
  return {};
}

} // namespace

int
main (int argc, char **argv)
{
  Job job;
  job.scene.noise_sigma = 1.5;
  job.scene.width = 640;
  job.scene.height = 480;
  Options options ("threads_bench", kUsage);
  options.text ("--model", job.scene.model);
  options.size ("--size", job.scene.width, job.scene.height, 16, 4096);
  options.number ("--threads", job.threads, 1, 64);
  options.number ("--rounds", job.rounds, 1, 100000);
  if (const auto status = options.parse (argc, argv))
    return *status;
  if (const Status s = run (job); !s.ok ()) {
    std::fprintf (stderr, "threads_bench: %s\n", s.message ().c_str ());
    return 1;
  }
  return 0;
}
