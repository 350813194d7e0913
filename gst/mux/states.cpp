/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "states.hpp"

#include <gstrange/gstrangestatus.hpp>

#include "streams.hpp"

const char *
name_of (MuxState state)
{
  switch (state) {
    case MuxState::kSilent:
      return "silent";
    case MuxState::kLate:
      return "late";
    case MuxState::kOutOfStep:
      return "out-of-step";
    case MuxState::kApart:
      return "apart";
    case MuxState::kClash:
      return "clash";
    case MuxState::kOtherRig:
      return "other-rig";
    default:
      return "in";
  }
}

std::string
explain (const MuxPad &entry, MuxState state, GstClockTimeDiff offset)
{
  const std::string seconds = std::to_string (double (ABS (offset)) / GST_SECOND) + " s";
  switch (state) {
    case MuxState::kSilent:
      return ": nothing came for " + std::to_string (kSilentAfter / GST_SECOND) +
             " s; the others continue without it";
    case MuxState::kLate:
      return ": all buffers are late, capture times are " + seconds +
             " behind the others'; left out; expected a host and a network that keep up, a "
             "synchronised clock, or a greater latency";
    case MuxState::kOutOfStep:
      return ": its capture times are " + seconds + (offset < 0 ? " behind" : " ahead of") +
             " the others': the host's clock is not synchronised; left out until it is";
    case MuxState::kApart:
      return (offset > 0 ? ": its capture times are " + seconds +
                               " ahead of the others': it waits until they catch up"
                         : std::string (": it has ended, and no frame set contains both its views "
                                        "and another stream's")) +
             "; expected recordings of the same time, by hosts with synchronised clocks";
    case MuxState::kOtherRig:
      return ": " + entry.other_rig.message () + "; left out";
    case MuxState::kClash:
      return ": " + entry.clash.message () + "; left out";
    default:
      return ": is back";
  }
}

void
tell_state (GstElement *element, MuxPad &entry, MuxState state, GstClockTimeDiff offset)
{
  entry.said = state;
  const std::string text = entry.title () + explain (entry, state, offset);
  if (state != MuxState::kIn)
    gst_range_post_warning (element, {rangecast::StatusCode::kBadData, text});
  gst_element_post_message (element,
      gst_message_new_element (GST_OBJECT (element),
          gst_structure_new ("rangemux-stream", "pad", G_TYPE_STRING, GST_PAD_NAME (entry.pad),
              "view-id", G_TYPE_INT, entry.view_id (), "state", G_TYPE_STRING, name_of (state),
              "offset", G_TYPE_INT64, gint64 (offset), nullptr)));
}
