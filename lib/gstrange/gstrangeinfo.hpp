/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <rangecast/geometry/rig.hpp>

#include "gstrangecaps.h"

namespace gstrange {

/** What the caps of a stream of frame sets say, raw or coded. */
struct RangeInfo {
  int width = 0;  ///< pixels, the widest view's full image
  int height = 0; ///< pixels, the highest view's full image
  int fps_n = 0;  ///< frame rate; 0/1 = variable or unknown
  int fps_d = 1;
  rangecast::Rig rig; ///< range views only

  [[nodiscard]] int views () const { return static_cast<int> (rig.views.size ()); }
  /** ns, or GST_CLOCK_TIME_NONE if the frame rate is unknown */
  [[nodiscard]] GST_RANGE_API GstClockTime frame_duration () const;
};

/** Reads fixed caps; the message of an error names the field. The rig is a must, its number of
 *  views agrees with `views`, no view is larger than width x height, and all are range views. */
GST_RANGE_API rangecast::Status parse_caps (const GstCaps *caps, RangeInfo &info);

/** Info of a rig: width and height are those of its largest views. */
GST_RANGE_API RangeInfo make_info (rangecast::Rig rig, int fps_n, int fps_d);

/** video/x-range. Returns: (transfer full) */
GST_RANGE_API GstCaps *make_range_caps (const RangeInfo &info);

/** The same caps with another rig. Returns: (transfer full) */
GST_RANGE_API GstCaps *with_rig (const GstCaps *caps, const rangecast::Rig &rig);

/** application/x-neighbour-code with alignment "access-unit" or "slice". Returns: (transfer full)
 */
GST_RANGE_API GstCaps *make_neighbour_code_caps (const RangeInfo &info, const char *alignment);

/** What an encoder or decoder has on its other side for `caps`: the same sizes, frame rates, views
 * and rig, as video/x-range or, if `coded`, as application/x-neighbour-code with any alignment that
 *  holds frame sets. For GstBaseTransform's transform_caps. Returns: (transfer full) */
GST_RANGE_API GstCaps *recode_caps (const GstCaps *caps, bool coded, GstCaps *filter);

} // namespace gstrange
