/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/base/gstaggregator.h>
#include <gst/video/video.h>

#include <rangecast/geometry/range_image.hpp>
#include <utility>

/** propose_allocation() of an aggregator that reads its input with VideoFrameReader: any stride and
 *  plane offset. The size is for bayer2rgb, which in GStreamer 1.24 to 1.26 has a wrong one of its
 *  own. */
inline gboolean
propose_video_meta (GstAggregator *, GstAggregatorPad *, GstQuery *, GstQuery *query)
{
  GstCaps *caps = nullptr;
  GstVideoInfo info;
  gst_query_parse_allocation (query, &caps, nullptr);
  if (!caps || !gst_video_info_from_caps (&info, caps))
    return FALSE;
  gst_query_add_allocation_pool (query, nullptr, guint (info.size), 0, 0);
  gst_query_add_allocation_meta (query, GST_VIDEO_META_API_TYPE, nullptr);
  return TRUE;
}

/** Maps video frames as RGBx: RGBx and RGBA directly, other formats through a converter into memory
 *  of its own. Not thread-safe. */
class VideoFrameReader {
public:
  VideoFrameReader () = default;
  VideoFrameReader (const VideoFrameReader &) = delete;
  VideoFrameReader &operator= (const VideoFrameReader &) = delete;
  ~VideoFrameReader () { reset (); }
  void reset ()
  {
    close ();
    if (converter_)
      gst_video_converter_free (converter_);
    converter_ = nullptr;
    gst_clear_buffer (&converted_);
  }
  /** @return false if the format cannot be converted to RGBx */
  bool set (const GstVideoInfo &info)
  {
    reset ();
    info_ = info;
    if (GST_VIDEO_INFO_FORMAT (&info) == GST_VIDEO_FORMAT_RGBx ||
        GST_VIDEO_INFO_FORMAT (&info) == GST_VIDEO_FORMAT_RGBA)
      return true;
    gst_video_info_set_format (
        &rgbx_, GST_VIDEO_FORMAT_RGBx, guint (info.width), guint (info.height));
    rgbx_.fps_n = info.fps_n;
    rgbx_.fps_d = info.fps_d;
    rgbx_.interlace_mode = info.interlace_mode;
    converter_ = gst_video_converter_new (&info_, &rgbx_, nullptr);
    converted_ = gst_buffer_new_allocate (nullptr, rgbx_.size, nullptr);
    return converter_ != nullptr;
  }
  /** Maps a buffer; view() is valid until close().
   *  @return false if the buffer is smaller than the format needs */
  bool open (GstBuffer *buffer)
  {
    close ();
    if (!converter_)
      return is_open_ = gst_video_frame_map (&frame_, &info_, buffer, GST_MAP_READ);
    GstVideoFrame from;
    if (!gst_video_frame_map (&from, &info_, buffer, GST_MAP_READ))
      return false;
    is_open_ = gst_video_frame_map (&frame_, &rgbx_, converted_, GST_MAP_READWRITE);
    if (is_open_)
      gst_video_converter_frame (converter_, &from, &frame_);
    gst_video_frame_unmap (&from);
    return is_open_;
  }
  void close ()
  {
    if (std::exchange (is_open_, false))
      gst_video_frame_unmap (&frame_);
  }
  [[nodiscard]] rangecast::ImageView<const rangecast::Rgbx> view () const
  {
    return {static_cast<const rangecast::Rgbx *> (GST_VIDEO_FRAME_PLANE_DATA (&frame_, 0)),
        GST_VIDEO_FRAME_WIDTH (&frame_), GST_VIDEO_FRAME_HEIGHT (&frame_),
        GST_VIDEO_FRAME_PLANE_STRIDE (&frame_, 0)};
  }

private:
  GstVideoInfo info_ = {}, rgbx_ = {};
  GstVideoConverter *converter_ = nullptr;
  GstBuffer *converted_ = nullptr;
  GstVideoFrame frame_ = {};
  bool is_open_ = false;
};
