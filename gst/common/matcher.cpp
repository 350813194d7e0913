/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "matcher.hpp"

#include <algorithm>
#include <gstrange/gstrangepairing.hpp>
#include <string>
#include <utility>

using Head = MatchStream::Head;

/* Successive images without partner before a warning is posted: two seconds at 25 Hz. */
static constexpr guint64 kMaxUnmatched = 100;

#define MS_FORMAT ".1f ms"
#define MS_ARGS(ns) (double (ns) / GST_MSECOND)

/* ---- what belongs together ---- */

MatchStep
match_streams (std::span<MatchStream *const> streams, GstClockTime tolerance, bool timeout,
    MatchStream *&dropped)
{
  MatchStream *oldest = nullptr, *gap = nullptr; /* the frame and the gap that come first */
  bool missing = false, required_ended = false;
  for (MatchStream *s : streams) {
    s->in_set = false;
    missing |= s->head == Head::kMissing;
    required_ended |= s->head == Head::kEnded && s->required;
    if (s->head == Head::kFrame && (!oldest || s->time < oldest->time)) /* NONE is the maximum */
      oldest = s;
    if (s->head == Head::kGap && (!gap || s->end < gap->end))
      gap = s;
  }
  if (required_ended || (!oldest && !gap && !missing))
    return MatchStep::kEnd;
  dropped = gap;
  if (gap && oldest && gap->end < oldest->time && GST_CLOCK_TIME_IS_VALID (oldest->time))
    return MatchStep::kDrop;
  if (missing && !timeout)
    return MatchStep::kWait;
  if (!oldest)
    return gap ? MatchStep::kDrop : MatchStep::kWait;
  dropped = oldest;
  for (MatchStream *s : streams) {
    s->in_set = s->head == Head::kFrame &&
                (!GST_CLOCK_TIME_IS_VALID (s->time) || s->time - oldest->time <= tolerance);
    if (s->required && !s->in_set)
      return MatchStep::kDrop;
  }
  return MatchStep::kSet;
}

void
PadStream::peek (GstClockTime tolerance)
{
  release ();
  head = Head::kMissing;
  time = end = running = GST_CLOCK_TIME_NONE;
  buffer = gst_aggregator_pad_peek_buffer (pad);
  if (!buffer) {
    if (gst_aggregator_pad_is_eos (pad))
      head = Head::kEnded;
    return;
  }
  time = running = gstrange::running_time_of (pad, buffer);
  head = gstrange::is_gap (buffer) ? Head::kGap : Head::kFrame;
  if (head == Head::kGap)
    end = gstrange::gap_end (running, buffer, tolerance);
}

/* ---- images of two or three pads ---- */

FrameMatcher::FrameMatcher (
    GstElement *element, GstDebugCategory *category, std::span<const char *const> names)
    : element_ (element), category_ (category), names_ (names)
{
  for (std::size_t i = 0; i < kMaxPads; i++) {
    streams_[i].required = i < 2;
    order_[i] = &streams_[i];
  }
}

/* Pads are looked up by name: the third one may be released at any time. */
void
FrameMatcher::peek (GstClockTime tolerance)
{
  for (std::size_t i = 0; i < names_.size (); i++) {
    PadStream &stream = streams_[i];
    stream.head = Head::kEnded;
    if (GstPad *pad = gst_element_get_static_pad (element_, names_[i])) {
      stream.pad = GST_AGGREGATOR_PAD (pad);
      stream.peek (tolerance);
    }
  }
}

GstFlowReturn
FrameMatcher::next (GstClockTime tolerance, bool timeout)
{
  release ();
  peek (tolerance);
  const GstFlowReturn flow = take_set (tolerance, timeout);
  release_heads ();
  return flow;
}

