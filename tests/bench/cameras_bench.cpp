/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What it costs to take in a pair of GigE Vision cameras, by stereocamsrc and by two aravissrc. The
 * cameras are a process of their own on this machine. */
#include <dlfcn.h>
#include <gst/gst.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "simulators/gige-camera.hpp"
#include <algorithm>
#include <atomic>
#include <csignal>
#include <cstdio>
#include <string>
#include <vector>

#include "options.hpp"

namespace {

const char *const kUsage =
    "usage: cameras_bench [--size WxH] [--fps N] [--seconds N] [--rounds N] [--mono]\n"
    "Takes in two GigE Vision cameras of this machine in several ways, in turns. Prints pictures "
    "sent\n"
    "and received, CPU time of the receiving process, and what it copied.\n"
    "  --size WxH     of the pictures (default 640x480)\n"
    "  --fps N        pairs a second (default 60)\n"
    "  --seconds N    of each run (default 10)\n"
    "  --rounds N     runs of each way (default 3)\n"
    "  --mono         Mono8 instead of RGB8\n";

struct Job {
  int width = 640, height = 480, fps = 60, seconds = 10, rounds = 3;
  bool mono = false;

  [[nodiscard]] std::size_t picture_bytes () const
  {
    return std::size_t (width) * height * (mono ? 1 : 3);
  }
};

/* ---- copies ---- */

std::size_t big_copy = ~std::size_t (0); /* bytes from which on it is one of a picture */
std::atomic<std::uint64_t> copied_bytes{0}, big_copies{0};

void
note_copy (std::size_t bytes)
{
  copied_bytes.fetch_add (bytes, std::memory_order_relaxed);
  if (bytes >= big_copy)
    big_copies.fetch_add (1, std::memory_order_relaxed);
}

using Copy = void *(*)(void *, const void *, std::size_t);
std::atomic<Copy> real_memcpy{nullptr}, real_memmove{nullptr};

Copy
find (std::atomic<Copy> &cache, const char *name)
{
  Copy copy = cache.load (std::memory_order_relaxed);
  if (!copy) {
    copy = reinterpret_cast<Copy> (dlsym (RTLD_NEXT, name));
    cache = copy;
  }
  return copy;
}

} // namespace

/* All libraries of the process call these: what the compiler did not put in place is counted. */
extern "C" void *
memcpy (void *to, const void *from, std::size_t bytes) noexcept
{
  note_copy (bytes);
  return find (real_memcpy, "memcpy") (to, from, bytes);
}

extern "C" void *
memmove (void *to, const void *from, std::size_t bytes) noexcept
{
  note_copy (bytes);
  return find (real_memmove, "memmove") (to, from, bytes);
}

namespace {

/* ---- the cameras ---- */

std::string
address_of (int camera)
{
  return "127.61.44." + std::to_string (camera + 1);
}

/* Both in a process of their own; tells how many pictures they sent. */
class CameraProcess {
public:
  bool start (const Job &job)
  {
    sent_ = static_cast<std::atomic<std::uint64_t> *> (mmap (
        nullptr, 2 * sizeof *sent_, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0));
    int ready[2];
    if (sent_ == MAP_FAILED || pipe (ready) != 0)
      return false;
    child_ = fork ();
    if (child_ == 0) {
      prctl (PR_SET_PDEATHSIG, SIGTERM);
      serve (job, ready[1]);
    }
    close (ready[1]);
    char byte = 0;
    const bool good = read (ready[0], &byte, 1) == 1;
    close (ready[0]);
    return good;
  }
  ~CameraProcess ()
  {
    if (child_ > 0) {
      kill (child_, SIGTERM);
      waitpid (child_, nullptr, 0);
    }
  }
  [[nodiscard]] std::uint64_t sent () const { return sent_[0] + sent_[1]; }

private:
  [[noreturn]] void serve (const Job &job, int ready)
  {
    std::vector<std::unique_ptr<GigeCamera>> cameras;
    for (int i = 0; i < 2; i++) {
      GigeCameraSettings settings;
      settings.address = address_of (i);
      settings.serial = i == 0 ? "left" : "right";
      settings.width = job.width;
      settings.height = job.height;
      settings.fps = job.fps;
      settings.pixel_format = job.mono ? kMono8 : kRgb8;
      settings.link_mbits = 2000;
      GigeCamera::Scenery scenery;
      scenery.moment = [] (std::int64_t now_ns) { return now_ns; };
      scenery.acquisition = [] (bool) {};
      scenery.exposed = [this, i] (std::uint16_t, std::int64_t) { sent_[i]++; };
      scenery.paint = [] (std::int64_t, std::uint32_t, const SensorRegion &,
                          std::span<std::uint8_t> out) { out[0]++; };
      std::unique_ptr<GigeCamera> camera;
      if (const auto s = GigeCamera::create (settings, std::move (scenery), camera); !s.ok ()) {
        std::fprintf (stderr, "cameras_bench: %s\n", s.message ().c_str ());
        _exit (1);
      }
      cameras.push_back (std::move (camera));
    }
    for (const auto &camera : cameras)
      camera->start ();
    if (write (ready, "r", 1) == 1)
      pause ();
    _exit (0);
  }

