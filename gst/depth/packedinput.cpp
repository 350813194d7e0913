/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "packedinput.hpp"

#include <algorithm>

namespace {

constexpr const char *kLinked = "images of two views, but the other sink pad is linked";
constexpr const char *kOneStream = "both views in one stream, or packing=none";

Packing
packing_of (const GstVideoInfo &info)
{
  switch (GST_VIDEO_INFO_MULTIVIEW_MODE (&info)) {
    case GST_VIDEO_MULTIVIEW_MODE_SIDE_BY_SIDE:
      return Packing::kSideBySide;
    case GST_VIDEO_MULTIVIEW_MODE_TOP_BOTTOM:
      return Packing::kTopBottom;
    default:
      return Packing::kNone;
  }
}

/* The first component of each plane says how it is sampled. */
int
component_of_plane (const GstVideoFormatInfo *format, guint plane)
{
  int component = 0;
  while (GST_VIDEO_FORMAT_INFO_PLANE (format, component) != plane)
    component++;
  return component;
}

/* What the width (or height) must be a multiple of, so that both halves begin at a pixel of each
 * plane. */
int
unit_of (const GstVideoFormatInfo *format, bool width)
{
  int most = 0;
  for (guint c = 0; c < GST_VIDEO_FORMAT_INFO_N_COMPONENTS (format); c++)
    most = std::max (most, int (width ? GST_VIDEO_FORMAT_INFO_W_SUB (format, c)
                                      : GST_VIDEO_FORMAT_INFO_H_SUB (format, c)));
  return 2 << most;
}

/* Whether pixels are where strides of pixels and lines say. */
bool
has_plain_layout (const GstVideoFormatInfo *format)
{
  for (guint c = 0; c < GST_VIDEO_FORMAT_INFO_N_COMPONENTS (format); c++)
    if (GST_VIDEO_FORMAT_INFO_PSTRIDE (format, c) <= 0)
      return false;
  return !GST_VIDEO_FORMAT_INFO_IS_COMPLEX (format) && !GST_VIDEO_FORMAT_INFO_IS_TILED (format) &&
         !GST_VIDEO_FORMAT_INFO_HAS_PALETTE (format);
}

} // namespace

void
PackedInput::watch (GstElement *element, GstPad *first, GstPad *second)
{
  element_ = element;
  first_ = first;
  second_ = second;
  gst_pad_add_probe (
      first,
      GstPadProbeType (GST_PAD_PROBE_TYPE_BUFFER | GST_PAD_PROBE_TYPE_EVENT_DOWNSTREAM |
                       GST_PAD_PROBE_TYPE_EVENT_FLUSH),
      [] (GstPad *, GstPadProbeInfo *info, gpointer self) {
        return static_cast<PackedInput *> (self)->handle (info);
      },
      this, nullptr);
  const auto linked = [] (GstPad *pad, GstPad *, gpointer self) {
    if (auto input = static_cast<PackedInput *> (self);
        input->is_packed_ && GST_PAD_IS_ACTIVE (pad))
      input->post (kLinked, kOneStream);
  };
  g_signal_connect (second, "linked", G_CALLBACK (+linked), this);
}

void
PackedInput::start (Packing packing)
{
  packing_ = packing;
  is_packed_ = is_refused_ = saw_one_view_ = false;
}

void
PackedInput::stop ()
{
  gst_pad_set_active (second_, FALSE);
}

GstPadProbeReturn
PackedInput::handle (GstPadProbeInfo *info)
{
  if (GST_PAD_PROBE_INFO_TYPE (info) & GST_PAD_PROBE_TYPE_BUFFER)
    return handle_buffer (info);
  GstEvent *event = GST_PAD_PROBE_INFO_EVENT (info);
  if (GST_EVENT_TYPE (event) == GST_EVENT_CAPS)
    return handle_caps (info);
  if (is_packed_)
    gst_pad_send_event (second_, gst_event_ref (event));
  return GST_PAD_PROBE_OK;
}

/* ---- caps ---- */

void
PackedInput::post (const std::string &what, const std::string &expected)
{
  GST_ELEMENT_ERROR (element_, STREAM, FORMAT,
      ("pad %s: %s; expected %s", GST_PAD_NAME (first_), what.c_str (), expected.c_str ()),
      (nullptr));
}

GstPadProbeReturn
PackedInput::refuse (GstPadProbeInfo *info, const std::string &what, const std::string &expected)
{
  post (what, expected);
  is_refused_ = true;
  gst_mini_object_unref (GST_MINI_OBJECT (GST_PAD_PROBE_INFO_DATA (info)));
  return GST_PAD_PROBE_HANDLED;
}

