/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <rangecast/geometry/rig.hpp>

#include "common/properties.hpp"
#include "packedinput.hpp"
#include "viewsettings.hpp"

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
