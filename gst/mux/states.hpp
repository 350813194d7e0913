/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <string>

struct MuxPad;

/** Whether a stream's buffers become part of frame sets, and why not. */
enum class MuxState {
  kIn,
  kSilent,    ///< nothing has come for a while
  kLate,      ///< its buffers come after their frame sets
  kOutOfStep, ///< its capture times are of another clock
  kApart,     ///< a recording of another time, or of another clock, than the others
  kClash,     ///< other streams have its view-id, or another format
  kOtherRig,  ///< the rig that was asked for has other cameras
};

/** Nick for statistics and messages: "in", "silent", "late", "out-of-step", "apart", "clash",
 *  "other-rig". */
const char *name_of (MuxState state);

/** What goes on with a stream, for people: follows its title().
 *  @param offset  of its capture times, ahead of the others', ns */
std::string explain (const MuxPad &entry, MuxState state, GstClockTimeDiff offset);

/** Tells a state to people, by a warning, and to applications, by a message. Call without any
 *  lock held. */
void tell_state (GstElement *element, MuxPad &entry, MuxState state, GstClockTimeDiff offset);
