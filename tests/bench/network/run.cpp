/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "run.hpp"

#include <gst/app/gstappsink.h>
#include <gst/app/gstappsrc.h>
#include <gst/gst.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <gstrange/gstrangeframe.hpp>
#include <gstrange/gstrangeinfo.hpp>
#include <gstrange/gstrangemeta.h>
#include <map>
#include <memory>
#include <mutex>
#include <thread>

namespace {

constexpr int kMediaType = 96; /* payload types */
constexpr const char *kRtxMap = "\"application/x-rtp-pt-map,96=(uint)97,122=(uint)123\"";
constexpr const char *kRtpCaps =
    "application/"
    "x-rtp,media=video,clock-rate=90000,encoding-name=X-NEIGHBOUR-CODE,payload=96,"
    "rtcp-fb-nack-pli=(boolean)true,rtcp-fb-nack=(boolean)true";

int64_t
now_ns ()
{
  return std::chrono::duration_cast<std::chrono::nanoseconds> (
      std::chrono::steady_clock::now ().time_since_epoch ())
      .count ();
}

/** One direction of the network: takes packets from an appsink, gives them to an appsrc. */
class Wire {
public:
  Wire (GstElement *from, GstElement *to, const FaultSettings &faults) : to_ (to), faults_ (faults)
  {
    GstAppSinkCallbacks callbacks = {};
    callbacks.new_sample = [] (GstAppSink *sink, gpointer wire) {
      static_cast<Wire *> (wire)->take (sink);
      return GST_FLOW_OK;
    };
    gst_app_sink_set_callbacks (GST_APP_SINK (from), &callbacks, this, nullptr);
    thread_ = std::thread ([this] { carry (); });
  }
  ~Wire ()
  {
    {
      std::lock_guard guard (lock_);
      ending_ = true;
    }
    changed_.notify_all ();
    thread_.join ();
  }
  Wire (const Wire &) = delete;
  Wire &operator= (const Wire &) = delete;

  void set (const FaultSettings &faults)
  {
    std::lock_guard guard (lock_);
    before_ = faults_.counters ();
    faults_.set (faults);
  }
  /** What happened since the last set() but one, that is while the faults held. */
  FaultCounters counters ()
  {
    std::lock_guard guard (lock_);
    return before_;
  }
  std::atomic<long long> media_bytes = 0, extra_bytes = 0;

private:
  void take (GstAppSink *sink)
  {
    GstSample *sample = gst_app_sink_pull_sample (sink);
    if (!sample)
      return;
    GstMapInfo map;
    if (gst_buffer_map (gst_sample_get_buffer (sample), &map, GST_MAP_READ)) {
      if (map.size > 1)
        ((map.data[1] & 0x7f) == kMediaType ? media_bytes : extra_bytes) += (long long)map.size;
      std::lock_guard guard (lock_);
      faults_.offer ({map.data, map.size}, now_ns ());
      gst_buffer_unmap (gst_sample_get_buffer (sample), &map);
    }
    gst_sample_unref (sample);
    changed_.notify_all ();
  }
  void carry ()
  {
    std::unique_lock guard (lock_);
    while (!ending_) {
      if (const auto packet = faults_.take (now_ns ())) {
        GstBuffer *buffer = gst_buffer_new_memdup (packet->data (), packet->size ());
        guard.unlock ();
        gst_app_src_push_buffer (GST_APP_SRC (to_), buffer);
        guard.lock ();
      } else if (const auto due = faults_.due_ns ()) {
        changed_.wait_for (
            guard, std::chrono::nanoseconds (std::max<int64_t> (*due - now_ns (), 1)));
      } else {
        changed_.wait (guard);
      }
    }
  }

  GstElement *to_;
  std::mutex lock_;
  std::condition_variable changed_;
  NetworkFaults faults_;
  FaultCounters before_;
  bool ending_ = false;
  std::thread thread_;
};

/* Frame sets by number, with the time when they came. */
struct Collected {
  std::mutex lock;
  std::map<int, std::pair<GstBuffer *, int64_t>> frame_sets;
  std::vector<std::pair<int, GstBuffer *>> repeats; /* of numbers that had come before */
  GstClockTime interval = 0;

