/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:element-capturesync
 * @title: capturesync
 *
 * Synchronises streams, such as audio and frame sets, by capture time (lip sync): each buffer's
 * PTS becomes its capture time plus the lag of the slowest stream. What enters at sink_0 leaves at
 * src_0. The capture time is a GstReferenceTimestampMeta, `timestamp/x-range-capture` or
 * `timestamp/x-ntp`; all have to be of one clock.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 capturesync name=s avatartestsrc is-live=true num-buffers=60 ! s.sink_0 \
 *   s.src_0 ! queue ! rangealign ! striprender ! glimagesink
 * ]|
 *
 * Since: 0.1
 */
#include <gst/gst.h>

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

/* Where lags differ by more, clocks are assumed to differ; nobody waits so long for a live stream.
 */
constexpr gint64 kMaxDelay = 2 * GST_SECOND;

struct Settings {
  std::string start_with; /* name of a sink pad; empty: streams begin when they come */
};

/* What enters at a sink pad and leaves at the source pad of the same number. */
struct Stream {
  guint number;
  GstPad *sink = nullptr, *src = nullptr; /* owned by the element */

  /* streaming thread of the sink pad only */
  GstSegment segment{};
  bool warned = false;    /* of missing capture times */
  bool started = false;   /* a segment was sent */
  GstClockTime start = 0; /* of that segment, where running time is 0 */

  /* under the element's lock */
  std::optional<gint64> lag{}; /* running time less capture time, smoothed, ns: follows drift */
  gint64 delay = 0;            /* ns from the last buffer's running time until it is due */
  bool stepped = false;        /* all streams were moved since its last buffer */
  GstClockTime last = GST_CLOCK_TIME_NONE; /* running time of its last buffer */

  /* Under the lock: it delays no other any more. */
  void forget_times ()
  {
    lag.reset ();
    delay = 0;
    last = GST_CLOCK_TIME_NONE;
  }
};

} // namespace

struct GstCaptureSyncPrivate {
  std::mutex lock; /* guards what follows; never held while pushing or posting */
  Settings settings;
  std::vector<std::unique_ptr<Stream>> streams;
  std::optional<gint64> common;             /* ns from capture to due, of all streams */
  bool mismatched = false;                  /* and a warning was posted */
  GstClockTime start = GST_CLOCK_TIME_NONE; /* with start-with: capture time of running time 0 */
  gint64 start_lag = 0;                     /* running time less capture time there */

  /* with the streaming thread, or while none runs */
  Stream *find (guint number)
  {
    const auto found = std::ranges::find (streams, number, &Stream::number);
    return found == streams.end () ? nullptr : found->get ();
  }
};

DECLARE_ELEMENT (GstCaptureSync, gst_capture_sync, CAPTURE_SYNC, GstElement)

static GstStaticPadTemplate sink_template =
    GST_STATIC_PAD_TEMPLATE ("sink_%u", GST_PAD_SINK, GST_PAD_REQUEST, GST_STATIC_CAPS_ANY);
static GstStaticPadTemplate src_template =
    GST_STATIC_PAD_TEMPLATE ("src_%u", GST_PAD_SRC, GST_PAD_SOMETIMES, GST_STATIC_CAPS_ANY);

G_DEFINE_TYPE (GstCaptureSync, gst_capture_sync, GST_TYPE_ELEMENT)
GST_ELEMENT_REGISTER_DEFINE (
    capturesync, "capturesync", GST_RANK_NONE, gst_capture_sync_get_type ())

static Stream *
stream_of (GstPad *pad)
{
  return static_cast<Stream *> (gst_pad_get_element_private (pad));
}

/* ---- times ---- */

/* Moves all streams at once. Under the lock. */
static void
step (GstCaptureSyncPrivate *priv)
{
  for (const auto &stream : priv->streams)
    stream->stepped = true;
}

/* A buffer is due at its capture time plus the lag of the slowest stream; one without a capture
 * time is delayed as the one before. Under the lock.
 * @param[out] mismatch  ns between the quickest and the slowest stream, if that is more than
 * kMaxDelay: none is delayed then
 * @return running time */
