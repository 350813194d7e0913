/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* network_bench: what arrives through a bad network, without help, with FEC and with
 * retransmission. */
#include "../options.hpp"
#include "run.hpp"

#include <gst/gst.h>

#include <cmath>
#include <cstdio>

namespace {

const char *const kUsage =
    "usage: network_bench [options]\n"
    "Sends frame sets of the built-in figure through a bad network to a receiver, in real time, "
    "and\n"
    "compares every pixel that arrives with the sender's decoded one. Ends with status 1 if a "
    "point is\n"
    "wrong. One line of JSON a run.\n"
    "  --table WHAT       faults: every fault with every kind of stream; help: losses without "
    "help, with\n"
    "                     FEC, with retransmission; as Markdown (and --json)\n"
    "  --json             with --table: JSON lines instead\n"
    "  --encoder WHAT     properties of neighbourcodeenc (default profile=entropy)\n"
    "  --fec PERCENT      (default 0: none)\n"
    "  --rtx              retransmission\n"
    "  --feedback         the receiver may ask for key frame sets\n"
    "  --views N, --size WxH, --fps N, --frames N  (default 4, 320x240, 15, 100)\n"
    "  --jitter-buffer MS (default 60)\n"
    "  --network-delay MS each way (default 5)\n";

void
print_json (const NetworkCase &c, const NetworkResult &r)
{
  std::printf (
      "{\"fault\": \"%s\", \"encoder\": \"%s\", \"fec\": %d, \"rtx\": %s, \"feedback\": %s, "
      "\"sent\": %d, \"received\": %d, \"points_share\": %.4f, \"whole_share\": %.4f, "
      "\"wrong_points\": %lld, \"freeze_ms\": %.1f, \"recovery_ms\": %.1f, "
      "\"latency_p50_ms\": %.1f, \"latency_p99_ms\": %.1f, \"media_kbit\": %.0f, "
      "\"extra_share\": %.4f, \"packets\": %llu, \"lost\": %llu, \"twice\": %llu, \"held_back\": "
      "%llu}\n",
      c.name.c_str (), c.encoder.c_str (), c.fec_percent, c.rtx ? "true" : "false",
      c.feedback ? "true" : "false", r.sent, r.received, r.points_share, r.whole_share,
      r.wrong_points, r.freeze_ms, r.recovery_ms, r.latency_p50_ms, r.latency_p99_ms, r.media_kbit,
      r.extra_share, (unsigned long long)r.network.in, (unsigned long long)r.network.lost,
      (unsigned long long)r.network.duplicated, (unsigned long long)r.network.held_back);
  std::fflush (stdout);
}

std::string
recovery_text (const NetworkResult &r)
{
  return r.recovery_ms < 0 ? "not in time" : std::to_string (std::lround (r.recovery_ms)) + " ms";
}

std::vector<NetworkCase>
faults (const NetworkCase &base)
{
  std::vector<NetworkCase> cases;
  const auto add = [&] (const char *name, auto set) {
    cases.push_back (base);
    cases.back ().name = name;
    set (cases.back ().faults);
  };
  add ("none", [] (FaultSettings &) {});
  add ("1 % lost", [] (FaultSettings &f) { f.loss = 0.01; });
  add ("5 % lost", [] (FaultSettings &f) { f.loss = 0.05; });
  add ("20 % lost", [] (FaultSettings &f) { f.loss = 0.2; });
  add ("5 % lost, 20 in a row", [] (FaultSettings &f) { f.loss = 0.05, f.burst = 20; });
  add ("10 % late by 10 packets", [] (FaultSettings &f) { f.reorder = 0.1; });
  add ("20 % twice", [] (FaultSettings &f) { f.duplicate = 0.2; });
  add ("jitter of 50 ms", [] (FaultSettings &f) { f.jitter_ns = 50'000'000; });
  return cases;
}

struct Kind {
  const char *name, *encoder;
  int fec;
  bool rtx, feedback;
};

const Kind kStreams[] = {
    {"packed", "profile=packed", 0, false, false},
    {"entropy", "profile=entropy", 0, false, false},
    {"temporal", "profile=entropy temporal=true", 0, false, false},
    {"temporal, may ask", "profile=entropy temporal=true", 0, false, true},
};
const Kind kHelps[] = {
    {"nothing", "profile=entropy", 0, false, false},
    {"FEC 20 %", "profile=entropy", 20, false, false},
    {"FEC 50 %", "profile=entropy", 50, false, false},
    {"retransmission", "profile=entropy", 0, true, false},
    {"both (20 %)", "profile=entropy", 20, true, false},
};

/* @return whether every point was right */
bool
table (const NetworkCase &base, std::span<const Kind> kinds, bool only_losses, bool json)
{
  bool right = true;
  if (!json)
    std::printf (
        "| network | %s | points | whole frame sets | wrong points | longest freeze | recovery | "
        "latency p50, p99 | more bytes |\n|---|---|---|---|---|---|---|---|---|\n",
        only_losses ? "help" : "stream");
  for (NetworkCase c : faults (base))
    for (const Kind &kind : kinds) {
      if (only_losses && c.faults.loss == 0)
        continue;
      c.encoder = kind.encoder;
      c.fec_percent = kind.fec;
      c.rtx = kind.rtx;
      c.feedback = kind.feedback;
      NetworkResult r;
      if (!run_network_case (c, r))
        return false;
      right = right && r.wrong_points == 0;
      if (json)
        print_json (c, r);
      else
        std::printf ("| %s | %s | %.1f %% | %.0f %% | %lld | %.0f ms | %s | %.0f, %.0f ms | "
                     "%.0f %% |\n",
            c.name.c_str (), kind.name, 100 * r.points_share, 100 * r.whole_share, r.wrong_points,
            r.freeze_ms, recovery_text (r).c_str (), r.latency_p50_ms, r.latency_p99_ms,
            100 * r.extra_share);
      std::fflush (stdout);
    }
  return right;
}

} // namespace

