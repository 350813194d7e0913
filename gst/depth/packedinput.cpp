/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "packedinput.hpp"

void
PackedInput::watch (GstElement *element, GstPad *left, GstPad *right)
{
  element_ = element;
  left_ = left;
  right_ = right;
  gst_pad_add_probe (
      left,
      GstPadProbeType (GST_PAD_PROBE_TYPE_BUFFER | GST_PAD_PROBE_TYPE_EVENT_DOWNSTREAM |
                       GST_PAD_PROBE_TYPE_EVENT_FLUSH),
      [] (GstPad *, GstPadProbeInfo *info, gpointer self) {
        return static_cast<PackedInput *> (self)->handle (info);
      },
      this, nullptr);
}

void
PackedInput::start (Packing packing)
{
  setting_ = packing;
  packing_ = Packing::kAuto;
  refused_ = false;
}

void
PackedInput::stop ()
{
  gst_pad_set_active (right_, FALSE);
}

bool
PackedInput::view_size (const GstVideoInfo &image, int &width, int &height) const
{
  width = image.width / (packing_ == Packing::kSideBySide ? 2 : 1);
  height = image.height / (packing_ == Packing::kTopBottom ? 2 : 1);
  return width > 0 && height > 0 && image.width % width == 0 && image.height % height == 0;
}

/* @return what is wrong, or null */
const char *
PackedInput::choose_packing (GstEvent *event)
{
  GstCaps *caps = nullptr;
  GstVideoInfo info;
  gst_event_parse_caps (event, &caps);
  if (!gst_video_info_from_caps (&info, caps))
    return nullptr; /* the element refuses them */
  const auto mode = GST_VIDEO_INFO_MULTIVIEW_MODE (&info);
  const Packing by_caps = mode == GST_VIDEO_MULTIVIEW_MODE_SIDE_BY_SIDE ? Packing::kSideBySide
                          : mode == GST_VIDEO_MULTIVIEW_MODE_TOP_BOTTOM ? Packing::kTopBottom
                                                                        : Packing::kNone;
  const Packing wanted = setting_ == Packing::kAuto ? by_caps : setting_,
                before = packing_.exchange (wanted);
  if (before != Packing::kAuto && before != wanted)
    return "the packing of views changed; restart the pipeline";
  right_first_ =
      GST_VIDEO_INFO_MULTIVIEW_FLAGS (&info) & GST_VIDEO_MULTIVIEW_FLAGS_RIGHT_VIEW_FIRST;
  if (!is_packed ())
    return nullptr;
  if (gst_pad_is_linked (right_))
    return "images contain both views, but pad right is linked, too; unlink it or set packing=none";
  if (before == Packing::kAuto)
    if (GstEvent *start = gst_pad_get_sticky_event (left_, GST_EVENT_STREAM_START, 0))
      gst_pad_send_event (right_, start);
  return nullptr;
}

GstPadProbeReturn
PackedInput::handle (GstPadProbeInfo *info)
{
  if (GST_PAD_PROBE_INFO_TYPE (info) & GST_PAD_PROBE_TYPE_BUFFER) {
    if (!refused_ && !is_packed ())
      return GST_PAD_PROBE_OK;
    GstBuffer *buffer = GST_PAD_PROBE_INFO_BUFFER (info);
    const GstFlowReturn flow =
        refused_ ? GST_FLOW_NOT_NEGOTIATED : gst_pad_chain (right_, gst_buffer_ref (buffer));
    GST_PAD_PROBE_INFO_FLOW_RETURN (info) = flow;
    if (flow == GST_FLOW_OK)
      return GST_PAD_PROBE_OK;
    gst_buffer_unref (buffer);
    return GST_PAD_PROBE_HANDLED;
  }
  GstEvent *event = GST_PAD_PROBE_INFO_EVENT (info);
  if (GST_EVENT_TYPE (event) == GST_EVENT_CAPS)
    if (const char *wrong = choose_packing (event)) {
      refused_ = true;
      GST_ELEMENT_ERROR (element_, STREAM, FORMAT, ("pad left: %s", wrong), (nullptr));
      return GST_PAD_PROBE_OK;
    }
  if (is_packed ())
    gst_pad_send_event (right_, gst_event_ref (event));
  return GST_PAD_PROBE_OK;
}
