/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "latency-trace.hpp"

#include <gstrange/gstrange.h>
#include <time.h>
#include <unistd.h>

#include <cinttypes>
#include <cstdio>

namespace {

/* Capture time of the frame set that this thread had last: packets have none of their own, but the
 * thread that makes them has just had their frame set. */
thread_local GstClockTime last_capture = GST_CLOCK_TIME_NONE;
thread_local gint64 last_rtp_time = -1;

gint64
thread_cpu_ns ()
{
  timespec now{};
  clock_gettime (CLOCK_THREAD_CPUTIME_ID, &now);
  return gint64 (now.tv_sec) * 1000000000 + now.tv_nsec;
}

GstBuffer *
first_buffer (GstPadProbeInfo *info)
{
  if (!(info->type & GST_PAD_PROBE_TYPE_BUFFER_LIST))
    return GST_PAD_PROBE_INFO_BUFFER (info);
  GstBufferList *list = GST_PAD_PROBE_INFO_BUFFER_LIST (info);
  return gst_buffer_list_length (list) > 0 ? gst_buffer_list_get (list, 0) : nullptr;
}

bool
carries_rtp (GstPad *pad)
{
  GstCaps *caps = gst_pad_get_current_caps (pad);
  const bool rtp = caps && gst_caps_get_size (caps) > 0 &&
                   gst_structure_has_name (gst_caps_get_structure (caps, 0), "application/x-rtp");
  gst_clear_caps (&caps);
  return rtp;
}

} // namespace

GstPadProbeReturn
LatencyTrace::note (GstPad *pad, GstPadProbeInfo *info, gpointer user_data)
{
  auto point = static_cast<Point *> (user_data);
  LatencyTrace &trace = *point->trace;
  GstBuffer *buffer = first_buffer (info);
  if (!buffer)
    return GST_PAD_PROBE_OK;
  GstClock *clock = gst_element_get_clock (trace.pipeline_);
  const GstClockTime now = clock ? gst_clock_get_time (clock) : gst_util_get_timestamp ();
  gst_clear_object (&clock);
  if (!point->is_rtp_known) {
    point->is_rtp = carries_rtp (pad);
    point->is_rtp_known = true;
  }
  const GstClockTime capture = gst_range_buffer_get_capture_time (buffer);
  if (GST_CLOCK_TIME_IS_VALID (capture))
    last_capture = capture;
  guint8 header[8];
  if (point->is_rtp && gst_buffer_extract (buffer, 0, header, sizeof header) == sizeof header)
    last_rtp_time = GST_READ_UINT32_BE (header + 4);
  const Passage passage = {
      point, last_capture, now, last_rtp_time, gint64 (gettid ()), thread_cpu_ns ()};
  std::lock_guard guard (trace.lock_);
  if (trace.passages_.size () < kMaxPassages)
    trace.passages_.push_back (passage);
  else
    trace.is_full_ = true;
  return GST_PAD_PROBE_OK;
}

void
LatencyTrace::add_pad (GstPad *pad)
{
  GstElement *element = gst_pad_get_parent_element (pad);
  GstElementFactory *factory = element ? gst_element_get_factory (element) : nullptr;
  auto point = std::make_unique<Point> ();
  point->trace = this;
  point->name = std::string (factory ? GST_OBJECT_NAME (factory) : "bin") + " " +
                (element ? GST_OBJECT_NAME (element) : "") + "." + GST_OBJECT_NAME (pad);
  gst_pad_add_probe (pad,
      GstPadProbeType (GST_PAD_PROBE_TYPE_BUFFER | GST_PAD_PROBE_TYPE_BUFFER_LIST), note,
      point.get (), nullptr);
  points_.push_back (std::move (point));
  gst_clear_object (&element);
}

LatencyTrace::LatencyTrace (GstElement *pipeline) : pipeline_ (pipeline)
{
  const auto each_pad = [] (const GValue *item, gpointer self) {
    static_cast<LatencyTrace *> (self)->add_pad (GST_PAD (g_value_get_object (item)));
  };
  std::pair<decltype (each_pad), gpointer> context (each_pad, this);
  GstIterator *elements = gst_bin_iterate_recurse (GST_BIN (pipeline));
  const auto each_element = [] (const GValue *item, gpointer data) {
    auto element = GST_ELEMENT (g_value_get_object (item));
    const auto &[add, self] = *static_cast<decltype (context) *> (data);
    if (GST_IS_BIN (element))
      return;
    const bool is_sink = GST_OBJECT_FLAG_IS_SET (element, GST_ELEMENT_FLAG_SINK);
    GstIterator *pads =
        is_sink ? gst_element_iterate_sink_pads (element) : gst_element_iterate_src_pads (element);
    gst_iterator_foreach (pads, add, self);
    gst_iterator_free (pads);
  };
  gst_iterator_foreach (elements, each_element, &context);
  gst_iterator_free (elements);
}

bool
LatencyTrace::write (const char *path) const
{
  FILE *file = std::fopen (path, "w");
  if (!file)
    return false;
  std::fputs ("# factory element.pad capture-ns rtp-time passed-ns thread thread-cpu-ns\n", file);
  if (is_full_)
    g_printerr (
        "rangecast-run: %s: full after %zu buffers; later ones are missing\n", path, kMaxPassages);
  for (const Passage &p : passages_)
    std::fprintf (file, "%s %" PRId64 " %" PRId64 " %" PRId64 " %" PRId64 " %" PRId64 "\n",
        p.point->name.c_str (), GST_CLOCK_TIME_IS_VALID (p.capture) ? std::int64_t (p.capture) : -1,
        std::int64_t{p.rtp_time}, std::int64_t (p.now), std::int64_t{p.thread},
        std::int64_t{p.cpu_ns});
  return std::fclose (file) == 0;
}
