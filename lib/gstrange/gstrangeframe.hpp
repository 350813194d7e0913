/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <rangecast/base/status.hpp>
#include <rangecast/geometry/range_image.hpp>
#include <span>

#include "gstrangemeta.h"

namespace gstrange {

/** An active pool for frame sets of these caps.
 *  @return kNoSpace, and no pool, if memory is short or the caps are larger than any rig may be */
GST_RANGE_API rangecast::Status make_pool (GstCaps *caps, GstBufferPool *&pool);

/** Takes a buffer. Where memory is short it posts the element's one error for it. */
GST_RANGE_API GstFlowReturn acquire (GstElement *element, GstBufferPool *pool, GstBuffer **buffer);

/** gst_range_buffer_add_view(). @return kNoSpace if the buffer has no room for that view */
GST_RANGE_API rangecast::Status add_view (
    GstBuffer *buffer, int view_id, const rangecast::Roi &roi, GstClockTime capture_time);

/** Adds the metas of `views` to a frame set: what gst_range_buffer_append() does, but for the
 * bytes, which shall lie `base` bytes behind the beginning.
 *  @return false, and nothing is added, if both have a view of the same view-id */
GST_RANGE_API bool append_metas (GstBuffer *frame_set, GstBuffer *views, gsize base);

/** Maps all views of a frame set, for as long as it lives. Lives on the stack, allocates nothing.
 *  After a failure views() is empty and status() says which view is at fault.
 *  crop() changes a view's ROI in its meta, without touching pixels. */
class GST_RANGE_API RangeFrameMap {
public:
  RangeFrameMap (GstBuffer *buffer, GstMapFlags flags);
  ~RangeFrameMap ();
  RangeFrameMap (const RangeFrameMap &) = delete;
  RangeFrameMap &operator= (const RangeFrameMap &) = delete;

  [[nodiscard]] const rangecast::Status &status () const { return status_; }
  /** In the order of the buffer's metas. Read-only maps must not be written through. */
  [[nodiscard]] std::span<const rangecast::RangeImage> views () const
  {
    return {images_.data (), count_};
  }

  /** Shrinks view number `index` (not view-id) to `roi`, given in full-image pixels, which must
   *  lie inside its present ROI (or be empty). The buffer must be writable. */
  void crop (std::size_t index, const rangecast::Roi &roi);

private:
  void unmap ();

  rangecast::Status status_;
  std::size_t count_ = 0;
  std::array<rangecast::RangeImage, rangecast::kMaxViews> images_;
  std::array<GstRangeView, rangecast::kMaxViews> maps_;
  std::array<GstRangeMeta *, rangecast::kMaxViews> metas_;
};

} // namespace gstrange
