/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "measure.hpp"

#include <arpa/inet.h>
#include <gst/gst.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <map>
#include <rangecast/neighbourcode/bitstream/unit.hpp>

#include "process.hpp"
#include "traffic.hpp"

using rangecast::Status;
using rangecast::StatusCode;

namespace bench {
namespace {

using Command = std::vector<std::string>;

constexpr double kWarmUpSeconds = 1, kStartSeconds = 20;
const char *const kCaps =
    "caps=application/x-rtp,media=video,clock-rate=90000,encoding-name=X-NEIGHBOUR-CODE";

void
sleep_s (double seconds)
{
  usleep (useconds_t (seconds * 1e6));
}

/* A part of the time, and what the process had used at its ends. */
struct Window {
  std::uint64_t begin_ns, end_ns;
  double cpu_ms, rss_mib;
};

Status
wait_for_packets (const Process &process, const Viewer &viewer)
{
  for (double waited = 0; !viewer.has_any (); waited += 0.05) {
    if (!process.runs ())
      return {StatusCode::kBadData, "ended at once: " + process.said ()};
    if (waited > kStartSeconds)
      return {StatusCode::kBadData, "nothing came out within 20 s: " + process.said ()};
    sleep_s (0.05);
  }
  return {};
}

double
percentile (std::vector<double> &sorted, double share)
{
  if (sorted.empty ())
    return 0;
  return sorted[std::size_t (share * double (sorted.size () - 1))];
}

/* Frame sets that were sent within the window, and what came of them. */
void
sum_up (const Window &window, const std::vector<CameraHosts::Sent> &sent,
    const std::vector<Viewer::Arrival> &arrivals, double fps, Row &row)
{
  struct Came {
    std::uint32_t slices = 0;
    std::uint64_t last_ns = 0;
  };
  std::map<std::uint64_t, Came> came;
  for (const Viewer::Arrival &a : arrivals) {
    Came &c = came[a.capture_ns];
    c.slices += a.slices;
    c.last_ns = std::max (c.last_ns, a.arrival_ns);
  }
  std::vector<double> latencies;
  double slices = 0, received = 0, sets = 0, packets = 0;
  for (const CameraHosts::Sent &s : sent) {
    if (s.capture_ns < window.begin_ns || s.capture_ns >= window.end_ns)
      continue;
    const Came &c = came[s.capture_ns];
    slices += s.slices;
    packets += s.packets;
    received += std::min (c.slices, s.slices);
    sets++;
    if (c.slices > 0)
      latencies.push_back (double (c.last_ns - s.sent_ns) / 1e6);
  }
  std::ranges::sort (latencies);
  row.p50_ms = percentile (latencies, 0.5);
  row.p99_ms = percentile (latencies, 0.99);
  row.lost = slices > 0 ? 1 - received / slices : 1;
  row.packets_per_set = sets > 0 ? packets / sets : 0;
  row.cpu_ms = window.cpu_ms / (double (window.end_ns - window.begin_ns) / 1e9 * fps);
  row.rss_mib = window.rss_mib;
}

/* Runs a process between camera hosts and a viewer, which must be open. */
Status
measure (const Command &command, Recording &recording, int first_port, Viewer &viewer,
    const Settings &settings, Row &row)
{
  Process process (command);
  CameraHosts hosts (recording, settings.fps, first_port);
  Status status = hosts.start ();
  if (status.ok ())
    status = wait_for_packets (process, viewer);
  if (!status.ok ())
    return {status.code (), command[0] + ": " + status.message ()};
  sleep_s (kWarmUpSeconds);
  Window window = {now_ns (), 0, process.cpu_ms (), 0};
  sleep_s (settings.seconds);
  window.cpu_ms = process.cpu_ms () - window.cpu_ms;
  window.rss_mib = process.memory_mib ();
  window.end_ns = now_ns ();
  const auto sent = hosts.sent ();
  sleep_s (0.3); /* what is on its way */
  hosts.stop ();
  viewer.stop ();
  row.views = int (recording.views.size ());
  row.mbit_per_s = recording.bytes_per_frame () * 8 * settings.fps / 1e6;
  row.sender_ms = hosts.worst_delay_ms ();
  sum_up (window, sent, viewer.arrivals (), settings.fps, row);
  return {};
}

std::string
local (int port)
{
  return "127.0.0.1:" + std::to_string (port);
}

/* Sockets that nobody reads: what a relay sends there costs it as much as what is read. */
class Silent {
public:
  explicit Silent (int count)
  {
    const int small = 2048;
    for (int i = 0; i < count; i++) {
      const int s = socket (AF_INET, SOCK_DGRAM, 0);
      sockaddr_in address = {};
      socklen_t length = sizeof address;
      address.sin_family = AF_INET;
      address.sin_addr.s_addr = htonl (INADDR_LOOPBACK);
      if (s < 0 || bind (s, reinterpret_cast<sockaddr *> (&address), length) < 0 ||
          getsockname (s, reinterpret_cast<sockaddr *> (&address), &length) < 0)
        continue;
      (void)setsockopt (s, SOL_SOCKET, SO_RCVBUF, &small, sizeof small);
      sockets_.push_back (s);
      clients += "," + local (ntohs (address.sin_port));
    }
  }
  ~Silent ()
  {
    for (const int s : sockets_)
      close (s);
  }
  Silent (const Silent &) = delete;
  Silent &operator= (const Silent &) = delete;