  ~Collected ()
  {
    for (auto &[number, frame_set] : frame_sets)
      gst_buffer_unref (frame_set.first);
    for (auto &[number, buffer] : repeats)
      gst_buffer_unref (buffer);
  }
  void collect (GstElement *sink)
  {
    GstAppSinkCallbacks callbacks = {};
    callbacks.new_sample = [] (GstAppSink *from, gpointer collected) {
      auto self = static_cast<Collected *> (collected);
      if (GstSample *sample = gst_app_sink_pull_sample (from)) {
        GstBuffer *buffer = gst_sample_get_buffer (sample);
        const GstClockTime capture = gst_range_buffer_get_capture_time (buffer);
        const int number = int ((capture + self->interval / 2) / self->interval);
        std::lock_guard guard (self->lock);
        gst_buffer_ref (buffer);
        if (!self->frame_sets.try_emplace (number, buffer, now_ns ()).second)
          self->repeats.emplace_back (number, buffer);
        gst_sample_unref (sample);
      }
      return GST_FLOW_OK;
    };
    gst_app_sink_set_callbacks (GST_APP_SINK (sink), &callbacks, this, nullptr);
  }
};

/* ---- the scene, rendered before the clock runs ---- */

struct Scene {
  GstCaps *caps = nullptr;
  std::vector<GstBuffer *> frame_sets;

  explicit Scene (const NetworkCase &c)
  {
    const std::string launch =
        "avatartestsrc range-person-only=true views=" + std::to_string (c.views) +
        " num-buffers=" + std::to_string (std::min (c.frames, 45)) +
        " ! video/x-range,width=" + std::to_string (c.width) +
        ",height=" + std::to_string (c.height) + ",framerate=" + std::to_string (c.fps) +
        "/1 ! appsink name=s sync=false";
    GstElement *pipeline = gst_parse_launch (launch.c_str (), nullptr);
    GstElement *sink = gst_bin_get_by_name (GST_BIN (pipeline), "s");
    gst_element_set_state (pipeline, GST_STATE_PLAYING);
    while (GstSample *sample = gst_app_sink_pull_sample (GST_APP_SINK (sink))) {
      gst_caps_replace (&caps, gst_sample_get_caps (sample));
      frame_sets.push_back (gst_buffer_ref (gst_sample_get_buffer (sample)));
      gst_sample_unref (sample);
    }
    gst_element_set_state (pipeline, GST_STATE_NULL);
    gst_object_unref (sink);
    gst_object_unref (pipeline);
  }
  ~Scene ()
  {
    for (GstBuffer *buffer : frame_sets)
      gst_buffer_unref (buffer);
    gst_clear_caps (&caps);
  }
  Scene (const Scene &) = delete;
  Scene &operator= (const Scene &) = delete;

