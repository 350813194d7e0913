/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <optional>
#include <rangecast/neighbourcode/bitstream/byte_stream.hpp>
#include <vector>

/** Finds access units in a file of coded frame sets, through a pad in pull mode. Any thread. Times
 *  are stream times, which begin at 0; `first_pts` is the time in the file there. */
class NeighbourCodeFile {
public:
  NeighbourCodeFile (GstPad *pad, GstClockTime first_pts) : pad_ (pad), first_pts_ (first_pts) {}

  /** Time of the last access unit; GST_CLOCK_TIME_NONE if it has none. */
  GstClockTime last_time ();

  /** Where decoding can begin. */
  struct Place {
    guint64 offset; ///< bytes
    GstClockTime time;
    std::vector<guint8> rig_units; ///< the last rig up to there
  };
  /** The key access unit for a seek to `start` with these flags; not after `stop`, unless it is the
   *  first one. Nothing if the file has no times. */
  std::optional<Place> find (GstClockTime start, GstClockTime stop, GstSeekFlags flags);

private:
  void read (guint64 offset, gsize size, std::vector<guint8> &to);
  rangecast::StreamFile stream ();
  guint64 pts_at (GstClockTime time) const;

  GstPad *pad_;
  GstClockTime first_pts_;
};
