/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <rangecast/geometry/rig.hpp>

#include "gstrangecaps.h"

namespace gstrange {

/** The contents of the caps of frame sets, raw or coded. */
struct RangeInfo {
  int width = 0;  ///< pixels, full image of the widest view
  int height = 0; ///< pixels, full image of the highest view
  int fps_n = 0;  ///< frame rate; 0/1 = variable or unknown
  int fps_d = 1;
  rangecast::Rig rig; ///< range views only

  [[nodiscard]] int views () const { return static_cast<int> (rig.views.size ()); }
  /** ns, or GST_CLOCK_TIME_NONE if the frame rate is unknown */
  [[nodiscard]] GstClockTime frame_duration () const;
};

/** Parses fixed caps. The rig is required; it must have as many views as the caps, all of them
 *  range views no larger than width x height.
 *  @param[out] info  unchanged on failure
 *  @return kNotFound, kBadValue, kBadSize, or the error of decode_rig(); the message names the
 *  field */
rangecast::Status parse_caps (const GstCaps *caps, RangeInfo &info);

/** Width and height are those of the rig's largest views. */
RangeInfo make_info (rangecast::Rig rig, int fps_n, int fps_d);

/** video/x-range. Returns: (transfer full) */
GstCaps *make_range_caps (const RangeInfo &info);

/** Adds the field "rig", with one view, to the video/x-raw caps of its colour or depth image. */
void set_view (GstCaps *caps, const rangecast::View &view);

/** Reads what set_view() added.
 *  @return kNotFound if there is no such field; kBadValue if it is not one range view, or the error
 *  of decode_rig() */
rangecast::Status parse_view (const GstCaps *caps, rangecast::View &view);

/** Copies caps and replaces their rig. Returns: (transfer full) */
GstCaps *with_rig (const GstCaps *caps, const rangecast::Rig &rig);

/** video/x-neighbour-code of access units. Returns: (transfer full)
 */
GstCaps *make_neighbour_code_caps (const RangeInfo &info);

/** transform_caps() of encoder and decoder: the same fields as video/x-range or, if `coded`, as
 *  video/x-neighbour-code. Returns: (transfer full) */
GstCaps *recode_caps (const GstCaps *caps, bool coded, GstCaps *filter);

} // namespace gstrange
