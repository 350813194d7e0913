/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <rangecast/geometry/rig.hpp>
#include <string>

#include "common/properties.hpp"
#include "packedinput.hpp"

/** The calibration of a view as the properties of stereodepth and rangecombine give it. */
struct ViewSettings {
  std::string rig; ///< rig file; empty: a pinhole camera with the members below
  int view_id = 0;
  double focal_length = 0;  ///< pixels; 0: unset
  double near = 0, far = 0; ///< metres; 0: from the rig, or the default
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

/** Warns if the focal length that is set gives a field of view that hardly any camera has: most
 *  likely it is that of other images or of another size. @param images  what it belongs to */
void check_field_of_view (
    GstElement *element, const ViewSettings &settings, const char *images, int width, int height);

/** Replaces near and far of a view by those that are set, and the depth unit by a larger one where
 *  far would not fit 16 bits. */
void set_depth_range (const ViewSettings &settings, rangecast::View &view);

/** stereodepth's properties. Guarded by the element's lock. */
struct StereoDepthSettings {
  ViewSettings view;
  double baseline = 0;       ///< metres, without a rig; 0: unset
  int n_threads = 0;         ///< 0: one per core
  int refresh_interval = 30; ///< frames
  Packing packing = Packing::kAuto;
  bool qos = true;
};

PropertyTable<StereoDepthSettings> &stereo_properties ();

/** The stereo view of the rig file, or of rectified input as the properties describe it.
 *  @param width, height  of the images
 *  @return the errors of load_view(); kNotFound if there is no calibration at all; kBadValue if the
 *  result is not a valid view */
rangecast::Status make_stereo_view (
    const StereoDepthSettings &settings, int width, int height, rangecast::View &view);
