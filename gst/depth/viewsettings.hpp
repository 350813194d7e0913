/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <rangecast/geometry/rig.hpp>
#include <string>

/** The calibration of a view as the properties of stereodepth and rangecombine give it. */
struct ViewSettings {
  std::string rig; ///< rig file; empty: a pinhole camera with the members below
  int view_id = 0;
  double focal_length = 0;                   ///< pixels; 0: unset
  double principal_x = -1, principal_y = -1; ///< pixels; -1: centre
  double near = 0, far = 0, depth_unit = 0;  ///< metres; 0: from the rig, or the default
};

/** Loads a view from a rig file and scales it to the size of the images.
 *  @param property  the name of the property that gives `view_id`, for the error
 *  @return the error of load_rig(); kNotFound if the rig lacks the view; kBadSize if it is for
 *  images of another shape */
rangecast::Status load_view (const std::string &rig_file, int view_id, const char *property,
    int width, int height, rangecast::View &view);

/** A pinhole camera at the world's origin that looks along -z. `focal_length` is in pixels. */
rangecast::View make_pinhole_view (
    const ViewSettings &settings, double focal_length, int width, int height);

/** Replaces near, far and the depth unit of a view by those that are set. */
void set_depth_range (const ViewSettings &settings, rangecast::View &view);
