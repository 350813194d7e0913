/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:element-capturesync
 * @title: capturesync
 *
 * Synchronises streams, such as speech and frame sets, by capture time (lip sync): each buffer's
 * PTS becomes its capture time plus the lag of the slowest stream. What enters at sink_0 leaves at
 * src_0. The capture time is a GstReferenceTimestampMeta, `timestamp/x-range-capture` or
 * `timestamp/x-ntp`; all have to be of one clock.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 capturesync name=s avatartestsrc is-live=true num-buffers=60 ! s.sink_0 s.src_0 !
 * queue ! rangealign ! striprender ! glimagesink
 * ]|
 *
 * Since: 0.1
 */
#include "gstcapturesync.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/capturetime.hpp"
#include "common/elementproperties.hpp"

GST_DEBUG_CATEGORY_STATIC (gst_capture_sync_debug);
#define GST_CAT_DEFAULT gst_capture_sync_debug

namespace {

/* A lag that differs by more than this from before is that of another sender or clock. */
constexpr gint64 kOtherClock = 500 * GST_MSECOND;
/* Less than this is followed without a step. Viewers notice sound that is 45 ms early or 125 ms
 * late (ITU-R BT.1359, detectability). */
constexpr gint64 kStep = 10 * GST_MSECOND;
/* A stream that has been silent for so long may come back from another host, and delays no other.
 */
constexpr GstClockTime kSilence = 5 * GST_SECOND;
/* Shares of a difference by which a lag, and the common lag, follow it with each buffer. */
constexpr gint64 kLagShare = 16, kCommonShare = 64;

struct Settings {
  GstClockTime max_delay = 2 * GST_SECOND;
  std::string start_with; /* name of a sink pad; empty: streams begin when they come */
};

/* When buffers of a stream are due. Its lag is the running time of a buffer less its capture time,
 * smoothed, so that it follows a clock that drifts. */
struct Timing {
  std::optional<gint64> lag; /* ns */
  gint64 delay = 0;          /* ns from the last buffer's running time until it is due */
  guint steps = 0;           /* of the element, when its last buffer came */
  GstClockTime last = GST_CLOCK_TIME_NONE; /* running time of its last buffer */
};

/* What enters at a sink pad and leaves at the source pad of the same number. */
struct Stream {
  guint number;
  GstPad *sink = nullptr, *src = nullptr; /* owned by the element */

  /* streaming thread of the sink pad only */
  GstSegment segment{};
  bool warned = false; /* of missing capture times */
  /* with start-with */
  bool started = false; /* its segment was sent */
  bool dropped = false; /* something */

  Timing timing{}; /* under the element's lock */
};

} // namespace

struct GstCaptureSyncPrivate {
  std::mutex lock; /* guards what follows; never held while pushing or posting */
  Settings settings;
  std::vector<std::unique_ptr<Stream>> streams;
  std::optional<gint64> common;             /* ns from capture to due, of all streams */
  guint steps = 0;                          /* how often all streams were moved at once */
  bool apart = false;                       /* and a warning was posted */
  GstClockTime start = GST_CLOCK_TIME_NONE; /* with start-with: capture time of running time 0 */
  gint64 start_lag = 0;                     /* running time less capture time there */

  /* with the streaming thread, or while none runs */
  Stream *find (guint number)
  {
    const auto found = std::ranges::find (streams, number, &Stream::number);
    return found == streams.end () ? nullptr : found->get ();
  }
};

struct _GstCaptureSync {
  GstElement parent;
  GstCaptureSyncPrivate *priv;
};

static GstStaticPadTemplate sink_template =
    GST_STATIC_PAD_TEMPLATE ("sink_%u", GST_PAD_SINK, GST_PAD_REQUEST, GST_STATIC_CAPS_ANY);
static GstStaticPadTemplate src_template =
    GST_STATIC_PAD_TEMPLATE ("src_%u", GST_PAD_SRC, GST_PAD_SOMETIMES, GST_STATIC_CAPS_ANY);

G_DEFINE_TYPE (GstCaptureSync, gst_capture_sync, GST_TYPE_ELEMENT)
GST_ELEMENT_REGISTER_DEFINE (capturesync, "capturesync", GST_RANK_NONE, GST_TYPE_CAPTURE_SYNC)

static Stream *
stream_of (GstPad *pad)
{
  return static_cast<Stream *> (gst_pad_get_element_private (pad));
}

/* ---- times ---- */