  /* There and back, so that the person never jumps. */
  [[nodiscard]] GstBuffer *at (int number) const
  {
    const int n = int (frame_sets.size ()), period = std::max (1, 2 * (n - 1));
    const int k = number % period;
    return frame_sets[std::size_t (k < n ? k : period - k)];
  }
};

/* ---- the pipelines: as those of the hosts' scripts ---- */

std::string
sender_launch (const NetworkCase &c)
{
  std::string s = "appsrc name=in is-live=true format=time do-timestamp=true ! neighbourcodeenc " +
                  c.encoder +
                  " ! tee name=coded ! queue max-size-buffers=0 max-size-bytes=0 "
                  "max-size-time=0 ! neighbourcodedec request-key-units=false ! appsink "
                  "name=sent sync=false async=false coded. ! rtpneighbourcodepay";
  if (c.feedback || c.rtx)
    s += " ! application/x-rtp,rtcp-fb-nack-pli=(boolean)true,rtcp-fb-nack=(boolean)true";
  if (c.fec_percent)
    s += " ! rtpulpfecenc pt=122 percentage=" + std::to_string (c.fec_percent);
  if (c.rtx)
    s += std::string (" ! rtprtxsend max-size-time=500 payload-type-map=") + kRtxMap;
  if (c.feedback || c.rtx)
    s += " ! session.send_rtp_sink session.send_rtp_src";
  s += " ! appsink name=wire sync=false async=false";
  if (c.feedback || c.rtx)
    s += " rtpsession name=session rtp-profile=avpf appsrc name=rtcp is-live=true format=time "
         "do-timestamp=true caps=application/x-rtcp ! session.recv_rtcp_sink";
  return s;
}

std::string
receiver_launch (const NetworkCase &c)
{
  std::string s =
      std::string ("appsrc name=wire is-live=true format=time do-timestamp=true caps=\"") +
      kRtpCaps + "\" ! rtpneighbourcodeguard";
  if (c.feedback || c.rtx)
    s += " ! capssetter caps=application/x-rtp,payload=96 ! session.recv_rtp_sink rtpsession "
         "name=session rtp-profile=avpf rtcp-min-interval=20000000 session.send_rtcp_src ! appsink "
         "name=rtcp sync=false "
         "async=false session.recv_rtp_src";
  if (c.rtx)
    s += std::string (" ! rtprtxreceive payload-type-map=") + kRtxMap;
  if (c.feedback || c.rtx)
    s += " ! rtpneighbourcodeguard";
  if (c.fec_percent)
    s += " ! rtpstorage size-time=500000000";
  s += " ! rtpjitterbuffer max-dropout-time=1000 max-misorder-time=500 latency=" +
       std::to_string (c.jitter_buffer_ms);
  if (c.rtx)
    s += " do-retransmission=true rtx-next-seqnum=false";
  if (c.fec_percent)
    s += " do-lost=true ! rtpulpfecdec pt=122";
  return s +
         " ! rtpneighbourcodedepay ! neighbourcodedec ! appsink name=got sync=false async=false";
}

struct Pipeline {
  GstElement *bin = nullptr;
  std::vector<GstElement *> named;

