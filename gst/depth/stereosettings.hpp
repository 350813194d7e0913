/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <rangecast/geometry/rig.hpp>
#include <rangecast/stereo/disparity_finder.hpp>
#include <string>

#include "common/properties.hpp"

/** What an application wants of stereodepth. Any thread, under the element's lock. */
struct StereoDepthSettings {
  std::string rig; ///< file; empty: what follows
  int view_id = 0;
  double focal_length = 0, baseline = 0;                           ///< pixels, metres; 0 = not set
  double principal_x = -1, principal_y = -1, principal_offset = 0; ///< pixels; -1 = the centre
  double near = 0, far = 0, depth_unit = 0; ///< metres; 0 = the rig's, or the default
  rangecast::StereoSettings core;
  int refresh_interval = 30; ///< frames
  bool qos = true;           ///< late pairs are not matched
};

/** Their properties. */
PropertyTable<StereoDepthSettings> &stereo_properties ();

/** The view of the rig that settings name, or one of rectified pictures that settings describe.
 *  @param width, height  of the pictures
 *  @return what load_rig() says; kNotFound if there is no such view, or no calibration at all;
 *  kBadSize if it is for pictures of another shape; kBadValue if the whole is no view */
rangecast::Status make_stereo_view (
    const StereoDepthSettings &settings, int width, int height, rangecast::View &view);

GType gst_stereo_depth_algorithm_get_type (void);
#define GST_TYPE_STEREO_DEPTH_ALGORITHM (gst_stereo_depth_algorithm_get_type ())
