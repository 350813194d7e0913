/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <optional>
#include <rangecast/neighbourcode/bitstream/byte_stream.hpp>
#include <vector>

/** A file of coded frame sets in front of a pad in pull mode. Any thread. Times are of the stream:
 *  they begin at 0, where the file says `first_pts`. */
class NeighbourCodeFile {
public:
  NeighbourCodeFile (GstPad *pad, GstClockTime first_pts) : pad_ (pad), first_pts_ (first_pts) {}

  /** Time of the last access unit; none if it has none. */
  GstClockTime last_time ();

  /** Where decoding begins. */
  struct Place {
    guint64 offset; ///< bytes
    GstClockTime time;
    std::vector<guint8> rig_units; ///< the rig that the file had last there
  };
  /** The key access unit that a seek to `start` with these flags means. None behind `stop`, unless
   *  it is the first one; nothing if there are no times. */
  std::optional<Place> find (GstClockTime start, GstClockTime stop, GstSeekFlags flags);

private:
  void read (guint64 offset, gsize size, std::vector<guint8> &to);
  rangecast::StreamFile stream ();
  guint64 pts_at (GstClockTime time) const;

  GstPad *pad_;
  GstClockTime first_pts_;
};