  explicit Pipeline (const std::string &launch)
  {
    GError *error = nullptr;
    bin = gst_parse_launch (launch.c_str (), &error);
    if (error)
      std::fprintf (stderr, "network_bench: %s: %s\n", launch.c_str (), error->message);
    if (error)
      gst_clear_object (&bin);
    g_clear_error (&error);
  }
  ~Pipeline ()
  {
    for (GstElement *element : named)
      gst_clear_object (&element);
    gst_clear_object (&bin);
  }
  Pipeline (const Pipeline &) = delete;
  Pipeline &operator= (const Pipeline &) = delete;
  GstElement *get (const char *name)
  {
    named.push_back (gst_bin_get_by_name (GST_BIN (bin), name));
    return named.back ();
  }
};

/* ---- judging ---- */

struct Compared {
  long long expected = 0, right = 0, wrong = 0;
};

/* The value of one pixel of a view's whole image; 0: no point. */
uint64_t
pixel (const rangecast::RangeImage &view, int x, int y)
{
  x -= view.roi.x;
  y -= view.roi.y;
  if (x < 0 || y < 0 || x >= view.roi.width || y >= view.roi.height || !view.depth.at (x, y))
    return 0;
  uint32_t colour = 0;
  memcpy (&colour, &view.colour.at (x, y), 3);
  return uint64_t (view.depth.at (x, y)) << 32 | colour;
}

long long
points_of (const rangecast::RangeImage &view)
{
  long long points = 0;
  for (int y = 0; y < view.roi.height; y++)
    for (int x = 0; x < view.roi.width; x++)
      points += view.depth.at (x, y) != 0;
  return points;
}

Compared
compare_view (const rangecast::RangeImage &sent, const rangecast::RangeImage *got)
{
  Compared c;
  c.expected = points_of (sent);
  if (!got)
    return c;
  for (int y = got->roi.y; y < got->roi.y + got->roi.height; y++)
    for (int x = got->roi.x; x < got->roi.x + got->roi.width; x++)
      if (const uint64_t value = pixel (*got, x, y))
        (value == pixel (sent, x, y) ? c.right : c.wrong)++;
  return c;
}

/* Points of views that nobody sent are wrong; without `sent`, all. */
long long
stray_points (GstBuffer *sent, GstBuffer *got)
{
  std::unique_ptr<gstrange::RangeFrameMap> a;
  if (sent)
    a = std::make_unique<gstrange::RangeFrameMap> (sent, GST_MAP_READ);
  const gstrange::RangeFrameMap b (got, GST_MAP_READ);
  long long points = 0;
  for (const auto &view : b.views ())
    if (!a || std::ranges::none_of (
                  a->views (), [&] (const auto &other) { return other.view_id == view.view_id; }))
      points += points_of (view);
  return points;
}

Compared
compare (GstBuffer *sent, GstBuffer *got)
{
  Compared all;
  gstrange::RangeFrameMap a (sent, GST_MAP_READ);
  std::unique_ptr<gstrange::RangeFrameMap> b;
  if (got)
    b = std::make_unique<gstrange::RangeFrameMap> (got, GST_MAP_READ);
  for (const auto &view : a.views ()) {
    const rangecast::RangeImage *same = nullptr;
    if (b)
      for (const auto &other : b->views ())
        if (other.view_id == view.view_id)
          same = &other;
    const Compared c = compare_view (view, same);
    all.expected += c.expected;
    all.right += c.right;
    all.wrong += c.wrong;
  }
  if (got)
    all.wrong += stray_points (sent, got);
  return all;
}

/* Frame sets that came once more, or that nobody sent. */
long long
wrong_points_of_others (const Collected &sent, const Collected &got)
{
  long long wrong = 0;
  const auto count = [&] (int number, GstBuffer *buffer) {
    const auto original = sent.frame_sets.find (number);
    wrong += original != sent.frame_sets.end () ? compare (original->second.first, buffer).wrong
                                                : stray_points (nullptr, buffer);
  };
  for (const auto &[number, buffer] : got.repeats)
    count (number, buffer);
  for (const auto &[number, frame_set] : got.frame_sets)
    if (!sent.frame_sets.contains (number))
      count (number, frame_set.first);
  return wrong;
}

double
percentile (std::vector<double> values, double p)
{
  if (values.empty ())
    return 0;
  std::sort (values.begin (), values.end ());
  return values[std::size_t (p * double (values.size () - 1))];
}

void
judge (const NetworkCase &c, Collected &sent, Collected &got, const std::vector<int64_t> &pushed_ns,
    NetworkResult &result)
{
  std::vector<double> latencies;
  long long expected = 0, right = 0;
  int whole = 0, last_broken = -1;
  int64_t last_ns = 0;
  const int end_of_faults = c.frames - kRecoveryFrames;
  result.wrong_points = wrong_points_of_others (sent, got);
  for (const auto &[number, frame_set] : sent.frame_sets) {
    const auto found = got.frame_sets.find (number);
    const bool came = found != got.frame_sets.end ();
    const Compared d = compare (frame_set.first, came ? found->second.first : nullptr);
    result.wrong_points += d.wrong;
    const bool is_whole = came && d.right == d.expected && d.wrong == 0;
    if (came && last_ns && number >= kQuietFrames)
      result.freeze_ms =
          std::max (result.freeze_ms, double (found->second.second - last_ns) * 1e-6);
    if (came)
      last_ns = found->second.second;
    if (!is_whole)
      last_broken = number;
    if (number < kQuietFrames || number >= end_of_faults)
      continue;
    result.sent++;
    result.received += came;
    expected += d.expected;
    right += d.right;
    whole += is_whole;
    if (came)
      latencies.push_back (double (found->second.second - pushed_ns[std::size_t (number)]) * 1e-6);
  }
  if (last_ns) /* a stream that stopped for good stands still until its end */
    result.freeze_ms = std::max (result.freeze_ms, double (pushed_ns.back () - last_ns) * 1e-6);
  result.points_share = expected ? double (right) / double (expected) : 0;
  result.whole_share = result.sent ? double (whole) / result.sent : 0;
  result.latency_p50_ms = percentile (latencies, 0.5);
  result.latency_p99_ms = percentile (latencies, 0.99);
  const auto first_good = got.frame_sets.find (std::max (last_broken + 1, end_of_faults));
  result.recovery_ms = -1; /* until the first frame set that is whole, as are all after it */
  if (first_good != got.frame_sets.end ())
    result.recovery_ms = std::max (
        0., double (first_good->second.second - pushed_ns[std::size_t (end_of_faults)]) * 1e-6);
}

/* In real time: pushes the frame sets, and makes the network bad in between. */
std::vector<int64_t>
send_all (const NetworkCase &c, const Scene &scene, GstElement *in, std::vector<Wire *> wires)
{
  FaultSettings quiet;
  quiet.delay_ns = c.delay_ms * 1'000'000LL;
  FaultSettings bad = c.faults;
  bad.delay_ns += quiet.delay_ns;
  std::vector<int64_t> pushed_ns;
  const int64_t interval_ns = 1'000'000'000 / c.fps, begin_ns = now_ns ();
  gst_app_src_set_caps (GST_APP_SRC (in), scene.caps);
  for (int i = 0; i < c.frames; i++) {
    std::this_thread::sleep_for (std::chrono::nanoseconds (begin_ns + i * interval_ns - now_ns ()));
    if (i == kQuietFrames || i == c.frames - kRecoveryFrames)
      for (Wire *wire : wires)
        wire->set (i == kQuietFrames ? bad : quiet);
    GstBuffer *buffer = gst_buffer_copy (scene.at (i));
    const auto capture_time = GstClockTime (i * interval_ns);
    gst_range_buffer_set_capture_time (buffer, capture_time);
    gpointer state = nullptr;
    while (GstRangeMeta *meta = gst_buffer_iterate_range_meta (buffer, &state))
      meta->capture_time = capture_time; /* what slices say */
    GST_BUFFER_PTS (buffer) = GST_BUFFER_DTS (buffer) = GST_CLOCK_TIME_NONE;
    pushed_ns.push_back (now_ns ());
    gst_app_src_push_buffer (GST_APP_SRC (in), buffer);
  }
  std::this_thread::sleep_for (std::chrono::milliseconds (400 + 4 * c.jitter_buffer_ms));
  return pushed_ns;
}

} // namespace