static GstClockTime
align (GstCaptureSyncPrivate *priv, Stream &stream, GstClockTime running, GstClockTime capture,
    gint64 &mismatch)
{
  if (!GST_CLOCK_TIME_IS_VALID (running))
    return running;
  if (!GST_CLOCK_TIME_IS_VALID (capture))
    return GstClockTime (std::max<gint64> (0, gint64 (running) + stream.delay));
  const gint64 lag = GST_CLOCK_DIFF (capture, running);
  if (stream.lag && std::abs (lag - *stream.lag) <= kOtherClock)
    *stream.lag += (lag - *stream.lag) / kLagShare;
  else
    stream.lag = lag;
  stream.last = running;
  gint64 quickest = *stream.lag, slowest = *stream.lag;
  for (const auto &other : priv->streams)
    if (other->lag && other->last + kSilence >= running) {
      quickest = std::min (quickest, *other->lag);
      slowest = std::max (slowest, *other->lag);
    }
  if (slowest - quickest > kMaxDelay) {
    mismatch = slowest - quickest;
    priv->common.reset ();
    if (std::exchange (stream.delay, 0) != 0)
      step (priv);
    return running;
  }
  if (!priv->common || std::abs (slowest - *priv->common) > kStep) {
    priv->common = slowest;
    step (priv);
  } else {
    *priv->common += (slowest - *priv->common) / kCommonShare;
  }
  stream.delay = *priv->common - lag;
  return GstClockTime (std::max<gint64> (0, gint64 (running) + stream.delay));
}

/* With start-with: a buffer is due at its capture time less that of the first key frame set (or
 * packet of audio) of the named pad. Under the lock.
 * @param[out] mismatch  ns between its clock and that one's, if more than kMaxDelay
 * @return running time; GST_CLOCK_TIME_NONE: it was captured before, or by another clock */
static GstClockTime
time_since_start (GstCaptureSyncPrivate *priv, Stream &stream, GstBuffer *buffer,
    GstClockTime running, GstClockTime capture, gint64 &mismatch)
{
  if (!GST_CLOCK_TIME_IS_VALID (running) || !GST_CLOCK_TIME_IS_VALID (capture))
    return GST_CLOCK_TIME_NONE;
  const gint64 lag = GST_CLOCK_DIFF (capture, running);
  if (!GST_CLOCK_TIME_IS_VALID (priv->start) &&
      priv->settings.start_with == GST_PAD_NAME (stream.sink) &&
      !GST_BUFFER_FLAG_IS_SET (buffer, GST_BUFFER_FLAG_DELTA_UNIT)) {
    priv->start = capture;
    priv->start_lag = lag;
  }
  if (!GST_CLOCK_TIME_IS_VALID (priv->start))
    return GST_CLOCK_TIME_NONE;
  if (const gint64 other = std::abs (lag - priv->start_lag); other > kMaxDelay) {
    mismatch = other;
    return GST_CLOCK_TIME_NONE;
  }
  if (capture < priv->start)
    return GST_CLOCK_TIME_NONE;
  stream.delay = GST_CLOCK_DIFF (running, capture - priv->start);
  return capture - priv->start;
}

/* When a buffer is due; posts what users are to know. @return running time; GST_CLOCK_TIME_NONE:
 * the buffer is to be dropped */
