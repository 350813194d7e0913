/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What a parent host costs: recorded streams in real time over UDP into parent-host.sh's pipeline.
 * Its peer, in the same run, only hands the same packets on. */
#include <gst/gst.h>

#include <cstdio>

#include "../options.hpp"
#include "measure.hpp"
#include "report.hpp"

using namespace bench;
using rangecast::Status;

namespace {

const char *const kUsage =
    "usage: parent_bench --parent FILE --recording FILE [--recording FILE...] [options]\n"
    "Sends recordings of neighbourcodeparse, as many camera hosts as they have views, in real "
    "time\n"
    "over UDP to parent-host.sh, and takes what that sends on. CPU is that of the parent's "
    "process\n"
    "with the kernel's work for it; latency is from sending a frame set to its last packet at the\n"
    "viewer. Peers: udpsrc ! rtpjitterbuffer ! udpsink for each view; udpsrc ! multiudpsink.\n"
    "  --parent FILE     parent-host.sh\n"
    "  --recording FILE  byte stream with all views; a row each\n"
    "  --fps N           frame sets a second (default 30)\n"
    "  --seconds N       that count, after one to get ready (default 5)\n"
    "  --port N          first of the UDP ports (default 27100)\n"
    "  --relay N         also a relay with one viewer and with N, for the last recording\n"
    "  --viewer          also what decoding and cylinderfilter cost a viewer\n"
    "  --draw            and striprender, into a picture of 640x480\n"
    "  --json FILE       write all of it there, too\n";

struct Job {
  Settings settings;
  std::vector<std::string> recordings;
  std::string json;
  int relay = 0;
  bool viewer = false, draw = false;
};

Status
run (Job &job, std::vector<Row> &rows, std::vector<ViewerRow> &viewers)
{
  Recording recording;
  for (const std::string &path : job.recordings) {
    if (Status s = read_recording (path, recording); !s.ok ())
      return s;
    for (const auto measure_one : {measure_parent, measure_peer})
      if (Status s = measure_one (recording, job.settings, rows.emplace_back ()); !s.ok ())
        return s;
    if (!job.viewer && !job.draw)
      continue;
    viewers.push_back ({int (recording.views.size ())});
    if (Status s = measure_viewer (path, job.draw, viewers.back ()); !s.ok ())
      return s;
  }
  for (const int n : {1, job.relay})
    if (job.relay > 0)
      if (Status s = measure_relay (recording, n, job.settings, rows.emplace_back ()); !s.ok ())
        return s;
  return {};
}

} // namespace

int
main (int argc, char **argv)
{
  Job job;
  job.settings.parent.clear ();
  Options options ("parent_bench", kUsage);
  options.text ("--parent", job.settings.parent);
  options.value ("--recording", [&] (const std::string &value) -> std::string {
    job.recordings.push_back (value);
    return value.empty () ? "a file" : "";
  });
  options.number ("--fps", job.settings.fps, 1, 1000);
  options.number ("--seconds", job.settings.seconds, 1, 3600);
  options.number ("--port", job.settings.port, 1024, 65000);
  options.number ("--relay", job.relay, 1, 1000);
  options.flag ("--viewer", job.viewer);
  options.flag ("--draw", job.draw);
  options.text ("--json", job.json);
  if (const auto status = options.parse (argc, argv))
    return *status;
  if (job.settings.parent.empty () || job.recordings.empty ())
    return options.refuse ("expected --parent FILE and --recording FILE");
  gst_init (nullptr, nullptr);
  std::vector<Row> rows;
  std::vector<ViewerRow> viewers;
  Status status = run (job, rows, viewers);
  if (status.ok ()) {
    print_rows (rows);
    print_viewers (viewers);
    if (!job.json.empty ())
      status = write_json (job.json, rows, viewers);
  }
  if (!status.ok ())
    std::fprintf (stderr, "parent_bench: %s\n", status.message ().c_str ());
  return status.ok () ? 0 : 1;
}