GstPadProbeReturn
PackedInput::handle_caps (GstPadProbeInfo *info)
{
  GstEvent *event = GST_PAD_PROBE_INFO_EVENT (info);
  GstCaps *caps = nullptr;
  GstVideoInfo video;
  gst_event_parse_caps (event, &caps);
  if (!gst_video_info_from_caps (&video, caps))
    return GST_PAD_PROBE_OK; /* the element refuses them */
  const Packing packing = packing_ == Packing::kAuto ? packing_of (video) : packing_;
  is_refused_ = false;
  if (packing == Packing::kNone)
    return is_packed_ ? refuse (info, "images of one view after images of two", "the same packing")
                      : GST_PAD_PROBE_OK;
  if (saw_one_view_)
    return refuse (info, "images of two views after images of one", "the same packing");
  if (gst_pad_is_linked (second_))
    return refuse (info, kLinked, kOneStream);
  if (!has_plain_layout (video.finfo))
    return refuse (info, "this format cannot be divided into two views", "I420, NV12, YUY2 or RGB");
  const bool beside = packing == Packing::kSideBySide;
  const int x = beside ? video.width / 2 : 0, y = beside ? 0 : video.height / 2;
  const int size = beside ? video.width : video.height, unit = unit_of (video.finfo, beside);
  if (size % unit != 0)
    return refuse (info,
        (beside ? "width " : "height ") + std::to_string (size) +
            " does not divide into two views of this format",
        "a multiple of " + std::to_string (unit));
  packed_ = video;
  offset_x_ = x;
  offset_y_ = y;
  second_view_first_ =
      GST_VIDEO_INFO_MULTIVIEW_FLAGS (&video) & GST_VIDEO_MULTIVIEW_FLAGS_RIGHT_VIEW_FIRST;
  caps = gst_caps_copy (caps);
  gst_caps_set_simple (
      caps, "width", G_TYPE_INT, video.width - x, "height", G_TYPE_INT, video.height - y, nullptr);
  for (const char *field : {"multiview-mode", "multiview-flags"})
    gst_structure_remove_field (gst_caps_get_structure (caps, 0), field);
  GstEvent *of_view = gst_event_new_caps (caps);
  gst_event_set_seqnum (of_view, gst_event_get_seqnum (event));
  gst_caps_unref (caps);
  const bool is_new = !is_packed_;
  if (is_new)
    if (GstEvent *start = gst_pad_get_sticky_event (first_, GST_EVENT_STREAM_START, 0))
      gst_pad_send_event (second_, start);
  is_packed_ = true;
  gst_pad_send_event (second_, gst_event_ref (of_view));
  if (is_new) /* after caps of one view, which no image followed */
    if (GstEvent *segment = gst_pad_get_sticky_event (first_, GST_EVENT_SEGMENT, 0))
      gst_pad_send_event (second_, segment);
  GST_PAD_PROBE_INFO_DATA (info) = of_view;
  gst_event_unref (event);
  return GST_PAD_PROBE_OK;
}

/* ---- images ---- */

/* One half of the image, in the same memory. */
GstBuffer *
PackedInput::make_view (GstBuffer *packed, bool first) const
{
  GstBuffer *view = gst_buffer_copy (packed);
  gst_buffer_add_parent_buffer_meta (view, packed); /* its pool must not use the memory again */
  GstVideoMeta *meta = gst_buffer_get_video_meta (view);
  if (!meta) {
    GstVideoInfo info = packed_;
    meta = gst_buffer_add_video_meta_full (view, GST_VIDEO_FRAME_FLAG_NONE,
        GST_VIDEO_INFO_FORMAT (&info), guint (info.width), guint (info.height),
        GST_VIDEO_INFO_N_PLANES (&info), info.offset, info.stride);
  }
  meta->width = guint (packed_.width - offset_x_);
  meta->height = guint (packed_.height - offset_y_);
  for (guint plane = 0; !first && plane < meta->n_planes; plane++) {
    const GstVideoFormatInfo *format = packed_.finfo;
    const int c = component_of_plane (format, plane);
    const int column = GST_VIDEO_FORMAT_INFO_SCALE_WIDTH (format, c, offset_x_);
    const int row = GST_VIDEO_FORMAT_INFO_SCALE_HEIGHT (format, c, offset_y_);
    meta->offset[plane] += gsize (column * GST_VIDEO_FORMAT_INFO_PSTRIDE (format, c)) +
                           gsize (row) * gsize (meta->stride[plane]);
  }
  return view;
}

GstPadProbeReturn
PackedInput::handle_buffer (GstPadProbeInfo *info)
{
  if (!is_packed_ && !is_refused_) {
    saw_one_view_ = true;
    return GST_PAD_PROBE_OK;
  }
  GstBuffer *packed = GST_PAD_PROBE_INFO_BUFFER (info);
  GstFlowReturn flow = GST_FLOW_NOT_NEGOTIATED;
  if (!is_refused_)
    flow = gst_pad_chain (second_, make_view (packed, second_view_first_));
  if (flow == GST_FLOW_OK)
    GST_PAD_PROBE_INFO_DATA (info) = make_view (packed, !second_view_first_);
  gst_buffer_unref (packed);
  GST_PAD_PROBE_INFO_FLOW_RETURN (info) = flow;
  return flow == GST_FLOW_OK ? GST_PAD_PROBE_OK : GST_PAD_PROBE_HANDLED;
}
