/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "gstrangeframe.hpp"

#include <string>

#include "gstrangebufferpool.h"
#include "gstrangestatus.hpp"

using rangecast::RangeImage;
using rangecast::Rgbx;
using rangecast::Roi;
using rangecast::Status;
using rangecast::StatusCode;

namespace gstrange {

static Status
no_memory ()
{
  return {StatusCode::kNoSpace, "out of memory for a frame set"};
}

Status
make_pool (GstCaps *caps, GstBufferPool *&pool)
{
  pool = gst_range_buffer_pool_new ();
  /* Allocates none in advance: caps from a network may claim any size. */
  if (gst_range_buffer_pool_configure (pool, caps, 0, 0) && gst_buffer_pool_set_active (pool, TRUE))
    return {};
  gst_clear_object (&pool);
  return no_memory ();
}

GstFlowReturn
acquire (GstElement *element, GstBufferPool *pool, GstBuffer **buffer)
{
  const GstFlowReturn flow = gst_buffer_pool_acquire_buffer (pool, buffer, nullptr);
  return flow == GST_FLOW_ERROR ? gst_range_flow_return (element, no_memory ()) : flow;
}

Status
add_view (GstBuffer *buffer, int view_id, const Roi &roi, GstClockTime capture_time)
{
  if (gst_range_buffer_add_view (buffer, guint (view_id), guint (roi.x), guint (roi.y),
          guint (roi.width), guint (roi.height), capture_time))
    return {};
  return {StatusCode::kNoSpace, "range buffer: no room for view " + std::to_string (view_id) +
                                    " of " + std::to_string (roi.width) + "x" +
                                    std::to_string (roi.height) + " pixels"};
}

void
copy_layout (GstRangeMeta *to, const GstRangeMeta *from)
{
  const GstMeta meta = to->meta;
  *to = *from;
  to->meta = meta;
}

bool
append_metas (GstBuffer *frame_set, GstBuffer *views, gsize base, guint id_offset)
{
  gpointer state = nullptr;
  while (const GstRangeMeta *meta = gst_buffer_iterate_range_meta (views, &state))
    if (meta->view_id >= rangecast::kMaxViews - id_offset ||
        gst_buffer_get_range_meta (frame_set, meta->view_id + id_offset))
      return false;
  state = nullptr;
  while (const GstRangeMeta *meta = gst_buffer_iterate_range_meta (views, &state)) {
    auto added = reinterpret_cast<GstRangeMeta *> (
        gst_buffer_add_meta (frame_set, GST_RANGE_META_INFO, nullptr));
    copy_layout (added, meta);
    added->view_id += id_offset;
    added->depth_offset += base;
    added->colour_offset += base;
  }
  return true;
}

static RangeImage
image_of (const GstRangeView &view, GstClockTime capture_time)
{
  const int width = static_cast<int> (view.width), height = static_cast<int> (view.height);
  RangeImage image;
  image.view_id = static_cast<int> (view.view_id);
  image.roi = {static_cast<int> (view.x), static_cast<int> (view.y), width, height};
  image.depth = {view.depth, width, height, view.depth_stride};
  image.colour = {reinterpret_cast<Rgbx *> (view.colour), width, height, view.colour_stride};
  image.capture_time_ns = capture_time;
  return image;
}

RangeFrameMap::RangeFrameMap (GstBuffer *buffer, GstMapFlags flags)
{
  gpointer state = nullptr;
  GstRangeMeta *meta;
  std::array<bool, rangecast::kMaxViews> seen{};
  while ((meta = gst_buffer_iterate_range_meta (buffer, &state))) {
    const bool fits = count_ < maps_.size () && meta->view_id < guint (rangecast::kMaxViews) &&
                      meta->x <= guint (rangecast::kMaxImageSide) &&
                      meta->y <= guint (rangecast::kMaxImageSide);
    if (!fits || !gst_range_view_map (&maps_[count_], buffer, meta, flags)) {
      status_ = {StatusCode::kBadData, "range buffer: the GstRangeMeta of view " +
                                           std::to_string (meta->view_id) +
                                           " does not describe planes inside the buffer"};
      unmap ();
      return;
    }
    if (seen[meta->view_id]) {
      status_ = {StatusCode::kBadData, "range buffer: view " + std::to_string (meta->view_id) +
                                           " has more than one GstRangeMeta"};
      gst_range_view_unmap (&maps_[count_]);
      unmap ();
      return;
    }
    seen[meta->view_id] = true;
    metas_[count_] = meta;
    images_[count_] = image_of (maps_[count_], meta->capture_time);
    count_++;
  }
  if (count_ == 0 && gst_buffer_get_size (buffer) > 0)
    status_ = {
        StatusCode::kBadData, "range buffer: " + std::to_string (gst_buffer_get_size (buffer)) +
                                  " bytes without a GstRangeMeta; each view needs one"};
}

RangeFrameMap::~RangeFrameMap ()
{
  unmap ();
}

void
RangeFrameMap::unmap ()
{
  for (std::size_t i = 0; i < count_; i++)
    gst_range_view_unmap (&maps_[i]);
  count_ = 0;
}

void
RangeFrameMap::crop (std::size_t index, const Roi &roi)
{
  RangeImage &image = images_[index];
  GstRangeMeta *meta = metas_[index];
  const gsize dx = roi.empty () ? 0 : static_cast<gsize> (roi.x - image.roi.x);
  const gsize dy = roi.empty () ? 0 : static_cast<gsize> (roi.y - image.roi.y);
  const Roi kept = roi.empty () ? Roi{} : roi;
  meta->x = static_cast<guint> (kept.x);
  meta->y = static_cast<guint> (kept.y);
  meta->width = static_cast<guint> (kept.width);
  meta->height = static_cast<guint> (kept.height);
  meta->depth_offset += dy * meta->depth_stride + dx * 2;
  meta->colour_offset += dy * meta->colour_stride + dx * 4;
  if (!kept.empty ()) {
    image.depth = image.depth.crop (int (dx), int (dy), kept.width, kept.height);
    image.colour = image.colour.crop (int (dx), int (dy), kept.width, kept.height);
  } else {
    image.depth = {};
    image.colour = {};
  }
  image.roi = kept;
}

} // namespace gstrange