static GstClockTime
due_time (GstCaptureSync *self, Stream &stream, GstBuffer *buffer)
{
  GstCaptureSyncPrivate *priv = self->priv;
  const GstClockTime capture = capture_time_of (buffer);
  const GstClockTime running =
      gst_segment_to_running_time (&stream.segment, GST_FORMAT_TIME, GST_BUFFER_PTS (buffer));
  if (!GST_CLOCK_TIME_IS_VALID (capture) && !std::exchange (stream.warned, true))
    GST_ELEMENT_WARNING (self, STREAM, FORMAT,
        ("%s: buffers without a capture time are not synchronised (dropped with start-with); they "
         "need a GstReferenceTimestampMeta timestamp/x-range-capture (frame sets) or "
         "timestamp/x-ntp (RTP with the header extension ntp-64)",
            GST_PAD_NAME (stream.sink)),
        (nullptr));
  GstClockTime due = GST_CLOCK_TIME_NONE;
  gint64 mismatch = 0;
  bool newly_mismatched = false;
  {
    std::lock_guard guard (priv->lock);
    due = priv->settings.start_with.empty ()
              ? align (priv, stream, running, capture, mismatch)
              : time_since_start (priv, stream, buffer, running, capture, mismatch);
    newly_mismatched = mismatch > 0 && !priv->mismatched;
    /* With start-with each stream is compared by itself: others do not end it. */
    if (mismatch > 0 || (GST_CLOCK_TIME_IS_VALID (capture) && priv->settings.start_with.empty ()))
      priv->mismatched = mismatch > 0;
  }
  if (newly_mismatched)
    GST_ELEMENT_WARNING (self, STREAM, FAILED,
        ("The streams are %.1f s apart and not synchronised; synchronise the hosts' clocks",
            double (mismatch) / GST_SECOND),
        (nullptr));
  GST_LOG_OBJECT (stream.sink,
      "captured %" GST_TIME_FORMAT ", running time %" GST_TIME_FORMAT ", due %" GST_TIME_FORMAT,
      GST_TIME_ARGS (capture), GST_TIME_ARGS (running), GST_TIME_ARGS (due));
  return due;
}

/* ---- data and events ---- */

/* Before the first buffer or gap; without start-with it begins where the one from upstream does, so
 * that what precedes that also precedes this. @return whether it was sent now */
static bool
send_segment (Stream &stream, bool is_aligned)
{
  if (std::exchange (stream.started, true))
    return false;
  GstSegment segment;
  gst_segment_init (&segment, GST_FORMAT_TIME);
  stream.start = is_aligned ? stream.segment.start : 0;
  segment.start = stream.start;
  segment.time = is_aligned ? stream.segment.time : 0;
  gst_pad_push_event (stream.src, gst_event_new_segment (&segment));
  return true;
}

/* @return running time at which a time of the segment is due, delayed as the last buffer was;
 * GST_CLOCK_TIME_NONE: it is outside the segment. Under the lock. */
static GstClockTime
delayed (const Stream &stream, GstClockTime time)
{
  const GstClockTime running = gst_segment_to_running_time (&stream.segment, GST_FORMAT_TIME, time);
  return GST_CLOCK_TIME_IS_VALID (running)
             ? GstClockTime (std::max<gint64> (0, gint64 (running) + stream.delay))
             : GST_CLOCK_TIME_NONE;
}

static GstFlowReturn
gst_capture_sync_chain (GstPad *pad, GstObject *parent, GstBuffer *buffer)
{
  auto self = GST_CAPTURE_SYNC (parent);
  Stream &stream = *stream_of (pad);
  if (stream.segment.format != GST_FORMAT_TIME) {
    GST_ELEMENT_ERROR (self, STREAM, FORMAT,
        ("%s: needs a segment of time, got %s", GST_PAD_NAME (pad),
            gst_format_get_name (stream.segment.format)),
        (nullptr));
    gst_buffer_unref (buffer);
    return GST_FLOW_ERROR;
  }
  const GstClockTime due = due_time (self, stream, buffer);
  bool is_aligned = false, is_discont = false;
  GstClockTime dts = GST_CLOCK_TIME_NONE;
  {
    std::lock_guard guard (self->priv->lock);
    is_aligned = self->priv->settings.start_with.empty ();
    is_discont = std::exchange (stream.stepped, false);
    if (is_aligned)
      dts = delayed (stream, GST_BUFFER_DTS (buffer));
  }
  if (!GST_CLOCK_TIME_IS_VALID (due) && !is_aligned) {
    GST_DEBUG_OBJECT (pad, "dropping %" GST_PTR_FORMAT, buffer);
    gst_buffer_unref (buffer);
    return GST_FLOW_OK;
  }
  is_discont |= send_segment (stream, is_aligned);
  buffer = gst_buffer_make_writable (buffer);
  if (GST_CLOCK_TIME_IS_VALID (due))
    GST_BUFFER_PTS (buffer) = stream.start + due;
  else if (GST_BUFFER_PTS_IS_VALID (buffer)) /* before the segment, after a seek: what follows needs
                                                it; sinks clip it */
    GST_BUFFER_FLAG_SET (buffer, GST_BUFFER_FLAG_DECODE_ONLY);
  GST_BUFFER_DTS (buffer) = GST_CLOCK_TIME_IS_VALID (dts) ? stream.start + dts : dts;
  if (is_discont)
    GST_BUFFER_FLAG_SET (buffer, GST_BUFFER_FLAG_DISCONT);
  return gst_pad_push (stream.src, buffer);
}