  std::atomic<std::uint64_t> *sent_ = nullptr;
  pid_t child_ = -1;
};

/* ---- the ways ---- */

struct Way {
  const char *name;
  std::string launch;
};

std::vector<Way>
make_ways (const Job &job)
{
  const std::string caps =
      std::string (" ! video/x-raw,format=") + (job.mono ? "GRAY8" : "RGB") +
      ",width=" + std::to_string (job.width) + ",height=" + std::to_string (job.height) +
      ",framerate=" + std::to_string (job.fps) + "/1 ! fakesink sync=false name=";
  const std::string names = " left=" + address_of (0) + " right=" + address_of (1);
  const auto pair = [&] (const char *trigger) {
    return std::string ("stereocamsrc name=c trigger=") + trigger + names + " c.left" + caps +
           "l c.right" + caps + "r";
  };
  return {{"stereocamsrc trigger=software", pair ("software")},
      {"stereocamsrc trigger=free-run", pair ("free-run")},
      {"aravissrc twice, unpaired", "aravissrc camera-name=" + address_of (0) + caps +
                                        "l aravissrc camera-name=" + address_of (1) + caps + "r"}};
}

struct Result {
  double sent = 0, received = 0, cpu_ms = 0, copied_bytes = 0, big_copies = 0, seconds = 0;
};

double
cpu_seconds ()
{
  rusage usage;
  getrusage (RUSAGE_SELF, &usage);
  const auto seconds = [] (const timeval &t) {
    return double (t.tv_sec) + 1e-6 * double (t.tv_usec);
  };
  return seconds (usage.ru_utime) + seconds (usage.ru_stime);
}

GstPadProbeReturn
count_buffer (GstPad *, GstPadProbeInfo *, gpointer count)
{
  ++*static_cast<std::atomic<std::uint64_t> *> (count);
  return GST_PAD_PROBE_OK;
}

struct Snapshot {
  double time, cpu;
  std::uint64_t sent, received, bytes, copies;
};

bool
has_failed (GstElement *pipeline)
{
  GstBus *bus = gst_element_get_bus (pipeline);
  GstMessage *message = gst_bus_pop_filtered (bus, GST_MESSAGE_ERROR);
  gst_object_unref (bus);
  if (!message)
    return false;
  GError *error = nullptr;
  gst_message_parse_error (message, &error, nullptr);
  std::fprintf (stderr, "cameras_bench: %s\n", error->message);
  g_clear_error (&error);
  gst_message_unref (message);
  return true;
}

bool
run (const Way &way, const Job &job, const CameraProcess &cameras, Result &result)
{
  std::atomic<std::uint64_t> received{0};
  GstElement *pipeline = gst_parse_launch (way.launch.c_str (), nullptr);
  if (!pipeline)
    return false;
  for (const char *name : {"l", "r"}) {
    GstElement *sink = gst_bin_get_by_name (GST_BIN (pipeline), name);
    GstPad *pad = gst_element_get_static_pad (sink, "sink");
    gst_pad_add_probe (pad, GST_PAD_PROBE_TYPE_BUFFER, count_buffer, &received, nullptr);
    gst_object_unref (pad);
    gst_object_unref (sink);
  }
  const auto snapshot = [&] {
    return Snapshot{double (g_get_monotonic_time ()) * 1e-6, cpu_seconds (), cameras.sent (),
        received, copied_bytes, big_copies};
  };
  gst_element_set_state (pipeline, GST_STATE_PLAYING);
  for (int i = 0; i < 100 && received < std::uint64_t (2 * job.fps); i++)
    g_usleep (100000); /* until it runs evenly */
  const Snapshot begin = snapshot ();
  g_usleep (gulong (job.seconds) * G_USEC_PER_SEC);
  const Snapshot end = snapshot ();
  const bool good = !has_failed (pipeline) && end.received > begin.received;
  gst_element_set_state (pipeline, GST_STATE_NULL);
  gst_object_unref (pipeline);
  const double pictures = std::max (1.0, double (end.received - begin.received));
  result = {double (end.sent - begin.sent), double (end.received - begin.received),
      (end.cpu - begin.cpu) * 1e3 / pictures * 2, double (end.bytes - begin.bytes) / pictures,
      double (end.copies - begin.copies) / pictures, end.time - begin.time};
  return good;
}

double
median (std::vector<Result> &results, double Result::*field)
{
  std::ranges::nth_element (
      results, results.begin () + std::ptrdiff_t (results.size () / 2), {}, field);
  return results[results.size () / 2].*field;
}

void
print (const Way &way, std::vector<Result> &results, const Job &job)
{
  double sent = 0, received = 0, seconds = 0;
  for (const Result &r : results) {
    sent += r.sent;
    received += r.received;
    seconds += r.seconds;
  }
  std::printf ("%-30s %9.1f %9.0f %9.0f %10.2f %12.2f %10.2f\n", way.name, received / seconds / 2,
      sent, received, median (results, &Result::cpu_ms),
      median (results, &Result::copied_bytes) / double (job.picture_bytes ()),
      median (results, &Result::big_copies));
}

int
measure (const Job &job)
{
  CameraProcess cameras; /* before there are threads */
  if (!cameras.start (job))
    return 1;
  gst_init (nullptr, nullptr);
  big_copy = job.picture_bytes () / 2;
  const std::vector<Way> ways = make_ways (job);
  std::vector<std::vector<Result>> results (ways.size ());
  for (int round = 0; round < job.rounds; round++)
    for (std::size_t i = 0; i < ways.size (); i++)
      if (Result result; run (ways[i], job, cameras, result))
        results[i].push_back (result);
      else
        std::fprintf (stderr, "cameras_bench: %s gave no pictures\n", ways[i].name);
  std::printf ("%dx%d %s at %d/s, %d x %d s\n", job.width, job.height, job.mono ? "Mono8" : "RGB8",
      job.fps, job.rounds, job.seconds);
  std::printf ("%-30s %9s %9s %9s %10s %12s %10s\n", "", "pairs/s", "sent", "received", "CPU ms",
      "copied", "copies of");
  std::printf ("%-30s %9s %9s %9s %10s %12s %10s\n", "", "", "pictures", "pictures", "a pair",
      "a picture", "a picture");
  for (std::size_t i = 0; i < ways.size (); i++)
    if (!results[i].empty ())
      print (ways[i], results[i], job);
  return 0;
}

} // namespace

int
main (int argc, char **argv)
{
  Job job;
  Options options ("cameras_bench", kUsage);
  options.size ("--size", job.width, job.height, 16, 4096);
  options.number ("--fps", job.fps, 1, 1000);
  options.number ("--seconds", job.seconds, 1, 3600);
  options.number ("--rounds", job.rounds, 1, 1000);
  options.flag ("--mono", job.mono);
  if (const auto status = options.parse (argc, argv))
    return *status;
  return measure (job);
}