GstFlowReturn
FrameMatcher::take_set (GstClockTime tolerance, bool timeout)
{
  MatchStream *dropped = nullptr;
  const auto streams = std::span (order_).first (names_.size ());
  switch (match_streams (streams, tolerance, timeout, dropped)) {
    case MatchStep::kWait:
      return GST_AGGREGATOR_FLOW_NEED_DATA;
    case MatchStep::kEnd:
      return GST_FLOW_EOS;
    case MatchStep::kDrop:
      drop (std::size_t (std::ranges::find (streams, dropped) - streams.begin ()), tolerance);
      return GST_AGGREGATOR_FLOW_NEED_DATA; /* GstAggregator looks at the pads again */
    case MatchStep::kSet:
      break;
  }
  discont_ = std::exchange (dropped_since_set_, false);
  for (std::size_t i = 0; i < names_.size (); i++)
    if (streams_[i].in_set) {
      set_[i] = gst_aggregator_pad_pop_buffer (streams_[i].pad);
      discont_ |= GST_BUFFER_IS_DISCONT (streams_[i].buffer);
      if (!set_[i] && streams_[i].required) /* flushed meanwhile */
        return GST_AGGREGATOR_FLOW_NEED_DATA;
    }
  running_ = streams_[0].running;
  unmatched_ = 0;
  if (GST_CLOCK_TIME_IS_VALID (running_)) {
    const GstClockTime length =
        GST_BUFFER_DURATION_IS_VALID (set_[0]) ? GST_BUFFER_DURATION (set_[0]) : 2 * tolerance;
    output_end_ = running_ + length;
  }
  segment_sent_ = true; /* GstAggregator sends it with the first buffer */
  return GST_FLOW_OK;
}

/* Once for each time that a pad falls silent, and for images that never pair up. */
void
FrameMatcher::warn_unmatched (std::size_t index)
{
  const auto silent = std::ranges::find_if (
      streams_, [] (const PadStream &s) { return s.required && s.head == Head::kMissing; });
  unmatched_++;
  if (unmatched_ == 1 && output_end_ > 0 && silent != streams_.end ())
    GST_ELEMENT_WARNING (element_, STREAM, FAILED,
        ("Pad %s has no images in time; those of pad %s are dropped until it has",
            GST_PAD_NAME (silent->pad), names_[index]),
        ("if they are only late, raise latency"));
  else if (unmatched_ == kMaxUnmatched && !std::exchange (warned_unmatched_, true))
    GST_ELEMENT_WARNING (element_, STREAM, FAILED,
        ("Images of pads %s and %s do not pair up: their times must differ by at most half a "
         "frame, or 5 ms if the caps have no framerate, and live ones must arrive within 0.5 s of "
         "each other, or latency must be raised",
            names_[0], names_[1]),
        ("the last %d images found no partner", int (kMaxUnmatched)));
}

/* Drops the head of one pad. Where a GAP is the reason, its time becomes one without output. */
void
FrameMatcher::drop (std::size_t index, GstClockTime tolerance)
{
  const PadStream &stream = streams_[index];
  const bool covered = std::ranges::any_of (
      streams_, [] (const PadStream &s) { return s.required && s.head == Head::kGap; });
  GST_CAT_DEBUG_OBJECT (category_, stream.pad, "dropping %s at %" GST_TIME_FORMAT ": %s",
      stream.head == Head::kGap ? "GAP" : "frame", GST_TIME_ARGS (stream.running),
      covered ? "GAP" : "no partner");
  dropped_since_set_ |= stream.head == Head::kFrame || GST_BUFFER_IS_DISCONT (stream.buffer);
  gst_aggregator_pad_drop_buffer (stream.pad);
  if (stream.head == Head::kFrame) {
    dropped_[index]++;
    warn_unmatched (index);
  }
  if (!covered || !stream.required || !GST_CLOCK_TIME_IS_VALID (stream.running))
    return;
  const GstClockTime length = GST_BUFFER_DURATION_IS_VALID (stream.buffer)
                                  ? GST_BUFFER_DURATION (stream.buffer)
                                  : 2 * tolerance;
  push_gap (std::max (stream.running, output_end_),
      stream.running + std::min (length, GST_CLOCK_TIME_NONE - 1 - stream.running));
}