/* A gap is due as a buffer would be. @return transfer full; null: there is no time for it */
static GstEvent *
move_gap (GstCaptureSync *self, Stream &stream, GstEvent *event)
{
  GstClockTime time, duration;
  GstGapFlags flags;
  gst_event_parse_gap (event, &time, &duration);
  gst_event_parse_gap_flags (event, &flags);
  GstClockTime due = GST_CLOCK_TIME_NONE;
  bool is_aligned = false;
  {
    std::lock_guard guard (self->priv->lock);
    is_aligned = self->priv->settings.start_with.empty ();
    if (stream.segment.format == GST_FORMAT_TIME && (stream.started || is_aligned))
      due = delayed (stream, time);
  }
  if (!GST_CLOCK_TIME_IS_VALID (due))
    return nullptr;
  send_segment (stream, is_aligned);
  GstEvent *moved = gst_event_new_gap (stream.start + due, duration);
  gst_event_set_gap_flags (moved, flags);
  gst_event_set_seqnum (moved, gst_event_get_seqnum (event));
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
    case GST_EVENT_EOS: {
      std::lock_guard guard (self->priv->lock);
      stream.forget_times ();
      break;
    }
    case GST_EVENT_SEGMENT: /* another one comes with the first buffer or gap */
      gst_event_copy_segment (event, &stream.segment);
      gst_event_unref (event);
      return TRUE;
    case GST_EVENT_GAP: {
      GstEvent *moved = move_gap (self, stream, event);
      gst_event_unref (event);
      return moved ? gst_pad_push_event (stream.src, moved) : TRUE;
    }
    case GST_EVENT_FLUSH_STOP: {
      gst_segment_init (&stream.segment, GST_FORMAT_UNDEFINED);
      stream.started = false;
      std::lock_guard guard (self->priv->lock);
      stream.forget_times ();
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
    stream->warned = stream->started = stream->stepped = false;
    stream->forget_times ();
  }
  priv->common.reset ();
  priv->start = GST_CLOCK_TIME_NONE;
  priv->mismatched = false;
  return result;
}

static PropertyTable<Settings> &
capture_sync_properties ()
{
  using P = PropertyTable<Settings>;
  static P table = {
      P::text<&Settings::start_with> ("start-with", "Start with",
          "Name of the sink pad whose first key buffer is running time 0, for recordings; what was "
          "captured before is dropped (unset = keep running times)",
          kMutableReady),
  };
  return table;
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

  object_class->finalize = delete_private<GstCaptureSync>;
  install_properties<GstCaptureSync, capture_sync_properties> (object_class);

  element_class->change_state = GST_DEBUG_FUNCPTR (gst_capture_sync_change_state);
  element_class->request_new_pad = GST_DEBUG_FUNCPTR (gst_capture_sync_request_pad);
  element_class->release_pad = GST_DEBUG_FUNCPTR (gst_capture_sync_release_pad);
  gst_element_class_add_static_pad_template (element_class, &sink_template);
  gst_element_class_add_static_pad_template (element_class, &src_template);
  gst_element_class_set_static_metadata (element_class, "Lip sync by capture time", "Generic",
      "Synchronises streams, such as audio and frame sets, by capture time", "gst-rangecast");

  GST_DEBUG_CATEGORY_INIT (gst_capture_sync_debug, "capturesync", 0, "Lip sync by capture time");
}