  std::string clients;

private:
  std::vector<int> sockets_;
};

double
process_cpu_ms ()
{
  timespec t;
  clock_gettime (CLOCK_PROCESS_CPUTIME_ID, &t);
  return double (t.tv_sec) * 1e3 + double (t.tv_nsec) / 1e6;
}

struct Counted {
  bool begins = false; /* the first frame set with pixels is on its way */
  int frames = 0;
  double first_ms = 0, last_ms = 0;
};

GstPadProbeReturn
count (GstPad *, GstPadProbeInfo *, gpointer data)
{
  auto counted = static_cast<Counted *> (data);
  counted->last_ms = process_cpu_ms ();
  if (counted->begins && counted->frames++ == 0)
    counted->first_ms = counted->last_ms;
  return GST_PAD_PROBE_OK;
}

/* Backgrounds are learnt from frame sets of which nothing is left: at most 64 empty slices. */
GstPadProbeReturn
look_for_pixels (GstPad *, GstPadProbeInfo *info, gpointer data)
{
  if (gst_buffer_get_size (GST_PAD_PROBE_INFO_BUFFER (info)) > 64 * rangecast::kSliceHeaderSize)
    static_cast<Counted *> (data)->begins = true;
  return GST_PAD_PROBE_OK;
}

void
add_probe (GstElement *pipeline, const char *name, const char *pad_name, GstPadProbeCallback probe,
    Counted &counted)
{
  GstElement *element = gst_bin_get_by_name (GST_BIN (pipeline), name);
  GstPad *pad = gst_element_get_static_pad (element, pad_name);
  gst_pad_add_probe (pad, GST_PAD_PROBE_TYPE_BUFFER, probe, &counted, nullptr);
  gst_object_unref (pad);
  gst_object_unref (element);
}

/* CPU ms a frame set of a launch string that ends in an element named sink. The first frame set is
 * for getting ready. */
Status
cost_of (const std::string &launch, double &ms)
{
  GError *error = nullptr;
  GstElement *pipeline = gst_parse_launch (launch.c_str (), &error);
  if (!pipeline || error) {
    const std::string text = error ? error->message : "no pipeline";
    g_clear_error (&error);
    return {StatusCode::kNotFound, text};
  }
  Counted counted;
  add_probe (pipeline, "parse", "src", look_for_pixels, counted);
  add_probe (pipeline, "sink", "sink", count, counted);
  gst_element_set_state (pipeline, GST_STATE_PLAYING);
  GstBus *bus = gst_element_get_bus (pipeline);
  GstMessage *message = gst_bus_timed_pop_filtered (
      bus, 300 * GST_SECOND, GstMessageType (GST_MESSAGE_EOS | GST_MESSAGE_ERROR));
  const bool good = message && GST_MESSAGE_TYPE (message) == GST_MESSAGE_EOS;
  if (message)
    gst_message_unref (message);
  gst_object_unref (bus);
  gst_element_set_state (pipeline, GST_STATE_NULL);
  gst_object_unref (pipeline);
  if (!good || counted.frames < 2)
    return {StatusCode::kBadData, "no frame sets from: " + launch};
  ms = (counted.last_ms - counted.first_ms) / (counted.frames - 1);
  return {};
}

} // namespace

Status
measure_parent (Recording &recording, const Settings &settings, Row &row)
{
  Viewer viewer;
  if (Status s = viewer.open (); !s.ok ())
    return s;
  row.what = "parent";
  const Command command = {settings.parent, "--views", std::to_string (recording.views.size ()),
      "--listen", std::to_string (settings.port), "--to", local (viewer.port ())};
  return measure (command, recording, settings.port, viewer, settings, row);
}

Status
measure_peer (Recording &recording, const Settings &settings, Row &row)
{
  Viewer viewer;
  if (Status s = viewer.open (); !s.ok ())
    return s;
  row.what = "peer";
  Command command = {"gst-launch-1.0", "-q"};
  for (std::size_t i = 0; i < recording.views.size (); i++)
    for (const std::string &word :
        {std::string ("udpsrc"), "port=" + std::to_string (settings.port + int (i)),
            std::string ("reuse=false"), std::string ("buffer-size=1048576"), std::string (kCaps),
            std::string ("!"), std::string ("rtpjitterbuffer"), std::string ("latency=30"),
            std::string ("!"), std::string ("udpsink"), std::string ("host=127.0.0.1"),
            "port=" + std::to_string (viewer.port ()), std::string ("sync=false"),
            std::string ("async=false")})
      command.push_back (word);
  return measure (command, recording, settings.port, viewer, settings, row);
}

Status
measure_relay (Recording &recording, int viewers, const Settings &settings, Row &row)
{
  Viewer viewer;
  if (Status s = viewer.open (); !s.ok ())
    return s;
  const Silent others (viewers - 1);
  row.what = "relay";
  row.viewers = viewers;
  Recording one = recording; /* the packets of all views, as the parent sends them */
  for (std::size_t v = 1; v < one.views.size (); v++)
    for (std::size_t f = 0; f < one.frames (); f++)
      one.views[0][f].insert (
          one.views[0][f].end (), one.views[v][f].begin (), one.views[v][f].end ());
  one.views.resize (1);
  const Command command = {"gst-launch-1.0", "-q", "udpsrc",
      "port=" + std::to_string (settings.port), "reuse=false", "buffer-size=4194304", kCaps, "!",
      "multiudpsink", "sync=false", "async=false",
      "clients=" + local (viewer.port ()) + others.clients};
  const Status status = measure (command, one, settings.port, viewer, settings, row);
  row.views = int (recording.views.size ());
  return status;
}

Status
measure_viewer (const std::string &path, bool draw, ViewerRow &row)
{
  const std::string source = "filesrc location=\"" + path + "\" ! neighbourcodeparse name=parse ! ";
  const std::string end = "fakesink name=sink sync=false";
  double read = 0, decode = 0, cylinder = 0, drawn = 0;
  if (Status s = cost_of (source + end, read); !s.ok ())
    return s;
  if (Status s = cost_of (source + "neighbourcodedec ! " + end, decode); !s.ok ())
    return s;
  if (Status s = cost_of (source + "neighbourcodedec ! cylinderfilter ! " + end, cylinder);
      !s.ok ())
    return s;
  if (draw)
    if (Status s = cost_of (source +
                                "neighbourcodedec ! cylinderfilter ! striprender ! "
                                "video/x-raw(memory:GLMemory),width=640,height=480 ! " +
                                end,
            drawn);
        !s.ok ())
      return s;
  row.decode_ms = decode - read;
  row.cylinder_ms = cylinder - decode;
  row.draw_ms = draw ? drawn - cylinder : 0;
  return {};
}

} // namespace bench
