/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <rangecast/base/status.hpp>
#include <rangecast/geometry/range_image.hpp>
#include <span>

#include "gstrangemeta.h"

namespace gstrange {

/** Creates an active pool for frame sets of these caps.
 *  @param[out] pool  transfer full; null on failure
 *  @return kNoSpace when out of memory, or if the caps exceed the limits of a rig */
rangecast::Status make_pool (GstCaps *caps, GstBufferPool *&pool);

/** Acquires a buffer. Posts an error when out of memory. */
GstFlowReturn acquire (GstElement *element, GstBufferPool *pool, GstBuffer **buffer);

/** gst_range_buffer_add_view() with a Status. @return kNoSpace if the view does not fit */
rangecast::Status add_view (
    GstBuffer *buffer, int view_id, const rangecast::Roi &roi, GstClockTime capture_time);

/** Copies all fields but the parent. */
void copy_layout (GstRangeMeta *to, const GstRangeMeta *from);

/** Adds the metas of `views` to a frame set like gst_range_buffer_append(), without its memories.
 *  @param base  offset in `frame_set` of the bytes of `views`
 *  @param id_offset  added to the view-ids of `views`
 *  @return false, and nothing is added, if both contain the same view-id or one is too large */
bool append_metas (GstBuffer *frame_set, GstBuffer *views, gsize base, guint id_offset = 0);

/** Maps all views of a frame set during its lifetime, without allocations. After a failure views()
 *  is empty and status() names the view. */
class RangeFrameMap {
public:
  RangeFrameMap (GstBuffer *buffer, GstMapFlags flags);
  ~RangeFrameMap ();
  RangeFrameMap (const RangeFrameMap &) = delete;
  RangeFrameMap &operator= (const RangeFrameMap &) = delete;

  [[nodiscard]] const rangecast::Status &status () const { return status_; }
  /** In the order of the buffer's metas. Do not write to views that are mapped for reading. */
  [[nodiscard]] std::span<const rangecast::RangeImage> views () const
  {
    return {images_.data (), count_};
  }

  /** Changes the ROI of a view in its meta, without moving pixels. The buffer must be writable.
   *  @param index  in views()
   *  @param roi    pixels of the full image; inside the current ROI, or empty */
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
