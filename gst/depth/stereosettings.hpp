/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <rangecast/geometry/rig.hpp>
#include <rangecast/stereo/disparity_finder.hpp>
#include <string>

/** What an application wants of stereodepth. Any thread, under the element's lock. */
struct StereoDepthSettings {
  static constexpr int kDefaultRefreshInterval = 30;

  std::string rig; ///< file; empty: what follows
  int view_id = 0;
  double focal_length = 0, baseline = 0;                           ///< pixels, metres; 0 = not set
  double principal_x = -1, principal_y = -1, principal_offset = 0; ///< pixels; -1 = the centre
  double near = 0, far = 0, depth_unit = 0; ///< metres; 0 = the rig's, or the default
  rangecast::StereoSettings core;
  int refresh_interval = kDefaultRefreshInterval; ///< frames
  bool qos = true;                                ///< late pairs are not matched
};

/** Installs the properties of these settings, numbers 1 to the result. All may change in READY, and
 *  qos at any time. */
guint install_stereo_settings (GObjectClass *object_class);

/** @return false if no property of these settings has that number */
bool set_stereo_setting (StereoDepthSettings &settings, guint id, const GValue *value);
bool get_stereo_setting (const StereoDepthSettings &settings, guint id, GValue *value);

/** The view of the rig that settings name, or one of rectified pictures that settings describe.
 *  @param width, height  of the pictures
 *  @return what load_rig() says; kNotFound if there is no such view, or no calibration at all;
 *  kBadSize if it is for pictures of another shape; kBadValue if the whole is no view */
rangecast::Status make_stereo_view (
    const StereoDepthSettings &settings, int width, int height, rangecast::View &view);

GType gst_stereo_depth_algorithm_get_type (void);
#define GST_TYPE_STEREO_DEPTH_ALGORITHM (gst_stereo_depth_algorithm_get_type ())
