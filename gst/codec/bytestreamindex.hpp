/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <optional>
#include <rangecast/neighbourcode/bitstream/byte_stream.hpp>
#include <vector>

/** Finds access units in a file of coded frame sets, through a pad in pull mode. Any thread. */
class NeighbourCodeFile {
public:
  explicit NeighbourCodeFile (GstPad *pad);

  /** The last access unit, if it has a time. */
  std::optional<rangecast::AccessUnitPlace> last ();
  /** The takes from an access unit on. */
  rangecast::TakeList takes (guint64 offset, GstClockTime frame_duration);

  /** Where decoding can begin. */
  struct Place {
    guint64 offset;                ///< bytes
    GstClockTime time;             ///< on the time line of the takes
    std::vector<guint8> rig_units; ///< the last rig up to there
  };
  /** The key access unit for a seek to `start` with these flags, in the take of that time or,
   *  if it snaps after that, the first one of the next; not after `stop`, unless it is the take's
   *  first one. Nothing if the file has no times. */
  std::optional<Place> find (
      const rangecast::TakeList &list, GstClockTime start, GstClockTime stop, GstSeekFlags flags);

private:
  void read (guint64 offset, gsize size, std::vector<guint8> &to);
  rangecast::StreamFile part (guint64 begin, guint64 end);

  GstPad *pad_;
  guint64 size_ = 0;
};