static void
warn_missing_capture_time (GstCaptureSync *self, Stream &stream, const char *consequence)
{
  if (!std::exchange (stream.warned, true))
    GST_ELEMENT_WARNING (self, STREAM, FORMAT,
        ("%s: buffers without a capture time %s; expected a GstReferenceTimestampMeta "
         "timestamp/x-range-capture (frame sets) or timestamp/x-ntp (RTP with the header extension "
         "ntp-64)",
            GST_PAD_NAME (stream.sink), consequence),
        (nullptr));
}

/* Sets the delay of a stream for a buffer: its capture time plus the lag of the slowest stream is
 * when it is due. Under the lock.
 * @return ns between the quickest and the slowest stream, if they are further apart than max-delay:
 *         none is delayed then; else 0 */
static gint64
place (GstCaptureSyncPrivate *priv, Timing &timing, GstClockTime running, GstClockTime capture)
{
  const gint64 lag = GST_CLOCK_DIFF (capture, running);
  if (timing.lag && std::abs (lag - *timing.lag) <= kOtherClock)
    *timing.lag += (lag - *timing.lag) / kLagShare;
  else
    timing.lag = lag;
  timing.last = running;
  gint64 quickest = *timing.lag, slowest = *timing.lag;
  for (const auto &stream : priv->streams)
    if (const Timing &other = stream->timing; other.lag && other.last + kSilence >= running) {
      quickest = std::min (quickest, *other.lag);
      slowest = std::max (slowest, *other.lag);
    }
  if (guint64 (slowest - quickest) > priv->settings.max_delay) {
    priv->common.reset ();
    priv->steps += timing.delay != 0;
    timing.delay = 0;
    return slowest - quickest;
  }
  if (!priv->common || std::abs (slowest - *priv->common) > kStep) {
    priv->common = slowest;
    priv->steps++;
  } else {
    *priv->common += (slowest - *priv->common) / kCommonShare;
  }
  timing.delay = *priv->common - lag;
  return 0;
}

/* Sets the buffer's time so that it is due with others of its capture time. */
static GstBuffer *
align (GstCaptureSync *self, Stream &stream, GstBuffer *buffer)
{
  GstCaptureSyncPrivate *priv = self->priv;
  const GstClockTime capture = capture_time_of (buffer);
  const GstClockTime running =
      gst_segment_to_running_time (&stream.segment, GST_FORMAT_TIME, GST_BUFFER_PTS (buffer));
  if (!GST_CLOCK_TIME_IS_VALID (capture))
    warn_missing_capture_time (self, stream, "pass as they are");
  GST_LOG_OBJECT (stream.sink, "captured %" GST_TIME_FORMAT ", running time %" GST_TIME_FORMAT,
      GST_TIME_ARGS (capture), GST_TIME_ARGS (running));
  bool stepped = false, newly_apart = false;
  gint64 delay = 0, apart = 0;
  {
    std::lock_guard guard (priv->lock);
    if (GST_CLOCK_TIME_IS_VALID (capture) && GST_CLOCK_TIME_IS_VALID (running)) {
      apart = place (priv, stream.timing, running, capture);
      newly_apart = apart > 0 && !priv->apart;
      priv->apart = apart > 0;
      stepped = std::exchange (stream.timing.steps, priv->steps) != priv->steps;
    }
    delay = stream.timing.delay;
  }
  if (newly_apart)
    GST_ELEMENT_WARNING (self, STREAM, FAILED,
        ("The streams are %.1f s apart and pass as they are; synchronise the hosts' clocks, or "
         "raise max-delay",
            double (apart) / GST_SECOND),
        (nullptr));
  if (stepped)
    GST_DEBUG_OBJECT (stream.sink, "step: from now on %" GST_STIME_FORMAT " later than it comes",
        GST_STIME_ARGS (delay));
  buffer = gst_buffer_make_writable (buffer);
  const auto shift = [delay] (GstClockTime time) {
    if (!GST_CLOCK_TIME_IS_VALID (time))
      return time;
    return delay < 0 && GstClockTime (-delay) > time ? 0 : time + delay;
  };
  GST_BUFFER_PTS (buffer) = shift (GST_BUFFER_PTS (buffer));
  GST_BUFFER_DTS (buffer) = shift (GST_BUFFER_DTS (buffer));
  if (stepped)
    GST_BUFFER_FLAG_SET (buffer, GST_BUFFER_FLAG_DISCONT);
  return buffer;
}

/* ---- start-with ---- */

/* Where running time 0 is, which the first key frame set (or packet of speech) of the named pad
 * decides. GST_CLOCK_TIME_NONE until then.
 * @param running  of the buffer on the pad, GST_CLOCK_TIME_NONE if unknown
 * @param[out] other_clock  whether the buffer was captured by another clock than the first one */
