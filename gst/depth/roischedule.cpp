/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "roischedule.hpp"

#include <algorithm>
#include <cmath>

using rangecast::Roi;

bool
RoiSchedule::handle_event (const GstStructure *event, int view_id)
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

void
RoiSchedule::reset ()
{
  std::lock_guard guard (lock_);
  requested_ = {};
}

/* The count of frames with which a view starts after an unscheduled full image. All hosts of a rig
 * match full images at the moment when something new appears; different start counts keep them from
 * doing so together from then on, and from waiting for each other. Multiples of the golden ratio
 * spread any number of views evenly. View 0 starts at 0. */
static int
refresh_phase (int view_id, int interval)
{
  constexpr double kGolden = 0.6180339887498949;
  const double turns = std::max (view_id, 0) * kGolden;
  return static_cast<int> ((turns - std::floor (turns)) * interval);
}

Roi
RoiSchedule::next (rangecast::StereoDepth &core, int interval, bool &restricted)
{
  const rangecast::View &view = core.range_view ();
  const Roi full = {0, 0, view.width, view.height};
  Roi roi;
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
