/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "measure.hpp"

#include <gstrange/gstrange.h>

#include <algorithm>
#include <cstdio>
#include <sys/resource.h>

namespace {

/* ---- reading elements ---- */

guint64
stat_of (GstElement *element, const char *field)
{
  GstStructure *stats = nullptr;
  guint64 value = 0;
  if (!g_object_class_find_property (G_OBJECT_GET_CLASS (element), "stats"))
    return 0;
  g_object_get (element, "stats", &stats, nullptr);
  if (!stats)
    return 0;
  gst_structure_get_uint64 (stats, field, &value);
  gst_structure_free (stats);
  return value;
}

void
add_jitterbuffer (const GValue *item, gpointer user_data)
{
  auto stats = static_cast<StreamStats *> (user_data);
  auto element = GST_ELEMENT (g_value_get_object (item));
  GstElementFactory *factory = gst_element_get_factory (element);
  if (!factory || g_strcmp0 (GST_OBJECT_NAME (factory), "rtpjitterbuffer") != 0)
    return;
  const guint64 lost = stat_of (element, "num-lost");
  stats->rtp_packets += stat_of (element, "num-pushed") + lost;
  stats->rtp_lost += lost;
}

void
read_decoder (GstBin *bin, StreamStats &stats)
{
  GstElement *decoder = gst_bin_get_by_name (bin, "decoder");
  if (!decoder)
    return;
  stats.coded_frames = stat_of (decoder, "frames");
  stats.points = stat_of (decoder, "points");
  stats.raw_bytes = stat_of (decoder, "raw-bytes");
  stats.coded_bytes = stat_of (decoder, "coded-bytes");
  GstPad *pad = gst_element_get_static_pad (decoder, "src");
  if (GstCaps *caps = gst_pad_get_current_caps (pad)) {
    int views = 0;
    gst_structure_get_int (gst_caps_get_structure (caps, 0), "views", &views);
    stats.views = static_cast<guint64> (views);
    gst_caps_unref (caps);
  }
  gst_object_unref (pad);
  gst_object_unref (decoder);
}

double
cpu_seconds ()
{
  rusage usage;
  getrusage (RUSAGE_SELF, &usage);
  return usage.ru_utime.tv_sec + usage.ru_stime.tv_sec +
         1e-6 * (usage.ru_utime.tv_usec + usage.ru_stime.tv_usec);
}

double
per_frame (guint64 total, guint64 frames)
{
  return frames ? double (total) / double (frames) : 0;
}

} // namespace

StreamStats
RunMeasure::read_stats ()
{
  StreamStats stats;
  auto bin = GST_BIN (pipeline_);
  read_decoder (bin, stats);
  GstIterator *elements = gst_bin_iterate_recurse (bin);
  while (gst_iterator_foreach (elements, add_jitterbuffer, &stats) == GST_ITERATOR_RESYNC) {
    stats.rtp_packets = stats.rtp_lost = 0;
    gst_iterator_resync (elements);
  }
  gst_iterator_free (elements);
  std::lock_guard guard (lock_);
  stats.frames = rendered_;
  stats.views_now = views_now_;
  return stats;
}

double
RunMeasure::fps ()
{
  std::lock_guard guard (lock_);
  if (rendered_ < 2 || last_frame_ <= first_frame_)
    return 0;
  return double (rendered_ - 1) * GST_SECOND / double (last_frame_ - first_frame_);
}

double
RunMeasure::latency_ms (double p)
{
  std::unique_lock guard (lock_);
  std::vector<double> values = latencies_ms_;
  guard.unlock (); /* no streaming thread waits while it sorts */
  if (values.empty ())
    return 0;
  const auto k = values.begin () + std::ptrdiff_t (p * double (values.size () - 1));
  std::nth_element (values.begin (), k, values.end ());
  return *k;
}

guint64
RunMeasure::whole_of (guint64 frames)
{
  std::lock_guard guard (lock_);
  return decoded_ ? frames * whole_ / decoded_ : 0;
}

/* ---- what is written ---- */

void
RunMeasure::print_progress ()
{
  const StreamStats stats = read_stats ();
  if (stats.frames == 0)
    std::printf ("  waiting: cameras are learning their background\n");
  else
    std::printf ("  frame set %5" G_GUINT64_FORMAT
                 "  %d view%s  %5.1f /s  %7.0f points  %6.1f ms\n",
        stats.frames, stats.views_now, stats.views_now == 1 ? "" : "s", fps (),
        per_frame (stats.points, stats.coded_frames), latency_ms (0.5));
  std::fflush (stdout);
}