void
FrameMatcher::push_gap (GstClockTime begin, GstClockTime end)
{
  auto aggregator = GST_AGGREGATOR (element_);
  if (begin >= end || !gst_pad_has_current_caps (aggregator->srcpad)) /* caps come first */
    return;
  GST_OBJECT_LOCK (aggregator);
  const GstSegment segment = GST_AGGREGATOR_PAD (aggregator->srcpad)->segment;
  GST_OBJECT_UNLOCK (aggregator);
  if (!std::exchange (segment_sent_, true)) { /* GstAggregator sends it with buffers only */
    GstEvent *event = gst_event_new_segment (&segment);
    if (GstEvent *cause =
            gst_pad_get_sticky_event (GST_PAD (streams_[0].pad), GST_EVENT_SEGMENT, 0)) {
      gst_event_set_seqnum (event, gst_event_get_seqnum (cause));
      gst_event_unref (cause);
    }
    gst_pad_push_event (aggregator->srcpad, event);
  }
  output_end_ = end;
  const GstClockTime from = gstrange::position_of (segment, begin);
  const GstClockTime to = gstrange::position_of (segment, end);
  GST_CAT_DEBUG_OBJECT (category_, aggregator, "GAP from %" GST_TIME_FORMAT " to %" GST_TIME_FORMAT,
      GST_TIME_ARGS (from), GST_TIME_ARGS (to));
  gst_pad_push_event (aggregator->srcpad, gst_event_new_gap (from, to - from));
}

GstClockTime
FrameMatcher::next_time ()
{
  peek (0);
  GstClockTime oldest = GST_CLOCK_TIME_NONE;
  bool complete = true, ended = false;
  for (std::size_t i = 0; i < names_.size (); i++) {
    const PadStream &stream = streams_[i];
    ended |= stream.head == Head::kEnded && stream.required;
    if (stream.head == Head::kMissing) {
      complete = complete && !stream.required;
      GST_CAT_LOG_OBJECT (category_, stream.pad, "waiting for %s",
          gst_pad_has_current_caps (GST_PAD (stream.pad)) ? "a frame" : "caps and a frame");
    }
    oldest = std::min (oldest, stream.running);
  }
  release_heads ();
  if (ended)
    return 0; /* the stream ends now */
  return complete || !GST_CLOCK_TIME_IS_VALID (oldest) ? oldest : oldest + kPatience;
}

/* ---- pads that nobody has linked ---- */

static gboolean
check_links (GstClock *, GstClockTime, GstClockID, gpointer data)
{
  auto element = static_cast<GstElement *> (data);
  std::string names;
  const auto add = [] (GstElement *, GstPad *pad, gpointer to) -> gboolean {
    auto &list = *static_cast<std::string *> (to);
    if (!gst_pad_is_linked (pad) && !gst_pad_has_current_caps (pad)) /* PackedInput feeds one */
      list += std::string (list.empty () ? "" : ", ") + GST_PAD_NAME (pad);
    return TRUE;
  };
  gst_element_foreach_sink_pad (element, add, &names);
  if (!names.empty () && GST_STATE_TARGET (element) >= GST_STATE_PAUSED) /* pads lose caps after */
    GST_ELEMENT_ERROR (element, CORE, PAD, ("Sink pad not linked: %s", names.c_str ()),
        ("another pad has had caps for a second; every sink pad of this element needs a stream"));
  return TRUE;
}

void
FrameMatcher::watch_links ()
{
  if (link_timer_)
    return;
  GstClock *clock = gst_system_clock_obtain ();
  link_timer_ = gst_clock_new_single_shot_id (clock, gst_clock_get_time (clock) + GST_SECOND);
  gst_clock_id_wait_async (link_timer_, check_links, gst_object_ref (element_), gst_object_unref);
  gst_object_unref (clock);
}

/* ---- life ---- */

void
FrameMatcher::release ()
{
  for (GstBuffer *&buffer : set_)
    gst_clear_buffer (&buffer);
}

void
FrameMatcher::release_heads ()
{
  for (PadStream &stream : streams_) {
    stream.release ();
    gst_clear_object (&stream.pad);
  }
}

void
FrameMatcher::flush ()
{
  release ();
  running_ = GST_CLOCK_TIME_NONE;
  output_end_ = unmatched_ = 0;
  discont_ = dropped_since_set_ = segment_sent_ = false;
}

void
FrameMatcher::start ()
{
  flush ();
  for (auto &dropped : dropped_)
    dropped = 0;
  warned_unmatched_ = false;
}

void
FrameMatcher::stop ()
{
  flush ();
  release_heads ();
  if (link_timer_) {
    gst_clock_id_unschedule (link_timer_);
    gst_clock_id_unref (link_timer_);
    link_timer_ = nullptr;
  }
}

/* ---- caps and pads ---- */

