/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* For LD_PRELOAD into programs that run launch strings. With CLAP_SEND, a clap every two seconds of
 * capture time, as when hands are clapped before the cameras: what reaches an encoder becomes
 * white, and loud, for 150 ms; otherwise sound is silent. The sinks named snapshot and speaker
 * write to the file $CLAP_LOG what they show and when it is due: a line of the kind (picture or
 * sound), the running time (ns) and the brightness or loudness.
 * tests/pipelines/claps.py finds the claps in it. */
#include <dlfcn.h>
#include <gst/gst.h>
#include <gstrange/gstrange.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>

static constexpr GstClockTime kPeriod_ms = 2000, kLength_ms = 150;
static constexpr gsize kRate = 48000; /* Hz */

static FILE *log_file;

static bool
claps_at (GstClockTime capture)
{
  return capture / GST_MSECOND % kPeriod_ms < kLength_ms;
}

static GstPadProbeReturn
whiten (GstPad *, GstPadProbeInfo *info, gpointer)
{
  GstBuffer *buffer = GST_PAD_PROBE_INFO_BUFFER (info);
  /* Captured at multiples of the frame period, which are rounded. */
  if (!claps_at (gst_range_buffer_get_capture_time (buffer) + GST_MSECOND))
    return GST_PAD_PROBE_OK;
  GST_PAD_PROBE_INFO_DATA (info) = buffer = gst_buffer_make_writable (buffer);
  gpointer state = nullptr;
  GstMeta *meta;
  while ((meta = gst_buffer_iterate_meta_filtered (buffer, &state, GST_RANGE_META_API_TYPE))) {
    GstRangeView view;
    if (!gst_range_view_map (&view, buffer, (GstRangeMeta *)meta, GST_MAP_READWRITE))
      continue;
    for (guint y = 0; view.colour && y < view.height; y++)
      std::memset (view.colour + (gsize)y * view.colour_stride, 255, 4 * view.width);
    gst_range_view_unmap (&view);
  }
  return GST_PAD_PROBE_OK;
}

/* The clock's time at which a buffer was captured, or is due without latency. */
static GstClockTime
clock_time_of (GstPad *pad, GstBuffer *buffer)
{
  GstEvent *event = gst_pad_get_sticky_event (pad, GST_EVENT_SEGMENT, 0);
  const GstSegment *segment;
  gst_event_parse_segment (event, &segment);
  GstClockTime running =
      gst_segment_to_running_time (segment, GST_FORMAT_TIME, GST_BUFFER_PTS (buffer));
  gst_event_unref (event);
  GstElement *element = gst_pad_get_parent_element (pad);
  running += gst_element_get_base_time (element);
  gst_object_unref (element);
  return running;
}

/* 16 bits, one channel; a square wave of 1 kHz. */
static GstPadProbeReturn
sound (GstPad *pad, GstPadProbeInfo *info, gpointer)
{
  GstBuffer *buffer = GST_PAD_PROBE_INFO_BUFFER (info);
  const GstClockTime begin = clock_time_of (pad, buffer);
  GST_PAD_PROBE_INFO_DATA (info) = buffer = gst_buffer_make_writable (buffer);
  GstMapInfo map;
  GST_BUFFER_FLAG_UNSET (buffer, GST_BUFFER_FLAG_GAP); /* of silence */
  if (!gst_buffer_map (buffer, &map, GST_MAP_WRITE))
    return GST_PAD_PROBE_OK;
  gint16 *samples = (gint16 *)map.data;
  for (gsize i = 0; i < map.size / 2; i++)
    samples[i] = !claps_at (begin + i * GST_SECOND / kRate) ? 0
                 : i / (kRate / 2000) % 2                   ? 20000
                                                            : -20000;
  gst_buffer_unmap (buffer, &map);
  return GST_PAD_PROBE_OK;
}