bool
RunMeasure::write_report (const char *path)
{
  const StreamStats s = read_stats ();
  FILE *file = std::fopen (path, "w");
  if (!file) {
    g_printerr ("rangecast-run: %s: cannot be opened for writing\n", path);
    return false;
  }
  std::fprintf (file,
      "{\n  \"frames\": %" G_GUINT64_FORMAT ",\n  \"whole_frame_sets\": %" G_GUINT64_FORMAT
      ",\n  \"views\": %" G_GUINT64_FORMAT
      ",\n  \"fps\": %.2f,\n  \"points_per_frame_set\": %.1f,\n"
      "  \"raw_bytes_per_frame_set\": %.1f,\n"
      "  \"coded_bytes_per_frame_set\": %.1f,\n"
      "  \"latency_ms\": {\"p50\": %.2f, \"p99\": %.2f},\n"
      "  \"rtp_packets\": %" G_GUINT64_FORMAT ",\n  \"rtp_lost\": %" G_GUINT64_FORMAT
      ",\n  \"cpu_seconds\": %.3f\n}\n",
      s.frames, whole_of (s.frames), s.views, fps (), per_frame (s.points, s.coded_frames),
      per_frame (s.raw_bytes, s.coded_frames), per_frame (s.coded_bytes, s.coded_frames),
      latency_ms (0.5), latency_ms (0.99), s.rtp_packets, s.rtp_lost, cpu_seconds ());
  const bool failed = std::ferror (file) != 0;
  if (std::fclose (file) == 0 && !failed)
    return true;
  g_printerr ("rangecast-run: %s: cannot be written\n", path);
  return false;
}

/* ---- probes, on streaming threads ---- */

/* While camera hosts learn their backgrounds, not all views have points, and nothing is drawn,
 * recorded or counted; for a limited time, since a view may see no person. */
GstPadProbeReturn
RunMeasure::count_views (GstPad *, GstPadProbeInfo *info, gpointer user_data)
{
  auto self = static_cast<RunMeasure *> (user_data);
  GstBuffer *buffer = GST_PAD_PROBE_INFO_BUFFER (info);
  constexpr gint64 kPatienceUs = 2 * G_USEC_PER_SEC;
  gpointer state = nullptr;
  gint seen = 0;
  while (GstRangeMeta *meta = gst_buffer_iterate_range_meta (buffer, &state))
    seen += meta->width > 0 && meta->height > 0;
  const bool whole = seen >= std::max (1, self->views_);
  std::lock_guard guard (self->lock_);
  if (seen > 0 && self->first_points_us_ == 0)
    self->first_points_us_ = g_get_monotonic_time ();
  const bool tired = seen > 0 && g_get_monotonic_time () - self->first_points_us_ > kPatienceUs;
  self->seen_points_ |= whole || tired;
  if (self->seen_points_) {
    self->decoded_++;
    self->whole_ += whole;
  }
  self->views_now_ = seen;
  return self->seen_points_ ? GST_PAD_PROBE_OK : GST_PAD_PROBE_DROP;
}

/* @param[out] frames  that have passed, with this one
 * @return false if there are enough already */
bool
RunMeasure::record_rendered (GstClockTime capture, gint &frames)
{
  GstClock *clock = gst_element_get_clock (pipeline_);
  const GstClockTime now = clock ? gst_clock_get_time (clock) : gst_util_get_timestamp ();
  gst_clear_object (&clock);
  std::lock_guard guard (lock_);
  if (frames_ > 0 && rendered_ >= guint64 (frames_))
    return false;
  if (!GST_CLOCK_TIME_IS_VALID (first_frame_))
    first_frame_ = now;
  last_frame_ = now;
  const double latency_ms =
      GST_CLOCK_TIME_IS_VALID (capture) ? (double (now) - double (capture)) * 1e-6 : 0;
  if (latencies_ms_.size () < kMaxLatencies)
    latencies_ms_.push_back (latency_ms);
  else
    latencies_ms_[rendered_ % kMaxLatencies] = latency_ms;
  frames = gint (std::min<guint64> (++rendered_, G_MAXINT));
  return true;
}

GstPadProbeReturn
RunMeasure::count_rendered (GstPad *pad, GstPadProbeInfo *info, gpointer user_data)
{
  auto self = static_cast<RunMeasure *> (user_data);
  gint frames = 0;
  if (!self->record_rendered (
          gst_range_buffer_get_capture_time (GST_PAD_PROBE_INFO_BUFFER (info)), frames)) {
    gst_pad_push_event (pad, gst_event_new_eos ()); /* sources get GST_FLOW_EOS from now on */
    return GST_PAD_PROBE_DROP;
  }
  const gint wanted = self->frames_;
  if (self->turned_) /* the next frame; the last one is the first view's again */
    g_object_set (
        self->turned_, "azimuth", 360.0 * std::min (frames + 1, wanted) / wanted, nullptr);
  return GST_PAD_PROBE_OK;
}

void
RunMeasure::add_probe (const char *element_name, GstPadProbeCallback probe)
{
  GstElement *element = gst_bin_get_by_name (GST_BIN (pipeline_), element_name);
  if (!element)
    return;
  GstPad *pad = gst_element_get_static_pad (element, "src");
  gst_pad_add_probe (pad, GST_PAD_PROBE_TYPE_BUFFER, probe, this, nullptr);
  gst_object_unref (pad);
  gst_object_unref (element);
}

/* ---- life ---- */

RunMeasure::RunMeasure (GstElement *pipeline, int views, int frames)
    : pipeline_ (pipeline), views_ (views), frames_ (frames)
{
  latencies_ms_.reserve (kMaxLatencies);
}

RunMeasure::~RunMeasure ()
{
  gst_clear_object (&turned_);
}

void
RunMeasure::start (bool turn)
{
  if (turn && frames_ > 0)
    turned_ = gst_bin_get_by_name (GST_BIN (pipeline_), "view");
  add_probe ("decoder", count_views);
  add_probe ("rendered", count_rendered);
}
