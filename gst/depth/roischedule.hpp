/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <mutex>
#include <rangecast/geometry/range_image.hpp>
#include <rangecast/geometry/rig.hpp>
#include <rangecast/stereo/stereo_depth.hpp>

/** Which part of a stereo pair is matched: what downstream asks for with GstRangeRoi events, and
 *  every so often all of it. */
class RoiSchedule {
public:
  /** From any thread.
   *  @return false if it is no GstRangeRoi of that view, or beyond any picture */
  bool take_event (const GstStructure *event, int view_id);
  /** Everything is wanted until somebody asks again. Any thread. */
  void forget ();

  /** Counts from 0 again. Streaming thread, as next(). */
  void restart () { since_refresh_ = 0; }
  /** What to match of the pair that `core` has taken.
   *  @param interval  frames from one whole picture to the next; 0: always the whole
   *  @param[out] restricted  whether less than the whole is asked for */
  rangecast::Roi next (rangecast::StereoDepth &core, int interval, bool &restricted);

private:
  std::mutex lock_;       // guards what follows; a leaf: nothing is called under it
  rangecast::Roi wanted_; // empty: everything
  int since_refresh_ = 0; // streaming thread only
};