static void
write_line (GstElement *sink, GstPad *pad, GstBuffer *buffer, const char *kind, GstClockTime later,
    double level)
{
  std::fprintf (log_file, "%s %" G_GUINT64_FORMAT " %.1f\n", kind,
      clock_time_of (pad, buffer) - gst_element_get_base_time (sink) + later, level);
  std::fflush (log_file);
}

static gsize
channels_of (GstPad *pad)
{
  GstCaps *caps = gst_pad_get_current_caps (pad);
  int channels = 1;
  gst_structure_get_int (gst_caps_get_structure (caps, 0), "channels", &channels);
  gst_caps_unref (caps);
  return gsize (channels);
}

static void
show (GstElement *sink, GstBuffer *buffer, GstPad *pad, gpointer kind)
{
  const auto kind_name = static_cast<const char *> (kind);
  GstMapInfo map;
  if (!gst_buffer_map (buffer, &map, GST_MAP_READ))
    return;
  double level = 0;
  if (std::strcmp (kind_name, "picture") == 0) {
    for (gsize i = 0; i < map.size; i += 7)
      level += map.data[i];
    write_line (sink, pad, buffer, kind_name, 0, level / (map.size / 7 + 1));
  } else {
    const gint16 *samples = (const gint16 *)map.data;
    const gsize channels = channels_of (pad), frames = map.size / 2 / channels;
    constexpr gsize kPiece = kRate / 1000; /* 1 ms */
    for (gsize i = 0; i < frames; i += kPiece) {
      int peak = 0;
      for (gsize k = i * channels; k < std::min (i + kPiece, frames) * channels; k++)
        peak = std::max (peak, std::abs (int (samples[k])));
      write_line (sink, pad, buffer, kind_name, i * GST_SECOND / kRate, peak);
    }
  }
  gst_buffer_unmap (buffer, &map);
}

static void
watch (const GValue *value, gpointer entry_of_sound)
{
  const auto entry = static_cast<const gchar *> (entry_of_sound);
  auto element = static_cast<GstElement *> (g_value_get_object (value));
  const gchar *factory = GST_OBJECT_NAME (gst_element_get_factory (element));
  const gchar *name = GST_OBJECT_NAME (element);
  GstPad *pad = gst_element_get_static_pad (element, "sink");
  const bool sends = std::getenv ("CLAP_SEND");
  if (sends && g_str_equal (factory, "neighbourcodeenc"))
    gst_pad_add_probe (pad, GST_PAD_PROBE_TYPE_BUFFER, whiten, nullptr, nullptr);
  else if (sends && g_str_equal (entry, g_str_equal (entry, "microphone") ? name : factory))
    gst_pad_add_probe (pad, GST_PAD_PROBE_TYPE_BUFFER, sound, nullptr, nullptr);
  else if (log_file && g_str_equal (factory, "fakesink") &&
           (g_str_equal (name, "snapshot") || g_str_equal (name, "speaker"))) {
    g_object_set (element, "signal-handoffs", TRUE, nullptr);
    g_signal_connect (element, "handoff", G_CALLBACK (show),
        (gpointer)(g_str_equal (name, "speaker") ? "sound" : "picture"));
  }
  gst_clear_object (&pad);
}

GstElement *
gst_parse_launchv (const gchar **argv, GError **error)
{
  const auto parse =
      reinterpret_cast<decltype (&gst_parse_launchv)> (dlsym (RTLD_NEXT, "gst_parse_launchv"));
  GstElement *pipeline = parse (argv, error);
  if (!log_file && std::getenv ("CLAP_LOG"))
    log_file = std::fopen (std::getenv ("CLAP_LOG"), "a");
  if (!GST_IS_BIN (pipeline))
    return pipeline;
  GstIterator *all = gst_bin_iterate_recurse (GST_BIN (pipeline));
  /* Before the switch that mutes it, if there is one. */
  GstElement *microphone = gst_bin_get_by_name (GST_BIN (pipeline), "microphone");
  gst_iterator_foreach (all, watch, const_cast<char *> (microphone ? "microphone" : "opusenc"));
  gst_clear_object (&microphone);
  gst_iterator_free (all);
  return pipeline;
}