int
main (int argc, char **argv)
{
  gst_init (nullptr, nullptr);
  NetworkCase c;
  c.name = "given";
  c.encoder = "profile=entropy";
  std::string which;
  bool json = false;
  Options options ("network_bench", std::string (kUsage) + kFaultOptions);
  options.value ("--table", [&] (const std::string &value) {
    which = value;
    return std::string (value == "faults" || value == "help" ? "" : "faults or help");
  });
  options.flag ("--json", json);
  options.text ("--encoder", c.encoder);
  options.number ("--fec", c.fec_percent, 0, 100);
  options.flag ("--rtx", c.rtx);
  options.flag ("--feedback", c.feedback);
  options.number ("--views", c.views, 1, 16);
  options.size ("--size", c.width, c.height, 16, 2048);
  options.number ("--fps", c.fps, 1, 120);
  options.number ("--frames", c.frames, kQuietFrames + kRecoveryFrames + 4, 2000);
  options.number ("--jitter-buffer", c.jitter_buffer_ms, 0, 5000);
  options.number ("--network-delay", c.delay_ms, 0, 1000);
  for (const char *name : {"--loss", "--burst", "--duplicate", "--reorder", "--reorder-by",
           "--delay", "--jitter", "--bandwidth", "--seed"})
    options.value (name, [&c, name] (const std::string &value) {
      std::string problem;
      read_fault_option (name, value, c.faults, problem);
      return problem;
    });
  if (const auto status = options.parse (argc, argv))
    return *status;
  if (which == "faults")
    return !table (c, kStreams, false, json);
  if (which == "help")
    return !table (c, kHelps, true, json);
  NetworkResult result;
  if (!run_network_case (c, result))
    return 2;
  print_json (c, result);
  return result.wrong_points ? 1 : 0;
}