static GstClockTime
find_start (GstCaptureSyncPrivate *priv, const Stream &stream, GstBuffer *buffer,
    GstClockTime capture, GstClockTime running, bool &other_clock)
{
  std::lock_guard guard (priv->lock);
  if (!GST_CLOCK_TIME_IS_VALID (priv->start) &&
      priv->settings.start_with == GST_PAD_NAME (stream.sink) &&
      !GST_BUFFER_FLAG_IS_SET (buffer, GST_BUFFER_FLAG_DELTA_UNIT) &&
      GST_CLOCK_TIME_IS_VALID (running)) {
    priv->start = capture;
    priv->start_lag = GST_CLOCK_DIFF (capture, running);
  }
  other_clock = GST_CLOCK_TIME_IS_VALID (priv->start) && GST_CLOCK_TIME_IS_VALID (capture) &&
                GST_CLOCK_TIME_IS_VALID (running) &&
                guint64 (ABS (GST_CLOCK_DIFF (capture, running) - priv->start_lag)) >
                    priv->settings.max_delay;
  return priv->start;
}

/* Gives the buffer its time since the start. nullptr: it was captured before that, and is dropped.
 * @param buffer  transfer full */
static GstBuffer *
restart (GstCaptureSync *self, Stream &stream, GstBuffer *buffer)
{
  const GstClockTime capture = capture_time_of (buffer);
  if (!GST_CLOCK_TIME_IS_VALID (capture))
    warn_missing_capture_time (self, stream, "are dropped");
  bool other_clock = false;
  const GstClockTime start = find_start (self->priv, stream, buffer, capture,
      gst_segment_to_running_time (&stream.segment, GST_FORMAT_TIME, GST_BUFFER_PTS (buffer)),
      other_clock);
  if (other_clock || !GST_CLOCK_TIME_IS_VALID (capture) || !GST_CLOCK_TIME_IS_VALID (start) ||
      capture < start) {
    GST_DEBUG_OBJECT (stream.sink, "%s: dropping %" GST_PTR_FORMAT,
        other_clock ? "another clock" : "before the start", buffer);
    gst_buffer_unref (buffer);
    stream.dropped = true;
    return nullptr;
  }
  buffer = gst_buffer_make_writable (buffer);
  GST_BUFFER_PTS (buffer) = capture - start;
  GST_BUFFER_DTS (buffer) = GST_CLOCK_TIME_NONE;
  if (!std::exchange (stream.started, true)) {
    GstSegment segment;
    gst_segment_init (&segment, GST_FORMAT_TIME);
    gst_pad_push_event (stream.src, gst_event_new_segment (&segment));
    GST_BUFFER_FLAG_SET (buffer, GST_BUFFER_FLAG_DISCONT);
  }
  return buffer;
}

static void
warn_if_all_was_dropped (GstCaptureSync *self, const Stream &stream)
{
  if (stream.dropped && !stream.started)
    GST_ELEMENT_WARNING (self, STREAM, FAILED,
        ("%s: all buffers were dropped; expected buffers with capture times after the first key "
         "frame set (or packet of speech) of the pad that start-with names",
            GST_PAD_NAME (stream.sink)),
        (nullptr));
}

static bool
has_start (GstCaptureSyncPrivate *priv)
{
  std::lock_guard guard (priv->lock);
  return !priv->settings.start_with.empty ();
}

/* ---- data and events ---- */

static GstFlowReturn
gst_capture_sync_chain (GstPad *pad, GstObject *parent, GstBuffer *buffer)
{
  auto self = GST_CAPTURE_SYNC (parent);
  Stream &stream = *stream_of (pad);
  if (stream.segment.format != GST_FORMAT_TIME) {
    GST_ELEMENT_ERROR (self, STREAM, FORMAT,
        ("%s: expected a segment of time, got %s", GST_PAD_NAME (pad),
            gst_format_get_name (stream.segment.format)),
        (nullptr));
    gst_buffer_unref (buffer);
    return GST_FLOW_ERROR;
  }
  buffer = has_start (self->priv) ? restart (self, stream, buffer) : align (self, stream, buffer);
  return buffer ? gst_pad_push (stream.src, buffer) : GST_FLOW_OK;
}

/* A gap is due as a buffer would be. */
static GstEvent *
move_gap (GstCaptureSync *self, Stream &stream, GstEvent *event)
{
  GstClockTime time, duration;
  gst_event_parse_gap (event, &time, &duration);
  gint64 delay = 0;
  {
    std::lock_guard guard (self->priv->lock);
    delay = stream.timing.delay;
  }
  GstEvent *moved =
      gst_event_new_gap (delay < 0 && GstClockTime (-delay) > time ? 0 : time + delay, duration);
  GstGapFlags flags;
  gst_event_parse_gap_flags (event, &flags);
  gst_event_set_gap_flags (moved, flags);
  gst_event_set_seqnum (moved, gst_event_get_seqnum (event));
  gst_event_unref (event);
  return moved;
}