bool
run_network_case (const NetworkCase &c, NetworkResult &result)
{
  const Scene scene (c);
  Pipeline sender (sender_launch (c)), receiver (receiver_launch (c));
  if (!sender.bin || !receiver.bin || !scene.caps)
    return false;
  Collected sent, got;
  sent.interval = got.interval = GST_SECOND / GstClockTime (c.fps);
  sent.collect (sender.get ("sent"));
  got.collect (receiver.get ("got"));
  std::vector<int64_t> pushed_ns;
  {
    FaultSettings quiet, back;
    quiet.delay_ns = c.delay_ms * 1'000'000LL;
    quiet.seed = c.faults.seed;
    back = quiet;
    back.seed += 1000;
    Wire there (sender.get ("wire"), receiver.get ("wire"), quiet);
    std::unique_ptr<Wire> way_back;
    std::vector<Wire *> wires = {&there};
    if (c.feedback || c.rtx) {
      way_back = std::make_unique<Wire> (receiver.get ("rtcp"), sender.get ("rtcp"), back);
      wires.push_back (way_back.get ());
    }
    gst_element_set_state (receiver.bin, GST_STATE_PLAYING);
    gst_element_set_state (sender.bin, GST_STATE_PLAYING);
    pushed_ns = send_all (c, scene, sender.get ("in"), wires);
    gst_element_set_state (sender.bin, GST_STATE_NULL);
    gst_element_set_state (receiver.bin, GST_STATE_NULL);
    const double seconds = double (c.frames) / c.fps;
    result.media_kbit = double (there.media_bytes) * 8e-3 / seconds;
    result.extra_share = double (there.extra_bytes) / std::max (1., double (there.media_bytes));
    result.network = there.counters ();
  }
  judge (c, sent, got, pushed_ns, result);
  return true;
}
