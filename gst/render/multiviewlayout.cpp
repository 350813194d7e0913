/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "multiviewlayout.hpp"

#include <cstring>
#include <utility>

MultiviewLayout::MultiviewLayout (const GstVideoInfo &info)
{
  const int width = GST_VIDEO_INFO_WIDTH (&info), height = GST_VIDEO_INFO_HEIGHT (&info);
  guint flags; /* copied: caps may have bits that are not in the enumeration */
  static_assert (sizeof flags == sizeof GST_VIDEO_INFO_MULTIVIEW_FLAGS (&info));
  std::memcpy (&flags, &GST_VIDEO_INFO_MULTIVIEW_FLAGS (&info), sizeof flags);
  const bool half = (flags & GST_VIDEO_MULTIVIEW_FLAGS_HALF_ASPECT) != 0;
  EyeViewport &first = eyes_[0], &second = eyes_[1];
  first = {0, 0, 0, 0, width, height, 1};
  first.aspect = double (width) * GST_VIDEO_INFO_PAR_N (&info) /
                 (double (height) * GST_VIDEO_INFO_PAR_D (&info));
  count_ = 2;
  switch (GST_VIDEO_INFO_MULTIVIEW_MODE (&info)) {
    case GST_VIDEO_MULTIVIEW_MODE_SIDE_BY_SIDE:
      first.aspect *= half ? 1 : 0.5;
      first.width = width / 2;
      second = first;
      second.x = width - second.width;
      break;
    case GST_VIDEO_MULTIVIEW_MODE_TOP_BOTTOM:
      first.aspect *= half ? 1 : 2;
      first.height = height / 2;
      second = first;
      second.y = height - second.height;
      break;
    case GST_VIDEO_MULTIVIEW_MODE_SEPARATED:
      second = first;
      second.memory = 1;
      break;
    case GST_VIDEO_MULTIVIEW_MODE_LEFT:
    case GST_VIDEO_MULTIVIEW_MODE_RIGHT:
      first.side = GST_VIDEO_INFO_MULTIVIEW_MODE (&info) == GST_VIDEO_MULTIVIEW_MODE_LEFT ? -1 : 1;
      [[fallthrough]];
    default:
      count_ = 1;
      return;
  }
  first.side = -1;
  second.side = 1;
  if (flags & GST_VIDEO_MULTIVIEW_FLAGS_RIGHT_VIEW_FIRST)
    std::swap (first.side, second.side);
}
