/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <mutex>
#include <rangecast/geometry/range_image.hpp>
#include <rangecast/stereo/stereo_depth.hpp>

/** Decides which region of each stereo pair is matched: the one that downstream requests with
 *  GstRangeRoi events, and the full image at regular intervals or when something else changes. */
class RoiSchedule {
public:
  /** Any thread.
   *  @return false if the event is malformed, of another view, or larger than any image */
  bool handle_event (const GstStructure *event, int view_id);
  /** Full images until the next event. Any thread. */
  void reset ();

  /** Restarts the refresh interval. Streaming thread. */
  void restart_interval () { since_refresh_ = 0; }
  /** The region of the pair that `core` has rectified. Streaming thread.
   *  @param interval  frames from one full image to the next; 0: always full images
   *  @param[out] restricted  whether it is less than the full image */
  rangecast::Roi next (rangecast::StereoDepth &core, int interval, bool &restricted);

private:
  std::mutex lock_;          // guards requested_; nothing is called with it held
  rangecast::Roi requested_; // empty: the full image
  int since_refresh_ = 0;    // streaming thread
};
