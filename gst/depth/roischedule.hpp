/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <algorithm>
#include <cmath>
#include <mutex>
#include <rangecast/geometry/range_image.hpp>
#include <rangecast/stereo/stereo_depth.hpp>

/** Decides which region of each stereo pair is matched: the one that downstream requests with
 *  GstRangeRoi events, and the full image at regular intervals or when something else changes. */
class RoiSchedule {
public:
  /** Any thread.
   *  @return false if the event is malformed, of another view, or larger than any image */
  bool handle_event (const GstStructure *event, int view_id)
  {
    guint id, x, y, width, height;
    if (!gst_structure_get (event, "view-id", G_TYPE_UINT, &id, "x", G_TYPE_UINT, &x, "y",
            G_TYPE_UINT, &y, "width", G_TYPE_UINT, &width, "height", G_TYPE_UINT, &height, nullptr))
      return false;
    if (int (id) != view_id || std::max ({x, y, width, height}) > guint (rangecast::kMaxImageSide))
      return false;
    std::lock_guard guard (lock_);
    requested_ = {int (x), int (y), int (width), int (height)};
    return true;
  }
  /** Full images until the next event. Any thread. */
  void reset ()
  {
    std::lock_guard guard (lock_);
    requested_ = {};
  }

  /** Restarts the refresh interval. Streaming thread. */
  void restart_interval () { since_refresh_ = 0; }
  /** The region of the pair that `core` has rectified. Streaming thread.
   *  @param interval  frames from one full image to the next; 0: always full images
   *  @param[out] restricted  whether it is less than the full image */
  rangecast::Roi next (rangecast::StereoDepth &core, int interval, bool &restricted)
  {
    const rangecast::View &view = core.range_view ();
    const rangecast::Roi full = {0, 0, view.width, view.height};
    rangecast::Roi roi;
    {
      std::lock_guard guard (lock_);
      roi = requested_;
    }
    roi.width = std::min (roi.width, full.width - roi.x);
    roi.height = std::min (roi.height, full.height - roi.y);
    restricted = false;
    if (interval == 0 || roi.empty () || core.changed_outside (roi)) {
      since_refresh_ = refresh_phase (view.id, interval);
      return full;
    }
    if (++since_refresh_ >= interval) {
      since_refresh_ = 0;
      return full;
    }
    restricted = true;
    return roi;
  }

private:
  /* The count of frames with which a view starts after an unscheduled full image. All hosts of a
   * rig match full images when something new appears; different counts keep them from doing so
   * together from then on. Multiples of the golden ratio spread any number of views evenly. */
  static int refresh_phase (int view_id, int interval)
  {
    const double turns = std::max (view_id, 0) * 0.6180339887498949;
    return static_cast<int> ((turns - std::floor (turns)) * interval);
  }

  std::mutex lock_;          // guards requested_; nothing is called with it held
  rangecast::Roi requested_; // empty: the full image
  int since_refresh_ = 0;    // streaming thread
};