static gboolean
gst_capture_sync_sink_event (GstPad *pad, GstObject *parent, GstEvent *event)
{
  auto self = GST_CAPTURE_SYNC (parent);
  if (!stream_of (pad)) { /* released */
    gst_event_unref (event);
    return FALSE;
  }
  Stream &stream = *stream_of (pad);
  switch (GST_EVENT_TYPE (event)) {
    case GST_EVENT_STREAM_START:
    case GST_EVENT_EOS: { /* holds nobody up any more */
      if (GST_EVENT_TYPE (event) == GST_EVENT_EOS)
        warn_if_all_was_dropped (self, stream);
      std::lock_guard guard (self->priv->lock);
      stream.timing = {};
      break;
    }
    case GST_EVENT_SEGMENT:
      gst_event_copy_segment (event, &stream.segment);
      if (!has_start (self->priv))
        break;
      gst_event_unref (event); /* another one comes with the first buffer */
      return TRUE;
    case GST_EVENT_GAP:
      if (has_start (self->priv)) {
        gst_event_unref (event);
        return TRUE;
      }
      event = move_gap (self, stream, event);
      break;
    case GST_EVENT_FLUSH_STOP: {
      gst_segment_init (&stream.segment, GST_FORMAT_UNDEFINED);
      std::lock_guard guard (self->priv->lock);
      stream.timing = {};
      stream.started = false;
      break;
    }
    default:
      break;
  }
  return gst_pad_event_default (pad, parent, event);
}

/* ---- pads ---- */

static GstIterator *
gst_capture_sync_links (GstPad *pad, GstObject *parent)
{
  GValue value = G_VALUE_INIT;
  g_value_init (&value, GST_TYPE_PAD);
  {
    std::lock_guard guard (GST_CAPTURE_SYNC (parent)->priv->lock);
    const Stream *stream = stream_of (pad);
    if (!stream) /* released */
      return nullptr;
    g_value_set_object (&value, pad == stream->sink ? stream->src : stream->sink);
  }
  GstIterator *links = gst_iterator_new_single (GST_TYPE_PAD, &value);
  g_value_unset (&value);
  return links;
}

static GstPad *
make_pad (GstStaticPadTemplate *pad_template, const std::string &name, Stream *stream)
{
  GstPad *pad = gst_pad_new_from_static_template (pad_template, name.c_str ());
  gst_pad_set_element_private (pad, stream);
  gst_pad_set_iterate_internal_links_function (pad, GST_DEBUG_FUNCPTR (gst_capture_sync_links));
  GST_PAD_SET_PROXY_CAPS (pad);
  GST_PAD_SET_PROXY_ALLOCATION (pad);
  gst_pad_set_active (pad, TRUE);
  return pad;
}

/* The number in "sink_3", the lowest free one without a name, G_MAXUINT if it is taken. */
static guint
choose_number (GstCaptureSyncPrivate *priv, const gchar *name)
{
  guint number = 0;
  if (name && sscanf (name, "sink_%u", &number) == 1)
    return priv->find (number) ? G_MAXUINT : number;
  while (priv->find (number))
    number++;
  return number;
}

static GstPad *
gst_capture_sync_request_pad (
    GstElement *element, GstPadTemplate *, const gchar *name, const GstCaps *)
{
  GstCaptureSyncPrivate *priv = GST_CAPTURE_SYNC (element)->priv;
  Stream *stream = nullptr;
  {
    std::lock_guard guard (priv->lock);
    const guint number = choose_number (priv, name);
    if (number == G_MAXUINT) {
      GST_WARNING_OBJECT (element, "pad %s exists already", name);
      return nullptr;
    }
    stream = priv->streams.emplace_back (new Stream{.number = number}).get ();
  }
  gst_segment_init (&stream->segment, GST_FORMAT_UNDEFINED);
  const std::string number = std::to_string (stream->number);
  stream->sink = make_pad (&sink_template, "sink_" + number, stream);
  stream->src = make_pad (&src_template, "src_" + number, stream);
  gst_pad_set_chain_function (stream->sink, GST_DEBUG_FUNCPTR (gst_capture_sync_chain));
  gst_pad_set_event_function (stream->sink, GST_DEBUG_FUNCPTR (gst_capture_sync_sink_event));
  gst_element_add_pad (element, stream->src);
  gst_element_add_pad (element, stream->sink);
  return stream->sink;
}