static GstPadProbeReturn
refuse_input (GstPad *, GstPadProbeInfo *info, gpointer)
{
  if (info->type & GST_PAD_PROBE_TYPE_BUFFER) {
    gst_buffer_unref (GST_PAD_PROBE_INFO_BUFFER (info));
    GST_PAD_PROBE_INFO_FLOW_RETURN (info) = GST_FLOW_EOS;
    return GST_PAD_PROBE_HANDLED;
  }
  if (info->type & GST_PAD_PROBE_TYPE_QUERY_DOWNSTREAM) { /* nobody takes it from the queue */
    const GstQueryType type = GST_QUERY_TYPE (GST_PAD_PROBE_INFO_QUERY (info));
    const bool queued = gst_query_type_get_flags (type) & GST_QUERY_TYPE_SERIALIZED;
    return queued ? GST_PAD_PROBE_DROP : GST_PAD_PROBE_OK;
  }
  const GstEventType type = GST_EVENT_TYPE (GST_PAD_PROBE_INFO_EVENT (info));
  if (type == GST_EVENT_STREAM_START || type == GST_EVENT_FLUSH_STOP)
    return GST_PAD_PROBE_REMOVE;
  return type == GST_EVENT_GAP ? GST_PAD_PROBE_DROP : GST_PAD_PROBE_OK;
}

void
end_inputs (GstAggregator *aggregator)
{
  const auto end = [] (GstElement *, GstPad *pad, gpointer) -> gboolean {
    gst_pad_add_probe (pad,
        GstPadProbeType (GST_PAD_PROBE_TYPE_BUFFER | GST_PAD_PROBE_TYPE_EVENT_DOWNSTREAM |
                         GST_PAD_PROBE_TYPE_EVENT_FLUSH | GST_PAD_PROBE_TYPE_QUERY_DOWNSTREAM),
        refuse_input, nullptr, nullptr);
    while (gst_aggregator_pad_drop_buffer (GST_AGGREGATOR_PAD (pad)))
      ;
    return TRUE;
  };
  gst_element_foreach_sink_pad (GST_ELEMENT (aggregator), end, nullptr);
}

std::optional<GstVideoInfo>
parse_caps_event (GstDebugCategory *category, GstAggregatorPad *pad, GstEvent *event)
{
  GstCaps *caps;
  GstVideoInfo info;
  gst_event_parse_caps (event, &caps);
  if (!gst_video_info_from_caps (&info, caps)) {
    GST_CAT_WARNING_OBJECT (category, pad, "refused caps %" GST_PTR_FORMAT, caps);
    return {};
  }
  GST_CAT_INFO_OBJECT (category, pad, "caps %" GST_PTR_FORMAT, caps);
  return info;
}

bool
refuse_bytes (GstAggregatorPad *pad, GstEvent *event)
{
  const GstSegment *segment = nullptr;
  if (GST_EVENT_TYPE (event) == GST_EVENT_SEGMENT)
    gst_event_parse_segment (event, &segment);
  if (!segment || segment->format == GST_FORMAT_TIME)
    return false;
  GstObject *element = gst_object_get_parent (GST_OBJECT (pad));
  GST_ELEMENT_ERROR (element, STREAM, FORMAT,
      ("Pad %s receives bytes without times: put a parser or decoder before it, for .rcnc files "
       "neighbourcodeparse, and set format=time on an appsrc",
          GST_PAD_NAME (pad)),
      (nullptr));
  gst_object_unref (element);
  gst_event_unref (event);
  GST_OBJECT_LOCK (pad);
  gst_segment_init (
      &pad->segment, GST_FORMAT_TIME); /* for buffers that come until the error ends it */
  GST_OBJECT_UNLOCK (pad);
  return true;
}

GstClockTime
frame_duration (const std::optional<GstVideoInfo> &info)
{
  return info && info->fps_n > 0 ? gst_util_uint64_scale_int (GST_SECOND, info->fps_d, info->fps_n)
                                 : GST_CLOCK_TIME_NONE;
}

GstAggregatorPad *
add_sink_pad (GstElement *aggregator, const char *name)
{
  GstPadTemplate *pad_template =
      gst_element_class_get_pad_template (GST_ELEMENT_GET_CLASS (aggregator), name);
  auto pad = static_cast<GstPad *> (g_object_new (GST_TYPE_AGGREGATOR_PAD, "name", name,
      "direction", GST_PAD_SINK, "template", pad_template, nullptr));
  gst_element_add_pad (aggregator, pad);
  return GST_AGGREGATOR_PAD (pad);
}
