/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "streams.hpp"

#include <algorithm>
#include <gstrange/gstrangestatus.hpp>

using rangecast::Rig;
using rangecast::Status;
using rangecast::StatusCode;
using rangecast::View;

void
RecordingRound::add (const WaitingBuffer &w)
{
  if (!GST_CLOCK_TIME_IS_VALID (begin))
    begin = w.capture;
  if (GST_CLOCK_TIME_IS_VALID (newest) && w.capture <= newest)
    return;
  newest = w.capture;
  newest_running = w.running;
}

void
MuxStream::reset ()
{
  has_caps = coded = chosen = alive = clash_reported = offset_known = shift_known = matched_others =
      different_time_reported = false;
  other_rig = clash = {};
  round = {};
  gst_clear_buffer (&held);
  seen = since = GST_CLOCK_TIME_NONE;
  reported = state = StreamState::kIn;
  received = late = out_of_sync = left_out = matched = views = 0;
  last_skew = offset = shift = ahead = 0;
}

std::string
MuxStream::title () const
{
  std::string text = std::string ("pad ") + GST_PAD_NAME (pad);
  if (has_caps)
    text += " (view " + std::to_string (info.rig.views.front ().id) + ")";
  return text;
}

/* ---- which streams make up frame sets ---- */

namespace {

/* The format of most streams that are alive; of the first stream if as many have the other one. */
bool
choose_coded (const std::vector<MuxStream *> &order)
{
  int votes = 0; /* > 0: coded */
  for (const MuxStream *stream : order)
    if (stream->alive)
      votes += stream->coded ? 1 : -1;
  return votes != 0 ? votes > 0 : order.front ()->coded;
}

Status
clash_of (const MuxStream &stream, const std::vector<MuxStream *> &chosen, const MuxFormat &format)
{
  const std::string name = GST_PAD_NAME (stream.pad);
  for (const MuxStream *other : chosen)
    for (const View &view : stream.info.rig.views)
      if (other->info.rig.find (view.id))
        return {StatusCode::kBadValue, "pads " + std::string (GST_PAD_NAME (other->pad)) + " and " +
                                           name + ": both have view-id " +
                                           std::to_string (view.id) + "; expected each view once"};
  if (stream.coded == format.coded)
    return {};
  const std::string first = chosen.empty () ? "most others" : GST_PAD_NAME (chosen.front ()->pad);
  return {StatusCode::kBadValue,
      "pads " + first + " and " + name + ": expected all raw or all coded streams"};
}

} // namespace

Status
choose_streams (const MuxStreams &streams, bool strict, MuxFormat &format)
{
  std::vector<MuxStream *> order, chosen;
  for (const auto &stream : streams) {
    if (strict && !stream->other_rig.ok ())
      return {stream->other_rig.code (), stream->title () + ": " + stream->other_rig.message ()};
    stream->chosen = stream->chosen && stream->other_rig.ok ();
    if (stream->has_caps && stream->other_rig.ok ())
      order.push_back (stream.get ());
  }
  std::ranges::stable_sort (order, {}, [strict] (const MuxStream *stream) {
    return strict ? 0 : 2 * !stream->alive + !stream->chosen;
  });
  format = {};
  if (order.empty ())
    return {};
  format.coded = strict ? order.front ()->coded : choose_coded (order);
  Rig united;
  for (MuxStream *stream : order) {
    stream->clash = clash_of (*stream, chosen, format);
    if (stream->clash.ok ())
      stream->clash = rangecast::merge (united, stream->info.rig);
    stream->chosen = stream->clash.ok ();
    if (stream->chosen)
      chosen.push_back (stream);
    else if (strict)
      return stream->clash;
  }
  if (!chosen.empty ())
    format.info = gstrange::make_info (
        std::move (united), chosen.front ()->info.fps_n, chosen.front ()->info.fps_d);
  return {};
}

/* ---- states, for users and applications ---- */

const char *
name_of (StreamState state)
{
  switch (state) {
    case StreamState::kSilent:
      return "silent";
    case StreamState::kLate:
      return "late";
    case StreamState::kOutOfSync:
      return "out-of-step";
    case StreamState::kDifferentTime:
      return "apart";
    case StreamState::kClash:
      return "clash";
    case StreamState::kOtherRig:
      return "other-rig";
    default:
      return "in";
  }
}

namespace {

std::string
explain_late (GstClockTimeDiff offset, const std::string &seconds, bool live)
{
  std::string text = ": all buffers are late";
  if (live) {
    if (offset != 0)
      text += ", capture times are " + seconds + " behind the others'";
    return text + "; left out; expected a host and a network that keep up, a synchronised clock, "
                  "or a greater latency";
  }
  text += offset < 0 ? ", captured " + seconds + " before" : ", captured at the time of";
  return text + " the last frame set; left out; expected capture times that rise";
}

std::string
explain_different_time (GstClockTimeDiff offset, const std::string &seconds)
{
  if (offset < 0)
    return ": it has begun again, its capture times are " + seconds +
           " behind the others': it waits until they begin again or end; expected recordings that "
           "are equally long";
  return (offset > 0 ? ": its capture times are " + seconds +
                           " ahead of the others': it waits until they catch up"
                     : std::string (": it has ended, and no frame set contains both its views and "
                                    "another stream's")) +
         "; expected recordings of the same time, by hosts with synchronised clocks";
}

/* The sentence that follows title(). */
std::string
explain (const MuxStream &stream, StreamState state, GstClockTimeDiff offset, bool live)
{
  const std::string seconds = std::to_string (double (ABS (offset)) / GST_SECOND) + " s";
  switch (state) {
    case StreamState::kSilent:
      return ": nothing came for " + std::to_string (kSilentAfter / GST_SECOND) +
             " s; the others continue without it";
    case StreamState::kLate:
      return explain_late (offset, seconds, live);
    case StreamState::kOutOfSync:
      return ": its capture times are " + seconds + (offset < 0 ? " behind" : " ahead of") +
             " the others': the host's clock is not synchronised; left out until it is";
    case StreamState::kDifferentTime:
      return explain_different_time (offset, seconds);
    case StreamState::kOtherRig:
      return ": " + stream.other_rig.message () + "; left out";
    case StreamState::kClash:
      return ": " + stream.clash.message () + "; left out";
    default:
      return ": is back";
  }
}

} // namespace

void
report_state (
    GstElement *element, MuxStream &stream, StreamState state, GstClockTimeDiff offset, bool live)
{
  const int view_id = stream.has_caps ? stream.info.rig.views.front ().id : -1;
  stream.reported = state;
  const std::string text = stream.title () + explain (stream, state, offset, live);
  if (state != StreamState::kIn)
    gst_range_post_warning (element, {StatusCode::kBadData, text});
  gst_element_post_message (element,
      gst_message_new_element (GST_OBJECT (element),
          gst_structure_new ("rangemux-stream", "pad", G_TYPE_STRING, GST_PAD_NAME (stream.pad),
              "view-id", G_TYPE_INT, view_id, "state", G_TYPE_STRING, name_of (state), "offset",
              G_TYPE_INT64, gint64 (offset), nullptr)));
}