static void
gst_capture_sync_release_pad (GstElement *element, GstPad *sink)
{
  GstCaptureSyncPrivate *priv = GST_CAPTURE_SYNC (element)->priv;
  Stream *stream = stream_of (sink);
  GstPad *src = stream->src;
  gst_pad_set_active (src, FALSE);
  gst_pad_set_active (sink, FALSE);
  {
    std::lock_guard guard (priv->lock);
    for (GstPad *pad : {src, sink})
      gst_pad_set_element_private (pad, nullptr);
    std::erase_if (priv->streams, [stream] (const auto &one) { return one.get () == stream; });
  }
  gst_element_remove_pad (element, src);
  gst_element_remove_pad (element, sink);
}

/* ---- life ---- */

static GstStateChangeReturn
gst_capture_sync_change_state (GstElement *element, GstStateChange transition)
{
  const GstStateChangeReturn result =
      GST_ELEMENT_CLASS (gst_capture_sync_parent_class)->change_state (element, transition);
  if (transition != GST_STATE_CHANGE_PAUSED_TO_READY)
    return result;
  GstCaptureSyncPrivate *priv = GST_CAPTURE_SYNC (element)->priv;
  std::lock_guard guard (priv->lock);
  for (const auto &stream : priv->streams) {
    gst_segment_init (&stream->segment, GST_FORMAT_UNDEFINED);
    stream->warned = stream->started = stream->dropped = false;
    stream->timing = {};
  }
  priv->common.reset ();
  priv->steps = 0;
  priv->start = GST_CLOCK_TIME_NONE;
  priv->apart = false;
  return result;
}

static PropertyTable<Settings> &
capture_sync_properties ()
{
  using P = PropertyTable<Settings>;
  static P table = {
      P::number<&Settings::max_delay> ("max-delay", "Maximum delay",
          "Maximum difference in lag between streams in nanoseconds; beyond it their clocks are "
          "assumed to differ, and timestamps are not changed",
          0, G_MAXINT64, kMutablePlaying),
      P::text<&Settings::start_with> ("start-with", "Start with",
          "Name of the sink pad whose first key buffer is running time 0, for recordings; what was "
          "captured before is dropped (unset = keep running times)",
          kMutableReady),
  };
  return table;
}

static GstStructure *
make_stats (const GstCaptureSyncPrivate *priv)
{
  GstStructure *stats = gst_structure_new (
      "application/x-capturesync-stats", "steps", G_TYPE_UINT64, guint64 (priv->steps), nullptr);
  for (const auto &stream : priv->streams) {
    if (!stream->timing.lag)
      continue;
    GstStructure *one = gst_structure_new ("stream", "lag", G_TYPE_INT64, *stream->timing.lag,
        "delay", G_TYPE_INT64, stream->timing.delay, nullptr);
    gst_structure_set (stats, GST_PAD_NAME (stream->sink), GST_TYPE_STRUCTURE, one, nullptr);
    gst_structure_free (one);
  }
  return stats;
}

static void
gst_capture_sync_finalize (GObject *object)
{
  delete GST_CAPTURE_SYNC (object)->priv;
  G_OBJECT_CLASS (gst_capture_sync_parent_class)->finalize (object);
}

static void
gst_capture_sync_init (GstCaptureSync *self)
{
  self->priv = new GstCaptureSyncPrivate;
}

static void
gst_capture_sync_class_init (GstCaptureSyncClass *klass)
{
  auto object_class = G_OBJECT_CLASS (klass);
  auto element_class = GST_ELEMENT_CLASS (klass);

  object_class->finalize = gst_capture_sync_finalize;
  install_properties<GstCaptureSync, capture_sync_properties, make_stats> (object_class,
      "steps, and a structure for each sink pad: lag (running time less capture time) and delay "
      "(added to the last buffer's PTS), both int64 in nanoseconds");

  element_class->change_state = GST_DEBUG_FUNCPTR (gst_capture_sync_change_state);
  element_class->request_new_pad = GST_DEBUG_FUNCPTR (gst_capture_sync_request_pad);
  element_class->release_pad = GST_DEBUG_FUNCPTR (gst_capture_sync_release_pad);
  gst_element_class_add_static_pad_template (element_class, &sink_template);
  gst_element_class_add_static_pad_template (element_class, &src_template);
  gst_element_class_set_static_metadata (element_class, "Lip sync by capture time", "Generic",
      "Synchronises streams, such as speech and frame sets, by capture time", "gst-rangecast");

  GST_DEBUG_CATEGORY_INIT (gst_capture_sync_debug, "capturesync", 0, "Lip sync by capture time");
}
